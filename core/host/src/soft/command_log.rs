//! The operator's commands as the samples show them: each with the tick in which it acted.

use tandem_rings::{OperatorInputs, Sample};

use crate::soft::command::{Command, Timed};

/// Compares what the operator asks for from sample to sample.
#[derive(Debug)]
pub struct CommandLog {
    last: OperatorInputs,
}

impl CommandLog {
    /// Nothing has changed against `given`.
    pub fn new(given: OperatorInputs) -> Self {
        Self { last: given }
    }

    /// The commands that acted in the period of `sample`, where there are any. Given again as a command file they have the same effect.
    #[inline]
    pub fn sample(&mut self, sample: &Sample) -> Option<impl Iterator<Item = Timed> + use<>> {
        // Hardly any sample has one.
        (sample.given != self.last).then(|| {
            let tick = sample.tick;
            let last = std::mem::replace(&mut self.last, sample.given);
            changes(&last, &sample.given).map(move |command| Timed { tick, command })
        })
    }
}

/// The commands that make `now` of `last`.
fn changes(last: &OperatorInputs, now: &OperatorInputs) -> impl Iterator<Item = Command> + use<> {
    // An abort ends the hold by itself.
    let resumed = last.hold && !now.hold && !last.abort;
    let changes = [
        (now.feed_override != last.feed_override)
            .then_some(Command::FeedOverride(now.feed_override)),
        (now.rapid_override != last.rapid_override)
            .then_some(Command::RapidOverride(now.rapid_override)),
        (now.optional_stop != last.optional_stop)
            .then_some(Command::OptionalStop(now.optional_stop)),
        (now.single_block != last.single_block).then_some(Command::SingleBlock(now.single_block)),
        (now.hold && !last.hold).then_some(Command::Hold),
        resumed.then_some(Command::Resume),
        (now.abort && !last.abort).then_some(Command::Abort),
        (now.emergency_stop && !last.emergency_stop).then_some(Command::EmergencyStop),
    ];
    changes.into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_change_is_told_once_in_its_tick() {
        let mut log = CommandLog::new(OperatorInputs::default());
        let mut told = |tick, given| {
            log.sample(&Sample {
                tick,
                given,
                ..Sample::default()
            })
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
        };
        assert!(told(0, OperatorInputs::default()).is_empty());
        let held = OperatorInputs {
            hold: true,
            feed_override: 0.5,
            ..OperatorInputs::default()
        };
        let expected =
            [Command::FeedOverride(0.5), Command::Hold].map(|command| Timed { tick: 1, command });
        assert_eq!(told(1, held), expected);
        assert!(told(2, held).is_empty());
        assert_eq!(
            told(
                3,
                OperatorInputs {
                    hold: false,
                    ..held
                }
            ),
            [Timed {
                tick: 3,
                command: Command::Resume
            }]
        );
        assert_eq!(
            told(
                4,
                OperatorInputs {
                    abort: true,
                    ..held
                }
            )[1]
            .command,
            Command::Abort
        );
        assert!(
            told(
                5,
                OperatorInputs {
                    hold: false,
                    ..held
                }
            )
            .is_empty(),
            "the abort has ended the hold"
        );
    }
}
