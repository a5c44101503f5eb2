//! What the forms with windows share: the path of consecutive stretches that join smoothly is planned window by window.
//!
//! A window begins in the present state and ends at rest, so that what is planned can always be driven to its end:
//!
//! 1. a form plans it ([`Planning`]): the path coordinate over time ([`Motion`]);
//! 2. [`check`]: every limit on the samples of the fine period, with those before the window in front, then on its segments,
//!    bounded for samples at any phase ([`trail`]);
//! 3. [`draw`]: the first part of the window as these segments; then the next window.
//!
//! Where no next window is found in motion, the one before is driven on, at last to its end, which is checked already.

mod bernstein;
pub mod check;
mod draw;
mod leg;
mod planner;
mod queue;
mod route;
pub mod slowdown;
mod trail;
mod window;

use std::collections::VecDeque;
use std::fmt::Debug;

use tandem_sdk::{AxisVector, Segment};

pub use leg::{Bounds, Least, Leg};
pub use planner::Streamer;
pub use route::{Cursor, Route};
pub use window::{Window, interval, lay_times};

/// Time of a window at least, s.
const WINDOW_S: f64 = 1.0;
/// Samples of a window at most: slower than that is no motion.
const MAX_SAMPLES: f64 = 4e5;
/// A state on the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    pub s_mm: f64,
    pub speed_mm_per_s: f64,
    pub acceleration_mm_per_s2: f64,
}

/// From where a window is planned.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub state: State,
    /// The last three samples, and when the next one comes, s.
    pub history: [AxisVector; 3],
    pub first_tick_s: f64,
}

/// What was driven last.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    /// The last segments, of three fine periods at least.
    pub segments: &'a VecDeque<Segment>,
    /// Where the machine is.
    pub at: AxisVector,
}

/// The path coordinate over the time of a window, interval by interval.
pub trait Motion: Debug + Default {
    /// The state `t_s` after the start of interval `k`.
    fn at(&self, k: usize, t_s: f64) -> State;
    /// Where it ends, mm.
    fn end_mm(&self) -> f64;
    /// Until when it is to be driven before the next window is planned, at most `latest_s`; `times` are those at the ends of
    /// the intervals.
    fn commit_s(&self, times: &[f64], latest_s: f64) -> f64;
    /// The same, where at `now_s` no window was found.
    fn later_s(&self, times: &[f64], now_s: f64) -> f64;
}

/// A window to be planned.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a, M> {
    pub route: &'a Route<'a>,
    pub bounds: &'a Bounds,
    pub start: Start,
    pub driven: Driven<'a>,
    /// Where the run ends, as far as it is known, mm.
    pub end_mm: f64,
    /// In motion the window that is driven, and the time in it at which this one begins, s.
    pub before: Option<(&'a Window<M>, f64)>,
}

impl<M> Job<'_, M> {
    /// Whether it begins at rest.
    pub fn rests(&self) -> bool {
        self.start.state.speed_mm_per_s == 0.0
    }
}

/// A form: how windows are planned. Keeps its memory.
pub trait Planning: Debug + Default {
    /// What it plans.
    type Motion: Motion;
    /// Plans `job` into `window`, checked; false where no try keeps the limits.
    fn plan(&mut self, job: &Job<Self::Motion>, window: &mut Window<Self::Motion>) -> bool;
}

/// Longest time that a window may take, s.
pub fn longest_s(bounds: &Bounds) -> f64 {
    MAX_SAMPLES * bounds.context.fine_period_s
}

/// Time of a window, s: three stops from `speed_mm_per_s`.
pub fn window_s(route: &Route, speed_mm_per_s: f64) -> f64 {
    WINDOW_S.max(3.0 * stop_s(route, speed_mm_per_s))
}

/// Longest time in which the axes that move on the path ahead stop from `speed_mm_per_s`, s.
fn stop_s(route: &Route, speed_mm_per_s: f64) -> f64 {
    let of = |least: &Least| {
        let a = least.acceleration_mm_per_s2;
        let j = least.jerk_mm_per_s3;
        speed_mm_per_s.min(least.speed_mm_per_s) / a + a / j
    };
    route.legs().map(|leg| of(&leg.least)).fold(0.0, f64::max)
}
