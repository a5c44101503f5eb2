//! Windows as segments.

use tandem_motion::blocks::BlockId;
use tandem_motion::stream::{Blocks, Emitted};
use tandem_sdk::{MAX_AXES, Segment, SegmentFlags, SegmentSink};

use crate::core::PathAhead;
use crate::frame::{dot, minus};
use crate::report::{of_block, path};
use crate::route::{Item, QueuedBlock};

/// Share of the jerk limits on which a stop counts: the plan takes the rest.
const STOP_JERK: f64 = 0.5;
/// Least duration of a segment, s: the derivatives of a shorter one are rounding.
const MIN_S: f64 = 5e-5;
/// Fine periods by which the marks may be off where the motion passes the end of a block. Where feeds are nearly the same it may be as
/// early or late as half a box is long; a motion that takes longer for that has hardly any speed there.
const MAX_OFF_PERIODS: usize = 256;
/// Halvings of the period in which the motion passes that end.
const HALVINGS: usize = 30;

/// What is left of blocks that share a segment.
#[derive(Clone, Copy, Debug)]
struct Shared {
    /// Lowest and highest of their feeds.
    feeds_mm_per_s: [f64; 2],
    /// Where the last of them ends.
    end_s: f64,
}

impl Shared {
    /// Another block joins those that there are.
    fn with(before: Option<Self>, feed_mm_per_s: f64, end_s: f64) -> Self {
        let [least, most] = before.map_or([feed_mm_per_s; 2], |it| it.feeds_mm_per_s);
        Self {
            feeds_mm_per_s: [least.min(feed_mm_per_s), most.max(feed_mm_per_s)],
            end_s,
        }
    }

    /// Whether any of them has another feed than this one.
    fn differs_from(&self, feed_mm_per_s: f64) -> bool {
        self.feeds_mm_per_s != [feed_mm_per_s; 2]
    }
}

impl<const L: usize> PathAhead<L> {
    /// Least time of the part of the block in front that is driven when `driven_s` of the window are, s.
    pub(crate) fn front_driven_s(&self, driven_s: f64) -> f64 {
        let Some(queued) = self.route.front() else {
            return 0.0;
        };
        let share =
            (self.window.along(driven_s) - queued.start) / (queued.end - queued.start).max(1e-12);
        queued.min_s * share.clamp(0.0, 1.0)
    }

    /// Emits a segment: to the end of the piece, of the block, or of `left_s`.
    pub(crate) fn emit_motion(
        &mut self,
        (from_s, commit_s): (f64, f64),
        left_s: f64,
        blocks: &mut Blocks,
        sink: &mut dyn SegmentSink,
    ) -> Emitted {
        let period_s = self.frame.period_s;
        let k = self.window.piece_at(from_s);
        let mut until_s = self.window.pieces[k].end_s().min(commit_s);
        if from_s + left_s < until_s - MIN_S {
            until_s = from_s + left_s.max(MIN_S);
        }
        let mut shared: Option<Shared> = None;
        let mut ends = false;
        while let Some(queued) = self.route.front() {
            let end_s = if queued.end < self.window.end() - 1e-9 {
                self.over_s(queued.end)
            } else {
                f64::INFINITY
            };
            self.begin_report(from_s, end_s, blocks, sink);
            // Blocks of which less than a fine period is left share a segment, which is named by the last of them. One that goes on
            // in the next piece, before another feed, is left to that: what it has there is still to be driven at its own feed.
            let another = self.route.items.len() > 1;
            let goes_on = end_s > until_s && self.route.end_before_other_feed().is_some();
            if end_s < from_s + period_s && another && !goes_on {
                shared = Some(Shared::with(shared, blocks.blank.feed_mm_per_s, end_s));
                self.pop_front();
                continue;
            }
            // At a low rate a fine period of program time lasts for many samples: where feeds differ, the segment has the lowest of
            // them and ends with the last block that it takes over.
            if let Some(it) = shared.filter(|it| it.differs_from(blocks.blank.feed_mm_per_s)) {
                until_s = until_s.min(it.end_s.max(from_s + MIN_S));
            }
            if end_s < until_s - period_s / 4.0 || end_s <= until_s {
                until_s = end_s.min(until_s);
                ends = true;
            }
            break;
        }
        let mut segment = self.draw(k, from_s, until_s, &blocks.blank);
        if let Some(it) = shared {
            segment.feed_mm_per_s = if it.end_s < until_s {
                segment.feed_mm_per_s.min(it.feeds_mm_per_s[0])
            } else {
                it.feeds_mm_per_s[0]
            };
        }
        if ends {
            segment.flags = segment.flags.with(SegmentFlags::BLOCK_ENDS);
            self.pop_front();
        }
        blocks.has_begun();
        segment.duration_s = until_s - from_s;
        sink.segment(&segment);
        Emitted {
            until_s,
            duration_s: segment.duration_s,
        }
    }

    /// When the motion is over the block in front, which ends at the path coordinate `end`. Between two marks that is an even pace, and the
    /// motion may be periods off; where the feed is another one behind it, it is when the motion passes the end of the block, or where
    /// the path turns back there moves away from it. What the feed of a segment bounds is then on the block that has it.
    fn over_s(&self, end: f64) -> f64 {
        let about_s = self.window.time_of(end);
        let Some(end) = self.route.end_before_other_feed() else {
            return about_s;
        };
        let is_before = |t: f64| {
            let [position, velocity, _] = self.window.state(t);
            let direction = end.direction.as_ref().unwrap_or(&velocity);
            dot(&minus(&end.vertex, &position), direction) > 0.0
        };
        let starts_before = is_before(about_s);
        let step_s = if starts_before {
            self.frame.period_s
        } else {
            -self.frame.period_s
        };
        let mut near_s = about_s;
        for _ in 0..MAX_OFF_PERIODS {
            let mut far_s = near_s + step_s;
            if is_before(far_s) == starts_before {
                near_s = far_s;
                continue;
            }
            for _ in 0..HALVINGS {
                let middle_s = f64::midpoint(near_s, far_s);
                if is_before(middle_s) == starts_before {
                    near_s = middle_s;
                } else {
                    far_s = middle_s;
                }
            }
            return near_s;
        }
        about_s
    }

    /// Gives the report of the block in front, where that was not done.
    fn begin_report(
        &self,
        from_s: f64,
        end_s: f64,
        blocks: &mut Blocks,
        sink: &mut dyn SegmentSink,
    ) {
        let Some(queued) = self.route.front() else {
            return;
        };
        if blocks.is_reported(&queued.block) {
            return;
        }
        let to_s = end_s.min(self.window.duration_s()).max(from_s);
        let start_s = self.window.time_of(queued.start).min(from_s).min(to_s);
        let report = of_block(
            &self.window,
            &self.frame.counted(queued.rotary),
            queued,
            (start_s, to_s),
        );
        blocks.begin(&queued.block, &report, sink);
    }

    fn pop_front(&mut self) {
        if let Some(Item::Motion(queued)) = self.route.pop() {
            self.held_s -= queued.min_s;
        }
    }

    /// The part of piece `k` from `from_s` to `until_s`.
    fn draw(&mut self, k: usize, from_s: f64, until_s: f64, blank: &Segment) -> Segment {
        let piece = &self.window.pieces[k];
        let rotary = self.route.front().is_some_and(|queued| queued.rotary);
        if self.driven.piece != Some(k) {
            let counted = self.frame.counted(rotary);
            self.driven.path_mm = path(&counted, piece, self.driven.path_mm, &mut self.driven.path);
            self.driven.piece = Some(k);
        }
        let mut segment = *blank;
        let t = from_s - piece.start_s;
        for axis in 0..self.frame.count {
            let lane: [f64; 6] = std::array::from_fn(|n| piece.c[n][axis] / self.frame.scale[axis]);
            segment.coefficients[axis] = shifted(&lane, t);
        }
        for axis in self.frame.count..MAX_AXES {
            segment.coefficients[axis] = [0.0; 6];
        }
        segment.path = shifted(&self.driven.path, t);
        segment.duration_s = until_s - from_s;
        let a = self.window.stop.deceleration();
        let v = self.window.stop.speed.max(1e-9);
        segment.stop_deceleration_mm_per_s2 = a;
        segment.max_sigma_rate_per_s = a / v;
        segment.max_sigma_acceleration_per_s2 = STOP_JERK * self.window.stop.jerk_per_speed;
        segment
    }

    /// Rest where the window ends: exactly at the end of a block, where one ends there.
    pub(crate) fn emit_rest(&mut self, blocks: &mut Blocks, sink: &mut dyn SegmentSink) {
        let end = self.window.end();
        let end_state = self.window.state(self.window.duration_s());
        self.at = end;
        self.position = end_state[0];
        let mut exact = self.frame.axes(&self.position);
        let mut named = blocks.present();
        let mut ended = false;
        while let Some(queued) = self.route.front().filter(|queued| queued.end <= end + 1e-9) {
            exact = queued.block.end;
            ended = true;
            named = BlockId::from(&queued.block);
            self.report_last(queued, blocks, sink);
            self.pop_front();
        }
        if ended {
            self.position = self.frame.lanes(&exact);
        }
        blocks.rest(named, &exact, self.driven.path_mm, sink);
    }

    fn report_last(&self, queued: &QueuedBlock, blocks: &mut Blocks, sink: &mut dyn SegmentSink) {
        if !blocks.is_reported(&queued.block) {
            let to_s = self.window.duration_s();
            let from_s = self.window.time_of(queued.start).min(to_s);
            let report = of_block(
                &self.window,
                &self.frame.counted(queued.rotary),
                queued,
                (from_s, to_s),
            );
            blocks.report(&report, sink);
        }
    }
}

/// The polynomial `c` as seen from `t` on.
fn shifted(c: &[f64; 6], t: f64) -> [f64; 6] {
    if t == 0.0 {
        return *c;
    }
    let mut shifted = *c;
    // Repeated synthetic division: Taylor's coefficients at t.
    for first in 0..5 {
        for n in (first..5).rev() {
            shifted[n] += t * shifted[n + 1];
        }
    }
    shifted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_polynomial_has_the_same_values() {
        let c = [1.0, -2.0, 0.5, 3.0, -1.0, 0.25];
        let value = |c: &[f64; 6], t: f64| c.iter().rev().fold(0.0, |sum, c| sum * t + c);
        assert!((value(&shifted(&c, 0.7), 0.4) - value(&c, 1.1)).abs() < 1e-12);
    }
}
