//! Stretches of a run that exceed a judged limit, for people: where, by how much.

use crate::judge::{ACCELERATION, AxisMotion, JERK, VELOCITY};
use crate::model::{Axis, Report};

/// Findings that are listed; the drawings mark all of them.
const LISTED: usize = 200;
/// Innocent samples between two guilty ones that still belong to the same stretch.
const GAP: usize = 3;

/// A stretch of samples that exceed one limit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Finding {
    /// What is exceeded, such as `X acceleration`.
    pub what: String,
    /// Unit of `peak` and `limit`.
    pub unit: String,
    /// First and last time, in s.
    pub from_s: f64,
    /// See `from_s`.
    pub to_s: f64,
    /// Line of the part program at the first sample.
    pub line: u32,
    /// Largest magnitude in the stretch.
    pub peak: f64,
    /// What would have been allowed.
    pub limit: f64,
    /// Samples that exceed the limit.
    pub samples: usize,
    /// Whether it is the distance from the path, whose limit may change from sample to sample.
    pub of_path: bool,
}

/// All that exceeds a limit.
#[derive(Default)]
pub(crate) struct Findings {
    /// The first stretches of each limit, in order of time.
    pub listed: Vec<Finding>,
    /// Stretches that are not listed.
    pub unlisted: usize,
    /// Samples that exceed a judged limit of an axis, once for each limit.
    pub limit_violations: usize,
    /// Samples farther from the path than the tolerance.
    pub off_path: usize,
}

impl Findings {
    /// Gathers what the marks of the axes and the path deviation say.
    pub(crate) fn of(report: &Report, motions: &[AxisMotion], off_path: &[u8]) -> Self {
        let mut findings = Self::default();
        for (axis, motion) in report.axes.iter().zip(motions) {
            findings.add_axis(report, axis, motion);
        }
        if let (Some(limit), Some(values)) =
            (report.path_tolerance_mm, &report.samples.deviation_mm)
        {
            let kind = Finding {
                what: "path deviation".into(),
                unit: "mm".into(),
                limit,
                of_path: true,
                ..Finding::default()
            };
            findings.off_path = findings.add(report, &kind, values, off_path, 1);
        }
        findings
            .listed
            .sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
        findings
    }

    fn add_axis(&mut self, report: &Report, axis: &Axis, motion: &AxisMotion) {
        let unit = axis.unit.as_str();
        let kind = |name: &str, per: &str, limit| Finding {
            what: format!("{} {name}", axis.letter),
            unit: format!("{unit}/{per}"),
            limit,
            ..Finding::default()
        };
        let velocity = kind("velocity", "s", axis.max_velocity);
        self.limit_violations +=
            self.add(report, &velocity, &motion.velocity, &motion.marks, VELOCITY);
        let acceleration = kind("acceleration", "s²", axis.max_acceleration);
        self.limit_violations += self.add(
            report,
            &acceleration,
            &motion.acceleration,
            &motion.marks,
            ACCELERATION,
        );
        if let Some(limit) = axis.max_jerk.filter(|_| report.jerk_is_judged) {
            let jerk = kind("jerk", "s³", limit);
            self.limit_violations += self.add(report, &jerk, &motion.jerk, &motion.marks, JERK);
        }
    }

    /// Adds the stretches in which `bit` is marked; answers the number of samples.
    fn add(
        &mut self,
        report: &Report,
        kind: &Finding,
        values: &[f64],
        marks: &[u8],
        bit: u8,
    ) -> usize {
        let mut stretches: Vec<Finding> = Vec::new();
        let (mut last, mut samples, mut unlisted) = (None, 0, 0);
        for i in (0..marks.len()).filter(|&i| marks[i] & bit != 0) {
            let continues = last.is_some_and(|last| i - last <= GAP);
            if continues && unlisted == 0 {
                stretches
                    .last_mut()
                    .into_iter()
                    .for_each(|stretch| stretch.extend(report.samples.t_s[i], values[i]));
            } else if !continues && stretches.len() < LISTED {
                stretches.push(kind.starting(report, i, values[i]));
            } else if !continues {
                unlisted += 1;
            }
            last = Some(i);
            samples += 1;
        }
        self.unlisted += unlisted;
        self.listed.append(&mut stretches);
        samples
    }
}

impl Finding {
    fn starting(&self, report: &Report, i: usize, value: f64) -> Self {
        let (t_s, line) = (report.samples.t_s[i], report.samples.line[i]);
        let limit = if self.of_path {
            report.tolerance_at_mm(i).unwrap_or(self.limit)
        } else {
            self.limit
        };
        Self {
            from_s: t_s,
            to_s: t_s,
            line,
            peak: value.abs(),
            samples: 1,
            limit,
            ..self.clone()
        }
    }

    fn extend(&mut self, t_s: f64, value: f64) {
        self.to_s = t_s;
        self.peak = self.peak.max(value.abs());
        self.samples += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Samples;

    fn report(deviation: Vec<f64>) -> Report {
        let n = deviation.len();
        Report {
            path_tolerance_mm: Some(0.01),
            samples: Samples {
                t_s: (0..n).map(|i| i as f64 * 0.001).collect(),
                line: vec![7; n],
                deviation_mm: Some(deviation),
                ..Samples::default()
            },
            ..Report::default()
        }
    }

    #[test]
    fn neighbours_are_one_finding() {
        let report = report(vec![0.0, 0.02, 0.03, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.05]);
        let findings = Findings::of(&report, &[], &[0, 1, 1, 0, 1, 0, 0, 0, 0, 1]);
        assert_eq!(findings.off_path, 4);
        assert_eq!(findings.listed.len(), 2);
        let first = &findings.listed[0];
        assert_eq!(
            (
                first.from_s,
                first.to_s,
                first.peak,
                first.samples,
                first.line
            ),
            (0.001, 0.004, 0.03, 3, 7)
        );
    }

    #[test]
    fn what_is_not_listed_is_counted() {
        let marks: Vec<u8> = (0..10_000).map(|i| u8::from(i % 10 == 0)).collect();
        let findings = Findings::of(&report(vec![0.02; 10_000]), &[], &marks);
        assert_eq!(
            (findings.listed.len(), findings.unlisted, findings.off_path),
            (LISTED, 800, 1000)
        );
    }
}
