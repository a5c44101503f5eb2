//! `[program]` and `[user_commands]`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::section::Section;

/// Lines that a program with O-words may execute where the machine does not say: some ten seconds of checking.
const DEFAULT_MAX_STEPS: u32 = 50_000_000;

/// Time that a command of the machine's own has where the machine does not say, s.
const DEFAULT_TIME_LIMIT_S: f64 = 60.0;

/// `M101 = "program"`.
fn command(commands: &Section<'_>, key: &str) -> Option<(u32, PathBuf)> {
    if key == "time_limit_s" {
        return None;
    }
    let number = key.strip_prefix('M').and_then(|number| number.parse().ok());
    let Some(number) = number.filter(|number| (100..=199).contains(number)) else {
        commands.refuse(key, "the commands of a machine are M100 to M199");
        return None;
    };
    commands
        .text(key)
        .map(|program| (number, PathBuf::from(program)))
}

/// What part programs may use.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramRules {
    /// The folder of files of subroutines, if there is one.
    pub subroutine_path: Option<PathBuf>,
    /// Lines that a program with O-words may execute in the check.
    pub max_steps: u32,
    /// What the words M100 to M199 run, by their numbers.
    pub user_commands: BTreeMap<u32, PathBuf>,
    /// Time that such a command has, s.
    pub user_command_time_limit_s: f64,
}

impl ProgramRules {
    pub(crate) fn read(program: &Section<'_>, commands: &Section<'_>) -> Self {
        Self {
            subroutine_path: program.text("subroutine_path").map(PathBuf::from),
            max_steps: program
                .whole("max_steps", 1, u32::MAX)
                .unwrap_or(DEFAULT_MAX_STEPS),
            user_commands: commands
                .keys()
                .filter_map(|key| command(commands, key))
                .collect(),
            user_command_time_limit_s: commands
                .positive("time_limit_s")
                .unwrap_or(DEFAULT_TIME_LIMIT_S),
        }
    }
}
