//! Jogs, and as operators say them: letters, mm or deg, minutes.

use tandem_sdk::{Axes, AxisVector};

/// How far a jog goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// Towards the end of the travel, as long as it is kept alive.
    On {
        /// Towards higher positions.
        positive: bool,
    },
    /// By a distance, with its sign.
    By {
        /// The distance, mm or rad.
        distance_mm: f64,
    },
}

/// One jog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jog {
    /// Index of the axis.
    pub axis: usize,
    /// How far.
    pub reach: Reach,
    /// Feed, mm/s or rad/s.
    pub feed_mm_per_s: f64,
}

/// How a jog came to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JogEnd {
    /// Its distance is driven.
    Arrived,
    /// It has come to the end of the travel.
    AtLimit,
    /// The operator has let go, aborted, or asked for another jog.
    LetGo,
    /// Nobody has kept it alive in time.
    Late,
}

/// A jog that is over: the machine rests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogRest {
    /// Index of the axis that moved.
    pub axis: usize,
    /// How.
    pub end: JogEnd,
    /// Where the machine stands, mm or rad.
    pub position: AxisVector,
}

/// How far, as it is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReachMessage {
    /// On, towards plus or minus.
    On {
        /// Towards plus.
        positive: bool,
    },
    /// By a distance, with its sign, mm or deg.
    By(f64),
}

/// A jog as it is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JogMessage {
    /// The axis, upper or lower case.
    pub axis: char,
    /// How far.
    pub reach: ReachMessage,
    /// Feed, mm/min or deg/min.
    pub feed_per_min: f64,
    /// Whether the units were named, and are degrees; without a word they are those of the axis.
    pub degrees: Option<bool>,
}

impl JogMessage {
    /// The jog on a machine with these axes.
    ///
    /// # Errors
    /// There is no such axis, the units are those of the other kind, or a number makes no sense.
    pub fn on(&self, axes: &Axes) -> Result<Jog, String> {
        let letter = self.axis.to_ascii_lowercase();
        let axis = axes
            .index(letter.to_ascii_uppercase())
            .ok_or_else(|| no_axis(axes, self.axis))?;
        let rotary = axes.is_rotary(axis);
        if self.degrees.is_some_and(|degrees| degrees != rotary) {
            let (kind, unit) = if rotary {
                ("rotary", "deg")
            } else {
                ("linear", "mm")
            };
            return Err(format!(
                "{letter} is a {kind} axis: its feed and distance are in {unit}"
            ));
        }
        let scale = if rotary { 1f64.to_radians() } else { 1.0 };
        if !(self.feed_per_min.is_finite() && self.feed_per_min > 0.0) {
            return Err(format!("a feed of {} is not above zero", self.feed_per_min));
        }
        let reach = match self.reach {
            ReachMessage::On { positive } => Reach::On { positive },
            ReachMessage::By(distance) if distance.is_finite() && distance != 0.0 => Reach::By {
                distance_mm: distance * scale,
            },
            ReachMessage::By(distance) => {
                return Err(format!("a distance of {distance} goes nowhere"));
            }
        };
        Ok(Jog {
            axis,
            reach,
            feed_mm_per_s: self.feed_per_min * scale / 60.0,
        })
    }
}

fn no_axis(axes: &Axes, asked: char) -> String {
    let all: Vec<String> = (0..axes.count())
        .map(|i| axes.letter(i).to_ascii_lowercase().to_string())
        .collect();
    format!("the machine has no axis {asked}; it has {}", all.join(", "))
}
