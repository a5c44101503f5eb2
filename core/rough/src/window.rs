//! Largest value over a sliding window of program time.

use std::collections::VecDeque;

/// Keeps the largest of the values whose end lies ahead. Amortised constant work a value.
#[derive(Debug, Default)]
pub struct SlidingMax {
    /// Values that fall from front to back, with the program time at which each ends.
    values: VecDeque<(f64, f64)>,
}

impl SlidingMax {
    /// Adds a value that holds until `until_s`.
    pub fn push(&mut self, value: f64, until_s: f64) {
        while self.values.back().is_some_and(|(last, _)| *last <= value) {
            self.values.pop_back();
        }
        self.values.push_back((value, until_s));
    }

    /// Forgets what ended before `now_s`.
    pub fn forget(&mut self, now_s: f64) {
        while self
            .values
            .front()
            .is_some_and(|(_, until_s)| *until_s < now_s)
        {
            self.values.pop_front();
        }
    }

    /// The largest value, if there is one.
    pub fn max(&self) -> Option<f64> {
        self.values.front().map(|(value, _)| *value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_ahead() {
        let mut window = SlidingMax::default();
        for (value, until) in [(3.0, 1.0), (1.0, 2.0), (2.0, 3.0)] {
            window.push(value, until);
        }
        assert_eq!(window.max(), Some(3.0));
        window.forget(1.5);
        assert_eq!(window.max(), Some(2.0));
        window.forget(3.5);
        assert_eq!(window.max(), None);
    }
}
