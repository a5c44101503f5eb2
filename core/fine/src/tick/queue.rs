//! How long what is queued lasts: whether the machine must begin to stop before the end of it.

use std::sync::atomic::Ordering::Acquire;

use tandem_rings::{Depth, STOP_SHARE};

use crate::governor::tuning::REACTION_PERIODS;

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
    /// plan of `planned_mm_per_s`, or is at a rest of it. Gives whether it has begun to starve.
    pub(super) fn look(
        &mut self,
        depth: &Depth,
        now_s: f64,
        sigma: f64,
        planned_mm_per_s: Option<f64>,
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
        let speed = sigma * planned_mm_per_s.unwrap_or(0.0);
        let deceleration = depth.stop_deceleration_mm_per_s2.load();
        // The governor keeps a margin, so it brakes with a share of the declared deceleration. The rough loop keeps the ring as deep
        // as this asks, with the same share and the same time of building up (core/rough/src/depth.rs): with a lower share here a ring
        // that is deep enough would starve, and with a higher one the machine would brake too late.
        let stop_s = (speed / deceleration).min(sigma * depth.stop_s.load()) / STOP_SHARE;
        let stop_s = stop_s + depth.build_up_s.load() + REACTION_PERIODS * period_s;
        let unserved_s = f64::from(self.unserved) * period_s;
        let deep_as_can_be = depth.full.load(Acquire) && unserved_s <= depth.served_for_s.load();
        let too_short = speed > 0.0 && wall_s - now_s < stop_s && !deep_as_can_be;
        // A plan may stand for a while without being at rest, a filter that has settled for one: it needs no way to stop, but behind the
        // wall it gets on no more.
        self.starved = too_short || (planned_mm_per_s.is_some() && now_s >= wall_s);
        self.starved
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::Ordering::Release;

    const PERIOD_S: f64 = 0.001;

    /// A queue that ends at 1 s of program time, in motion, with 100 mm/s² to brake with.
    fn depth(stop_s: f64) -> Depth {
        let depth = Depth::default();
        depth.begin(0, 0.0);
        depth.wall_s.store(1.0);
        depth.stop_deceleration_mm_per_s2.store(100.0);
        depth.stop_s.store(stop_s);
        depth.build_up_s.store(0.05);
        depth.required_s.store(0.5);
        depth
    }

    #[test]
    fn a_queue_starves_where_what_is_left_of_it_is_shorter_than_a_stop() {
        for (longest_s, stop_s) in [(10.0, 25.0 / 100.0), (0.2, 0.5 * 0.2)] {
            let needed_s = stop_s / STOP_SHARE + 0.05 + 3.0 * PERIOD_S;
            for (spare_s, starves) in [(1e-6, false), (-1e-6, true)] {
                let (depth, mut watch) = (depth(longest_s), QueueWatch::default());
                let now_s = 1.0 - needed_s - spare_s;
                assert_eq!(
                    watch.look(&depth, now_s, 0.5, Some(50.0), PERIOD_S),
                    starves
                );
                assert_eq!(watch.is_starved(), starves, "{longest_s} {spare_s}");
            }
        }
        let mut watch = QueueWatch::default();
        let stands = watch.look(&depth(10.0), 0.9999, 0.0, Some(50.0), PERIOD_S);
        assert!(!stands, "what stands needs no queue");
        let mut at_the_wall = |speed| watch.look(&depth(10.0), 1.0, 0.0, speed, PERIOD_S);
        assert!(!at_the_wall(None), "a rest needs none either");
        assert!(at_the_wall(Some(0.0)), "a plan that stands gets on no more");
    }

    #[test]
    fn it_starves_once_until_enough_is_queued_again_or_an_epoch_ends() {
        let (depth, mut watch) = (depth(10.0), QueueWatch::default());
        assert!(watch.look(&depth, 0.9, 1.0, Some(50.0), PERIOD_S));
        assert!(
            !watch.look(&depth, 0.9, 1.0, Some(50.0), PERIOD_S),
            "it has begun before"
        );
        assert!(watch.is_starved());
        depth.wall_s.store(1.5);
        assert!(!watch.look(&depth, 0.9, 1.0, Some(50.0), PERIOD_S));
        assert!(!watch.is_starved(), "motion may start");
        assert!(watch.look(&depth, 1.45, 1.0, Some(50.0), PERIOD_S));
        watch.forget();
        assert!(!watch.is_starved());
    }

    #[test]
    fn a_full_ring_starves_only_where_nobody_looks_after_it() {
        let (depth, mut watch) = (depth(10.0), QueueWatch::default());
        depth.full.store(true, Release);
        depth.served_for_s.store(4.5 * PERIOD_S);
        for served in 1..20 {
            depth.served.store(served, Release);
            assert!(!watch.look(&depth, 0.9, 1.0, Some(50.0), PERIOD_S));
        }
        for unserved in 1..=4 {
            assert!(
                !watch.look(&depth, 0.9, 1.0, Some(50.0), PERIOD_S),
                "{unserved}"
            );
        }
        assert!(watch.look(&depth, 0.9, 1.0, Some(50.0), PERIOD_S));
    }
}
