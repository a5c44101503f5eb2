//! Single-block operation: a hold at the end of every line of the program.

use std::sync::atomic::Ordering::Relaxed;

use super::FineLoop;

/// How near to the end of its line the machine comes to rest, mm.
pub(super) const LINE_END_MM: f64 = 0.01;

impl FineLoop {
    /// In single-block operation: where to come to rest, as a path coordinate, mm.
    pub(super) fn line_end(&mut self) -> Option<f64> {
        if !self.given.single_block {
            self.line_end.forget();
            return None;
        }
        if self.cursor.is_resting() {
            return None;
        }
        if self.line_end.is_passed(&self.cursor) {
            // What a turn behind the end takes of the jerk may not have been left for braking: it rests a little behind.
            self.controls.hold.store(true, Relaxed);
            self.line_end.forget();
            return None;
        }
        let along = self.along();
        let way_mm = if self.config.order >= 3 {
            along.way_to_mm(0.0)
        } else {
            along.speed_mm_per_s * along.speed_mm_per_s / (2.0 * along.most_mm_per_s2)
        };
        let soon_mm = 3.0 * self.config.period_s * along.speed_mm_per_s;
        self.line_end.look(&mut self.cursor, way_mm + soon_mm)
    }

    /// The end of the line is reached: a feed hold stands until the operator resumes.
    pub(super) fn stop_at_line_end(&mut self, end_mm: Option<f64>) {
        let Some(end_mm) = end_mm else { return };
        if self.governor.sigma() == 0.0 && end_mm - self.cursor.path_mm() < LINE_END_MM {
            self.controls.hold.store(true, Relaxed);
            self.line_end.forget();
        }
    }

    /// At a rest of the plan between two lines: a feed hold stands until the operator resumes.
    pub(super) fn stop_between_lines(&mut self) {
        if !self.given.single_block || !self.cursor.is_resting() {
            self.line_moves |= !self.cursor.is_resting();
            return;
        }
        let line = self.cursor.segment().line;
        if self.line_moves && self.cursor.next_line().is_some_and(|next| next != line) {
            self.controls.hold.store(true, Relaxed);
            // It acts in this period already.
            self.given.hold = true;
            self.line_moves = false;
        }
    }
}
