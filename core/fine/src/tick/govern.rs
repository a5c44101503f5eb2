//! Choosing the rate of program time: what the ratios ask for, and what the limits allow.

use super::FineLoop;
use super::follow::Ask;
use crate::config::GuardMode;
use crate::governor::Governor;

/// The feed ratios that count now.
struct Ratios {
    feed: f64,
    rapid: f64,
}

impl FineLoop {
    /// Chooses the rate for this period; gives the program time that passes, s.
    pub(super) fn govern(&mut self, ask: Ask) -> f64 {
        self.cursor.scan(self.config.period_s, &mut self.points);
        // Under `count` everything is sent: forms that break limits on purpose are not slowed.
        let counting = self.config.guard == GuardMode::Count;
        let limit = if counting { 1.0 } else { Governor::plan_limit(&self.points) };
        let ratios = self.ratios_in_force();
        let wanted = if ask == Ask::Run { self.ratio_target(&ratios) } else { 0.0 };
        let target = wanted.min(limit);
        let unchanged = target == self.governor.sigma();
        let sigma = if unchanged { target } else { self.governor.choose(target, &self.points) };
        let asked = ask != Ask::Run || ratios.feed < self.config.max_feed_ratio || ratios.rapid < 1.0;
        self.recovering = asked || (self.recovering && sigma < 1.0);
        self.counters.governed_samples += u64::from(sigma < 1.0 && !self.recovering);
        self.governor.take(sigma).min(self.points.covered_s.max(if self.cursor.is_resting() { f64::MAX } else { 0.0 }))
    }

    fn ratios_in_force(&self) -> Ratios {
        let operator = |value: f64| if self.outputs.override_permitted { value } else { 1.0 };
        let adaptive = if self.outputs.adaptive_permitted { self.ratio } else { 1.0 };
        Ratios {
            feed: operator(self.controls.feed_override.load()) * adaptive,
            rapid: operator(self.controls.rapid_override.load()).min(1.0),
        }
    }

    /// The rate at which the path speed is at most ratio × programmed feed at the end of the period.
    fn ratio_target(&mut self, ratios: &Ratios) -> f64 {
        let (from, from_mm) = (self.governor.sigma(), self.cursor.path_mm());
        let mut sigma = from;
        // The plan at the end of the period depends on the rate sought: three rounds settle it.
        for _ in 0..3 {
            let delta_s = self.governor.program_time_s(sigma);
            let ahead = self.cursor.ahead(delta_s);
            let at_end = within(ratios.feed * ahead.feed_mm_per_s, ahead.speed_mm_per_s);
            let mean = if delta_s > 0.0 { (ahead.path_mm - from_mm) / delta_s } else { ahead.speed_mm_per_s };
            let of_period = 2.0 * within(ratios.feed * ahead.most_feed_mm_per_s, mean) - from;
            let next = if ahead.rapid { ratios.rapid } else { at_end.min(of_period).clamp(0.0, 1.0) };
            if next == sigma {
                break;
            }
            sigma = next;
        }
        sigma
    }

    /// Takes the ratios that are due.
    pub(super) fn take_ratio(&mut self) {
        loop {
            let Some(next) = self.next_ratio.take().or_else(|| self.ratios.pop().ok()) else { return };
            if next.tick > self.tick {
                self.next_ratio = Some(next);
                return;
            }
            self.counters.late_ratios += u64::from(next.tick < self.tick);
            self.ratio = next.ratio;
        }
    }
}

/// The rate at which a planned speed is at most `allowed`; 1 where it is anyway, to the rounding of a long path.
fn within(allowed: f64, planned_mm_per_s: f64) -> f64 {
    if planned_mm_per_s * (1.0 - FEED_TOLERANCE) > allowed { allowed / planned_mm_per_s } else { 1.0 }
}

/// Relative tolerance on the feed: differences of path coordinates of 1e6 mm have this rounding.
const FEED_TOLERANCE: f64 = 1e-7;
