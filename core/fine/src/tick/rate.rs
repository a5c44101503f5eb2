//! How fast program time passes: the plan that is followed, and all that says at which rate.

use std::sync::Arc;

use rtrb::Consumer;
use tandem_rings::{Depth, OperatorInputs, Queued, Ratio};
use tandem_sdk::{AxisVector, StopOn};

use super::govern::{Ask, Governed, PlanFollower, Request};
use super::progress::Progress;
use super::queue::QueueWatch;
use super::ratio::{Ratios, StrategyRatio};
use crate::config::FineConfig;
use crate::cursor::{Cursor, Reached};
use crate::fault::FaultKind;
use crate::outputs::Outputs;

/// The plan as it is followed, and what its rate depends on.
pub(super) struct Rate {
    plan: PlanFollower,
    strategy: StrategyRatio,
    depth: Arc<Depth>,
    queue: QueueWatch,
    progress: Progress,
    /// Something has moved since the last hold between two lines.
    line_moves: bool,
}

impl Rate {
    /// At rest in front of an empty queue. Host; allocates.
    pub(super) fn new(
        config: &FineConfig,
        segments: Consumer<Queued>,
        ratios: Consumer<Ratio>,
        depth: Arc<Depth>,
    ) -> Self {
        Self {
            plan: PlanFollower::new(config, Cursor::new(segments, &config.position)),
            strategy: StrategyRatio::new(ratios, config.ratio_periods),
            depth,
            queue: QueueWatch::default(),
            progress: Progress::new(config),
            line_moves: false,
        }
    }

    /// Where the machine is in the plan.
    #[inline]
    pub(super) fn cursor(&self) -> &Cursor {
        &self.plan.cursor
    }

    /// The rate at the end of the last period.
    #[inline]
    pub(super) fn sigma(&self) -> f64 {
        self.plan.governor.sigma()
    }

    /// The feed at the end of the last period, mm/s.
    #[inline]
    pub(super) fn end_feed_mm_per_s(&self) -> f64 {
        self.sigma() * self.plan.cursor.path_speed_mm_per_s()
    }

    /// Whether nothing moves along the plan.
    pub(super) fn stands(&self) -> bool {
        self.sigma() == 0.0 || self.plan.cursor.is_resting()
    }

    /// Whether the machine stands where the plan does not.
    pub(super) fn stands_inside(&self) -> bool {
        !self.plan.cursor.is_resting() && self.sigma() == 0.0
    }

    /// Whether what comes next, or is in progress, is a cut.
    pub(super) fn is_cutting(&mut self) -> bool {
        self.plan.cursor.is_cutting()
    }

    /// What the motion that begins next at a rest waits for; `None` elsewhere.
    pub(super) fn next_stop_on(&mut self) -> Option<StopOn> {
        let cursor = &mut self.plan.cursor;
        cursor.is_resting().then(|| cursor.next_stop_on())
    }

    /// Takes the strategy's ratios that are due in the fine period `tick`; gives how many came too late.
    #[inline]
    pub(super) fn take_ratios(&mut self, tick: u64) -> u64 {
        self.strategy.take(tick)
    }

    /// The ratios that count now, where the program permits them.
    #[inline]
    pub(super) fn ratios_in_force(
        &self,
        config: &FineConfig,
        outputs: &Outputs,
        inputs: &OperatorInputs,
    ) -> Ratios {
        self.strategy.in_force(config, outputs, inputs)
    }

    /// In single-block operation: whether the machine rests between two lines, and has moved since it last did.
    pub(super) fn is_between_lines(&mut self, single_block: bool) -> bool {
        if !single_block || !self.plan.cursor.is_resting() {
            self.line_moves |= !self.plan.cursor.is_resting();
            return false;
        }
        let line = self.plan.cursor.segment().line;
        let ends = self.line_moves
            && self
                .plan
                .cursor
                .next_line()
                .is_some_and(|next| next != line);
        self.line_moves &= !ends;
        ends
    }

    /// Looks at the queue; gives whether it has begun to starve.
    #[inline]
    pub(super) fn look_at_queue(&mut self, period_s: f64) -> bool {
        let cursor = &self.plan.cursor;
        let planned_mm_per_s = (!cursor.is_resting()).then(|| cursor.path_speed_mm_per_s());
        self.queue.look(
            &self.depth,
            cursor.program_time_s(),
            self.plan.governor.sigma(),
            planned_mm_per_s,
            period_s,
        )
    }

    /// Whether the queue is too short to go on at full speed and still be able to stop.
    pub(super) fn is_starved(&self) -> bool {
        self.queue.is_starved()
    }

    /// At a rest any rate is as good: where the plan is to run, the highest that the queue allows, else none.
    #[inline]
    pub(super) fn begin_at_rest(&mut self, ask: Ask) {
        if self.plan.cursor.is_resting() {
            self.plan.governor.jump(if ask == Ask::Run {
                self.depth.max_rate.load()
            } else {
                0.0
            });
        }
    }

    /// Chooses the rate for this period.
    #[inline]
    pub(super) fn govern(&mut self, ask: Ask, ratios: Ratios, single_block: bool) -> &Governed {
        let governed = self.plan.govern(Request {
            ask,
            ratios,
            single_block,
            max_rate: self.depth.max_rate.load(),
            stop_deceleration_mm_per_s2: self.depth.stop_deceleration_mm_per_s2.load(),
        });
        self.progress.ask(governed.least_asked);
        governed
    }

    /// Moves on by `delta_s` of program time; `meet` says whether the machine is to stay at a rest ([`Cursor::advance`]).
    #[inline]
    pub(super) fn advance(&mut self, delta_s: f64, meet: impl FnMut(&Queued) -> bool) -> Reached {
        self.plan.cursor.advance(delta_s, meet)
    }

    /// After a move that `reached` something: the fault where program time should have got on and has not.
    #[inline]
    pub(super) fn watch_progress(
        &mut self,
        ask: Ask,
        reached: Reached,
        config: &FineConfig,
        outputs: &Outputs,
        inputs: &OperatorInputs,
    ) -> Option<FaultKind> {
        // What was met on the way may have changed which ratios count.
        let least_ratio = || {
            let ratios = self.strategy.in_force(config, outputs, inputs);
            ratios.feed.min(ratios.rapid)
        };
        self.progress.watch(
            &self.plan.cursor,
            ask,
            reached,
            config.period_s,
            least_ratio,
        )
    }

    /// Whether motion of the present epoch may start: it has been planned, and enough of it is queued. What is left of older epochs in
    /// the queue is dropped first, so that there is room for it.
    pub(super) fn may_start(&mut self) -> bool {
        let epoch = self.plan.cursor.epoch();
        let is_queued = self.plan.cursor.drop_older();
        // A first epoch with nothing in it is over at once.
        let is_planned = epoch == 0 || (is_queued && self.depth.is_of(epoch));
        is_planned && self.depth.may_start(self.plan.cursor.program_time_s())
    }

    /// Rests at `position`; what is queued counts no more.
    pub(super) fn end_epoch(&mut self, position: &AxisVector) {
        self.plan.cursor.end_epoch(position);
        self.plan.forget_ahead();
        self.queue.forget();
    }

    /// Once more after a fault: program time passes at its own rate. Host; allocates.
    pub(super) fn forget(&mut self, config: &FineConfig) {
        self.plan.forget_rate(config);
        self.progress = Progress::new(config);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::{Producer, RingBuffer};
    use tandem_sdk::{AxisLimits, Limits, Segment};

    /// In front of an empty queue: the way into it, and what is said of it.
    fn rate() -> (Rate, Producer<Queued>, Arc<Depth>) {
        let axis = AxisLimits {
            min_mm: -1.0,
            max_mm: 1.0,
            feed_mm_per_s: 1.0,
            rapid_mm_per_s: 1.0,
            acceleration_mm_per_s2: 1.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let config = FineConfig::new(0.001, Limits::new(&[axis]).unwrap());
        let (queue, segments) = RingBuffer::new(16);
        let depth = Arc::new(Depth::default());
        let ratios = RingBuffer::new(16).1;
        let rate = Rate::new(&config, segments, ratios, Arc::clone(&depth));
        (rate, queue, depth)
    }

    /// What has been planned for an older epoch, or is not queued yet, starts no motion; a first epoch with nothing in it does.
    #[test]
    fn motion_starts_when_that_of_its_own_epoch_is_queued() {
        let (mut rate, mut queue, depth) = rate();
        depth.required_s.store(0.0);
        assert!(rate.may_start());
        rate.end_epoch(&AxisVector::ZERO);
        assert!(!rate.may_start(), "nothing is planned");
        depth.begin(rate.cursor().epoch(), 0.0);
        depth.required_s.store(0.0);
        assert!(!rate.may_start(), "nothing is queued");
        let mut segment = Segment::rest(&AxisVector::ZERO, 1.0);
        segment.epoch = rate.cursor().epoch();
        let start_s = 0.0;
        queue.push(Queued::Segment { start_s, segment }).unwrap();
        assert!(rate.may_start());
        depth.wall_s.store(-1.0);
        assert!(!rate.may_start(), "not enough of it");
    }

    /// A cut waits for the spindle where the machine stands in its midst: that is neither in motion nor at a rest of the plan.
    #[test]
    fn the_machine_stands_inside_the_plan_at_a_rate_of_zero_and_away_from_rests() {
        let (mut rate, mut queue, _) = rate();
        let (start_s, segment) = (0.0, Segment::rest(&AxisVector::ZERO, 1.0));
        queue.push(Queued::Segment { start_s, segment }).unwrap();
        for (sigma, moved_s, stands_inside) in [
            (1.0, 0.0, false),
            (0.0, 0.0, false),
            (0.0, 0.5, true),
            (0.5, 0.0, false),
            (0.0, 1.0, false),
        ] {
            rate.plan.governor.jump(sigma);
            rate.advance(moved_s, |_| false);
            let time_s = rate.cursor().program_time_s();
            assert_eq!(rate.stands_inside(), stands_inside, "{sigma} at {time_s} s");
        }
    }
}
