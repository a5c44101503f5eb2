//! Following the plan: what is asked of the rate of program time, and the sample that results.

use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::STOP_SHARE;
use tandem_sdk::AxisVector;

use super::{FineLoop, Phase};
use crate::config::GuardMode;
use crate::cursor::Reached;
use crate::fault::FaultKind;
use crate::governor::Governor;
use crate::guard::Checked;
use crate::state::Input;

/// Why the rate of program time is to go down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ask {
    Run,
    Hold,
    Starve,
}

/// The feed ratios that count now.
struct Ratios {
    feed: f64,
    rapid: f64,
}

impl FineLoop {
    /// Follows the plan for one period.
    pub(super) fn follow(&mut self) -> (AxisVector, Input) {
        self.take_ratio();
        let ask = self.ask();
        if self.cursor.is_resting() {
            self.governor.jump(if ask == Ask::Run { 1.0 } else { 0.0 });
        }
        if self.governor.sigma() == 0.0 && ask == Ask::Hold && self.controls.soft_fault.load(Relaxed) {
            self.fail(FaultKind::Soft);
            return (*self.guard.position(), Input::Trip);
        }
        let delta_s = self.govern(ask);
        let pause = self.config.pause_at_stops;
        let reached = self.cursor.advance(delta_s, |event| {
            self.outputs.apply(event);
            pause && self.outputs.stop_requested
        });
        let position = self.cursor.position();
        let checked = self.guard.check(&position);
        let position = self.let_pass(position, &checked);
        (position, self.input(ask, reached))
    }

    fn let_pass(&mut self, position: AxisVector, checked: &Checked) -> AxisVector {
        match (checked.breach, self.config.guard) {
            (Some(breach), GuardMode::Stop) => {
                self.counters.guard_stops += 1;
                self.fail(breach);
                self.next_position().0
            }
            (breach, _) => {
                self.counters.limit_violations += u64::from(breach.is_some());
                self.guard.sent(&position, checked);
                position
            }
        }
    }

    /// What is asked of the rate of program time, before ratios.
    fn ask(&mut self) -> Ask {
        let stop_wanted = self.config.pause_at_stops && self.outputs.stop_requested;
        if stop_wanted {
            self.controls.program_hold.store(true, Relaxed);
            self.outputs.stop_requested = false;
        }
        self.watch_queue();
        let controls = &self.controls;
        let flags = [&controls.hold, &controls.program_hold, &controls.soft_fault];
        if flags.iter().any(|flag| flag.load(Relaxed)) {
            Ask::Hold
        } else if self.starved {
            Ask::Starve
        } else {
            Ask::Run
        }
    }

    /// Starvation: the end of the queue is a wall unless it ends at rest, and the machine must be able to stop before.
    fn watch_queue(&mut self) {
        let wall_s = self.depth.wall_s.load();
        if self.starved {
            self.starved = !self.depth.may_start(self.cursor.program_time_s());
            return;
        }
        let speed = self.governor.sigma() * self.cursor.path_speed_mm_per_s();
        let deceleration = self.depth.stop_deceleration_mm_per_s2.load();
        // The declared deceleration is kept within the governor's margin and from the next period on.
        let stop_s = speed / (STOP_SHARE * deceleration) + 3.0 * self.config.period_s;
        if speed > 0.0 && wall_s - self.cursor.program_time_s() < stop_s {
            self.starved = true;
            self.counters.starvations += 1;
        }
    }

    /// Chooses the rate for this period; gives the program time that passes, s.
    fn govern(&mut self, ask: Ask) -> f64 {
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
    fn take_ratio(&mut self) {
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

    fn input(&self, ask: Ask, reached: Reached) -> Input {
        match (&self.phase, ask) {
            (Phase::Ramping(_), _) => Input::Trip,
            (Phase::Faulted, _) => Input::Stopped,
            (_, Ask::Hold) => Input::Hold,
            (_, Ask::Starve) => Input::Starve,
            _ if reached == Reached::Rest && self.cursor.is_last() => Input::Rest,
            _ => Input::Run,
        }
    }
}

/// The rate at which a planned speed is at most `allowed`; 1 where it is anyway, to the rounding of a long path.
fn within(allowed: f64, planned_mm_per_s: f64) -> f64 {
    if planned_mm_per_s * (1.0 - FEED_TOLERANCE) > allowed { allowed / planned_mm_per_s } else { 1.0 }
}

/// Relative tolerance on the feed: differences of path coordinates of 1e6 mm have this rounding.
const FEED_TOLERANCE: f64 = 1e-7;
