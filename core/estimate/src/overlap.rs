//! The overlap form: a block takes its length over its feed, at least a constant time.
//!
//! `T = Σ max(l/F, τ) + τ` for each stretch of motion from rest to rest: the next block starts when this one begins to
//! slow down, which takes τ.

use crate::element::{Element, Kind};
use crate::model::{Case, Model, Sink, Spent, without_feed};

/// The constants of an overlap machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constants {
    /// Time constant where the program asks for none, s.
    pub time_constant_s: f64,
    /// Whether the machine obeys `TA` words.
    pub obeys_program: bool,
    /// Blocks take whole multiples of this, s; none: they take what they take.
    pub tick_s: Option<f64>,
    /// Acceleration of rapids, mm/s²; none: they take their length over their feed and the time constant.
    pub rapid_acceleration_mm_per_s2: Option<f64>,
}

/// The model.
#[derive(Clone, Debug)]
pub struct Overlap {
    constants: Constants,
    /// Time constant with which the next block speeds up, s.
    up_s: f64,
    waiting: Option<Element>,
}

/// Blocks that are a tick longer by rounding alone.
const ROUNDING: f64 = 1e-9;

impl Overlap {
    /// A model at rest.
    pub fn new(constants: Constants) -> Self {
        Self {
            constants,
            up_s: constants.time_constant_s,
            waiting: None,
        }
    }

    fn down_s(&self, element: &Element) -> f64 {
        let asked_s = element.time_constant_s;
        let constant_s = if self.constants.obeys_program && asked_s.is_finite() {
            asked_s
        } else {
            self.constants.time_constant_s
        };
        self.constants.tick_s.map_or(constant_s, |tick_s| {
            (constant_s / tick_s).round().max(1.0) * tick_s
        })
    }

    /// From the start of the block to the start of the next, s: where the ramps differ, the difference of their halves
    /// goes with the cruise.
    fn until_next_s(&self, element: &Element, down_s: f64) -> f64 {
        let cruise_s = element.length_mm / element.feed_mm_per_s + (self.up_s - down_s) / 2.0;
        let whole_s = match self.constants.tick_s {
            Some(tick_s) => (cruise_s / tick_s - ROUNDING).ceil() * tick_s,
            None => cruise_s,
        };
        whole_s.max(self.up_s)
    }

    fn emit(&mut self, element: &Element, rests_after: bool, out: &mut Sink<'_>) {
        let rapid = self.constants.rapid_acceleration_mm_per_s2;
        if let Some(spent) =
            without_feed(element, rapid).filter(|_| element.kind == Kind::Dwell || rapid.is_some())
        {
            return out(element, &spent);
        }
        if element.length_mm <= 0.0 {
            return out(element, &Spent::NOTHING);
        }
        let down_s = self.down_s(element);
        let until_next_s = self.until_next_s(element, down_s);
        let mean_s = f64::midpoint(self.up_s, down_s);
        let short = element.length_mm < element.feed_mm_per_s * mean_s;
        let slowed = element.length_mm / (until_next_s + (down_s - self.up_s) / 2.0);
        let case = if short { Case::Peak } else { Case::ReachesFeed };
        let time_s = until_next_s + if rests_after { down_s } else { 0.0 };
        self.up_s = down_s;
        let case = (element.kind == Kind::Cut).then_some(case);
        out(
            element,
            &Spent {
                time_s,
                reached_mm_per_s: slowed.min(element.feed_mm_per_s),
                case,
            },
        );
    }
}

impl Model for Overlap {
    fn block(&mut self, element: &Element, out: &mut Sink<'_>) {
        if element.length_mm <= 0.0 && !element.starts_at_rest && !element.ends_at_rest {
            return out(element, &Spent::NOTHING);
        }
        if let Some(before) = self.waiting.replace(*element) {
            self.emit(&before, before.rests_before(element), out);
        }
    }

    fn finish(&mut self, out: &mut Sink<'_>) {
        if let Some(last) = self.waiting.take() {
            self.emit(&last, true, out);
        }
        self.up_s = self.constants.time_constant_s;
    }
}
