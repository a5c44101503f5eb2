//! A case from a seed.

use tandem_rig::Random;

use crate::case::Case;
use crate::machine::Planner;
use crate::{commands, machine, program};

/// Draws machine, program and commands; the same for the same seed and planner everywhere.
pub fn draw(seed: u64, planner: Option<Planner>) -> Case {
    // Seeds that follow each other begin alike: a few numbers later they do not.
    let mut random = Random::new(seed);
    (0..8).for_each(|_| _ = random.unit());
    let machine = machine::draw(&mut random, planner);
    let (program, time_s) = program::draw(&mut random, &machine);
    let commands = commands::draw(&mut random, &machine, time_s);
    Case {
        program,
        machine: machine.text,
        commands,
    }
}
