//! What the soft side is told of each period: its sample, the state of the machine, and what was switched.

use std::iter::once_with;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use rtrb::Producer;
use tandem_rings::{Counters, MachineState, Sample, Status, Switched};
use tandem_sdk::{AxisVector, Feedback, Segment};

use super::drives::Drives;
use super::rate::Rate;

/// What the drives were sent beside the axes when that last changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Left {
    /// The fine period.
    pub tick: u64,
    /// Block that moved.
    pub block: u64,
    /// Program line that moved.
    pub line: u32,
    /// What was sent.
    pub switched: Switched,
}

/// How a job of a resident machine has ended; its loop stays at the drives until the next one takes over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JobEnd {
    /// What the job counted.
    pub counters: Counters,
    /// What was switched last.
    pub left: Left,
    /// Where the machine rests, axis space, mm or rad.
    pub position: AxisVector,
}

/// What the status says of a period beside what the plan and the drives do.
#[allow(clippy::struct_excessive_bools)] // independent facts of one period
pub(super) struct Present {
    /// Number of the fine period that comes next.
    pub(super) tick: u64,
    pub(super) state: MachineState,
    /// There is a fault: off the plan nothing is waited for or enabled.
    pub(super) is_faulted: bool,
    pub(super) end_feed_mm_per_s: f64,
    pub(super) waits_for_spindle: bool,
    pub(super) all_hold: bool,
    /// A sample of this period was handed out, or lost for want of room.
    pub(super) is_sampled: bool,
}

/// Where samples and the state of the machine go.
pub(super) struct Report {
    status: Arc<Status>,
    samples: Producer<Sample>,
    left: Left,
}

impl Report {
    /// Nothing has been told. Host.
    pub(super) fn new(status: Arc<Status>, samples: Producer<Sample>) -> Self {
        Self {
            status,
            samples,
            left: Left::default(),
        }
    }

    /// Hands samples out through another ring from here on.
    pub(super) fn hand_out_through(&mut self, samples: Producer<Sample>) {
        self.samples = samples;
    }

    /// What was switched last.
    pub(super) fn left(&self) -> Left {
        self.left
    }

    /// Inputs with a role that are tripped, a bit each.
    pub(super) fn tell_tripped(&self, inputs: u64) {
        self.status.tripped.store(inputs, Relaxed);
    }

    /// How old what the drives have answered is, and how late the exchange was.
    #[inline]
    pub(super) fn tell_bus(&self, feedback: &Feedback, age_periods: u32) {
        let bus = &self.status.bus;
        bus.age_periods.store(age_periods, Relaxed);
        if age_periods > 0 {
            bus.old_periods.fetch_add(1, Relaxed);
        }
        bus.has_phase.store(feedback.has_phase != 0, Relaxed);
        bus.phase_ns.store(feedback.phase_ns, Relaxed);
    }

    /// Hands a sample out; one that finds no room is counted as lost.
    #[inline]
    pub(super) fn publish(&mut self, sample: impl FnOnce() -> Sample) {
        match self.samples.write_chunk_uninit(1) {
            // Made in its slot: to push it would copy it.
            Ok(slot) => _ = slot.fill_from_iter(once_with(sample)),
            Err(_) => _ = self.status.lost_samples.fetch_add(1, Relaxed),
        }
    }

    /// Keeps what was `switched`, in the fine period `tick` of `segment`, where that has changed.
    #[inline]
    pub(super) fn keep_switched(&mut self, tick: u64, segment: &Segment, switched: &Switched) {
        if *switched != self.left.switched {
            self.left = Left {
                tick,
                block: segment.block,
                line: segment.line,
                switched: *switched,
            };
        }
    }

    /// Says where the machine is and what it does.
    #[inline]
    pub(super) fn tell(&self, present: &Present, rate: &Rate, drives: &Drives, counts: &Counters) {
        let (status, cursor) = (&self.status, rate.cursor());
        let (setpoint, feedback) = (drives.setpoint(), drives.feedback());
        status.tick.store(present.tick, Relaxed);
        status.program_time_s.store(cursor.program_time_s());
        status.feed_mm_per_s.store(present.end_feed_mm_per_s);
        let moves = present.end_feed_mm_per_s != 0.0 || present.state == MachineState::Stopping;
        if moves && present.is_sampled {
            status.rests_from_tick.store(present.tick, Relaxed);
        }
        status.line.store(cursor.segment().line, Relaxed);
        status.state.store(present.state as u32, Relaxed);
        status.inputs.store(feedback.inputs, Relaxed);
        let spindle = &status.spindle;
        let waits = present.waits_for_spindle && !present.is_faulted;
        spindle.waits.store(waits, Relaxed);
        spindle.told_rad_per_s.store(setpoint.spindle_rad_per_s);
        spindle.turns_rad_per_s.store(feedback.spindle_rad_per_s);
        for (joint, status) in status.joints.iter().enumerate().take(drives.joints()) {
            status.store(feedback.state[joint], feedback.fault_code[joint]);
        }
        let is_enabling = !present.all_hold && !present.is_faulted;
        status.enabling.store(is_enabling, Relaxed);
        let is_idle = cursor.is_resting() && cursor.is_last();
        status.idle.store(is_idle, Relaxed);
        status.counts.store(counts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rtrb::RingBuffer;

    /// A phase is told where the drives give one, beside how many periods went by on old answers.
    #[test]
    fn the_phase_of_the_bus_counts_where_the_drives_give_one() {
        let status = Arc::new(Status::default());
        let report = Report::new(Arc::clone(&status), RingBuffer::new(1).0);
        let mut feedback = Feedback::default();
        for (has_phase, age_periods, old_periods) in [(1, 0, 0), (0, 2, 1), (1, 3, 2)] {
            (feedback.has_phase, feedback.phase_ns) = (has_phase, 1234);
            report.tell_bus(&feedback, age_periods);
            let bus = &status.bus;
            assert_eq!(bus.has_phase.load(Relaxed), has_phase == 1);
            assert_eq!(bus.phase_ns.load(Relaxed), 1234);
            assert_eq!(bus.age_periods.load(Relaxed), age_periods);
            assert_eq!(bus.old_periods.load(Relaxed), old_periods);
        }
    }
}
