//! Machines without their real drives: for commands that move nothing.

use tandem_gcode::Item;
use tandem_machine::{AxisHoming, DriverChoice, Machine, PluginChoice};
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;
use tandem_sdk::Edge;

use crate::error::{HostError, refusal};
use crate::plugins::registry::{Registry, is_real};

/// `machine` with each real driver replaced by what stands in for it: its `stand_in`, else `ideal` drives. What replaces what is
/// told in words, none where nothing is real. Host; allocates.
///
/// # Errors
/// A real driver has no stand-in and there are no ideal drives, or what is to stand in for it is real itself.
pub fn with_stand_ins(
    machine: &Machine,
    registry: &Registry,
    ideal: Option<&str>,
) -> Result<(Machine, Vec<String>), HostError> {
    let mut machine = machine.clone();
    let mut notes = vec![];
    for index in 0..machine.drivers.len() {
        let driver = &machine.drivers[index];
        if !is_real(driver, registry) {
            continue;
        }
        let (title, section) = (driver.title(), driver.section());
        let inputs_at_rest = if driver.stand_in.is_none() {
            inputs_at_rest(&machine)
        } else {
            0
        };
        let stand_in = driver
            .stand_in
            .clone()
            .or_else(|| ideal.map(PluginChoice::named));
        let Some(choice) = stand_in else {
            let cause = format!("driver {title} moves metal, and nothing stands in for it");
            return Err(refusal(&machine, &format!("{section}.stand_in"), cause));
        };
        let replaced = DriverChoice {
            choice,
            inputs_at_rest,
            ..driver.clone()
        };
        if is_real(&replaced, registry) {
            let cause = format!("{} moves metal itself", replaced.choice.plugin);
            return Err(refusal(
                &machine,
                &format!("{section}.stand_in.plugin"),
                cause,
            ));
        }
        notes.push(format!(
            "driver {title} moves metal: {} stands in for it",
            replaced.choice.plugin
        ));
        machine.drivers[index] = replaced;
    }
    Ok((machine, notes))
}

/// Inputs that are 1 as long as nothing trips them: an inverted probe or home switch, and what is normally closed.
fn inputs_at_rest(machine: &Machine) -> u64 {
    let probe = machine
        .probe
        .filter(|probe| probe.inverted)
        .map(|probe| probe.input);
    let switches = machine
        .homing
        .iter()
        .filter_map(AxisHoming::switch)
        .filter(|switch| switch.inverted);
    let roles = machine
        .inputs
        .iter()
        .filter(|input| input.role.is_some() && input.normally_closed);
    let all = probe
        .into_iter()
        .chain(switches.map(|switch| switch.input))
        .chain(roles.map(|input| input.input));
    all.fold(0, |mask, input| mask | 1 << input.min(63))
}

/// A stream whose motion towards an edge ends at its end, with the edge there, where the edge does not come: what stands in for
/// real drives has nothing to touch.
pub struct AssumedEdges<S>(pub S);

impl<S: Source> Source for AssumedEdges<S> {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let before = items.len();
        let more = self.0.next_items(items)?;
        for item in &mut items[before..] {
            if let Item::Block(block, _) = item
                && block.stop_on.edge != Edge::None
            {
                block.stop_on.miss_is_fault = 0;
            }
        }
        Ok(more)
    }

    fn provide_input(&mut self, value: f64) {
        self.0.provide_input(value);
    }

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        if rest.cause != RestCause::Missed {
            return self.0.provide_rest(rest);
        }
        self.0.provide_rest(&Rest {
            cause: RestCause::Edge,
            latch: Some(rest.position),
            ..*rest
        })
    }
}
