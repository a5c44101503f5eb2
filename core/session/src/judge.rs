//! Lines of G-code by hand, judged before anything of them moves.

use tandem_gcode::{Interpreter, Item};
use tandem_host::check_block;
use tandem_machine::Machine;
use tandem_sdk::{NurbsData, Planner};

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

    /// The items of line `number`, and the interpreter as it is behind the line, where every block of it can be driven;
    /// `before` stays what it was. M2 is left out: it ends a program, and not what an operator has to say. Soft side; allocates.
    ///
    /// # Errors
    /// What is wrong with the line, with its place.
    pub fn judge(
        &self,
        before: &Interpreter,
        number: u32,
        text: &str,
    ) -> Result<(Interpreter, Vec<Item>), String> {
        let (mut tried, mut items) = (before.clone(), vec![]);
        tried
            .line(number, text.as_bytes(), &mut items)
            .map_err(|e| e.to_string())?;
        for item in &items {
            self.check(item)
                .map_err(|why| format!("input:{number}: {why}"))?;
        }
        items.retain(|item| !matches!(item, Item::End));
        tried.go_on();
        Ok((tried, items))
    }

    fn check(&self, item: &Item) -> Result<(), String> {
        let Item::Block(block, curve) = item else {
            return Ok(());
        };
        let curve = curve.as_deref().map(NurbsData::curve);
        check_block(&self.machine, self.planner.as_ref(), block, curve)
    }
}
