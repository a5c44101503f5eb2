//! From what a script asks for to what it gets.

use tandem_sdk::BlockKind;

/// What a script asks for a block: time constant, path tolerance, feed cap; NaN where it leaves them.
pub type Asks = [f64; 3];

/// What a script may ask for on this machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Shortest and longest time constant, s.
    pub time_constant_s: (f64, f64),
    /// Smallest and largest path tolerance, mm; without a largest the tolerance in force is the largest.
    pub path_tolerance_mm: (f64, Option<f64>),
    /// Smallest share of the programmed feed that a script can bring a block to, whatever it answers: by a cap, by a
    /// ratio, or by both at once.
    pub lowest_feed_ratio: f64,
    /// Highest feed ratio.
    pub max_feed_ratio: f64,
    /// How fast the feed ratio may change, 1/s; infinite where it may jump.
    pub ratio_change_per_s: f64,
}

impl Default for Bounds {
    fn default() -> Self {
        Self {
            time_constant_s: (0.001, 1.0),
            path_tolerance_mm: (1e-4, None),
            lowest_feed_ratio: 0.05,
            max_feed_ratio: 1.0,
            ratio_change_per_s: f64::INFINITY,
        }
    }
}

/// What a script gets for one block; `None` where the block keeps its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tuning {
    /// Time constant, s.
    pub time_constant_s: Option<f64>,
    /// Path tolerance, mm.
    pub path_tolerance_mm: Option<f64>,
    /// Feed cap, mm/s.
    pub feed_cap_mm_per_s: Option<f64>,
}

impl Tuning {
    /// Whether the block stays as it is.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// What is in force for a block before the script is asked.
#[derive(Clone, Copy, Debug)]
pub struct InForce {
    pub line: u32,
    /// Its kind; a dwell where nothing is to be tuned.
    pub kind: BlockKind,
    pub time_constant_s: f64,
    pub path_tolerance_mm: f64,
    pub programmed_feed_mm_per_s: f64,
    pub feed_cap_mm_per_s: f64,
}

impl Bounds {
    /// The bounds of each answer. A cap is fixed when a block is planned and a ratio when it is driven, so that neither
    /// knows the other: where a script gives both, each keeps to the root of the share that they have together.
    pub(crate) fn for_each_answer(self, gives_both: bool) -> Self {
        let lowest = if gives_both {
            self.lowest_feed_ratio.sqrt()
        } else {
            self.lowest_feed_ratio
        };
        Self {
            lowest_feed_ratio: lowest,
            ..self
        }
    }

    /// What a script gets that asks for `asks`; the second says which of the three were changed on the way.
    pub(crate) fn apply(&self, asks: &Asks, block: &InForce) -> (Tuning, [bool; 3]) {
        let [time_constant, tolerance, cap] = *asks;
        let (shortest, longest) = self.time_constant_s;
        let (smallest, largest) = self.path_tolerance_mm;
        let largest = largest.unwrap_or(block.path_tolerance_mm);
        let slowest = self.lowest_feed_ratio * block.programmed_feed_mm_per_s;
        let moves = block.kind != BlockKind::Dwell;
        let feeds = moves && block.kind != BlockKind::Rapid;
        let time_constant = limited(
            time_constant,
            shortest,
            longest,
            block.time_constant_s,
            moves,
        );
        let tolerance = limited(
            tolerance,
            smallest.min(largest),
            largest,
            block.path_tolerance_mm,
            moves,
        );
        let highest = block.programmed_feed_mm_per_s.min(block.feed_cap_mm_per_s);
        let cap = limited(cap, slowest.min(highest), highest, highest, feeds);
        let tuning = Tuning {
            time_constant_s: time_constant.0,
            path_tolerance_mm: tolerance.0,
            feed_cap_mm_per_s: cap.0,
        };
        (tuning, [time_constant.1, tolerance.1, cap.1])
    }

    /// The ratio that a script gets that asks for `asked` a period of `period_s` after it got `last`; and whether it was
    /// changed.
    pub(crate) fn ratio(&self, asked: f64, last: f64, period_s: f64) -> (f64, bool) {
        let step = self.ratio_change_per_s * period_s;
        let inside = asked.clamp(self.lowest_feed_ratio, self.max_feed_ratio);
        let given = inside.clamp(last - step, last + step);
        (given, given != asked)
    }
}

/// `asked` between `lowest` and `highest`, where it differs from what is in force; and whether it was changed.
fn limited(
    asked: f64,
    lowest: f64,
    highest: f64,
    in_force: f64,
    applies: bool,
) -> (Option<f64>, bool) {
    if asked.is_nan() {
        return (None, false);
    }
    if !applies {
        return (None, true);
    }
    let given = asked.clamp(lowest, highest);
    ((given != in_force).then_some(given), given != asked)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: InForce = InForce {
        line: 1,
        kind: BlockKind::Line,
        time_constant_s: 0.05,
        path_tolerance_mm: 0.01,
        programmed_feed_mm_per_s: 100.0,
        feed_cap_mm_per_s: f64::INFINITY,
    };

    #[test]
    fn what_is_left_is_left() {
        let (tuning, changed) = Bounds::default().apply(&[f64::NAN; 3], &LINE);
        assert!(tuning.is_empty() && changed == [false; 3]);
    }

    #[test]
    fn requests_are_kept_within_the_machine() {
        let (tuning, changed) = Bounds::default().apply(&[1e308, 1e308, 1e308], &LINE);
        assert_eq!(
            tuning,
            Tuning {
                time_constant_s: Some(1.0),
                ..Tuning::default()
            }
        );
        assert_eq!(
            changed, [true; 3],
            "a tolerance above the one in force, a cap above the feed"
        );
        let (tuning, changed) = Bounds::default().apply(&[-1e308; 3], &LINE);
        let lowest = (
            tuning.time_constant_s,
            tuning.path_tolerance_mm,
            tuning.feed_cap_mm_per_s,
        );
        assert_eq!(
            (lowest, changed),
            ((Some(0.001), Some(1e-4), Some(5.0)), [true; 3])
        );
        let (tuning, changed) = Bounds::default().apply(&[0.02, 0.005, 50.0], &LINE);
        let given = (
            tuning.time_constant_s,
            tuning.path_tolerance_mm,
            tuning.feed_cap_mm_per_s,
        );
        assert_eq!(
            (given, changed),
            ((Some(0.02), Some(0.005), Some(50.0)), [false; 3])
        );
    }

    #[test]
    fn a_cap_never_exceeds_the_cap_in_force() {
        let capped = InForce {
            feed_cap_mm_per_s: 30.0,
            ..LINE
        };
        for asked in [30.000_001, 60.0, 100.0, 1e308] {
            let (tuning, changed) = Bounds::default().apply(&[f64::NAN, f64::NAN, asked], &capped);
            assert_eq!(
                (tuning.feed_cap_mm_per_s, changed),
                (None, [false, false, true]),
                "{asked}"
            );
        }
        let (tuning, changed) = Bounds::default().apply(&[f64::NAN, f64::NAN, 29.0], &capped);
        assert_eq!((tuning.feed_cap_mm_per_s, changed[2]), (Some(29.0), false));
        // A cap below the floor that somebody else has set stays.
        let slow = InForce {
            feed_cap_mm_per_s: 2.0,
            ..LINE
        };
        let (tuning, changed) = Bounds::default().apply(&[f64::NAN, f64::NAN, 1.0], &slow);
        assert_eq!((tuning.feed_cap_mm_per_s, changed[2]), (None, true));
    }

    #[test]
    fn rapids_have_no_feed_and_dwells_nothing_to_tune() {
        let rapid = InForce {
            kind: BlockKind::Rapid,
            programmed_feed_mm_per_s: f64::INFINITY,
            ..LINE
        };
        let (tuning, changed) = Bounds::default().apply(&[0.02, f64::NAN, 50.0], &rapid);
        assert_eq!(
            (tuning.time_constant_s, tuning.feed_cap_mm_per_s),
            (Some(0.02), None)
        );
        assert_eq!(changed, [false, false, true]);
        let capped = InForce {
            feed_cap_mm_per_s: 30.0,
            ..rapid
        };
        let (tuning, changed) = Bounds::default().apply(&[f64::NAN, f64::NAN, 20.0], &capped);
        assert_eq!((tuning.feed_cap_mm_per_s, changed[2]), (None, true));
        let dwell = InForce {
            kind: BlockKind::Dwell,
            ..LINE
        };
        assert!(
            Bounds::default()
                .apply(&[0.02, 0.005, 50.0], &dwell)
                .0
                .is_empty()
        );
    }

    #[test]
    fn a_tolerance_in_force_that_is_smaller_than_any_that_can_be_asked_for_stays() {
        let fine = InForce {
            path_tolerance_mm: 5e-5,
            ..LINE
        };
        for asked in [1e-6, 5e-5, 0.01] {
            let (tuning, _) = Bounds::default().apply(&[f64::NAN, asked, f64::NAN], &fine);
            assert!(tuning.is_empty(), "{asked}");
        }
    }

    #[test]
    fn ratios_change_no_faster_than_stated() {
        let bounds = Bounds {
            ratio_change_per_s: 2.0,
            ..Bounds::default()
        };
        assert_eq!(bounds.ratio(0.0, 1.0, 0.01), (0.98, true));
        assert_eq!(bounds.ratio(1e308, 0.5, 0.01), (0.52, true));
        assert_eq!(Bounds::default().ratio(0.0, 1.0, 0.01), (0.05, true));
    }
}
