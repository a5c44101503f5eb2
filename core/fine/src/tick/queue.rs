//! How long what is queued lasts: whether the machine must begin to stop before the end of it.

use std::sync::atomic::Ordering::Acquire;

use tandem_rings::{Depth, STOP_SHARE};

/// Fine periods in which a stop has not begun to slow the machine: the one in which the queue is looked at, the one in which the rate
/// is chosen, and the one in which it begins to fall.
const REACTION_PERIODS: f64 = 3.0;

/// Starvation: the end of the queue is a wall unless it ends at rest, and the machine must be able to stop before.
///
/// Where the ring is full and the rough loop looks after it, nothing is late: the wall moves on as entries are driven,
/// and the rate that the rough loop has found for what the ring holds counts instead.
#[derive(Debug, Default)]
pub(super) struct QueueWatch {
    starved: bool,
    /// How often the rough loop had filled the ring up when that was last looked at.
    served: u32,
    /// Fine periods since that has changed.
    unserved: u32,
}

impl QueueWatch {
    /// Whether the queue is too short to go on at full speed and still be able to stop.
    pub(super) fn is_starved(&self) -> bool {
        self.starved
    }

    /// What is queued no longer counts: a new epoch begins.
    pub(super) fn forget(&mut self) {
        self.starved = false;
    }

    /// Looks at the queue in a fine period of `period_s`, at program time `now_s`, where the machine moves at the rate `sigma` of a
    /// plan of `planned_mm_per_s`. Gives whether it has begun to starve.
    pub(super) fn look(
        &mut self,
        depth: &Depth,
        now_s: f64,
        sigma: f64,
        planned_mm_per_s: f64,
        period_s: f64,
    ) -> bool {
        let served = depth.served.load(Acquire);
        self.unserved = if served == self.served {
            self.unserved + 1
        } else {
            0
        };
        self.served = served;
        let wall_s = depth.wall_s.load();
        if self.starved {
            self.starved = !depth.may_start(now_s);
            return false;
        }
        let speed = sigma * planned_mm_per_s;
        let deceleration = depth.stop_deceleration_mm_per_s2.load();
        // The governor keeps a margin, so it brakes with a share of the declared deceleration. The rough loop keeps the ring as deep
        // as this asks, with the same share and the same time of building up (core/rough/src/depth.rs): with a lower share here a ring
        // that is deep enough would starve, and with a higher one the machine would brake too late.
        let stop_s = (speed / deceleration).min(sigma * depth.stop_s.load()) / STOP_SHARE;
        let stop_s = stop_s + depth.build_up_s.load() + REACTION_PERIODS * period_s;
        let unserved_s = f64::from(self.unserved) * period_s;
        let deep_as_can_be = depth.full.load(Acquire) && unserved_s <= depth.served_for_s.load();
        self.starved = speed > 0.0 && wall_s - now_s < stop_s && !deep_as_can_be;
        self.starved
    }
}
