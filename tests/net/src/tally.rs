//! The table at the end, and the verdict.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::cases::Case;
use crate::compare::Finding;

/// Greatest distance from 1 of the median ratio of times of a planner whose grid may change.
const MAX_MEDIAN_SHIFT: f64 = 0.002;

/// Counts by group, and the ratios of times by planner.
#[derive(Debug, Default)]
pub struct Tally {
    groups: BTreeMap<String, Counts>,
    ratios: BTreeMap<String, Vec<f64>>,
}

#[derive(Debug, Default)]
struct Counts {
    cases: usize,
    /// Trace, blocks, summary and messages are the same.
    same: usize,
    differing: usize,
}

impl Tally {
    /// Counts a case.
    pub fn add(&mut self, case: &Case, finding: &Finding) {
        let group = case.name.split('/').next().unwrap_or_default();
        let counts = self.groups.entry(group.to_string()).or_default();
        counts.cases += 1;
        counts.differing += usize::from(!finding.differences.is_empty());
        counts.same += usize::from(finding.differences.is_empty() && finding.is_same);
        if let Some(ratio) = finding.time_ratio {
            self.ratios
                .entry(finding.planner.clone())
                .or_default()
                .push(ratio);
        }
    }

    /// Whether nothing differs and no planner has become faster or slower on the whole.
    pub fn passed(&self) -> bool {
        let steady = |ratios: &Vec<f64>| (median(ratios) - 1.0).abs() <= MAX_MEDIAN_SHIFT;
        self.groups.values().all(|counts| counts.differing == 0) && self.ratios.values().all(steady)
    }

    /// The table.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{:<12}{:>8}{:>8}{:>12}{:>8}\n",
            "group", "cases", "same", "as allowed", "differ"
        );
        for (group, counts) in &self.groups {
            let allowed = counts.cases - counts.same - counts.differing;
            let Counts {
                cases,
                same,
                differing,
            } = counts;
            writeln!(
                text,
                "{group:<12}{cases:>8}{same:>8}{allowed:>12}{differing:>8}"
            )
            .expect("a text takes what is written");
        }
        for (planner, ratios) in &self.ratios {
            let most = ratios.iter().copied().fold(0.0, f64::max);
            let median = median(ratios);
            writeln!(
                text,
                "{planner}: time new/old: median {median:.5}, longest {most:.5}, of {} programs",
                ratios.len()
            )
            .expect("a text takes what is written");
        }
        text
    }
}

/// The middle of the ratios; 1 of none.
fn median(ratios: &[f64]) -> f64 {
    let mut sorted = ratios.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(1.0)
}
