//! Lines of G-code by hand, judged before anything of them moves.

use std::fmt;

use tandem_gcode::{Diagnostic, Interpreter, Item};
use tandem_host::check_block;
use tandem_machine::Machine;
use tandem_sdk::{NurbsData, Planner};

/// Why a line is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Short stable name of the error; `planner` where the planner does not take a block of it.
    pub code: &'static str,
    /// The cause in words, in one line, without a place.
    pub cause: String,
    /// The same with place and text of the line.
    text: String,
}

impl Refusal {
    fn of_planner(number: u32, cause: String) -> Self {
        Self {
            code: "planner",
            text: format!("input:{number}: {cause}"),
            cause,
        }
    }

    /// One that is for people alone.
    pub fn of(code: &'static str, cause: impl Into<String>) -> Self {
        let cause = cause.into();
        Self {
            code,
            text: cause.clone(),
            cause,
        }
    }
}

impl From<Diagnostic> for Refusal {
    fn from(diagnostic: Diagnostic) -> Self {
        Self {
            code: diagnostic.code,
            text: diagnostic.to_string(),
            cause: diagnostic.message,
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// A line of which every block can be driven.
pub struct JudgedLine {
    /// The interpreter as it is behind it.
    pub behind: Interpreter,
    /// What it orders; that a program ends is left out, which is not what an operator has to say.
    pub items: Vec<Item>,
    /// It ends a program: M2, M30, a `%` that closes.
    pub ends: bool,
}

/// Judges lines as the planner and the machine will have to drive them.
pub struct LineJudge {
    machine: Machine,
    /// A planner that only judges blocks.
    planner: Box<dyn Planner>,
}

impl LineJudge {
    /// For `machine`, whose planner drives the lines. Host; allocates.
    pub fn new(machine: Machine, planner: Box<dyn Planner>) -> Self {
        Self { machine, planner }
    }

    /// Line `number`, where every block of it can be driven; `before` stays what it was. Soft side; allocates.
    ///
    /// # Errors
    /// What is wrong with the line, with its place.
    pub fn judge(
        &self,
        before: &Interpreter,
        number: u32,
        text: &str,
    ) -> Result<JudgedLine, Refusal> {
        let mut tried = before.clone();
        let mut items = vec![];
        tried.line(number, text.as_bytes(), &mut items)?;
        for item in &items {
            self.check(item)
                .map_err(|why| Refusal::of_planner(number, why))?;
        }
        items.retain(|item| !matches!(item, Item::End));
        let ends = tried.ended();
        tried.go_on();
        Ok(JudgedLine {
            behind: tried,
            items,
            ends,
        })
    }

    fn check(&self, item: &Item) -> Result<(), String> {
        let Item::Block(block, curve) = item else {
            return Ok(());
        };
        let curve = curve.as_deref().map(NurbsData::curve);
        check_block(&self.machine, self.planner.as_ref(), block, curve)
    }
}
