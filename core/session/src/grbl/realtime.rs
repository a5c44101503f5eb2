//! What acts at once: straight to the operator's atomics, whatever lines wait.

use std::time::Instant;

use tandem_host::Command;

use super::scan::{RealTime, Step};
use super::sender::Sender;
use crate::controller::{ControllerState, Mode};
use crate::operator::Lease;

/// Lowest feed override, percent.
const MIN_FEED_PERCENT: f64 = 10.0;

impl Sender {
    pub(super) fn real_time(&mut self, what: RealTime, lease: &mut Lease, now: Instant) {
        match what {
            RealTime::Status => self.status(),
            RealTime::Hold | RealTime::Door => self.hold(what == RealTime::Door),
            RealTime::Resume => self.resume(lease, now),
            RealTime::Reset => self.begin_reset(lease, now),
            RealTime::CancelJog => {
                if self.dispatcher.state() == ControllerState::Manual
                    || self.dispatcher.with_lines(|lines| lines.are_jogs())
                {
                    self.dispatcher.cancel_jogs();
                    self.forget_jogs();
                }
            }
            RealTime::Feed(step) => {
                if self.may(lease, now) {
                    self.override_feed(step);
                }
            }
            RealTime::Rapid(percent) => {
                if self.may(lease, now) {
                    let ratio = f64::from(percent) / 100.0;
                    self.give(Command::RapidOverride(ratio));
                }
            }
            RealTime::Spindle => {
                self.message("the spindle has no override here: S sets its speed");
            }
            RealTime::Flood => self.switch_coolant("M8", lease, now),
            RealTime::Mist => self.switch_coolant("M7", lease, now),
        }
    }

    /// Stops are free for all.
    fn hold(&mut self, door: bool) {
        if self.dispatcher.mode() == Mode::Jog {
            // As grbl has it: a hold ends jogs.
            self.dispatcher.cancel_jogs();
            self.forget_jogs();
            return;
        }
        self.dispatcher.hold();
        self.said.holds = true;
        self.said.door = door;
    }

    fn resume(&mut self, lease: &mut Lease, now: Instant) {
        if !self.dispatcher.is_still() && !self.may(lease, now) {
            return;
        }
        if let Err(why) = self.dispatcher.hub.give(Command::Resume) {
            self.message(&why);
            return;
        }
        self.said.holds = false;
        self.said.door = false;
    }

    fn override_feed(&mut self, step: Step) {
        let now = self.dispatcher.hub.controls().feed_override.load() * 100.0;
        let most = self.dispatcher.hub.max_feed_ratio() * 100.0;
        let asked = match step {
            Step::To(percent) => f64::from(percent),
            Step::By(percent) => (now + f64::from(percent)).round(),
        };
        let kept = asked.clamp(MIN_FEED_PERCENT.min(most), most);
        if kept != asked {
            self.message(&format!(
                "the feed override stays between {MIN_FEED_PERCENT} and {most} percent"
            ));
        }
        self.give(Command::FeedOverride(kept / 100.0));
    }

    fn give(&mut self, command: Command) {
        if let Err(why) = self.dispatcher.hub.give(command) {
            self.message(&why);
        }
    }

    /// Coolant is a word of a line: it is switched where no line is driven.
    fn switch_coolant(&mut self, word: &str, lease: &mut Lease, now: Instant) {
        if !self.may(lease, now) {
            return;
        }
        if !self.dispatcher.is_still() {
            self.message("coolant is switched by M7, M8 and M9 while lines are driven");
            return;
        }
        let on = self
            .dispatcher
            .with_lines(|lines| lines.standing().coolant_words());
        let line = if on.contains(&word) {
            let others: Vec<&str> = on.into_iter().filter(|other| *other != word).collect();
            format!("M9 {}", others.join(" "))
        } else {
            word.to_string()
        };
        // M9 and another of its kind do not go into one line.
        for word in line.split_whitespace() {
            if let Err(why) = self.of_our_own(word) {
                self.message(&why);
            }
        }
    }
}
