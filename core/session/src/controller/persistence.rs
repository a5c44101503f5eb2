//! Where what lasts is kept, so that a killed process does not lose it.

use std::collections::BTreeMap;

use tandem_state::{Alarm, Change, Driven, Job, Store};

/// Jobs and alarms that are held ready for clients; a state file keeps more.
pub const HELD: usize = 100;

/// What a process finds from those before it, beside offsets, parameters and tools.
#[derive(Clone, Debug, Default)]
pub struct Remembered {
    /// The last jobs, the latest first.
    pub jobs: Vec<Job>,
    /// The last alarms, the latest first.
    pub alarms: Vec<Alarm>,
    /// The line that was driven last.
    pub driven: Option<Driven>,
    /// Parameters of the policy script.
    pub policy_parameters: BTreeMap<String, f64>,
}

/// Keeps what lasts. No method but [`Persistence::commit`] waits for a disk.
pub trait Persistence: Send + Sync {
    /// Keeps what a client has asked for: it is safe when this returns.
    ///
    /// # Errors
    /// Why it is not, in words; nothing of it is kept.
    fn commit(&self, changes: Vec<Change>) -> Result<(), String>;

    /// Keeps what has happened; nobody waits for it.
    fn record(&self, change: Change);

    /// The line that is driven; only the last one counts.
    fn driven(&self, _driven: Driven) {}

    /// What there was before.
    fn remembered(&self) -> Remembered {
        Remembered::default()
    }

    /// Why nothing can be kept now, in words.
    fn trouble(&self) -> Option<String> {
        None
    }
}

/// Keeps nothing: what lasts ends with the process.
pub struct NoPersistence;

impl Persistence for NoPersistence {
    fn commit(&self, _changes: Vec<Change>) -> Result<(), String> {
        Ok(())
    }

    fn record(&self, _change: Change) {}
}

impl Persistence for Store {
    fn commit(&self, changes: Vec<Change>) -> Result<(), String> {
        Self::commit(self, changes).map_err(|e| e.to_string())
    }

    fn record(&self, change: Change) {
        // What could not be a number was refused where it was written; a disk that fails is told by `trouble`.
        let _ = self.recorder().record(change);
    }

    fn driven(&self, driven: Driven) {
        self.recorder().driven(driven);
    }

    fn remembered(&self) -> Remembered {
        let state = self.load();
        Remembered {
            // A history that cannot be read keeps no machine from working.
            jobs: self.jobs(HELD).unwrap_or_default(),
            alarms: self.alarms(HELD).unwrap_or_default(),
            driven: state.driven.clone(),
            policy_parameters: state.policy_parameters.clone(),
        }
    }

    fn trouble(&self) -> Option<String> {
        Self::trouble(self).map(|trouble| trouble.to_string())
    }
}
