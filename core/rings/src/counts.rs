//! What the fine loop counts: one list, of which plain numbers and atomics for looking at them meanwhile are made.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

macro_rules! counters {
    ($($(#[$meaning:meta])* $name:ident,)*) => {
        /// What the fine loop counts in a run.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Counters {
            $($(#[$meaning])* pub $name: u64,)*
        }

        /// The counters as the fine loop last published them, once a fine period. Each is exact; a reader may see one of them a
        /// period before the next.
        #[derive(Debug, Default)]
        pub struct Counts {
            $($name: AtomicU64,)*
        }

        impl Counts {
            /// Publishes `counters`. Fine loop; does not allocate.
            #[inline]
            pub fn store(&self, counters: &Counters) {
                $(self.$name.store(counters.$name, Relaxed);)*
            }

            /// What was published last. Any loop; does not allocate.
            pub fn load(&self) -> Counters {
                Counters { $($name: self.$name.load(Relaxed),)* }
            }
        }
    };
}

counters! {
    /// Samples handed out.
    samples,
    /// Samples the guard stopped: 0 or 1.
    guard_stops,
    /// Samples beyond a limit that were sent all the same: `guard.mode = "count"`, or a relaxed jerk.
    limit_violations,
    /// Samples with σ < 1 though nothing asked for it.
    governed_samples,
    /// How often the queue ran low.
    starvations,
    /// Samples with σ < 1 because the ring holds too little program time, or comes by in too many pieces, for more.
    queue_limited_samples,
    /// Ratios that came after the tick they were meant for.
    late_ratios,
    /// Fine periods that passed without a sample.
    missed_periods,
    /// Those among them in which the machine moved.
    missed_in_motion,
    /// Samples beyond the jerk limit, within velocity and acceleration: no rate was known that keeps it.
    jerk_relaxed_samples,
    /// Fine periods in which what is known of some joint was old: a frame was lost or late.
    old_feedback_periods,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_published_is_what_was_counted() {
        let counted = Counters {
            samples: 1,
            guard_stops: 2,
            limit_violations: 3,
            governed_samples: 4,
            starvations: 5,
            queue_limited_samples: 6,
            late_ratios: 7,
            missed_periods: 8,
            missed_in_motion: 9,
            jerk_relaxed_samples: 10,
            old_feedback_periods: 11,
        };
        let counts = Counts::default();
        assert_eq!(counts.load(), Counters::default());
        counts.store(&counted);
        assert_eq!(counts.load(), counted);
    }
}
