//! Machines without their real drives: for commands that move nothing.

use tandem_gcode::Item;
use tandem_machine::{DriverChoice, Machine, PluginChoice};
use tandem_rings::{Rest, RestCause};
use tandem_rough::Source;
use tandem_sdk::Edge;

use crate::error::HostError;
use crate::registry::Registry;
use crate::rules::refusal;
use crate::setup;

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
    let (mut machine, mut notes) = (machine.clone(), vec![]);
    for index in 0..machine.drivers.len() {
        let driver = &machine.drivers[index];
        if !setup::is_real(driver, registry) {
            continue;
        }
        let (title, section) = (driver.title(), driver.section());
        let stand_in = driver.stand_in.clone().or_else(|| ideal.map(PluginChoice::named));
        let Some(choice) = stand_in else {
            let cause = format!("driver {title} moves metal, and nothing stands in for it");
            return Err(refusal(&machine, &format!("{section}.stand_in"), cause));
        };
        let replaced = DriverChoice { choice, ..driver.clone() };
        if setup::is_real(&replaced, registry) {
            let cause = format!("{} moves metal itself", replaced.choice.plugin);
            return Err(refusal(&machine, &format!("{section}.stand_in.plugin"), cause));
        }
        notes.push(format!("driver {title} moves metal: {} stands in for it", replaced.choice.plugin));
        machine.drivers[index] = replaced;
    }
    Ok((machine, notes))
}

/// A stream whose motion towards an edge ends at its end, with the edge there, where the edge does not come: what stands in for
/// real drives has nothing to touch.
pub struct AssumedEdges<S>(pub S);

impl<S: Source> Source for AssumedEdges<S> {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let before = items.len();
        let more = self.0.next_items(items)?;
        for item in &mut items[before..] {
            if let Item::Block(block) = item
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
        self.0.provide_rest(&Rest { cause: RestCause::Edge, latch: Some(rest.position), ..*rest })
    }
}
