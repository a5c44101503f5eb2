//! The feed laws: from mean torque to the feed asked for.

/// A feed law. Gains are per rough period where they integrate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Programmed feed + gain × error, as published. It leaves an offset: see [`Law::Pi`].
    Proportional {
        /// Feed per torque, (mm/s)/(N·m).
        gain: f64,
    },
    /// The same with an integral, which holds the reference.
    Pi {
        /// Feed per torque, (mm/s)/(N·m).
        gain: f64,
        /// Feed per torque and rough period, (mm/s)/(N·m).
        integral_gain: f64,
    },
    /// Feed × (reference/torque)^exponent in every rough period: the loop gain does not depend on the depth of cut.
    Ratio {
        /// The exponent.
        exponent: f64,
    },
}

/// The smallest torque that the law [`Law::Ratio`] divides by, as a share of the reference.
const MIN_SHARE: f64 = 0.2;

/// What a law is bounded by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Torque to be held, N·m.
    pub reference_nm: f64,
    /// Lowest feed, mm/s.
    pub min_mm_per_s: f64,
    /// Highest feed, mm/s.
    pub max_mm_per_s: f64,
}

/// A law with its memory. Does not allocate.
#[derive(Clone, Copy, Debug)]
pub struct FeedLaw {
    law: Law,
    bounds: Bounds,
    ceiling_mm_per_s: f64,
    integral_mm_per_s: f64,
    feed_mm_per_s: f64,
}

impl FeedLaw {
    /// A law that begins at the feed `feed_mm_per_s`.
    pub fn new(law: Law, bounds: Bounds, feed_mm_per_s: f64) -> Self {
        Self {
            law,
            bounds,
            ceiling_mm_per_s: f64::INFINITY,
            integral_mm_per_s: 0.0,
            feed_mm_per_s,
        }
    }

    /// The feed to ask for, mm/s, after a rough period of mean torque `torque_nm` in a block of `programmed_mm_per_s`.
    /// With `may_rise` false (the last feed asked for was not driven) nothing accumulates upwards.
    pub fn next(&mut self, programmed_mm_per_s: f64, torque_nm: f64, may_rise: bool) -> f64 {
        let error_nm = self.bounds.reference_nm - torque_nm;
        let wanted = match self.law {
            Law::Proportional { gain } => programmed_mm_per_s + gain * error_nm,
            Law::Pi {
                gain,
                integral_gain,
            } => {
                let held = self.integral_mm_per_s;
                let integral = held + integral_gain * error_nm;
                let wanted = programmed_mm_per_s + gain * error_nm + integral;
                let free = self.clip(wanted) == wanted && (may_rise || error_nm < 0.0);
                self.integral_mm_per_s = if free { integral } else { held };
                wanted
            }
            Law::Ratio { exponent } => {
                let min_nm = MIN_SHARE * self.bounds.reference_nm;
                let factor = (self.bounds.reference_nm / torque_nm.max(min_nm)).powf(exponent);
                self.feed_mm_per_s * if may_rise { factor } else { factor.min(1.0) }
            }
        };
        self.feed_mm_per_s = self.clip(wanted);
        self.feed_mm_per_s
    }

    /// Goes on from `feed_mm_per_s`, as if the law had asked for it at the torque `torque_nm`.
    pub fn restart(&mut self, programmed_mm_per_s: f64, torque_nm: f64, feed_mm_per_s: f64) {
        self.feed_mm_per_s = self.clip(feed_mm_per_s);
        if let Law::Pi { gain, .. } = self.law {
            let error_nm = self.bounds.reference_nm - torque_nm;
            self.integral_mm_per_s = self.feed_mm_per_s - programmed_mm_per_s - gain * error_nm;
        }
    }

    /// The feed asked for last, mm/s.
    pub fn feed_mm_per_s(&self) -> f64 {
        self.feed_mm_per_s
    }

    /// Bounds the law further, where the programmed feed or the machine allows less: no integral passes this feed, mm/s.
    pub fn set_max(&mut self, mm_per_s: f64) {
        self.ceiling_mm_per_s = mm_per_s;
    }

    fn clip(&self, feed_mm_per_s: f64) -> f64 {
        feed_mm_per_s
            .min(self.bounds.max_mm_per_s.min(self.ceiling_mm_per_s))
            .max(self.bounds.min_mm_per_s)
    }
}

/// A feed that changes by at most a step a rough period.
#[derive(Clone, Copy, Debug)]
pub struct RateLimit {
    step_mm_per_s: f64,
    feed_mm_per_s: f64,
}

impl RateLimit {
    /// Begins at `feed_mm_per_s`.
    pub fn new(step_mm_per_s: f64, feed_mm_per_s: f64) -> Self {
        Self {
            step_mm_per_s,
            feed_mm_per_s,
        }
    }

    /// The feed after one rough period, on the way to `target_mm_per_s`.
    pub fn next(&mut self, target_mm_per_s: f64) -> f64 {
        let change = target_mm_per_s - self.feed_mm_per_s;
        self.feed_mm_per_s += change.clamp(-self.step_mm_per_s, self.step_mm_per_s);
        self.feed_mm_per_s
    }

    /// Goes on from another feed.
    pub fn restart(&mut self, feed_mm_per_s: f64) {
        self.feed_mm_per_s = feed_mm_per_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds {
        reference_nm: 0.1,
        min_mm_per_s: 0.5,
        max_mm_per_s: 5.0,
    };

    /// Torque and feed where a law and a cut of `depth` times the demo's gain come to rest.
    fn settled(law: Law, torque_per_feed: f64) -> (f64, f64) {
        let mut law = FeedLaw::new(law, BOUNDS, 2.5);
        let (mut feed, mut torque) = (2.5, 0.0);
        for _ in 0..5000 {
            torque += 0.2 * (feed * torque_per_feed - torque);
            feed = law.next(2.5, torque, true);
        }
        (torque, feed)
    }

    #[test]
    fn only_the_integrating_laws_hold_the_reference() {
        let at_4_mm = 2.0 / 37.5;
        let (torque, _) = settled(Law::Proportional { gain: 25.0 }, at_4_mm);
        assert!(
            (torque - 0.114_285_7).abs() < 1e-6,
            "the published offset, not {torque}"
        );
        for law in [
            Law::Pi {
                gain: 10.0,
                integral_gain: 0.5,
            },
            Law::Ratio { exponent: 0.05 },
        ] {
            let (torque, feed) = settled(law, at_4_mm);
            assert!(
                (torque - 0.1).abs() < 1e-9 && (feed - 1.875).abs() < 1e-7,
                "{law:?}: {torque} {feed}"
            );
        }
    }

    #[test]
    fn nothing_winds_up_at_a_bound_or_while_the_feed_is_not_driven() {
        for may_rise in [true, false] {
            let mut law = FeedLaw::new(
                Law::Pi {
                    gain: 16.0,
                    integral_gain: 0.8,
                },
                BOUNDS,
                2.5,
            );
            let _ = (0..1000).map(|_| law.next(2.5, 0.0, may_rise)).last();
            let after = law.next(2.5, 0.1, true);
            assert!(
                after <= if may_rise { 5.0 } else { 2.5 + 1e-12 },
                "{may_rise}: {after}"
            );
        }
        let mut law = FeedLaw::new(Law::Ratio { exponent: 0.05 }, BOUNDS, 2.5);
        let _ = (0..1000).map(|_| law.next(2.5, 0.0, false)).last();
        assert_eq!(law.next(2.5, 0.1, true), 2.5);
    }

    #[test]
    fn a_restart_is_bumpless() {
        for law in [
            Law::Pi {
                gain: 16.0,
                integral_gain: 0.0,
            },
            Law::Ratio { exponent: 0.0 },
        ] {
            let mut law = FeedLaw::new(law, BOUNDS, 2.5);
            law.restart(2.5, 0.03, 1.25);
            assert!((law.next(2.5, 0.03, true) - 1.25).abs() < 1e-12);
        }
    }

    #[test]
    fn the_feed_changes_in_steps() {
        let mut limit = RateLimit::new(0.8, 0.0);
        assert_eq!(
            [
                limit.next(2.0),
                limit.next(2.0),
                limit.next(2.0),
                limit.next(0.0)
            ],
            [0.8, 1.6, 2.0, 1.2]
        );
    }
}
