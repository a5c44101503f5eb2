//! Many runs: seeds over workers, a table of counts, and what failed as files.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

use crate::case::Case;
use crate::draw::draw;
use crate::machine::Planner;
use crate::minimise::minimise;
use crate::verdict::Report;
use crate::worker::Worker;

/// Refused programs of a thousand runs that are no failure of the campaign.
const REFUSED_PER_THOUSAND: u64 = 1;

/// What is to be run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The seeds.
    pub seeds: RangeInclusive<u64>,
    /// All machines have this planner.
    pub planner: Option<Planner>,
    /// Workers at the same time.
    pub jobs: usize,
    /// Time that a run may take before its worker is ended.
    pub patience: Duration,
    /// Failures of each planner and kind that are made smaller; the others are written as they are.
    pub minimised: u64,
    /// Runs that making one smaller may take.
    pub minimiser_runs: u32,
    /// The binary that is a worker.
    pub binary: PathBuf,
    /// The folder for what fails.
    pub out: PathBuf,
}

/// Counts of a campaign by planner and kind.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    counts: BTreeMap<(String, String), u64>,
    /// Runs.
    pub runs: u64,
    /// Samples of all runs.
    pub samples: u64,
    /// Most memory of a run, MB.
    pub max_memory_mb: f64,
    /// Seeds of programs that a planner refused, with the reason.
    pub refused: Vec<(u64, String)>,
    /// Runs that failed.
    pub failed: Vec<Failed>,
}

/// A run that failed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Failed {
    /// Its seed.
    pub seed: u64,
    /// The planner, with its form where it has several.
    pub planner: String,
    /// What failed, as the table of `docs/campaign.md` names it.
    pub kind: String,
    /// In words.
    pub why: String,
}

impl Tally {
    fn count(&mut self, seed: u64, report: &Report) -> u64 {
        self.runs += 1;
        self.samples += report.samples;
        self.max_memory_mb = self.max_memory_mb.max(report.memory_mb);
        let Report {
            planner, kind, why, ..
        } = report;
        if report.is_failure() {
            self.failed.push(Failed {
                seed,
                planner: planner.clone(),
                kind: kind.clone(),
                why: why.clone(),
            });
        } else if kind == "refused" {
            self.refused.push((seed, format!("{planner}: {why}")));
        }
        let count = self
            .counts
            .entry((planner.clone(), kind.clone()))
            .or_default();
        *count += 1;
        *count
    }

    /// Whether nothing failed and hardly anything was refused.
    pub fn passed(&self) -> bool {
        self.failed.is_empty()
            && self.refused.len() as u64 * 1000 <= REFUSED_PER_THOUSAND * self.runs.max(1000)
    }

    /// Counts as a table: a row for each planner and kind.
    pub fn table(&self) -> String {
        let mut text = String::new();
        for ((planner, kind), count) in &self.counts {
            writeln!(text, "{planner:22} {kind:16} {count:8}")
                .expect("a text takes what is written");
        }
        for (seed, why) in &self.refused {
            writeln!(text, "refused: seed {seed}: {why}").expect("a text takes what is written");
        }
        let Self {
            runs,
            samples,
            max_memory_mb,
            failed,
            refused,
            ..
        } = self;
        let (failed, refused) = (failed.len(), refused.len());
        let last = format!(
            "{runs} runs, {samples} samples, {failed} failed, {refused} refused, {max_memory_mb:.0} MB at most\n"
        );
        text + &last
    }
}

/// Runs all seeds; each failure is handed to `tell` as it is found.
pub fn campaign(plan: &Plan, tell: &(dyn Fn(&str) + Sync)) -> Tally {
    let shared = Mutex::new((plan.seeds.clone(), Tally::default()));
    std::thread::scope(|scope| {
        for job in 0..plan.jobs.max(1) {
            let shared = &shared;
            scope.spawn(move || {
                let folder = plan
                    .out
                    .join(format!("worker-{}-{job}", std::process::id()));
                let mut worker = Worker::new(&plan.binary, &folder, plan.patience);
                loop {
                    // In a statement of its own, so that the lock is not held for the run.
                    let next = lock(shared).0.next();
                    let Some(seed) = next else { break };
                    one(plan, seed, &mut worker, shared, tell);
                }
                let _ = std::fs::remove_dir_all(&folder);
            });
        }
    });
    let (_, mut tally) = shared
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    tally.failed.sort();
    tally.refused.sort();
    tally
}

type Shared = Mutex<(RangeInclusive<u64>, Tally)>;

fn lock(shared: &Shared) -> std::sync::MutexGuard<'_, (RangeInclusive<u64>, Tally)> {
    shared
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn one(plan: &Plan, seed: u64, worker: &mut Worker, shared: &Shared, tell: &(dyn Fn(&str) + Sync)) {
    let case = draw(seed, plan.planner);
    let report = worker.run(&case);
    let count = lock(shared).1.count(seed, &report);
    if !report.is_failure() {
        return;
    }
    let Report {
        planner, kind, why, ..
    } = &report;
    let failure = format!("seed {seed}: {planner}: {kind}");
    let (smallest, last) = if count <= plan.minimised {
        // What is slow to run is made smaller for hours, which may not hide that it failed.
        tell(&format!("{failure}: {why}\n  is made smaller"));
        minimise(
            &mut |case| worker.run(case),
            &case,
            &report,
            plan.minimiser_runs,
        )
    } else {
        (case.clone(), report.clone())
    };
    let folder = plan
        .out
        .join(format!("{}-{kind}-{seed}", planner.replace(' ', "-")));
    let words = write(&folder, seed, plan.planner, &smallest, &last).unwrap_or_else(|e| e);
    tell(&format!("{failure}: {}\n{words}", last.why));
}

/// Writes a failure; what to tell of it.
fn write(
    folder: &Path,
    seed: u64,
    planner: Option<Planner>,
    case: &Case,
    report: &Report,
) -> Result<String, String> {
    case.write(folder)?;
    let Report {
        planner: name,
        kind,
        why,
        size,
        samples,
        memory_mb,
    } = report;
    let asked = planner.map_or_else(String::new, |planner| {
        format!(" --planner {}", planner.name())
    });
    let text = format!(
        "{name}: {kind}: {why}\nsize {size:e}, {samples} samples, {memory_mb:.0} MB\n\
         drawn again by: cargo run --release -p tandem-campaign -- --seeds {seed}..{seed}{asked}\n\
         judged again by: cargo run --release -p tandem-campaign -- judge {}\n{}\n",
        folder.display(),
        Case::replay(folder)
    );
    std::fs::write(folder.join("why.txt"), &text)
        .map_err(|e| format!("{}: {e}", folder.display()))?;
    Ok(format!("  {}\n", Case::replay(folder)))
}
