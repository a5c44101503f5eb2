//! What was sent or reported in the last periods.

use tandem_sdk::{AxisVector, MAX_DELAY_PERIODS};

/// Periods that are kept: the present one and as many as a driver may be behind.
const KEPT: usize = MAX_DELAY_PERIODS as usize + 1;

/// Joint positions of the last periods, mm or rad.
#[derive(Debug)]
pub struct History {
    kept: [AxisVector; KEPT],
    /// Where the next one goes.
    next: usize,
}

impl History {
    /// Always there. Any loop; does not allocate.
    pub fn new(position: &AxisVector) -> Self {
        Self {
            kept: [*position; KEPT],
            next: 0,
        }
    }

    /// Another period. Fine loop.
    #[inline]
    pub fn push(&mut self, position: &AxisVector) {
        self.kept[self.next] = *position;
        self.next = (self.next + 1) % KEPT;
    }

    /// What was pushed last. Fine loop.
    #[inline]
    pub fn last(&self) -> &AxisVector {
        self.at(0)
    }

    /// What was pushed `periods` before the last; at most as long ago as is kept. Fine loop.
    #[inline]
    pub fn at(&self, periods: u32) -> &AxisVector {
        let back = 1 + (periods.min(MAX_DELAY_PERIODS) as usize);
        &self.kept[(self.next + KEPT - back) % KEPT]
    }

    /// The place `periods` before the last one, between what was pushed; at most as long ago as is kept. Fine loop.
    pub fn before(&self, periods: f64) -> AxisVector {
        let back = if periods.is_nan() {
            0.0
        } else {
            periods.clamp(0.0, f64::from(MAX_DELAY_PERIODS))
        };
        let (newer, share) = (back as u32, back.fract());
        let (from, to) = (*self.at(newer), *self.at(newer + 1));
        from + (to - from) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_are_counted_back_from_the_last_and_places_lie_between_them() {
        let mut history = History::new(&AxisVector([-1.0; 8]));
        for period in 0..40 {
            history.push(&AxisVector([f64::from(period); 8]));
        }
        for periods in 0..=MAX_DELAY_PERIODS {
            assert_eq!(history.at(periods)[0], 39.0 - f64::from(periods));
        }
        assert_eq!(history.before(2.25)[0], 36.75);
        assert_eq!(history.before(1e9)[0], 39.0 - f64::from(MAX_DELAY_PERIODS));
        assert_eq!(
            history.before(f64::NAN)[0],
            39.0,
            "what is no number is no time ago"
        );
        assert_eq!(History::new(&AxisVector([3.0; 8])).before(7.5)[0], 3.0);
    }
}
