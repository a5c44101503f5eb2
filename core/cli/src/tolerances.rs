//! The path tolerance in force at each sample, for the report.

use tandem_rings::Sample;
use tandem_sdk::Block;

/// Collects it: 16 bytes for each change in the program, 8 bytes a sample.
pub struct Tolerances {
    machine_mm: f64,
    /// The first block with a tolerance, and the tolerance, mm.
    changes: Vec<(u64, f64)>,
    at: usize,
    each_mm: Vec<f64>,
}

impl Tolerances {
    /// With the machine's own tolerance where a block states none.
    pub fn new(machine_mm: f64) -> Self {
        Self {
            machine_mm,
            changes: vec![(0, machine_mm)],
            at: 0,
            each_mm: vec![],
        }
    }

    /// A block is planned for good.
    pub fn block(&mut self, block: &Block) {
        let stated = block.path_tolerance_mm;
        let tolerance_mm = if stated.is_nan() {
            self.machine_mm
        } else {
            stated
        };
        let last_mm = self
            .changes
            .last()
            .map_or(f64::NAN, |(_, last_mm)| *last_mm);
        if last_mm != tolerance_mm {
            self.changes.push((block.index, tolerance_mm));
        }
    }

    /// A sample was sent. Where two blocks meet, the wider tolerance counts for both, as one of them still moves.
    pub fn sample(&mut self, sample: &Sample) {
        while self
            .changes
            .get(self.at + 1)
            .is_some_and(|(block, _)| *block <= sample.block)
        {
            self.at += 1;
        }
        let (first, here_mm) = self.changes[self.at];
        let meets = self.at > 0 && first == sample.block;
        let before_mm = if meets {
            self.changes[self.at - 1].1
        } else {
            here_mm
        };
        self.each_mm.push(here_mm.max(before_mm));
    }

    /// The largest tolerance of the run, and that at each sample where it changes, mm.
    pub fn of_run_mm(self) -> (f64, Option<Vec<f64>>) {
        let most = self.each_mm.iter().copied().fold(f64::NAN, f64::max);
        let changes = self.each_mm.iter().any(|each| *each != most);
        (
            if most.is_nan() { self.machine_mm } else { most },
            changes.then_some(self.each_mm),
        )
    }
}
