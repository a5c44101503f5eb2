//! What the operator and the feed strategy ask for beside the ratio, as one fine period sees it.
//!
//! The dead man's switch of a jog is here too: where nobody keeps it alive, the machine stops on the path, whatever the soft side
//! does.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use rtrb::Consumer;
use tandem_rings::{Controls, OperatorInputs, RequestKind, StrategyRequest};

/// Fine periods since the operator last kept the jog alive.
#[derive(Debug, Default)]
struct KeepAlive {
    beats: u64,
    periods: u64,
}

/// The operator's side: flags that both sides set, read once in a period, and the requests of the strategy.
pub(super) struct Operator {
    controls: Arc<Controls>,
    /// As this period sees them.
    inputs: OperatorInputs,
    keep_alive: KeepAlive,
    requests: Consumer<StrategyRequest>,
}

impl Operator {
    /// Nothing is asked for yet. Host.
    pub(super) fn new(controls: Arc<Controls>, requests: Consumer<StrategyRequest>) -> Self {
        Self {
            controls,
            inputs: OperatorInputs::default(),
            keep_alive: KeepAlive::default(),
            requests,
        }
    }

    /// Reads what is asked for in this period, in which the job `has_ended` or not.
    #[inline]
    pub(super) fn begin_period(&mut self, has_ended: bool) {
        self.inputs = OperatorInputs::of(&self.controls);
        // Nothing of this job is left to be aborted: what is asked now is meant for the one that is about to take over.
        self.inputs.abort &= !has_ended;
        self.watch_jog();
    }

    /// What is asked for in this period.
    pub(super) fn inputs(&self) -> &OperatorInputs {
        &self.inputs
    }

    /// Lets go of a jog whose keep-alive is late.
    fn watch_jog(&mut self) {
        let jog = &self.controls.jog;
        let beats = jog.beats.load(Relaxed);
        if beats != self.keep_alive.beats {
            self.keep_alive = KeepAlive { beats, periods: 0 };
            return;
        }
        self.keep_alive.periods = self.keep_alive.periods.saturating_add(1);
        let most = jog.max_periods.load(Relaxed);
        if most > 0 && self.keep_alive.periods >= most {
            jog.let_go.store(true, Relaxed);
        }
    }

    /// Periods without a sample are time in which nobody kept the jog alive.
    pub(super) fn miss_beats(&mut self, periods: u64) {
        self.keep_alive.periods = self.keep_alive.periods.saturating_add(periods);
    }

    /// Takes the strategy's requests that are due in the fine period `tick`; gives how many came after the tick that they were meant
    /// for. A hold is the operator's: it is resumed like one.
    #[inline]
    pub(super) fn take_requests(&mut self, tick: u64) -> u64 {
        let mut late = 0;
        while let Ok(next) = self.requests.peek() {
            if next.tick > tick {
                break;
            }
            late += u64::from(next.tick < tick);
            match next.kind {
                RequestKind::Hold => self.hold(),
                RequestKind::Fault => self.controls.soft_fault.store(true, Relaxed),
            }
            let _ = self.requests.pop();
        }
        late
    }

    /// Sets a feed hold, which acts in this period already and stands until the operator resumes.
    pub(super) fn hold(&mut self) {
        self.hold_from_next_period();
        self.inputs.hold = true;
    }

    /// Sets a feed hold that stands until the operator resumes, from the next period on.
    pub(super) fn hold_from_next_period(&self) {
        self.controls.hold.store(true, Relaxed);
    }

    /// The program waits for the operator, in this period already.
    pub(super) fn hold_for_program(&mut self) {
        self.controls.program_hold.store(true, Relaxed);
        self.inputs.program_hold = true;
    }

    /// An input presses the emergency stop in this period.
    pub(super) fn press_emergency_stop(&mut self) {
        self.inputs.emergency_stop = true;
    }

    /// Whether a hold of the operator, an input or the program stands.
    pub(super) fn is_held(&self) -> bool {
        self.inputs.hold || self.inputs.program_hold
    }

    /// Whether the soft side has failed.
    pub(super) fn has_soft_fault(&self) -> bool {
        self.controls.soft_fault.load(Relaxed)
    }

    /// Whether the jog is to stop.
    pub(super) fn is_jog_let_go(&self) -> bool {
        self.controls.jog.let_go.load(Relaxed)
    }

    /// Whether the drives are to let go though another job may follow.
    pub(super) fn lets_drives_go(&self) -> bool {
        self.controls.drives_let_go.load(Relaxed)
    }

    /// The abort has been carried out: neither it nor a hold is left. A jog that is let go stays so.
    pub(super) fn forget_abort(&self) {
        let controls = &self.controls;
        for flag in [&controls.hold, &controls.program_hold, &controls.abort] {
            flag.store(false, Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::{Producer, RingBuffer};

    fn operator() -> (Operator, Arc<Controls>, Producer<StrategyRequest>) {
        let (input, output) = RingBuffer::new(8);
        let controls = Arc::new(Controls::default());
        (
            Operator::new(Arc::clone(&controls), output),
            controls,
            input,
        )
    }

    #[test]
    fn a_jog_is_let_go_where_nobody_keeps_it_alive_for_as_many_periods() {
        let (mut operator, controls, _requests) = operator();
        for _ in 0..100 {
            operator.begin_period(false);
        }
        assert!(!operator.is_jog_let_go(), "nothing needs to be kept alive");
        controls.jog.max_periods.store(4, Relaxed);
        for beat in 1..10 {
            controls.jog.beats.store(beat, Relaxed);
            (0..4).for_each(|_| operator.begin_period(false));
            assert!(!operator.is_jog_let_go());
        }
        operator.begin_period(false);
        assert!(operator.is_jog_let_go());
        // Periods that went by without a sample are time as well.
        controls.jog.let_go.store(false, Relaxed);
        controls.jog.beats.store(10, Relaxed);
        operator.begin_period(false);
        operator.miss_beats(2);
        operator.begin_period(false);
        assert!(!operator.is_jog_let_go());
        operator.begin_period(false);
        assert!(operator.is_jog_let_go());
    }

    #[test]
    fn a_request_acts_in_its_tick_and_counts_as_late_after_it() {
        let (mut operator, controls, mut requests) = operator();
        for (tick, kind) in [(3, RequestKind::Hold), (4, RequestKind::Fault)] {
            requests.push(StrategyRequest { tick, kind }).unwrap();
        }
        assert_eq!(operator.take_requests(2), 0);
        assert!(!operator.is_held());
        assert_eq!(operator.take_requests(3), 0);
        assert!(operator.is_held() && operator.inputs().hold, "at once");
        assert!(!operator.has_soft_fault());
        assert_eq!(
            operator.take_requests(6),
            1,
            "it was meant for another tick"
        );
        assert!(operator.has_soft_fault());
        operator.begin_period(false);
        assert!(operator.is_held(), "until the operator resumes");
        controls.hold.store(false, Relaxed);
        operator.begin_period(false);
        assert!(!operator.is_held());
    }

    #[test]
    fn holds_act_when_they_say_and_an_abort_leaves_none() {
        let (mut operator, controls, _requests) = operator();
        operator.hold_from_next_period();
        assert!(!operator.is_held());
        operator.begin_period(false);
        assert!(operator.is_held());
        controls.hold.store(false, Relaxed);
        operator.begin_period(false);
        operator.hold_for_program();
        assert!(operator.is_held() && controls.program_hold.load(Relaxed));
        controls.abort.store(true, Relaxed);
        controls.jog.let_go.store(true, Relaxed);
        operator.begin_period(true);
        assert!(
            !operator.inputs().abort,
            "nothing of the job is left to be aborted"
        );
        operator.begin_period(false);
        assert!(operator.inputs().abort);
        operator.forget_abort();
        operator.begin_period(false);
        assert!(!operator.is_held() && !operator.inputs().abort && operator.is_jog_let_go());
        operator.press_emergency_stop();
        assert!(operator.inputs().emergency_stop && !operator.lets_drives_go());
        controls.drives_let_go.store(true, Relaxed);
        assert!(operator.lets_drives_go());
    }
}
