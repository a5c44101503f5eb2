//! Refusals as numbers that senders know.

use crate::judge::Refusal;

/// A number of grbl's, beside which our words stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorNumber(pub u32);

impl ErrorNumber {
    /// `$` is followed by what is no command.
    pub const STATEMENT: Self = Self(3);
    /// The machine needs no homing.
    pub const HOMING_OFF: Self = Self(5);
    /// It asks for a machine that stands.
    pub const NOT_IDLE: Self = Self(8);
    /// The state of the machine does not allow it.
    pub const LOCKED: Self = Self(9);
    /// The line is too long.
    pub const TOO_LONG: Self = Self(11);
    /// A jog with words that a jog cannot have.
    pub const JOG: Self = Self(16);
    /// A word that is not supported; what no other number fits.
    pub const UNSUPPORTED: Self = Self(20);
    /// No feed.
    pub const NO_FEED: Self = Self(22);

    /// The number of what was refused.
    pub fn of(refusal: &Refusal) -> Self {
        Self(match refusal.code {
            "unexpected" | "assignment" | "comment" => 1,
            "number" | "number-long" | "value-missing" | "not-finite" => 2,
            "waits" | "not-idle" => 8,
            "jogs" => 9,
            "line-long" | "too-many" => 11,
            "travel" => 15,
            "conflict" => 21,
            "feed-missing" => 22,
            "non-modal" => 24,
            "word-twice" | "ambiguous" => 25,
            "axis-missing" => 26,
            "word-missing" => 28,
            "rapid" => 30,
            "motion-missing" => 31,
            "arc-ends" | "arc-radius" | "probe-distance" => 33,
            "arc-centre" => 35,
            "unused-word" => 36,
            "tool" => 38,
            _ => return Self::UNSUPPORTED,
        })
    }
}

/// A fault as one of grbl's alarms; our words stand beside it.
pub fn alarm_of(words: &str, homes: bool, probes: bool) -> u32 {
    if probes && words.contains("when the motion began") {
        4
    } else if probes && words.contains("before the motion ended") {
        5
    } else if homes {
        8
    } else if words.contains("travel ends at") {
        2
    } else {
        1
    }
}
