//! The polygons of the calibration: what they are made of, and what a model says they take.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write as _;

use crate::element::Element;
use crate::model::{Model, Spent};

/// Corners of the polygons.
pub const CORNERS: [u32; 12] = [3, 4, 5, 6, 8, 9, 12, 18, 36, 72, 180, 360];
/// Sides of the polygons, mm: the paper's 0.10, 0.42 and 1.00, and two longer ones.
pub const SIDES_MM: [f64; 5] = [0.1, 0.42, 1.0, 2.0, 4.0];
/// Sides of the strokes along X and along Y, mm. Polygons of three corners and more take nearly as long when X and Y are exchanged,
/// and their short sides say little of acceleration where jerk is bounded. A stroke moves one axis, from rest to rest; the longest
/// reaches its feed.
pub const STROKES_MM: [f64; 6] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
/// Sides of those at a lower feed under G61, from rest to rest, and that feed, mm/min: there a time constant shows, which at a high feed hides
/// behind the acceleration, and where blocks overlap behind the tolerance.
pub const SLOW_STROKES_MM: [f64; 2] = [2.0, 8.0];
/// See there.
pub const SLOW_MM_PER_MIN: f64 = 1000.0;
/// Corners of a stroke.
pub const STROKE: u32 = 2;
/// Feed of the polygons, mm/min.
pub const FEED_MM_PER_MIN: f64 = 5000.0;

/// Blocks after which nothing changes any more from round to round.
const ENOUGH_BLOCKS: u32 = 1000;

/// An axis of the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlaneAxis {
    /// The first.
    #[default]
    X,
    /// The second.
    Y,
}

impl PlaneAxis {
    /// Its letter.
    pub fn letter(self) -> char {
        match self {
            Self::X => 'X',
            Self::Y => 'Y',
        }
    }

    /// Angle from +X, rad.
    fn angle_rad(self) -> f64 {
        match self {
            Self::X => 0.0,
            Self::Y => FRAC_PI_2,
        }
    }
}

/// A regular polygon, gone round some times. One of two corners is a stroke: a line there and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polygon {
    /// Corners.
    pub corners: u32,
    /// Side, mm.
    pub side_mm: f64,
    /// How often it is gone round.
    pub rounds: u32,
    /// The axis along which its first side points.
    pub along: PlaneAxis,
    /// Programmed feed, mm/s.
    pub feed_mm_per_s: f64,
    /// Whether it is driven under G61, so that strokes stop at both ends whatever the control does elsewhere.
    pub exact_stop: bool,
}

/// A polygon and the time it took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// The polygon.
    pub polygon: Polygon,
    /// Time, s.
    pub time_s: f64,
    /// How far the reading may be off, s; 0 where nothing is known of that.
    pub reading_error_s: f64,
}

/// Relative reading error below which a time counts in full.
const SURE: f64 = 2e-3;

impl Polygon {
    /// Turn at each corner, rad.
    pub fn turn_rad(&self) -> f64 {
        TAU / f64::from(self.corners)
    }

    /// Whether it is a line there and back, which moves one axis alone.
    pub fn is_stroke(&self) -> bool {
        self.corners == STROKE
    }

    /// Writes it around a centre as part of a program, from a rest to a rest: three lines, and one for each of its blocks.
    pub(crate) fn write(&self, center_mm: [f64; 2], text: &mut String) {
        let points: Vec<_> = self.points_mm(center_mm).collect();
        let [x, y] = points[0];
        let mode = if self.exact_stop { "G61" } else { "G64" };
        let feed_mm_per_min = self.feed_mm_per_s * 60.0;
        let _ = writeln!(
            text,
            "{mode} G0 X{x:.6} Y{y:.6}\nG4 P0.1\nF{feed_mm_per_min:.3}"
        );
        let sides = points.iter().cycle().skip(1);
        for [x, y] in sides.take(self.blocks() as usize) {
            let _ = writeln!(text, "G1 X{x:.6} Y{y:.6}");
        }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.corners * self.rounds
    }

    /// Corners around a centre, mm, the turn to the left.
    pub fn points_mm(&self, center_mm: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
        let (turn, radius) = (self.turn_rad(), self.radius_mm());
        let first = self.along.angle_rad() - FRAC_PI_2 - turn / 2.0;
        (0..self.corners).map(move |k| {
            let angle = f64::from(k) * turn + first;
            [
                center_mm[0] + radius * angle.cos(),
                center_mm[1] + radius * angle.sin(),
            ]
        })
    }

    /// Radius of the circle through the corners, mm.
    pub fn radius_mm(&self) -> f64 {
        self.side_mm / (2.0 * (self.turn_rad() / 2.0).sin())
    }

    /// Its blocks.
    pub fn elements(&self) -> impl Iterator<Item = Element> {
        let (turn, side_mm, first) = (self.turn_rad(), self.side_mm, self.along.angle_rad());
        let round: Vec<_> = (0..self.corners)
            .map(|k| Element::line(side_mm, first + f64::from(k) * turn, self.feed_mm_per_s))
            .collect();
        let count = self.blocks() as usize;
        round.into_iter().cycle().take(count)
    }
}

impl Timed {
    /// Relative reading error.
    pub fn reading_error(&self) -> f64 {
        self.reading_error_s / self.time_s
    }

    /// How much a residual counts beside those of times that are known well: less, the more the reading may be off.
    pub fn weight(&self) -> f64 {
        SURE / self.reading_error().max(SURE)
    }

    /// Time of a block, s.
    pub fn block_s(&self) -> f64 {
        self.time_s / f64::from(self.polygon.blocks())
    }

    /// Mean feed, mm/s.
    pub fn mean_feed_mm_per_s(&self) -> f64 {
        self.polygon.side_mm / self.block_s()
    }

    /// Minimum feed by equations (7) and (8), with the acceleration that the paper assumes, mm/s; it may come out
    /// negative, where that acceleration is not the machine's.
    pub fn minimum_feed_mm_per_s(&self, acceleration_mm_per_s2: f64) -> f64 {
        let ramp_s = self.block_s() / 2.0;
        self.polygon.side_mm / 2.0 / ramp_s - acceleration_mm_per_s2 * ramp_s / 2.0
    }

    /// What `model` says it takes, s. Where there are many rounds, those in the middle are taken to be alike.
    pub fn under(&self, model: &mut dyn Model) -> f64 {
        let corners = self.polygon.corners as usize;
        let rounds = self
            .polygon
            .rounds
            .min(ENOUGH_BLOCKS.div_ceil(self.polygon.corners));
        let shorter = Polygon {
            rounds,
            ..self.polygon
        };
        let from = rounds as usize / 2 * corners;
        let (mut total_s, mut round_s, mut number) = (0.0, 0.0, 0);
        let mut add = |_: &Element, spent: &Spent| {
            total_s += spent.time_s;
            round_s += if (from..from + corners).contains(&number) {
                spent.time_s
            } else {
                0.0
            };
            number += 1;
        };
        for element in shorter.elements() {
            model.block(&element, &mut add);
            if shorter.exact_stop {
                model.finish(&mut add);
            }
        }
        model.finish(&mut add);
        total_s + f64::from(self.polygon.rounds - rounds) * round_s
    }
}
