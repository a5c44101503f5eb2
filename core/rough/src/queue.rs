//! The rough loop's side of the segment ring.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering::{Relaxed, Release};

use tandem_rings::{Queued, Rest, RoughEnd};
use tandem_sdk::{
    Block, BlockReport, Edge, Event, NurbsData, Segment, SegmentFlags, SegmentSink, StopOn,
};

use crate::Observer;
use crate::depth::{QueueDepth, SERVED_FOR_PERIODS};
use crate::junction_steps::JunctionSteps;
use crate::staged::Staged;

/// Collects what the planner emits, ties events to their place, and moves it into the ring as there is room.
pub struct Queue {
    end: RoughEnd,
    depth: QueueDepth,
    epoch: u32,
    /// Path coordinate at the start of the epoch, mm: planners begin each at zero.
    path_start_mm: f64,
    staged: Staged,
    /// Events whose block has not been emitted yet.
    events: VecDeque<Event>,
    /// Blocks accepted by the planner, not yet reported, and their curves. A block is large: by itself it is copied to its place, and
    /// forgotten there.
    blocks: VecDeque<Block>,
    curves: VecDeque<Option<Arc<NurbsData>>>,
    /// Blocks that wait for an edge, until they are emitted.
    stops: VecDeque<(u64, StopOn)>,
    /// Reports of blocks planned for good since the last look; their blocks are still in `blocks`.
    reported: Vec<BlockReport>,
    /// Program time at the end of what was emitted, s.
    emitted_s: f64,
    /// Program time at the end of what is in the ring, s.
    queued_s: f64,
    ends_at_rest: bool,
    /// What was emitted last ends at rest.
    plan_rests: bool,
    junction_steps: JunctionSteps,
    defect: Option<&'static str>,
}

impl Queue {
    /// An empty queue.
    pub fn new(end: RoughEnd, depth: QueueDepth, junction_steps: JunctionSteps) -> Self {
        Self {
            end,
            depth,
            epoch: 0,
            path_start_mm: 0.0,
            staged: Staged::default(),
            events: VecDeque::new(),
            blocks: VecDeque::new(),
            curves: VecDeque::new(),
            stops: VecDeque::new(),
            reported: Vec::new(),
            emitted_s: 0.0,
            queued_s: 0.0,
            ends_at_rest: true,
            plan_rests: true,
            junction_steps,
            defect: None,
        }
    }

    /// The planner has accepted `block`.
    pub fn accepted(&mut self, block: &Block, curve: Option<&Arc<NurbsData>>) {
        if block.stop_on.edge != Edge::None {
            self.stops.push_back((block.index, block.stop_on));
        }
        self.blocks.extend(std::slice::from_ref(block));
        self.curves.push_back(curve.cloned());
    }

    /// The next rest that the fine loop has reported.
    pub fn take_rest(&mut self) -> Option<Rest> {
        self.end.rests.pop().ok()
    }

    /// Forgets all that was queued behind `rest`, and begins the next epoch there.
    pub fn restart(&mut self, rest: &Rest) {
        self.epoch = rest.epoch + 1;
        self.junction_steps.restart();
        self.path_start_mm = rest.path_mm;
        (self.emitted_s, self.queued_s, self.ends_at_rest) =
            (rest.program_time_s, rest.program_time_s, true);
        self.plan_rests = true;
        self.staged.clear();
        self.events.clear();
        self.blocks.clear();
        self.curves.clear();
        self.stops.clear();
        self.reported.clear();
        self.depth.clear();
        self.end.depth.begin(self.epoch, rest.program_time_s);
    }

    /// What ends the motion of `block` early.
    fn stop_on(&mut self, block: u64) -> StopOn {
        while self.stops.front().is_some_and(|(index, _)| *index < block) {
            self.stops.pop_front();
        }
        self.stops
            .front()
            .filter(|(index, _)| *index == block)
            .map_or(StopOn::default(), |(_, stop_on)| *stop_on)
    }

    /// Takes an event that belongs in front of a block still to come.
    pub fn event(&mut self, event: Event) {
        self.events.push_back(event);
    }

    /// Nothing more will be emitted for now: events that wait for a block take their place at the end.
    pub fn release_events(&mut self) {
        while let Some(event) = self.events.pop_front() {
            self.stage_event(event);
        }
    }

    /// Tells `observer` of the blocks planned for good since the last look, and forgets them.
    pub fn tell_of_blocks(&mut self, observer: &mut dyn Observer) {
        for report in self.reported.drain(..) {
            while let Some(block) = self
                .blocks
                .front()
                .filter(|block| block.index <= report.block)
            {
                let curve = self.curves.pop_front().flatten();
                if block.index == report.block {
                    observer.block(block, curve.as_deref().map(NurbsData::curve), &report);
                }
                self.blocks.pop_front();
            }
        }
    }

    /// The planner's defect met while emitting, if any.
    pub fn defect(&self) -> Option<&'static str> {
        self.defect
    }

    /// Digital inputs as the fine loop last read them.
    pub fn inputs(&self) -> u64 {
        self.end.status.inputs.load(Relaxed)
    }

    /// Program time at the end of what the planner has emitted, s.
    pub fn emitted_s(&self) -> f64 {
        self.emitted_s
    }

    /// Whether what the planner has emitted ends at rest.
    pub fn plan_rests(&self) -> bool {
        self.plan_rests
    }

    /// Whether all is driven: nothing staged, and the fine loop rests at the end of its queue.
    pub fn is_driven(&self) -> bool {
        self.staged.is_empty()
            && self.end.segments.slots() == self.end.segments.buffer().capacity()
            && self.end.status.idle.load(Relaxed)
    }

    /// Whether the fine loop has as much as the worst stop asks for, with a margin of `margin_s`; or the ring is full.
    pub fn is_deep(&mut self, margin_s: f64) -> bool {
        let now_s = self.end.status.program_time_s.load();
        self.depth.passed(now_s);
        self.is_waiting_for_room() || self.emitted_s - now_s >= self.depth.required_s() + margin_s
    }

    /// Whether something that was emitted waits for room in the ring.
    pub fn is_waiting_for_room(&self) -> bool {
        !self.staged.is_empty()
    }

    /// Moves what is staged into the ring and tells the fine loop how far it reaches. `over`: nothing follows for now.
    /// `full`: the ring was full before.
    pub fn flush(&mut self, over: bool, full: bool) {
        self.move_staged();
        self.tell(over, full || self.is_waiting_for_room());
    }

    /// Moves what is staged into the ring, as far as there is room.
    pub fn move_staged(&mut self) {
        let (moved, _) = self.end.segments.push_partial_slice(self.staged.waiting());
        let last = moved
            .iter()
            .rfind(|queued| matches!(queued, Queued::Segment { .. }));
        if let Some(Queued::Segment { start_s, segment }) = last {
            self.queued_s = start_s + segment.duration_s;
            self.ends_at_rest = segment.flags.contains(SegmentFlags::ENDS_AT_REST);
        }
        let count = moved.len();
        self.staged.moved(count);
    }

    /// `full`: deeper the queue does not get.
    fn tell(&mut self, over: bool, full: bool) {
        let now_s = self.end.status.program_time_s.load();
        self.depth.passed(now_s);
        let shared = &self.end.depth;
        let max_rate = self.depth.rate_for_entries();
        let max_rate = if full {
            max_rate.min(self.depth.rate_for_wall(now_s, self.queued_s))
        } else {
            max_rate
        };
        shared.max_rate.store(max_rate);
        shared.full.store(full, Release);
        shared
            .stop_deceleration_mm_per_s2
            .store(self.depth.stop_deceleration_mm_per_s2());
        shared.stop_s.store(self.depth.stop_s());
        shared.build_up_s.store(self.depth.build_up_s());
        shared.wall_s.store(if self.ends_at_rest {
            f64::INFINITY
        } else {
            self.queued_s
        });
        shared.required_s.store(if over || full {
            0.0
        } else {
            self.depth.required_s()
        });
        shared
            .served_for_s
            .store(SERVED_FOR_PERIODS * self.depth.rough_period_s());
        shared.served.fetch_add(1, Release);
    }

    fn stage_event(&mut self, mut event: Event) {
        (event.program_time_s, event.epoch) = (self.emitted_s, self.epoch);
        self.staged.event(event);
    }
}

impl SegmentSink for Queue {
    fn segment(&mut self, segment: &Segment) {
        if !is_sound(segment) {
            self.defect = Some(
                "advance emits a segment with a number that is not finite, or a negative duration",
            );
            return;
        }
        while self
            .events
            .front()
            .is_some_and(|event| event.before_block <= segment.block)
        {
            let event = self
                .events
                .pop_front()
                .unwrap_or_else(|| unreachable!("looked at above"));
            self.stage_event(event);
        }
        let stop_on = self.stop_on(segment.block);
        let is_step = self.junction_steps.is_step_at(segment);
        let epoch = self.epoch;
        let path_start_mm = self.path_start_mm;
        self.staged.segment(self.emitted_s, segment, |marked| {
            marked.epoch = epoch;
            marked.stop_on = stop_on;
            marked.path[0] += path_start_mm;
            if is_step {
                marked.flags = marked.flags.with(SegmentFlags::STEPS);
            }
        });
        self.emitted_s += segment.duration_s;
        self.plan_rests = segment.flags.contains(SegmentFlags::ENDS_AT_REST);
        self.depth.push(segment, self.emitted_s);
    }

    fn block(&mut self, report: &BlockReport) {
        let first = self.reported.last().map_or(0, |last| last.block + 1);
        let place = self
            .blocks
            .front()
            .map_or(0, |front| report.block.wrapping_sub(front.index) as usize);
        if report.block >= first
            && self
                .blocks
                .get(place)
                .is_some_and(|block| block.index == report.block)
        {
            self.reported.push(*report);
        } else {
            self.defect = Some("advance emits a report of a block that it was not given");
        }
    }
}

/// Whether all numbers are finite and time goes forward.
fn is_sound(segment: &Segment) -> bool {
    // Nothing times a number is nothing, and times what is not finite no number: one sum a power of t, and no branch for each number.
    let mut sums = segment.path.map(|c| 0.0 * c);
    for coefficients in &segment.coefficients {
        for (sum, c) in sums.iter_mut().zip(coefficients) {
            *sum += 0.0 * c;
        }
    }
    let sum: f64 = sums.iter().sum();
    sum == 0.0 && segment.duration_s.is_finite() && segment.duration_s >= 0.0
}

#[cfg(test)]
#[path = "queue_tests.rs"]
mod tests;
