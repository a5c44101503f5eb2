//! The verdict for people.

use std::fmt;

use super::{Finding, Kind, Maxima, Outcome, Verdict};
use crate::LETTERS;

/// Findings shown before the rest is only counted.
const SHOWN: usize = 20;

impl fmt::Display for Verdict {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.outcome {
            Outcome::Pass => writeln!(out, "PASS")?,
            Outcome::Fail => writeln!(out, "FAIL: {} findings", self.findings.len())?,
            Outcome::NotJudged { .. } => writeln!(out, "NOT JUDGED")?,
        }
        if let Some(reason) = &self.not_judged {
            writeln!(out, "not judged: {reason}")?;
        }
        for finding in self.findings.iter().take(SHOWN) {
            writeln!(out, "{finding}")?;
        }
        if self.findings.len() > SHOWN {
            writeln!(out, "and {} more", self.findings.len() - SHOWN)?;
        }
        write!(out, "{}", self.maxima)
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            out,
            "sample {} ({:.6} s, line {}): ",
            self.sample, self.t_s, self.line
        )?;
        match (&self.joint, self.axis) {
            (Some(joint), _) => write!(out, "joint {joint} ")?,
            (None, Some(axis)) => write!(out, "{} ", LETTERS[axis])?,
            (None, None) => {}
        }
        let (what, unit) = self.kind.describe();
        write!(
            out,
            "{what}: {:.9} {unit}, limit {:.9}",
            self.value, self.limit
        )
    }
}

impl Kind {
    fn describe(self) -> (&'static str, &'static str) {
        match self {
            Self::NotFinite => ("no finite number", ""),
            Self::Period => ("time since the row before", "s"),
            Self::StartPoint => ("start point off", "mm|deg"),
            Self::Travel => ("beyond travel", "mm|deg"),
            Self::Velocity => ("speed", "mm|deg/s"),
            Self::Acceleration => ("acceleration", "mm|deg/s²"),
            Self::SpeedStep => ("speed step", "mm|deg/s"),
            Self::Jerk => ("jerk", "mm|deg/s³"),
            Self::Feed => ("above the programmed feed", "mm|deg/s"),
            Self::PathDeviation => ("off the path", "mm"),
            Self::VertexMissed => ("vertex missed", "mm"),
            Self::NotCovered => ("path left out", "mm"),
            Self::EndPoint => ("end point off", "mm|deg"),
        }
    }
}

impl fmt::Display for Maxima {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axes = self
            .axes
            .iter()
            .map(|axis| (LETTERS[axis.axis].to_string(), axis));
        let joints = self
            .joints
            .iter()
            .map(|(name, joint)| (format!("joint {name}"), joint));
        for (name, axis) in axes.chain(joints) {
            writeln!(
                out,
                "{name}: speed {:.6} /s, acceleration {:.6} /s², step {:.6} /s, jerk {:.3} /s³",
                axis.velocity_mm_per_s,
                axis.acceleration_mm_per_s2,
                axis.speed_step_mm_per_s,
                axis.jerk_mm_per_s3
            )?;
        }
        write!(
            out,
            "feed ratio {:.6}, samples off path {:.3e} mm, vertices {:.3e} mm, exact stops {:.3e} mm, end {:.3e}",
            self.feed_ratio,
            self.sample_deviation_mm,
            self.vertex_deviation_mm,
            self.exact_stop_error_mm,
            self.end_error_mm
        )
    }
}
