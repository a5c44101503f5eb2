//! The operator's commands.

use std::fmt;
use std::sync::atomic::Ordering::Relaxed;

use tandem_rings::Controls;

/// One command. It acts in the next fine period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Feed hold, on the path.
    Hold,
    /// Goes on after a hold.
    Resume,
    /// Feed override, 1 for the programmed feed.
    FeedOverride(f64),
    /// Rapid override, 1 for the rapid feed.
    RapidOverride(f64),
    /// Optional stop: whether M1 waits for the operator.
    OptionalStop(bool),
    /// Single block: whether the machine rests at the end of each block.
    SingleBlock(bool),
    /// Emergency stop: ramps out off the path.
    EmergencyStop,
    /// Stop on the path, drop what is queued, and end the program.
    Abort,
    /// Takes a fault back in a session that stands in one: its drives are reset and it goes on from there.
    Reset,
    /// Loads the policy script anew, and takes it out of quarantine.
    ReloadPolicy,
    /// A test's doing: the rough loop does nothing for so many rough periods. Virtual clock only.
    StallRough(u64),
}

impl Command {
    /// Gives the command to the fine loop.
    pub fn give(self, controls: &Controls) {
        match self {
            Self::Hold => controls.hold.store(true, Relaxed),
            Self::Resume => controls.hold.store(false, Relaxed),
            Self::FeedOverride(ratio) => controls.feed_override.store(ratio.max(0.0)),
            Self::RapidOverride(ratio) => controls.rapid_override.store(ratio.clamp(0.0, 1.0)),
            Self::OptionalStop(on) => controls.optional_stop.store(on, Relaxed),
            Self::SingleBlock(on) => controls.single_block.store(on, Relaxed),
            Self::EmergencyStop => controls.emergency_stop.store(true, Relaxed),
            Self::Abort => controls.abort.store(true, Relaxed),
            Self::ReloadPolicy => controls.reload_policy.store(true, Relaxed),
            // A reset is the session's, between two runs: the desk takes it.
            Self::Reset | Self::StallRough(_) => {}
        }
    }
}

/// A command with the tick before which it is given: how a run's commands are recorded and replayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed {
    /// The command acts in this tick.
    pub tick: u64,
    /// The command.
    pub command: Command,
}

impl Timed {
    /// Reads one line `tick,command[,value]`, as in `120,hold`, `300,feed-override,0.5`.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn parse(line: &str) -> Result<Self, String> {
        let mut fields = line.split(',').map(str::trim);
        let tick = fields.next().unwrap_or_default();
        let tick = tick
            .parse()
            .map_err(|_| format!("{tick:?} is not the number of a fine period"))?;
        let name = fields.next().ok_or("a line is tick,command[,value]")?;
        let command = Command::parse(name, fields.next())?;
        fields.next().map_or(Ok(Self { tick, command }), |more| {
            Err(format!("{more:?} is one field too many"))
        })
    }
}

impl fmt::Display for Timed {
    /// The line that [`Timed::parse`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},", self.tick)?;
        match self.command {
            Command::Hold => write!(f, "hold"),
            Command::Resume => write!(f, "resume"),
            Command::FeedOverride(ratio) => write!(f, "feed-override,{ratio}"),
            Command::RapidOverride(ratio) => write!(f, "rapid-override,{ratio}"),
            Command::OptionalStop(on) => write!(f, "optional-stop,{}", u8::from(on)),
            Command::SingleBlock(on) => write!(f, "single-block,{}", u8::from(on)),
            Command::EmergencyStop => write!(f, "emergency-stop"),
            Command::Abort => write!(f, "abort"),
            Command::Reset => write!(f, "reset"),
            Command::ReloadPolicy => write!(f, "reload-policy"),
            Command::StallRough(periods) => write!(f, "stall-rough,{periods}"),
        }
    }
}

impl Command {
    /// The command's name, as [`Command::parse`] reads it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Resume => "resume",
            Self::FeedOverride(_) => "feed-override",
            Self::RapidOverride(_) => "rapid-override",
            Self::OptionalStop(_) => "optional-stop",
            Self::SingleBlock(_) => "single-block",
            Self::EmergencyStop => "emergency-stop",
            Self::Abort => "abort",
            Self::Reset => "reset",
            Self::ReloadPolicy => "reload-policy",
            Self::StallRough(_) => "stall-rough",
        }
    }

    /// Refuses a ratio above what the machine plans for, `max_feed_ratio` (`motion.max_feed_ratio`), or above 1 for
    /// rapids.
    ///
    /// # Errors
    /// The ratio and what it may be.
    pub fn check(self, max_feed_ratio: f64) -> Result<(), String> {
        match self {
            Self::FeedOverride(ratio) if ratio > max_feed_ratio => Err(format!(
                "a feed override of {ratio} is above motion.max_feed_ratio, which is {max_feed_ratio}"
            )),
            Self::RapidOverride(ratio) if ratio > 1.0 => Err(format!(
                "a rapid override of {ratio} is above 1: rapids run at the axes' rapid feeds"
            )),
            _ => Ok(()),
        }
    }

    /// The command called `name`, with its value as text.
    ///
    /// # Errors
    /// There is no such command, or its value is missing, wrong or too much.
    pub fn parse(name: &str, value: Option<&str>) -> Result<Self, String> {
        let number = || -> Result<f64, String> {
            let text = value.ok_or_else(|| format!("{name} needs a value"))?;
            let ratio = text
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite() && *v >= 0.0);
            ratio.ok_or_else(|| format!("{text:?} is not a number of zero or more"))
        };
        let switch = || match value {
            Some("0") => Ok(false),
            Some("1") => Ok(true),
            other => Err(format!(
                "{name} is switched with 1 or 0, not {:?}",
                other.unwrap_or_default()
            )),
        };
        let command = match name {
            "hold" => Self::Hold,
            "resume" => Self::Resume,
            "emergency-stop" => Self::EmergencyStop,
            "abort" => Self::Abort,
            "reset" => Self::Reset,
            "reload-policy" => Self::ReloadPolicy,
            "feed-override" => return number().map(Self::FeedOverride),
            "rapid-override" => return number().map(Self::RapidOverride),
            "optional-stop" => return switch().map(Self::OptionalStop),
            "single-block" => return switch().map(Self::SingleBlock),
            "stall-rough" => return number().map(|periods| Self::StallRough(periods as u64)),
            _ => {
                return Err(format!(
                    "no command is called {name:?}: hold, resume, feed-override, rapid-override, optional-stop, \
                     single-block, abort, emergency-stop, reset, reload-policy, stall-rough"
                ));
            }
        };
        value.map_or(Ok(command), |more| {
            Err(format!("{name} takes no value, not {more:?}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let lines = [
            "1,hold",
            "2,resume",
            "3,feed-override,0.1",
            "4,rapid-override,1",
            "5,optional-stop,1",
        ];
        for line in lines.into_iter().chain([
            "6,single-block,0",
            "7,emergency-stop",
            "8,abort",
            "9,stall-rough,7",
            "10,reload-policy",
        ]) {
            assert_eq!(Timed::parse(line).unwrap().to_string(), line);
        }
    }

    #[test]
    fn lines_of_a_command_file() {
        assert_eq!(
            Timed::parse("120, hold"),
            Ok(Timed {
                tick: 120,
                command: Command::Hold
            })
        );
        assert_eq!(
            Timed::parse("3,feed-override,0.5"),
            Ok(Timed {
                tick: 3,
                command: Command::FeedOverride(0.5)
            })
        );
        assert_eq!(
            Timed::parse("7,single-block,1"),
            Ok(Timed {
                tick: 7,
                command: Command::SingleBlock(true)
            })
        );
        assert_eq!(
            Timed::parse("8,optional-stop,0"),
            Ok(Timed {
                tick: 8,
                command: Command::OptionalStop(false)
            })
        );
        for bad in [
            "",
            "x,hold",
            "1",
            "1,hodl",
            "1,hold,2",
            "1,feed-override",
            "1,feed-override,NaN",
            "1,single-block",
            "1,single-block,on",
            "1,resume,,",
        ] {
            assert!(Timed::parse(bad).is_err(), "{bad}");
        }
    }
}
