//! What must be true of the feedback of every exchange.

use tandem_sdk::{Arm, Attached, AxisVector, Feedback, JointState, MAX_DELAY_PERIODS, Setpoint};

use super::JOINTS;
use crate::report::Report;

/// How far a joint at rest may be from where it is told to be, mm or rad: far more than encoders are off by, far less than a jump
/// that anybody would call one.
pub const STANDS_MM: f64 = 0.05;

/// Way of the setpoint in each period from which on no encoder says the same twice, mm or rad.
const SURELY_MOVES_MM: f64 = 0.01;

/// Fine periods without a word of a joint after which it is lost, whatever the driver's patience.
const MAX_AGE: u32 = 250;

/// How long after it was disarmed a latch may still be told: as long as feedback may be behind, and some lost frames.
const LATCH_PERIODS: u64 = 50;

/// What was seen of the exchanges so far.
#[derive(Default)]
pub struct Watch {
    last: Option<Feedback>,
    /// Where the setpoint was in the last period.
    aim: AxisVector,
    /// Periods in a row in which the setpoint of each joint moved.
    moving: [u32; JOINTS],
    /// The edge that was armed last, and the period in which it was so last.
    armed: Option<(Arm, u64)>,
}

impl Watch {
    /// From where the joints stand.
    pub fn new(attached: &Attached) -> Self {
        Self {
            aim: attached.position,
            ..Self::default()
        }
    }

    /// One more exchange.
    pub fn look(&mut self, setpoint: &Setpoint, feedback: &Feedback, report: &mut Report) {
        judge_numbers(setpoint, feedback, report);
        self.judge_latches(setpoint, feedback, report);
        for joint in 0..JOINTS {
            let step = (setpoint.position[joint] - self.aim[joint]).abs();
            self.moving[joint] = if step > SURELY_MOVES_MM {
                self.moving[joint] + 1
            } else {
                0
            };
            if let Some(last) = self.last {
                self.judge_age(joint, setpoint.tick, [&last, feedback], report);
            }
        }
        self.judge_inputs(setpoint.tick, feedback, report);
        self.aim = setpoint.position;
        self.last = Some(*feedback);
    }

    /// Old feedback says how old it is, and what is new is not what was said before.
    fn judge_age(&self, joint: usize, tick: u64, [last, now]: [&Feedback; 2], report: &mut Report) {
        const CHECK: &str = "age of feedback";
        report.judged(CHECK);
        let ages = [last.age_periods[joint], now.age_periods[joint]];
        let said = |feedback: &Feedback| {
            [feedback.position[joint], feedback.speed[joint]].map(f64::to_bits)
        };
        let is_same = said(last) == said(now);
        if ages[1] > ages[0].saturating_add(1) {
            let words = format!(
                "it was {} periods old, and is {} a period later",
                ages[0], ages[1]
            );
            report.find(CHECK, format!("period {tick}: joint {joint}: {words}"));
        }
        if ages[1] > 0 && ages[1] == ages[0].saturating_add(1) && !is_same {
            let words = format!(
                "its feedback is {} periods old and not what was told then",
                ages[1]
            );
            report.find(CHECK, format!("period {tick}: joint {joint}: {words}"));
        }
        let has_moved =
            self.moving[joint] > MAX_DELAY_PERIODS && now.state[joint] == JointState::Enabled;
        if ages[1] == 0 && is_same && has_moved {
            report.find(
                CHECK,
                format!("period {tick}: joint {joint} moves, and the old feedback is told as new"),
            );
        }
        judge_lost(joint, tick, now, report);
    }

    /// Inputs grow older with the periods too, and an old one is what it was.
    fn judge_inputs(&self, tick: u64, now: &Feedback, report: &mut Report) {
        const CHECK: &str = "age of inputs";
        report.judged(CHECK);
        let Some(last) = self.last else { return };
        for (input, (then, age)) in last
            .input_age_periods
            .into_iter()
            .zip(now.input_age_periods)
            .enumerate()
        {
            let bit = |feedback: &Feedback| feedback.inputs >> input & 1;
            if age > then.saturating_add(1) {
                report.find(
                    CHECK,
                    format!("period {tick}: input {input} was {then} periods old, and is {age} a period later"),
                );
            }
            if age > 0 && age == then.saturating_add(1) && bit(now) != bit(&last) {
                report.find(
                    CHECK,
                    format!("period {tick}: input {input} is {age} periods old and not what was told then"),
                );
            }
        }
    }

    /// Positions are caught at the edge that was armed, by somebody, and not in the future.
    fn judge_latches(&mut self, setpoint: &Setpoint, feedback: &Feedback, report: &mut Report) {
        const CHECK: &str = "latches";
        report.judged(CHECK);
        let tick = setpoint.tick;
        if setpoint.arm.edge != 0 {
            self.armed = Some((setpoint.arm, tick));
        }
        for latch in feedback.latches.iter().filter(|latch| latch.edge != 0) {
            let came = Arm {
                input: latch.input,
                edge: latch.edge,
            };
            let mut find = |words: String| {
                report.find(
                    CHECK,
                    format!(
                        "period {tick}, edge {} of input {}: {words}",
                        came.edge, came.input
                    ),
                );
            };
            let armed = self
                .armed
                .is_some_and(|(arm, since)| arm == came && tick <= since + LATCH_PERIODS);
            if !armed {
                find("a latch of what was not armed".to_string());
            }
            let caught = |joint: &usize| latch.joints >> joint & 1 == 1;
            if !(0..JOINTS).any(|joint| caught(&joint)) {
                find("a latch that caught no joint".to_string());
            }
            if (0..JOINTS)
                .filter(caught)
                .any(|joint| !latch.position[joint].is_finite())
            {
                find("a position that is no number".to_string());
            }
            if !(latch.before_s >= 0.0 && latch.before_s.is_finite()) {
                find(format!("it came {} s before the feedback", latch.before_s));
            }
        }
    }
}

fn judge_numbers(setpoint: &Setpoint, feedback: &Feedback, report: &mut Report) {
    const CHECK: &str = "feedback";
    report.judged(CHECK);
    let tick = setpoint.tick;
    let numbers = [feedback.position, feedback.speed, feedback.current_a];
    if numbers
        .iter()
        .any(|v| v.0[..JOINTS].iter().any(|v| !v.is_finite()))
    {
        report.find(
            CHECK,
            format!("period {tick}: the feedback has a number that is not finite"),
        );
    }
    if let Some(joint) = (0..JOINTS).find(|joint| !feedback.state[*joint].is_known()) {
        let number = feedback.state[joint].0;
        report.find(
            CHECK,
            format!("period {tick}: the state of joint {joint} is {number}, which stands for none"),
        );
    }
}

fn judge_lost(joint: usize, tick: u64, now: &Feedback, report: &mut Report) {
    const CHECK: &str = "lost joints";
    report.judged(CHECK);
    let age = now.age_periods[joint];
    if age > MAX_AGE && now.state[joint] != JointState::Lost {
        let words =
            format!("joint {joint} was last heard of {age} periods ago, and is not told as lost");
        report.find(CHECK, format!("period {tick}: {words}"));
    }
}
