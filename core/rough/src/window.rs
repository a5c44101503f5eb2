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

    #[test]
    fn it_is_the_largest_of_all_that_do_not_end_before_now() {
        let mut window = SlidingMax::default();
        let (mut all, mut now_s) = (Vec::new(), 0.0);
        for step in 0..500 {
            let (value, until_s) = (f64::from(step * 37 % 101), f64::from(step));
            window.push(value, until_s);
            all.push((value, until_s));
            if step % 7 == 0 {
                now_s = f64::from(step * 9 / 10);
                window.forget(now_s);
            }
            let ahead = all.iter().filter(|(_, until_s)| *until_s >= now_s);
            let most = ahead.map(|(value, _)| *value).reduce(f64::max);
            assert_eq!(window.max(), most, "{step}");
        }
    }
}
