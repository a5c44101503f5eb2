//! How long the windows are: as long as asked, or shorter where those are refused.
//!
//! Where the tolerance is far below what the grid can follow, no window passes but a short one, which is found by halving a long one
//! again and again. Beginning with the long one at every rest would plan each piece of the path many times over.

/// Refusals at one rest from which on the next windows are shorter. On curves at 0.24 µm with a fine period of 1.6 ms, on a machine of
/// 700 m/s², a window as long as asked has 300 steps, and one that passes has 12: planning takes a tenth of the time that it takes
/// without this, and the motion is 5 % shorter. With half as many both take 2 to 5 % longer; with twice as many planning takes a third
/// longer, and the motion 3 %.
const MANY: usize = 4;
/// How much longer than the one that passed they are. There planning takes a tenth less with half of it, and 1.6 times as long with twice
/// as much; the motion takes as long.
const LONGER: f64 = 2.0;
/// Shortest time of a window, s. There planning takes a tenth less with half of it, and half as long again with twice as much; the motion
/// takes 2 % longer with either.
const SHORTEST_S: f64 = 0.03;

/// The time that windows are planned over.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    asked_s: f64,
    now_s: f64,
}

impl Span {
    /// As long as asked.
    pub fn new(asked_s: f64) -> Self {
        Self {
            asked_s,
            now_s: asked_s,
        }
    }

    /// How long windows are to be, s.
    pub fn asked_s(&self) -> f64 {
        self.asked_s
    }

    /// Another path begins: as long as asked.
    pub fn restart(&mut self) {
        self.now_s = self.asked_s;
    }

    /// How long the next window is, s.
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// One of `took_s` passed behind so many that were `refused`.
    pub fn passed(&mut self, refused: usize, took_s: f64) {
        if refused >= MANY {
            self.now_s = (LONGER * took_s).clamp(SHORTEST_S, self.now_s);
        } else if refused == 0 {
            self.now_s = (LONGER * self.now_s).min(self.asked_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_shorter_behind_many_refusals_and_as_long_as_asked_again_where_they_pass() {
        let mut span = Span::new(1.0);
        assert_eq!(span.now_s(), 1.0);
        span.passed(MANY - 1, 0.1);
        assert_eq!(span.now_s(), 1.0);
        span.passed(MANY, 0.1);
        assert_eq!(span.now_s(), 0.2);
        span.passed(1, 0.1);
        assert_eq!(span.now_s(), 0.2);
        for longer_s in [0.4, 0.8, 1.0, 1.0] {
            span.passed(0, 0.2);
            assert_eq!(span.now_s(), longer_s);
        }
    }

    #[test]
    fn windows_are_never_shorter_than_the_shortest_nor_longer_than_the_refused_ones() {
        let mut span = Span::new(1.0);
        span.passed(MANY, 0.9);
        assert_eq!(span.now_s(), 1.0);
        span.passed(MANY + 5, 1e-4);
        assert_eq!(span.now_s(), SHORTEST_S);
    }
}
