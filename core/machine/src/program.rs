//! `[program]`.

use std::path::PathBuf;

use crate::section::Section;

/// Lines that a program with O-words may execute where the machine does not say: some ten seconds of checking.
const DEFAULT_MAX_STEPS: u32 = 50_000_000;

/// What part programs may use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramRules {
    /// The folder of files of subroutines, if there is one.
    pub subroutine_path: Option<PathBuf>,
    /// Lines that a program with O-words may execute in the check.
    pub max_steps: u32,
}

impl ProgramRules {
    pub(crate) fn read(program: &Section<'_>) -> Self {
        Self {
            subroutine_path: program.text("subroutine_path").map(PathBuf::from),
            max_steps: program.whole("max_steps", 1, u32::MAX).unwrap_or(DEFAULT_MAX_STEPS),
        }
    }
}
