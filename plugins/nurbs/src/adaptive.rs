//! The published baseline: in each fine period the feed that the chord error allows where the period begins.

use tandem_motion::nurbs::Place;

use crate::course::Course;
use crate::limit::chord_feed_mm_per_s;
use crate::piece::Piece;

/// The feed profile of one course, fine period by fine period.
#[derive(Clone, Copy, Debug)]
pub struct Adaptive {
    /// Programmed feed, mm/s.
    pub feed_mm_per_s: f64,
    /// Chord error, mm.
    pub chord_error_mm: f64,
    /// Fine period, s.
    pub period_s: f64,
}

impl Adaptive {
    /// The motion from `s_mm` of stretch `index` on: at one feed for a fine period, or to the end of the stretch.
    pub fn piece(&self, course: &Course, index: usize, s_mm: f64, place: &mut Place) -> Piece {
        let curvature = course.counted_length(&course.at(index, s_mm, place).curvature);
        let chord_feed = chord_feed_mm_per_s(curvature, self.chord_error_mm, self.period_s);
        let speed_mm_per_s = self.feed_mm_per_s.min(chord_feed);
        let left_s = (course.stretches()[index].length_mm - s_mm) / speed_mm_per_s;
        Piece {
            start_mm: s_mm,
            speed_mm_per_s,
            duration_s: left_s.min(self.period_s),
            ..Piece::default()
        }
    }

    /// Duration, and feed at the start, highest and at the end.
    pub fn summary(&self, course: &Course) -> (f64, [f64; 3]) {
        let mut time_s = 0.0;
        let mut feeds = [f64::NAN, 0.0, 0.0];
        for (index, stretch) in course.stretches().iter().enumerate() {
            let mut s_mm = 0.0;
            let mut place = Place::default();
            while s_mm < stretch.length_mm {
                let piece = self.piece(course, index, s_mm, &mut place);
                let speed = piece.speed_mm_per_s;
                feeds = [
                    if feeds[0].is_nan() { speed } else { feeds[0] },
                    feeds[1].max(speed),
                    speed,
                ];
                time_s += piece.duration_s;
                s_mm = next_mm(&piece, stretch.length_mm, self.period_s);
            }
        }
        (time_s, feeds)
    }
}

/// Where the next piece begins: at the end of the stretch exactly, where this one was the last.
pub fn next_mm(piece: &Piece, length_mm: f64, period_s: f64) -> f64 {
    if piece.duration_s < period_s {
        length_mm
    } else {
        piece.start_mm + piece.speed_mm_per_s * piece.duration_s
    }
}
