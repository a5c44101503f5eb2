//! A period in which the plan turns from getting faster to braking, without a jerk limit.
//!
//! One rate of change of σ for the whole period would have to keep the limits on both sides of the turn: where the plan gets
//! faster σ may fall, and where it brakes with all that an axis has it may not. So the feed could not be kept. Where that is
//! so the period is driven segment by segment: in each σ is linear, and within the limits of that segment alone.

use tandem_sdk::{Segment, SegmentFlags};

use super::ratio::{Ratios, within};
use crate::governor::Governor;
use crate::governor::tuning::ABOVE_FEED_SHARE;
use crate::period_points::PeriodPoints;
use crate::plan_ahead::Ahead;

/// Rounds in which the rate at the end of a piece is sought; an odd number, so that the last one is not too high.
const PIECE_ROUNDS: usize = 3;

/// What a period is not to exceed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds<'a> {
    pub(super) ratios: &'a Ratios,
    /// For places ahead, mm/s.
    pub(super) way_speed_mm_per_s: f64,
    /// The highest rate.
    pub(super) limit: f64,
}

/// A period that is laid out segment by segment, as far as that has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Laid {
    /// Rate at the end.
    pub(super) sigma: f64,
    /// Time of the period that is left, s.
    left_s: f64,
    /// Program time that has passed, s.
    pub(super) passed_s: f64,
}

impl Laid {
    /// Passes `piece_s` of program time, or what the time that is left allows, with σ going to `sigma` in no less than `time_s`.
    fn pass(&mut self, piece_s: f64, sigma: f64, time_s: f64) {
        let mean = f64::midpoint(self.sigma, sigma);
        let needed_s = piece_s / mean;
        if needed_s < self.left_s {
            *self = Self {
                sigma,
                left_s: self.left_s - needed_s,
                passed_s: self.passed_s + piece_s,
            };
            return;
        }
        let end = self.sigma + (sigma - self.sigma) * (self.left_s / time_s).min(1.0);
        self.passed_s += f64::midpoint(self.sigma, end) * self.left_s;
        (self.sigma, self.left_s) = (end, 0.0);
    }

    /// Lays a period of `period_s` out on the plan ahead, from the rate of `governor`, which is not changed. `points` are taken for one
    /// piece after the other.
    pub(super) fn out(
        ahead: &Ahead<'_>,
        governor: &Governor,
        points: &mut PeriodPoints,
        period_s: f64,
        bounds: &Bounds<'_>,
    ) -> Self {
        let covered_s = points.covered_s;
        let mut laid = Self {
            sigma: governor.sigma(),
            left_s: period_s,
            passed_s: 0.0,
        };
        for piece in ahead.pieces() {
            let (segment, from_s) = (piece.segment, piece.from_s);
            let whole_s = piece.duration_s();
            let piece_s = whole_s.min(laid.sigma * laid.left_s);
            if piece_s > 0.0 {
                let target_to = |piece_s: f64| {
                    piece_target(segment, from_s, piece_s, laid.sigma, bounds)
                        .min(governor.rate_in_time(laid.passed_s + piece_s))
                        .min(bounds.limit)
                };
                let mut target = target_to(piece_s);
                // The higher the rate becomes the farther the piece goes, where the plan may be faster: rounds find it from both
                // sides, and the last one from below.
                for _ in 0..PIECE_ROUNDS {
                    if target <= laid.sigma {
                        break;
                    }
                    let mean = f64::midpoint(laid.sigma, target);
                    target = target_to(whole_s.min(mean * laid.left_s));
                }
                points.clear();
                points.add(
                    segment,
                    from_s,
                    whole_s.min(laid.sigma.max(target) * laid.left_s),
                );
                let shortest_s = laid.left_s.min(whole_s / laid.sigma.max(target));
                let sigma = governor.choose_within(laid.sigma, target, points, shortest_s);
                laid.pass(whole_s, sigma, shortest_s);
            }
            if laid.left_s <= 0.0 || laid.sigma <= 0.0 {
                break;
            }
        }
        points.covered_s = covered_s;
        laid
    }
}

/// The rate at the end of a piece of `segment` at which neither that end nor the mean exceed what is asked for.
fn piece_target(
    segment: &Segment,
    from_s: f64,
    piece_s: f64,
    sigma: f64,
    bounds: &Bounds<'_>,
) -> f64 {
    let ratios = bounds.ratios;
    let to_s = from_s + piece_s;
    let before = segment.path_speed_mm_per_s(from_s);
    let behind = segment.path_speed_mm_per_s(to_s);
    let of_places = within(bounds.way_speed_mm_per_s, behind);
    if segment.flags.contains(SegmentFlags::RAPID) {
        return ratios.rapid.min(of_places);
    }
    let at_end = within(ratios.feed * segment.feed_mm_per_s, behind).min(of_places);
    let allowed = ratios.mean_feed * segment.feed_mm_per_s;
    let way_mm = segment.path_mm(to_s) - segment.path_mm(from_s);
    let is_below = sigma * before <= allowed * (1.0 + ABOVE_FEED_SHARE);
    if is_below && way_mm > 0.0 {
        at_end.min((2.0 * allowed * piece_s / way_mm - sigma).max(0.0))
    } else {
        at_end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::AxisVector;

    /// From 8 mm/s by way of a hump to 8 mm/s: 16 mm/s in the mean of 1 ms.
    fn hump() -> Segment {
        let mut segment = Segment::rest(&AxisVector::ZERO, 0.001);
        segment.path = [0.0, 8.0, 24e3, -16e6, 0.0, 0.0];
        segment.feed_mm_per_s = 8.0;
        segment.flags = SegmentFlags::default();
        segment
    }

    #[test]
    fn a_piece_is_to_keep_the_feed_at_its_end_and_from_below_it_in_its_mean() {
        let ratios = Ratios {
            feed: 0.5,
            mean_feed: 1.0,
            rapid: 0.7,
        };
        let target = |segment: &Segment, sigma: f64, way_speed_mm_per_s: f64| {
            let bounds = Bounds {
                ratios: &ratios,
                way_speed_mm_per_s,
                limit: 1.0,
            };
            piece_target(segment, 0.0, 0.001, sigma, &bounds)
        };
        let near = |one: f64, other: f64| (one - other).abs() < 1e-9;
        // The mean of σ and the target is half of one.
        assert!(near(target(&hump(), 0.6, f64::INFINITY), 0.4));
        assert!(near(target(&hump(), 0.9, f64::INFINITY), 0.1));
        // Its end is what binds, by the feed or by a place ahead.
        assert!(near(target(&hump(), 0.2, f64::INFINITY), 0.5));
        assert!(near(target(&hump(), 0.2, 2.0), 0.25));
        let above = Segment {
            feed_mm_per_s: 4.0,
            ..hump()
        };
        assert!(near(target(&above, 0.9, f64::INFINITY), 0.25));
        let rapid = Segment {
            flags: SegmentFlags::RAPID,
            ..hump()
        };
        assert!(near(target(&rapid, 0.9, f64::INFINITY), 0.7));
        assert!(near(target(&rapid, 0.9, 4.0), 0.5));
        let stands = Segment {
            path: [5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            ..hump()
        };
        assert!(near(target(&stands, 0.9, f64::INFINITY), 1.0));
    }

    /// At the feed itself, and a rounding above it, a piece is still asked for its mean; what is clearly above only for its end.
    #[test]
    fn a_piece_that_begins_at_the_feed_keeps_it_in_its_mean() {
        let bounds = Bounds {
            ratios: &Ratios {
                feed: 0.6,
                mean_feed: 0.6,
                rapid: 1.0,
            },
            way_speed_mm_per_s: f64::INFINITY,
            limit: 1.0,
        };
        for (sigma, expected) in [(0.6, 0.0), (0.600_001, 0.0), (0.62, 0.6)] {
            let found = piece_target(&hump(), 0.0, 0.001, sigma, &bounds);
            assert!((found - expected).abs() < 1e-9, "from {sigma}: {found}");
        }
    }

    /// Over no time there is no mean: only the end is asked for.
    #[test]
    fn a_piece_without_time_is_asked_for_its_end() {
        let ratios = Ratios {
            feed: 0.5,
            mean_feed: 0.5,
            rapid: 1.0,
        };
        let bounds = Bounds {
            ratios: &ratios,
            way_speed_mm_per_s: f64::INFINITY,
            limit: 1.0,
        };
        assert_eq!(piece_target(&hump(), 0.0, 0.0, 0.4, &bounds), 0.5);
    }

    /// At half the rate a piece takes twice its time; the last one goes as far as what is left of the period lets it.
    #[test]
    fn pieces_take_their_time_of_the_period_by_the_mean_rate() {
        let mut laid = Laid {
            sigma: 0.5,
            left_s: 0.010,
            passed_s: 0.0,
        };
        laid.pass(0.002, 0.5, 0.0);
        laid.pass(0.001, 0.3, 0.0);
        assert!((laid.left_s - 0.0035).abs() < 1e-12, "{laid:?}");
        assert!((laid.passed_s - 0.003).abs() < 1e-12, "{laid:?}");
        laid.pass(1.0, 0.7, 0.007);
        assert!((laid.sigma - 0.5).abs() < 1e-12 && laid.left_s == 0.0);
        assert!((laid.passed_s - 0.003 - 0.4 * 0.0035).abs() < 1e-12);
    }
}
