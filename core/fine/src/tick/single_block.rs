//! Single-block operation: a hold at the end of every line of the program.

use super::govern::PlanFollower;
use crate::governor::RestAt;
use crate::governor::tuning::LINE_END_JERK_SHARES;
use crate::law::Along;

/// How near to the end of its line the machine comes to rest, mm.
const LINE_END_MM: f64 = 0.01;
/// As near as this to the end of its line, mm, the machine comes to rest at once: it does not get faster again.
const AT_LINE_END_MM: f64 = 0.001;

/// Fine periods at the present speed by which the end of a line is looked for further than a stop takes.
const LINE_END_LOOK_PERIODS: f64 = 3.0;

impl PlanFollower {
    /// In single-block operation: where to come to rest, as a path coordinate, mm.
    pub(super) fn line_end(&mut self) -> Option<f64> {
        if !self.request.single_block {
            self.line_end.forget();
            return None;
        }
        if self.cursor.is_resting() {
            return None;
        }
        if self.line_end.is_passed(&self.cursor) {
            // The next corner may need jerk that braking counted on; the machine then stops slightly past the end of the line.
            self.chosen.holds = true;
            self.line_end.forget();
            return None;
        }
        let along = self.along();
        let way_mm = if self.order >= 3 {
            let rest = self.rest_at(f64::INFINITY);
            let stop = Along {
                jerk_mm_per_s3: rest.jerk_mm_per_s3,
                ..along
            };
            stop.way_to_mm(0.0)
        } else {
            along.speed_mm_per_s * along.speed_mm_per_s / (2.0 * along.max_mm_per_s2)
        };
        let soon_mm = LINE_END_LOOK_PERIODS * self.period_s * along.speed_mm_per_s;
        self.line_end.look(&mut self.cursor, way_mm + soon_mm)
    }

    /// The speed at the end of this period from which rest can be met at the end of the line, mm/s; with a jerk limit σ̈ is sought
    /// for it instead, until the end is next to reached.
    pub(super) fn speed_to_rest(&self, end_mm: f64) -> f64 {
        if self.order < 3 {
            return self.speed_towards(end_mm, 0.0);
        }
        if end_mm - self.cursor.path_mm() > AT_LINE_END_MM {
            f64::INFINITY
        } else {
            0.0
        }
    }

    /// Rest at `path_mm` with what braking there may count on. Jerk is limited.
    pub(super) fn rest_at(&self, path_mm: f64) -> RestAt {
        let share = LINE_END_JERK_SHARES[usize::from(self.horizon.is_steady())];
        RestAt {
            path_mm,
            max_mm_per_s2: self.along().max_mm_per_s2,
            jerk_mm_per_s3: share * self.horizon.path_jerk_mm_per_s3,
        }
    }

    /// The end of the line is reached: a feed hold stands until the operator resumes.
    pub(super) fn stop_at_line_end(&mut self, end_mm: Option<f64>) {
        let Some(end_mm) = end_mm else { return };
        if self.governor.sigma() == 0.0 && end_mm - self.cursor.path_mm() < LINE_END_MM {
            self.chosen.holds = true;
            self.line_end.forget();
        }
    }
}
