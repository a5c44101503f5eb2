//! Where a motion turns back on the path.
//!
//! Samples of one phase may say that a motion is in the order of the path, and those of another that it goes back by more than two
//! places within tolerance may: it goes on between two samples, and back from there. How far it goes is said by the places at which it
//! turns, and these are places that a sample may have. The speed along a chord is a polynomial, and changes its sign only where its
//! control points do.

use tandem_motion::tube::Lanes;

use crate::frame::dot;
use crate::peaks::velocities;
use crate::route::Run;
use crate::window::{Piece, Window};

/// Halvings of a piece in which a turn is found: a piece of 6 ms is then known to 1 µs, in which no motion goes anywhere.
const HALVINGS: u32 = 12;
/// Chords of which the direction differs by less, as the cosine between them, have the same turns.
const SAME: f64 = 0.999;

/// The samples of a motion and its turns; keeps its memory.
#[derive(Debug)]
pub struct Turns<const L: usize> {
    times: Vec<f64>,
    places: Vec<Lanes<L>>,
}

impl<const L: usize> Default for Turns<L> {
    fn default() -> Self {
        Self {
            times: Vec::new(),
            places: Vec::new(),
        }
    }
}

impl<const L: usize> Turns<L> {
    /// The `samples` of `window`, which are a fine period apart, with the turns between them; none where the motion turns nowhere.
    #[inline(always)]
    pub fn among(
        &mut self,
        run: &Run<'_, L>,
        window: &Window<L>,
        samples: &[Lanes<L>],
        period_s: f64,
    ) -> Option<&[Lanes<L>]> {
        self.times.clear();
        let mut chord = run.chord_at(window.marks[0].s, 0);
        for piece in &window.pieces {
            let last = run.chord_at(window.along(piece.end_s()), chord);
            let control = velocities(piece);
            let mut before: Option<&Lanes<L>> = None;
            for direction in run.chords[chord..=last.max(chord)]
                .iter()
                .map(|chord| &chord.direction)
            {
                if before.is_none_or(|before| dot(before, direction) < SAME) {
                    before = Some(direction);
                    self.look(piece, &control, direction);
                }
            }
            chord = last;
        }
        if self.times.is_empty() {
            return None;
        }
        self.times.sort_unstable_by(f64::total_cmp);
        self.places.clear();
        let mut turns = self.times.iter().peekable();
        for (n, sample) in samples.iter().enumerate() {
            while let Some(turn_s) = turns.next_if(|turn_s| **turn_s < n as f64 * period_s) {
                let piece = &window.pieces[window.piece_at(*turn_s)];
                self.places.push(piece.position(*turn_s - piece.start_s));
            }
            self.places.push(*sample);
        }
        Some(&self.places)
    }

    #[inline(always)]
    fn look(&mut self, piece: &Piece<L>, control: &[Lanes<L>; 5], direction: &Lanes<L>) {
        let along = control.map(|v| dot(&v, direction));
        if along.iter().any(|v| *v < 0.0) {
            changes(
                &along,
                [piece.start_s, piece.end_s()],
                HALVINGS,
                &mut self.times,
            );
        }
    }
}

/// Adds the times at which the polynomial with these control points changes its sign.
fn changes(control: &[f64; 5], [from_s, to_s]: [f64; 2], left: u32, into: &mut Vec<f64>) {
    if control.iter().all(|v| *v >= 0.0) || control.iter().all(|v| *v <= 0.0) {
        return;
    }
    let middle_s = f64::midpoint(from_s, to_s);
    if left == 0 {
        into.push(middle_s);
        return;
    }
    let mut first = *control;
    let mut second = *control;
    for level in 1..5 {
        for n in 0..5 - level {
            second[n] = f64::midpoint(second[n], second[n + 1]);
        }
        first[level] = second[0];
    }
    if second[0] == 0.0 {
        into.push(middle_s);
    }
    changes(&first, [from_s, middle_s], left - 1, into);
    changes(&second, [middle_s, to_s], left - 1, into);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::order::Order;
    use crate::order::tests::{lines, open};
    use crate::timing::Mark;

    /// On a line a motion goes on, back by `back_mm`, and on, all between two samples.
    fn follows(back_mm: f64) -> bool {
        let chords = lines(&[[0.0, 0.0], [1.0, 0.0]]);
        let run = open(&chords);
        let mut window = Window::<2>::new();
        let mut piece = Piece::between(&[[0.0; 2]; 3], &[[0.0; 2]; 3], 0.0, 4.0);
        // A cubic that turns after 1 s and after 3 s.
        for (c, x) in piece.c.iter_mut().zip([-2.0, 9.0, -6.0, 1.0]) {
            *c = [x * back_mm / 4.0, 0.0];
        }
        piece.c[0][0] += 0.5;
        window.pieces.push(piece);
        let samples = [0.0, 4.0].map(|t| piece.position(t));
        window.marks = [0.0, 4.0]
            .map(|t| Mark {
                t,
                s: piece.position(t)[0],
            })
            .to_vec();
        let mut order = Order::default();
        assert!(order.walk(&run, (&samples, &[]), 0, (0, run.end())));
        let mut turns = Turns::default();
        let found = turns.among(&run, &window, &samples, 4.0).unwrap();
        assert!(found.len() >= 4, "{found:?}");
        order.walk(&run, (found, &[]), 0, (0, run.end()))
    }

    /// The tolerance is 0.01 mm.
    #[test]
    fn a_motion_that_goes_back_between_two_samples_by_more_than_both_may_stand_off_does_not_follow_the_path()
     {
        assert!(follows(0.0195));
        assert!(!follows(0.0205));
    }

    #[test]
    fn a_motion_that_goes_on_has_no_turns() {
        let chords = lines(&[[0.0, 0.0], [1.0, 0.0]]);
        let run = open(&chords);
        let rest = |x: f64| [[x, 0.0], [0.0; 2], [0.0; 2]];
        let mut window = Window::<2>::new();
        let piece = Piece::between(&rest(0.0), &rest(1.0), 0.0, 1.0);
        window.pieces.push(piece);
        window.marks = vec![Mark { t: 0.0, s: 0.0 }, Mark { t: 1.0, s: 1.0 }];
        let mut turns = Turns::default();
        let samples = [[0.0; 2], [1.0, 0.0]];
        assert!(turns.among(&run, &window, &samples, 1.0).is_none());
    }

    #[test]
    fn a_change_of_sign_is_found_where_it_is_and_one_that_is_none_is_not() {
        let found = |control: &[f64; 5]| {
            let mut times = vec![];
            changes(control, [2.0, 3.0], HALVINGS, &mut times);
            times
        };
        let line = found(&[-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert!(line.iter().all(|t| (t - 2.5).abs() < 1e-3) && !line.is_empty());
        // The hull is below zero, and the polynomial is not.
        assert!(found(&[1.0, 0.5, -0.1, 0.5, 1.0]).is_empty());
        assert!(found(&[0.0, 0.0, 1.0, 1.0, 0.0]).is_empty());
    }
}
