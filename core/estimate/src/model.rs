//! What every model of machining time is: blocks in, their times out.

use crate::element::{Element, Kind};

/// How a block is driven: the four cases of the published model. The first is a long block, the others are short ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    /// It reaches its feed.
    ReachesFeed = 1,
    /// It speeds up and slows down below its feed.
    Peak = 2,
    /// It only speeds up.
    SpeedsUp = 3,
    /// It only slows down.
    SlowsDown = 4,
}

/// What one block takes.
#[derive(Clone, Copy, Debug)]
pub struct Spent {
    /// Time, s.
    pub time_s: f64,
    /// Highest feed reached in it, mm/s.
    pub reached_mm_per_s: f64,
    /// How it is driven; none for rapids and dwells.
    pub case: Option<Case>,
}

impl Spent {
    /// No time: a path without length.
    pub const NOTHING: Self = Self {
        time_s: 0.0,
        reached_mm_per_s: 0.0,
        case: None,
    };
}

/// Takes the time of each block, in the order of the program.
pub type Sink<'a> = dyn FnMut(&Element, &Spent) + 'a;

/// A model of machining time. It keeps a bounded number of blocks, whatever the length of the program.
pub trait Model: Send {
    /// Takes the next block; gives the times of those that are known by now.
    fn block(&mut self, element: &Element, out: &mut Sink<'_>);

    /// The program is over: gives the times that are left. The model is as new afterwards.
    fn finish(&mut self, out: &mut Sink<'_>);
}

/// Time of a straight way from rest to rest, s.
pub(crate) fn rest_to_rest_s(
    length_mm: f64,
    feed_mm_per_s: f64,
    acceleration_mm_per_s2: f64,
) -> f64 {
    if length_mm <= 0.0 {
        return 0.0;
    }
    let ramps_mm = feed_mm_per_s * feed_mm_per_s / acceleration_mm_per_s2;
    if length_mm >= ramps_mm {
        length_mm / feed_mm_per_s + feed_mm_per_s / acceleration_mm_per_s2
    } else {
        2.0 * (length_mm / acceleration_mm_per_s2).sqrt()
    }
}

/// What a rapid or a dwell takes; none for feed motion.
pub(crate) fn without_feed(
    element: &Element,
    rapid_acceleration_mm_per_s2: Option<f64>,
) -> Option<Spent> {
    let acceleration = rapid_acceleration_mm_per_s2.unwrap_or(element.acceleration_mm_per_s2);
    let time_s = match element.kind {
        Kind::Cut => return None,
        Kind::Dwell => element.nominal_s,
        Kind::Rapid => rest_to_rest_s(element.length_mm, element.feed_mm_per_s, acceleration),
    };
    Some(Spent {
        time_s,
        reached_mm_per_s: 0.0,
        case: None,
    })
}

/// Total time of `elements` under `model`, s.
pub fn total_s(model: &mut dyn Model, elements: impl Iterator<Item = Element>) -> f64 {
    let mut total_s = 0.0;
    let mut add = |_: &Element, spent: &Spent| total_s += spent.time_s;
    elements.for_each(|element| model.block(&element, &mut add));
    model.finish(&mut add);
    total_s
}
