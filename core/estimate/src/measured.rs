//! Estimates beside what was measured, and what the difference comes from.

use crate::estimate::Estimate;
use crate::fit::least_squares;
use crate::measurements::ProgramTime;

/// A program's estimate and what it took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// Estimated, s.
    pub estimated_s: f64,
    /// Measured, s.
    pub measured_s: f64,
    /// How far the reading may be off, s.
    pub reading_error_s: f64,
}

impl Beside {
    /// Of an estimate, where its program was measured: by its name, or by that of its file alone.
    pub fn of(estimate: &Estimate, measured: &[ProgramTime]) -> Option<Self> {
        let file = |name: &str| name.rsplit('/').next().unwrap_or(name).to_string();
        let found = measured
            .iter()
            .find(|time| time.program == estimate.program)
            .or_else(|| {
                let name = file(&estimate.program);
                measured.iter().find(|time| file(&time.program) == name)
            })?;
        Some(Self {
            estimated_s: estimate.estimated_s,
            measured_s: found.seconds,
            reading_error_s: found.reading_error_s,
        })
    }

    /// Estimate over measurement less one.
    pub fn residual(&self) -> f64 {
        self.estimated_s / self.measured_s - 1.0
    }

    /// Whether the difference may be the reading's.
    pub fn is_within_reading(&self) -> bool {
        (self.estimated_s - self.measured_s).abs() <= self.reading_error_s
    }
}

/// What a part of a program may be off by.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    /// What is estimated wrongly.
    pub name: &'static str,
    /// Seconds that are missing for each of `unit`.
    pub missing_s: f64,
    /// What the seconds are for.
    pub unit: &'static str,
}

/// Causes of the residuals of several programs, by least squares: what is missing of each second of rapids, of each block that reaches
/// its feed, and of each that does not. What no program has is left out.
///
/// # Errors
/// Programs that are too few or too much alike to tell the causes apart.
pub fn causes(of: &[(&Estimate, Beside)]) -> Result<Vec<Cause>, String> {
    const CAUSES: [(&str, &str); 3] = [
        ("rapids", "second of rapids"),
        ("blocks that reach their feed", "block"),
        ("shorter blocks", "block"),
    ];
    let row = |estimate: &Estimate| {
        let (long, short) = estimate.tally.long_and_short();
        [estimate.tally.rapid.time_s, long as f64, short as f64]
    };
    let rows: Vec<[f64; 3]> = of.iter().map(|(estimate, _)| row(estimate)).collect();
    let missing: Vec<f64> = of
        .iter()
        .map(|(_, beside)| beside.measured_s - beside.estimated_s)
        .collect();
    let present: Vec<usize> = (0..3)
        .filter(|cause| rows.iter().any(|row| row[*cause] > 0.0))
        .collect();
    let found = match present[..] {
        [] => vec![],
        [a] => least_squares(
            &rows.iter().map(|row| [row[a]]).collect::<Vec<_>>(),
            &missing,
        )?
        .to_vec(),
        [a, b] => {
            let rows: Vec<_> = rows.iter().map(|row| [row[a], row[b]]).collect();
            least_squares(&rows, &missing)?.to_vec()
        }
        _ => least_squares(&rows, &missing)?.to_vec(),
    };
    let cause = |(cause, missing_s): (usize, f64)| Cause {
        name: CAUSES[cause].0,
        missing_s,
        unit: CAUSES[cause].1,
    };
    Ok(present.into_iter().zip(found).map(cause).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::Element;
    use crate::model::{Case, Spent};
    use crate::tally::Tally;

    fn estimate(program: &str, long: u32, short: u32) -> Estimate {
        let mut tally = Tally::default();
        for (count, case) in [(long, Case::ReachesFeed), (short, Case::Peak)] {
            for _ in 0..count {
                let spent = Spent {
                    time_s: 0.1,
                    reached_mm_per_s: 10.0,
                    case: Some(case),
                };
                tally.add(&Element::line(1.0, 0.0, 10.0), &spent);
            }
        }
        Estimate {
            program: program.to_string(),
            model: "overlap",
            estimated_s: 0.1 * f64::from(long + short),
            tally,
            assumed_edges: 0,
        }
    }

    #[test]
    fn what_blocks_lack_is_told_apart_and_a_reading_error_is_no_cause() {
        let estimates = [
            estimate("a/one.ngc", 100, 10),
            estimate("two.ngc", 20, 200),
            estimate("3.ngc", 50, 50),
        ];
        // Shorter blocks take 4 ms more, others 1 ms less.
        let seconds = [11.0 - 0.1 + 0.04, 22.0 - 0.02 + 0.8, 10.0 - 0.05 + 0.2];
        let measured: Vec<ProgramTime> = ["one.ngc", "two.ngc", "3.ngc"]
            .iter()
            .zip(seconds)
            .map(|(program, seconds)| ProgramTime {
                program: (*program).to_string(),
                seconds,
                reading_error_s: 0.1,
            })
            .collect();
        let beside: Vec<(&Estimate, Beside)> = estimates
            .iter()
            .map(|estimate| (estimate, Beside::of(estimate, &measured).unwrap()))
            .collect();
        assert!(beside[0].1.is_within_reading() && !beside[1].1.is_within_reading());
        let found = causes(&beside).unwrap();
        assert_eq!(found.len(), 2, "there are no rapids");
        assert!((found[0].missing_s + 1e-3).abs() < 1e-12, "{found:?}");
        assert!((found[1].missing_s - 4e-3).abs() < 1e-12, "{found:?}");
        assert!(
            causes(&beside[..1]).is_err(),
            "one program cannot tell two causes apart"
        );
    }
}
