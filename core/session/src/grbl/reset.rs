//! Soft resets, and alarms.

use std::time::Instant;

use tandem_host::Command;

use super::errors::alarm_of;
use super::report::{GrblState, state_of};
use super::sender::{Pending, Sender};
use crate::controller::{ControllerState, Lines, Mode, NotTaken, RequestId};
use crate::operator::Lease;

impl Sender {
    /// Lines that wait are forgotten, what this sender drives comes to rest on its path; what another client drives is left alone.
    pub(super) fn begin_reset(&mut self, lease: &mut Lease, now: Instant) {
        self.forget_lines();
        // The welcome behind the reset is the one that it waits for.
        self.greet_at = None;
        self.said.holds = false;
        self.said.door = false;
        self.said.checks = false;
        self.said.unlocked = false;
        self.check = None;
        let others = lease.holder().is_some_and(|holder| holder != self.client);
        let foreign = others && !self.dispatcher.is_still();
        if foreign {
            self.greet();
            let who = lease.name_of(lease.holder().unwrap_or_default());
            self.message(&format!("{who} drives the machine: it goes on"));
            return;
        }
        if !self.dispatcher.is_still() {
            // It is nobody's, or ours.
            let _ = lease.take(self.client, now);
            self.dispatcher.stop();
        }
        self.resetting = true;
    }

    /// Once the machine rests: spindle and coolant off, modes as at the start.
    pub(super) fn end_reset(&mut self, lease: &Lease) {
        if !self.resetting || !self.dispatcher.is_still() {
            return;
        }
        self.resetting = false;
        let others = lease.holder().is_some_and(|holder| holder != self.client);
        if !others {
            self.dispatcher.with_lines(Lines::reset_modes);
            for command in [Command::FeedOverride(1.0), Command::RapidOverride(1.0)] {
                // One is always allowed.
                let _ = self.dispatcher.hub.give(command);
            }
            let runs = self.dispatcher.with_lines(|lines| {
                let standing = lines.standing();
                let turns = !standing.modal_words().iter().any(|word| word == "M5");
                turns || !standing.coolant_words().is_empty()
            });
            if runs && let Err(why) = self.of_our_own("M5 M9") {
                self.message(&why);
            }
        }
        self.greet();
    }

    /// The welcome that senders wait for, and what is to be done first.
    pub(super) fn greet(&mut self) {
        self.reports.renew();
        self.say("\r\nGrbl 1.1h ['$' for help]\r\n");
        if state_of(&self.dispatcher, self.said) == GrblState::Alarm {
            self.message("'$H'|'$X' to unlock");
        }
    }

    /// Tells of a fault, once.
    pub(super) fn look_for_fault(&mut self) {
        let words = self.dispatcher.fault_words();
        if words == self.fault {
            return;
        }
        self.fault.clone_from(&words);
        let Some(words) = words else { return };
        let homes = self.last_mode == Mode::Homing;
        let probes = matches!(self.pending, Some(Pending::Driven { probes: true, .. }));
        if probes {
            self.tell_probe();
        }
        let alarm = alarm_of(&words, homes, probes);
        self.say(&format!("ALARM:{alarm}\r\n"));
        self.message(&words);
        self.message("'$H'|'$X' to unlock");
    }

    /// A line of ours that nobody waits for.
    pub(super) fn of_our_own(&mut self, line: &str) -> Result<(), String> {
        if self.dispatcher.state() != ControllerState::Ready {
            return Err(format!("{line} is for a machine that is ready"));
        }
        match self.dispatcher.take_line(RequestId::nobody(), line) {
            Ok(_) => Ok(()),
            Err(NotTaken::Refused(why)) => Err(why.cause),
            Err(NotTaken::Locked(why)) => Err(why),
            Err(NotTaken::NotYet | NotTaken::NotIdle) => Err(format!("{line} came too early")),
        }
    }
}
