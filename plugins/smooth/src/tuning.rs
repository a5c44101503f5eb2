//! The grid, the boxes and the windows, as the options or the machine say them.

use tandem_motion::tube::{Lanes, each};

use crate::frame::Frame;

/// What can be tuned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Step of the grid, s, where that is not coarser than the motion; zero where the path and the limits say it.
    pub step_s: f64,
    /// Time of a window, s; zero where the limits say it.
    pub window_s: f64,
    /// Share of the boxes that is used where little lies between two samples.
    pub box_share: f64,
    /// Rounds of a window in motion; one from rest has twice as many.
    pub rounds: usize,
    /// Rounds more where the window does not pass.
    pub repairs: usize,
}

/// Step of the grid as a share of the time of a feature. With half of it the programs of docs/smooth-planner.md take up to 0.4 % less,
/// for twice as many intervals; with twice as much 0.3 to 9 % more.
const STEP_SHARE: f64 = 0.76;
/// Steps are multiples of this, s: tolerances that differ by rounding have one grid.
const ROUND_S: f64 = 0.25e-3;
/// Shortest and longest step that is taken by itself, s.
const STEPS_S: (f64, f64) = (1.5e-3, 12e-3);
/// Longest step that is taken where one is asked for, as a multiple of the one that is taken by itself: on a coarser grid the spline
/// cannot follow the path at its speed, and comes to crawl.
const MAX_COARSER: f64 = 2.0;
/// Share of the most that acceleration adds between two samples that boxes leave room for, and the least share of them that is
/// left: few motions use all of the acceleration across the path. Half of the second changes nothing; twice as much, which
/// is beyond the tolerance, has windows refused and costs up to 2.4 % of the time.
const BETWEEN: f64 = 0.2;
const LEAST: f64 = 0.8;
/// Steps of a window, without those of the stop at its end.
pub const MAX_STEPS: f64 = 300.0;
/// Part of a window in which it may be left for the next. Left at 0.40 of it at the latest, the programs of docs/smooth-planner.md
/// take 6 to 13 % longer.
pub const COMMIT: (f64, f64) = (0.42, 0.80);
/// Time of a window as a multiple of that in which the softest axis builds up its acceleration. Each window ends in a rest, and from a
/// state of hard braking hardly anything but the braking can be planned: a window that is short for the machine is followed by ones
/// that are refused, and the motion comes to rest in mid-path. On six paths and ten machines whose acceleration takes 67 to 670 ms
/// (each machine sixteen times, a thousandth stronger from one to the next) windows of a second are refused 1868 times, come to rest
/// 222 times and take 2 % longer than these, which are refused 73 times and rest twice. With half of it the times are 0.03 % longer in
/// the mean, 0.07 % on fourteen machines that take 10 to 100 ms; with one and a half times of it they are the same. Longer windows are no
/// dearer: they are fewer.
pub const WINDOW_RAMPS: f64 = 40.0;
/// Shortest window that is taken by itself, s.
const MIN_WINDOW_S: f64 = 1.0;

impl Tuning {
    /// Time of a window, s, without the stop at its end.
    pub fn window_s<const L: usize>(&self, frame: &Frame<L>) -> f64 {
        if self.window_s > 0.0 {
            return self.window_s;
        }
        let ramp_s: Lanes<L> = each(|l| frame.acceleration[l] / frame.jerk[l]);
        let softest_s = ramp_s[..frame.count].iter().copied().fold(0.0, f64::max);
        MIN_WINDOW_S.max(WINDOW_RAMPS * softest_s)
    }

    /// Step of the grid for a window whose least tolerance is `tolerance`, s: where none is stated, a share of the time in which
    /// an axis can go the tolerance at its limits, which is how long the motion takes around a feature of the path.
    pub fn step_s<const L: usize>(&self, frame: &Frame<L>, tolerance: f64) -> f64 {
        let by_jerk_s = (tolerance / frame.largest(&frame.jerk)).cbrt();
        let by_acceleration_s = (tolerance / frame.largest(&frame.acceleration)).sqrt();
        let step_s = STEP_SHARE * by_jerk_s.max(by_acceleration_s);
        let step_s = (ROUND_S * (step_s / ROUND_S).round()).clamp(STEPS_S.0, STEPS_S.1);
        if self.step_s > 0.0 {
            self.step_s.min(MAX_COARSER * step_s)
        } else {
            step_s
        }
    }

    /// Share of the boxes of such a window: what the motion does between two samples counts as much as how far these are off.
    pub fn share<const L: usize>(&self, frame: &Frame<L>, tolerance: f64) -> f64 {
        let acceleration = frame.largest(&frame.acceleration);
        let between = acceleration * frame.period_s * frame.period_s / 8.0;
        self.box_share * (1.0 - BETWEEN * between / tolerance).max(LEAST)
    }
}
