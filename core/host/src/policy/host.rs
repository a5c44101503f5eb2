//! The script of a machine at work.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use tandem_gcode::Watched;
use tandem_machine::Machine;
use tandem_policy::{Engine, Parameter, Period, Policy};
use tandem_recorder::PolicySummary;

use super::setup::PolicySetup;
use crate::error::{HostError, refusal};

/// The script at work, shared by the rough loop and what is asked once a rough period, which run on one thread.
#[derive(Clone)]
pub struct PolicyHost {
    pub(super) engine: Engine,
    pub(super) path: PathBuf,
    /// The file as it was when it was read.
    pub(super) stamp: Option<Stamp>,
    policy: Arc<Mutex<Policy>>,
}

impl PolicyHost {
    /// Compiles and starts the machine's script, if it names one; the machine's feed strategy has `strategy_signals`.
    pub fn open(machine: &Machine, strategy_signals: &[&str]) -> Result<Option<Self>, HostError> {
        let Some(choice) = &machine.policy else {
            return Ok(None);
        };
        let refuse = |cause: String| refusal(machine, "policy.script", cause);
        let path = choice.script.clone();
        let stamp = stamp(&path);
        let bytes = std::fs::read(&path).map_err(|e| refuse(format!("{}: {e}", path.display())))?;
        let named = |e: tandem_policy::Refusal| refuse(format!("{}: {e}", path.display()));
        let engine = Engine::new().map_err(named)?;
        let script = engine.compile(&bytes).map_err(named)?;
        let PolicySetup {
            values,
            budget,
            bounds,
            facts,
        } = PolicySetup::of(machine, strategy_signals)?;
        let policy = Policy::new(script, values, budget, bounds, &facts);
        let policy = policy.map_err(|e| match e {
            e @ tandem_policy::Refusal::Parameters(_) => {
                refusal(machine, "policy.parameters", e.to_string())
            }
            e => refuse(format!("{}: {e}", path.display())),
        })?;
        Ok(Some(Self {
            engine,
            path,
            stamp,
            policy: Arc::new(Mutex::new(policy)),
        }))
    }

    /// The parameters that the script declares. Allocates.
    pub fn declared(&self) -> Vec<Parameter> {
        self.lock().declared()
    }

    /// The ratio after a rough period, of which `means` makes what the script looks at; `None` where it asks for none.
    pub fn period(&self, means: impl FnOnce(&Policy) -> Period) -> Option<f64> {
        let mut policy = self.lock();
        let period = means(&policy);
        policy.period(&period)
    }

    /// What the interpreter is to watch for in the program.
    pub fn watched(&self) -> Vec<Watched> {
        let policy = self.lock();
        let inputs = policy.program_inputs().iter();
        inputs
            .map(|input| Watched {
                name: input.name.clone(),
                words: input.words.clone(),
            })
            .collect()
    }

    /// What the script did, for the observer; the rest of a run's notes is in [`Self::summary`].
    pub fn take_notes(&self) -> Vec<String> {
        self.lock().take_notes()
    }

    /// What the script did, for the summary.
    pub fn summary(&self) -> PolicySummary {
        let policy = self.lock();
        let counters = policy.counters();
        PolicySummary {
            name: self
                .path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            windows: counters.windows,
            blocks: counters.blocks,
            periods: counters.periods,
            time_constants_changed: counters.time_constants,
            tolerances_changed: counters.tolerances,
            feeds_capped: counters.feed_caps,
            ratios_changed: counters.ratios,
            requests_limited: counters.limited,
            requests_refused: counters.refused_by_planner,
            traps: counters.troubles(),
            out_of_fuel: counters.out_of_fuel,
            memory_refusals: counters.memory_refusals,
            stack_overflows: counters.stack_overflows,
            not_finite: counters.not_finite,
            quarantined: policy.is_quarantined(),
            reloads: counters.reloads,
            refused_reloads: counters.refused_reloads,
            max_window_fuel: counters.max_window_fuel,
            max_period_fuel: counters.max_period_fuel,
        }
    }

    /// A panic while the lock is held has ended the run; what follows only reports.
    pub(super) fn lock(&self) -> MutexGuard<'_, Policy> {
        self.policy.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What changes with a file: when it was written, and its size.
pub type Stamp = (SystemTime, u64);

/// The stamp of a file that can be read.
pub fn stamp(path: &Path) -> Option<Stamp> {
    let data = std::fs::metadata(path).ok()?;
    Some((data.modified().ok()?, data.len()))
}
