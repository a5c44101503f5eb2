//! Places on the chain of samples, one behind the other.

use tandem_motion::tube::Lanes;

use crate::frame::{dot, minus};

/// What is as near as it may be is within reach, whatever rounding says.
const ROUNDED: f64 = 1.0 + 1e-9;

/// A place on the lines from sample to sample, which only goes on.
pub struct Chain<'a, const L: usize> {
    samples: &'a [Lanes<L>],
    /// The sample before it, and which part of the line from there lies before it.
    link: usize,
    part: f64,
}

impl<'a, const L: usize> Chain<'a, L> {
    /// At the first sample.
    pub fn new(samples: &'a [Lanes<L>]) -> Self {
        Self {
            samples,
            link: 0,
            part: 0.0,
        }
    }

    /// Goes on to the first place from here on that is within `reach` of `point`, behind one of the samples from `first` to `last`; false
    /// where there is none. Whoever takes the first place each time has more left than by any other choice.
    pub fn goes_on(&mut self, point: &Lanes<L>, (first, last): (usize, usize), reach: f64) -> bool {
        if self.link < first {
            (self.link, self.part) = (first, 0.0);
        }
        let lines = self.samples.len() - 1;
        while self.link <= last && self.link < lines {
            let line = [&self.samples[self.link], &self.samples[self.link + 1]];
            if let Some(part) = first_within(point, line, reach * ROUNDED, self.part) {
                self.part = part;
                return true;
            }
            (self.link, self.part) = (self.link + 1, 0.0);
        }
        false
    }
}

/// The first part of the line from one point to another, `low` at least, up to which it comes within `reach` of `point`.
fn first_within<const L: usize>(
    point: &Lanes<L>,
    [from, to]: [&Lanes<L>; 2],
    reach: f64,
    low: f64,
) -> Option<f64> {
    let line = minus(to, from);
    let way = minus(point, from);
    let squared = dot(&line, &line);
    // Samples at rest are one place.
    let foot = if squared > 0.0 {
        dot(&way, &line) / squared
    } else {
        low
    };
    let across = minus(&way, &line.map(|v| foot * v));
    let left = reach * reach - dot(&across, &across);
    if reach < 0.0 || left < 0.0 {
        return None;
    }
    let half = if squared > 0.0 {
        (left / squared).sqrt()
    } else {
        0.0
    };
    let first = low.max(foot - half);
    (first <= 1.0 && first <= foot + half).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The places, as multiples of a link, at which a chain meets points one behind the other, as far as it does.
    fn met(samples: &[[f64; 2]], points: &[[f64; 2]], reach: f64) -> Vec<f64> {
        let mut chain = Chain::new(samples);
        let goes_on = |point| {
            let place = chain.goes_on(point, (0, usize::MAX), reach);
            place.then_some(chain.link as f64 + chain.part)
        };
        points.iter().map_while(goes_on).collect()
    }

    fn assert_met(samples: &[[f64; 2]], points: &[[f64; 2]], reach: f64, expected: &[f64]) {
        let met = met(samples, points, reach);
        assert_eq!(met.len(), expected.len(), "{met:?}");
        for (at, expected) in met.iter().zip(expected) {
            assert!((at - expected).abs() < 1e-4, "{met:?}");
        }
    }

    #[test]
    fn the_first_place_within_reach_is_where_a_line_comes_into_the_circle() {
        let line = [[0.0, 0.0], [10.0, 0.0]];
        assert_met(&line, &[[5.0, 3.0]], 5.0, &[0.1]);
        assert_met(&line, &[[5.0, 5.0]], 5.0, &[0.5]);
        assert_met(&line, &[[5.0, 5.1]], 5.0, &[]);
        assert_met(&line, &[[-3.0, 0.0]], 5.0, &[0.0]);
        assert_met(&line, &[[14.0, 3.0]], 5.0, &[1.0]);
        assert_met(&line, &[[14.1, 3.0]], 5.0, &[]);
        assert_met(&line, &[[5.0, 0.0]], -1.0, &[]);
    }

    #[test]
    fn a_place_is_behind_the_one_before_on_the_same_line_too() {
        let line = [[0.0, 0.0], [10.0, 0.0]];
        assert_met(&line, &[[5.0, 0.0], [4.0, 0.0]], 1.0, &[0.4, 0.4]);
        assert_met(&line, &[[5.0, 0.0], [3.0, 0.0]], 1.0, &[0.4, 0.4]);
        assert_met(&line, &[[5.0, 0.0], [2.9, 0.0]], 1.0, &[0.4]);
        assert_met(
            &[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0], [10.0, 0.0]],
            &[[5.0, 0.0], [2.9, 0.0], [5.5, 0.0]],
            1.0,
            &[1.0, 1.05, 2.3125],
        );
    }

    #[test]
    fn samples_at_rest_are_one_place() {
        let samples = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        assert_met(
            &samples,
            &[[0.9, 0.0], [1.0, 0.0], [2.0, 0.0]],
            0.1,
            &[0.8, 0.9, 3.9],
        );
        assert_met(&[[1.0, 0.0]; 3], &[[1.0, 0.1], [1.0, 0.3]], 0.2, &[0.0]);
    }

    #[test]
    fn what_lies_outside_of_the_samples_named_is_no_place() {
        let samples: Vec<_> = (0..10).map(|n| [f64::from(n), 0.0]).collect();
        let mut chain = Chain::new(&samples);
        assert!(chain.goes_on(&[1.5, 0.0], (0, 3), 0.1));
        assert!(!Chain::new(&samples).goes_on(&[1.5, 0.0], (2, 5), 0.1));
        assert!(!Chain::new(&samples).goes_on(&[4.5, 0.0], (0, 3), 0.1));
        assert!(Chain::new(&samples).goes_on(&[4.5, 0.0], (0, 4), 0.1));
        assert!(Chain::new(&samples).goes_on(&[9.0, 0.0], (8, 20), 0.1));
    }
}
