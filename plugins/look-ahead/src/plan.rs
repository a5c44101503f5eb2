//! What is decided for one block when it is taken out of the buffer: its profile and the steps at its ends.

use tandem_motion::Profile;
use tandem_motion::blocks::report;
use tandem_sdk::{AxisVector, BlockReport, LimitedBy};

use crate::geometry::Entry;
use crate::options::Junction;
use crate::rows::greater;

/// The plan of one block.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The speed along it.
    pub profile: Profile,
    /// Durations of speeding up, cruising and slowing down, s.
    pub durations_s: [f64; 3],
    /// Half the velocity steps at the start and at the end, mm/s; none under the tangent rule, which bounds nothing.
    pub steps: [AxisVector; 2],
    peak_square: f64,
}

impl Plan {
    /// The plan of `entry` between the squares of its end speeds: up to the feed, what turning may take, or what the
    /// length allows.
    ///
    /// It starts at `start_mm_per_s`, the square root of the first square: the end of the block before.
    pub fn new(
        entry: &Entry,
        end_half_step: &AxisVector,
        squares: [f64; 2],
        start_mm_per_s: f64,
        rule: Junction,
    ) -> Self {
        let length_mm = entry.length_mm();
        let [start, end] = squares;
        let most = entry
            .rows
            .peak(f64::midpoint(start, end), length_mm, entry.own_square);
        let peak_square = greater(greater(most, start), end);
        // While the machine cruises there is no root to draw.
        let root = |square: f64| {
            if square == start {
                start_mm_per_s
            } else {
                square.sqrt()
            }
        };
        let profile = Profile {
            length_mm,
            start_mm_per_s,
            peak_mm_per_s: root(peak_square),
            end_mm_per_s: root(end),
            acceleration_mm_per_s2: entry.rows.acceleration(peak_square),
        };
        let steps = match rule {
            Junction::Tangent => [AxisVector::ZERO; 2],
            Junction::Axis => [
                entry.half_step * profile.start_mm_per_s,
                *end_half_step * profile.end_mm_per_s,
            ],
        };
        Self {
            profile,
            durations_s: profile.durations_s(),
            steps,
            peak_square,
        }
    }

    /// Duration of the block, s.
    pub fn duration_s(&self) -> f64 {
        self.durations_s.iter().sum()
    }

    /// The block's row of the report.
    pub fn report(&self, entry: &Entry) -> BlockReport {
        let Profile {
            start_mm_per_s,
            peak_mm_per_s,
            end_mm_per_s,
            ..
        } = self.profile;
        let feeds_mm_per_s = [start_mm_per_s, peak_mm_per_s, end_mm_per_s];
        report(
            entry.index,
            self.limited_by(entry),
            feeds_mm_per_s,
            self.duration_s(),
        )
    }

    fn limited_by(&self, entry: &Entry) -> LimitedBy {
        let reached = |square: f64| self.peak_square >= square * (1.0 - 1e-9);
        let moving_ends = self.profile.start_mm_per_s > 0.0 && self.profile.end_mm_per_s > 0.0;
        if reached(entry.feed_mm_per_s.powi(2)) {
            entry.feed_reason
        } else if reached(entry.own_square) {
            LimitedBy::Curvature
        } else if moving_ends && self.durations_s[0] > 0.0 && self.durations_s[2] > 0.0 {
            LimitedBy::Junction
        } else {
            LimitedBy::Acceleration
        }
    }
}
