//! The first pass: the whole program, before anything moves.

use std::sync::Arc;

use tandem_sdk::{Block, Curve, NurbsData};

use crate::config::Config;
use crate::diagnostic::{Diagnostic, Severity};
use crate::flow::{Execution, Step};
use crate::item::Item;
use crate::line_error::{LineError, Span};
use crate::program::lines::{Next, Pass};
use crate::program::{Program, ProgramError};

/// Most errors that are listed.
pub const MAX_DIAGNOSTICS: usize = 1000;
/// Errors of numbers: where a number follows from an assumed answer, only the run can tell.
const OF_NUMBERS: [&str; 11] = [
    "arithmetic",
    "travel",
    "arc-ends",
    "arc-radius",
    "word-range",
    "tool",
    "time-constant",
    "feed-missing",
    "parameter-number",
    "not-finite",
    "probe-distance",
];

/// What the first pass found.
#[derive(Clone, Debug, Default)]
pub struct CheckReport {
    /// The first [`MAX_DIAGNOSTICS`] errors, in the order of the lines. A missing feed is listed once.
    pub diagnostics: Vec<Diagnostic>,
    /// Number of errors beyond those.
    pub unlisted: u64,
    /// What does not keep the program from being driven, but is worth to be known.
    pub warnings: Vec<Diagnostic>,
    /// Lines read: to the end of the program.
    pub lines: u32,
    /// Blocks, dwells included.
    pub blocks: u64,
    /// Length of all paths, mm (a block that only turns counts in rad).
    pub length_mm: f64,
    /// Lines whose numbers follow from what a probe or an input will answer: the run judges them when it comes to them.
    pub open_lines: u64,
    /// Where the check ended because the program's way depends on what a probe or an input will answer (a branch, a loop or
    /// a call): the line. What the program does after it is checked when it is driven.
    pub seen_to: Option<u32>,
}

impl CheckReport {
    /// Whether the program may run.
    pub fn is_ok(&self) -> bool {
        self.diagnostics.is_empty()
    }

    fn add(&mut self, diagnostic: Diagnostic) {
        // A line that is executed again says nothing new.
        if self.diagnostics.contains(&diagnostic) {
            return;
        }
        let once = |d: &Diagnostic| d.code == "feed-missing" && diagnostic.code == d.code;
        if self.diagnostics.len() >= MAX_DIAGNOSTICS || self.diagnostics.iter().any(once) {
            self.unlisted += 1;
        } else {
            self.diagnostics.push(diagnostic);
        }
    }
}

/// Asks whether a block, with its curve where it is a NURBS, can be driven; says why not.
pub type PerBlock<'a> = dyn FnMut(&Block, Option<Curve<'_>>) -> Result<(), String> + 'a;

/// Runs the whole of `program` on the machine `config`. Each block goes to `per_block` (a policy, a planner's check),
/// whose refusal becomes an error of the block's line. M66 is taken to have timed out, a probe to
/// have touched at its end; what is wrong with numbers that follow from that is left to the run.
///
/// # Errors
/// The file cannot be read. What is wrong with the program is in the report.
pub fn check(
    program: &mut Program,
    config: &Config,
    per_block: &mut PerBlock<'_>,
) -> Result<CheckReport, ProgramError> {
    program.subroutines.clear();
    let mut pass = FirstPass::new(program, config, per_block);
    match pass.run(program) {
        Ok(()) => {}
        Err(ProgramError::Text(diagnostic)) => pass.report.add(*diagnostic),
        Err(other) => return Err(other),
    }
    pass.report
        .warnings
        .extend(pass.execution.interpreter.notes());
    Ok(pass.report)
}

struct FirstPass<'a> {
    execution: Execution,
    per_block: &'a mut PerBlock<'a>,
    items: Vec<Item>,
    report: CheckReport,
}

impl<'a> FirstPass<'a> {
    fn new(program: &mut Program, config: &Config, per_block: &'a mut PerBlock<'a>) -> Self {
        let execution = Execution::new(program, config, Pass::First);
        Self {
            execution,
            per_block,
            items: Vec::new(),
            report: CheckReport::default(),
        }
    }

    fn run(&mut self, program: &mut Program) -> Result<(), ProgramError> {
        while !self.execution.interpreter.ended() {
            self.items.clear();
            let step = self.execution.step(program, &mut self.items)?;
            self.report.lines = self.report.lines.max(self.execution.lines().number);
            match step {
                Step::Line => self.line(program, None),
                Step::Wrong(diagnostic) => self.line(program, Some(diagnostic)),
                Step::Stuck(diagnostic) => {
                    self.report.add(*diagnostic);
                    return Ok(());
                }
                Step::Open(warning) => {
                    self.report.seen_to = Some(warning.line);
                    self.report.warnings.push(*warning);
                    return Ok(());
                }
                Step::End => break,
            }
        }
        self.look_behind_percent(program)?;
        self.items.clear();
        self.execution.interpreter.finish(&mut self.items)?;
        self.take_items(program);
        Ok(())
    }

    /// Where `%` ended the program: text behind it is not driven, which nobody may find out by what is missing. RS274/NGC
    /// lets a program that begins with `%` end at the second one, whatever follows; a `%` that closes what none opened
    /// may only be the last text of the file.
    fn look_behind_percent(&mut self, program: &mut Program) -> Result<(), ProgramError> {
        let Some((percent, opened)) = self.execution.interpreter.ended_by_percent() else {
            return Ok(());
        };
        loop {
            let next = self.execution.lines().next(program);
            let lines = self.execution.lines();
            let found = match next {
                Ok(Next::End) => return Ok(()),
                Ok(Next::Line(range)) => {
                    let number = lines.number;
                    let text = lines.text(&range).to_vec();
                    let text = &text[..];
                    let Some(at) = self.execution.interpreter.first_text(text) else {
                        continue;
                    };
                    let message = if opened {
                        format!(
                            "this and all that follows is not driven: the % of line {percent} has ended the program"
                        )
                    } else {
                        format!(
                            "text behind the % of line {percent}: % ends a program that begins with it, \
                             and this one does not; what follows would not be driven"
                        )
                    };
                    let error =
                        LineError::new(Span::new(at, text.len()), "behind-percent", message);
                    Diagnostic::new(&program.name, number, text, error)
                }
                Ok(Next::Bad(diagnostic)) | Err(ProgramError::Text(diagnostic)) => *diagnostic,
                Err(other) => return Err(other),
            };
            if opened {
                self.report.warnings.push(Diagnostic {
                    severity: Severity::Warning,
                    ..found
                });
            } else {
                self.report.add(found);
            }
            return Ok(());
        }
    }

    /// A line has been executed, or could not be.
    fn line(&mut self, program: &Program, wrong: Option<Box<Diagnostic>>) {
        let interpreter = &mut self.execution.interpreter;
        let open = interpreter.is_assumed();
        if self.items.iter().any(Item::is_probe) {
            interpreter.assume_probe();
        }
        self.report.open_lines += u64::from(open);
        if let Some(diagnostic) = wrong
            && !(open && OF_NUMBERS.contains(&diagnostic.code))
        {
            self.report.add(*diagnostic);
        }
        self.take_items(program);
    }

    fn take_items(&mut self, program: &Program) {
        let text = self.execution.text();
        let mut waits = false;
        for item in &self.items {
            match item {
                Item::Block(block, curve) => {
                    // A curve takes more lines than the one that is read.
                    let text = if curve.is_some() { b"" } else { text };
                    let curve = curve.as_deref().map(NurbsData::curve);
                    judge_block(
                        &mut self.report,
                        &mut self.per_block,
                        (block, curve),
                        (&program.name, text),
                    );
                }
                Item::Wait(_) => waits = true,
                Item::Event(_) | Item::Command(_) | Item::Stated { .. } | Item::End => {}
            }
        }
        if waits {
            self.execution.interpreter.assume_input();
        }
    }
}

/// Counts a block and asks whether the planner can drive it. `place` is the program and the text of the block's line.
fn judge_block(
    report: &mut CheckReport,
    per_block: &mut PerBlock<'_>,
    (block, curve): (&Block, Option<Curve<'_>>),
    place: (&Arc<str>, &[u8]),
) {
    report.blocks += 1;
    report.length_mm += block.length_mm;
    if let Err(why) = per_block(block, curve) {
        report.add(Diagnostic::whole_line(
            place.0,
            block.line,
            place.1,
            "block-refused",
            why,
        ));
    }
}
