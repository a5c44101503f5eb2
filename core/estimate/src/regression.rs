//! The published regression: the minimum feed at the end of a block from its length, its turn and its feed.
//!
//! After S. Heo, C.-J. Kim and S. G. Kim on machining-time estimation: equations (9) and (11), the four cases, and the
//! forward algorithm of their Fig. 6.

use crate::element::Element;
use crate::four_cases::drive;
use crate::model::{Model, Sink, Spent, without_feed};

/// Coefficients as printed, mm/min, 1/min and mm/min/rad.
pub const PRINTED_SHORT: [f64; 3] = [-191.0, 3971.0, 42.1];
/// Coefficients of equation (11) as printed, but for the last: the printed −2.37796e-9 contradicts the paper's own
/// table by up to 92 mm/min, this one by 36 at most.
pub const CORRECTED_LONG: [f64; 13] = [
    0.003_735_58,
    0.000_950_213,
    0.000_428_506,
    0.000_297_818,
    0.000_342_609,
    0.998_778,
    -0.010_768_2,
    -0.110_314,
    0.003_548_89,
    2.391_89e-6,
    4.918_26e-6,
    -5.415_29e-6,
    -7.256_59e-10,
];
/// The last coefficient of equation (11) as printed.
pub const PRINTED_CUBE: f64 = -2.377_96e-9;

/// Half the length up to which equation (9) holds in the paper, mm.
const FIXED_SWITCH_MM: f64 = 0.5;
const MM_PER_MIN: f64 = 60.0;

/// Up to which length equation (9) holds; above it (11) does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Switch {
    /// Half the length, mm: 0.5 in the paper.
    Fixed(f64),
    /// Half of what the feed covers in this block time, s: F·τ/2, and 0.5 mm at least.
    Moving(f64),
}

/// The regression with its coefficients, which are in mm and minutes as published.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficients {
    /// Of equation (9): constant, per mm of half the length, per rad of the turn.
    pub short: [f64; 3],
    /// Of equation (11), in the order of [`long_terms`].
    pub long: [f64; 13],
    /// Where (9) ends.
    pub switch: Switch,
    /// Acceleration in feed motion, mm/s².
    pub acceleration_mm_per_s2: f64,
    /// What ramps of long blocks take on a control of constant block time, s: they accelerate with F/τ, and minimum feeds
    /// of very short blocks stay below zero, as equation (8) gives them, which keeps their block time. None, as in the
    /// paper: one acceleration for all, no feed below zero.
    pub ramp_s: Option<f64>,
    /// Acceleration of rapids, mm/s²; none: the machine's.
    pub rapid_acceleration_mm_per_s2: Option<f64>,
}

impl Default for Coefficients {
    fn default() -> Self {
        Self {
            short: PRINTED_SHORT,
            long: CORRECTED_LONG,
            switch: Switch::Fixed(FIXED_SWITCH_MM),
            acceleration_mm_per_s2: 1_200_000.0 / 3600.0,
            ramp_s: None,
            rapid_acceleration_mm_per_s2: Some(18_000_000.0 / 3600.0),
        }
    }
}

/// The terms of equation (11) for a turn in rad and a feed in mm/min.
pub fn long_terms(turn_rad: f64, feed_mm_per_min: f64) -> [f64; 13] {
    let (t, f) = (turn_rad, feed_mm_per_min);
    [
        1.0,
        t,
        t * t,
        t.powi(3),
        t.powi(4),
        f,
        t * f,
        t * t * f,
        t.powi(3) * f,
        f * f,
        t * f * f,
        t * t * f * f,
        f.powi(3),
    ]
}

impl Coefficients {
    /// Equation (9), mm/min.
    pub fn short_mm_per_min(&self, half_mm: f64, turn_rad: f64) -> f64 {
        let [constant, per_mm, per_rad] = self.short;
        constant + per_mm * half_mm + per_rad * turn_rad
    }

    /// Equation (11), mm/min. The paper's turns end at a right angle; sharper ones count as one.
    pub fn long_mm_per_min(&self, turn_rad: f64, feed_mm_per_min: f64) -> f64 {
        let terms = long_terms(turn_rad.min(std::f64::consts::FRAC_PI_2), feed_mm_per_min);
        terms.iter().zip(self.long).map(|(term, k)| term * k).sum()
    }

    /// Whether equation (9) holds for a block.
    fn is_short(&self, element: &Element) -> bool {
        let switch_mm = match self.switch {
            Switch::Fixed(half_mm) => half_mm,
            Switch::Moving(block_time_s) => {
                (element.feed_mm_per_s * block_time_s / 2.0).max(FIXED_SWITCH_MM)
            }
        };
        element.length_mm / 2.0 <= switch_mm
    }

    /// The feed at the end of a block that moves on into `next`, mm/s.
    pub fn end_mm_per_s(&self, element: &Element, turn_rad: f64, next: &Element) -> f64 {
        let next_feed_mm_per_s = next.feed_mm_per_s;
        let end = if self.is_short(element) {
            self.short_mm_per_min(element.length_mm / 2.0, turn_rad)
        } else if self.ramp_s.is_some() && self.is_short(next) {
            self.short_mm_per_min(next.length_mm / 2.0, turn_rad)
        } else {
            self.long_mm_per_min(turn_rad, element.feed_mm_per_s * MM_PER_MIN)
        };
        let most = element.feed_mm_per_s.min(next_feed_mm_per_s);
        let least = if self.ramp_s.is_some() { -most } else { 0.0 };
        (end / MM_PER_MIN).clamp(least, most)
    }

    fn acceleration(&self, element: &Element) -> f64 {
        let ramps_s = self.ramp_s.filter(|_| !self.is_short(element));
        ramps_s.map_or(self.acceleration_mm_per_s2, |ramp_s| {
            element.feed_mm_per_s / ramp_s
        })
    }
}

/// The model. It goes forward only, as published: a block too short to slow down leaves faster than was asked.
#[derive(Clone, Debug)]
pub struct Regression {
    coefficients: Coefficients,
    waiting: Option<Element>,
    start_mm_per_s: f64,
}

impl Regression {
    /// A model at rest.
    pub fn new(coefficients: Coefficients) -> Self {
        Self {
            coefficients,
            waiting: None,
            start_mm_per_s: 0.0,
        }
    }

    fn emit(&mut self, element: &Element, end_mm_per_s: f64, out: &mut Sink<'_>) {
        let coefficients = &self.coefficients;
        if let Some(spent) = without_feed(element, coefficients.rapid_acceleration_mm_per_s2) {
            return out(element, &spent);
        }
        let start = self.start_mm_per_s.min(element.feed_mm_per_s);
        let a = coefficients.acceleration(element);
        let driven = drive(
            element.length_mm,
            element.feed_mm_per_s,
            start,
            end_mm_per_s,
            a,
        );
        self.start_mm_per_s = driven.end;
        out(
            element,
            &Spent {
                time_s: driven.time,
                reached_mm_per_s: driven.peak,
                case: Some(driven.case),
            },
        );
    }
}

impl Model for Regression {
    fn block(&mut self, element: &Element, out: &mut Sink<'_>) {
        if element.length_mm <= 0.0 && !element.starts_at_rest && !element.ends_at_rest {
            return out(element, &Spent::NOTHING);
        }
        if let Some(before) = self.waiting.replace(*element) {
            let rests = before.rests_before(element);
            let turn_rad = if rests { 0.0 } else { before.turn_rad(element) };
            let end = self.coefficients.end_mm_per_s(&before, turn_rad, element);
            self.emit(&before, if rests { 0.0 } else { end }, out);
            if rests {
                self.start_mm_per_s = 0.0;
            }
        }
    }

    fn finish(&mut self, out: &mut Sink<'_>) {
        if let Some(last) = self.waiting.take() {
            self.emit(&last, 0.0, out);
        }
        self.start_mm_per_s = 0.0;
    }
}
