//! `tandem script`: policy scripts from a first file to a measured module.

mod bench;
mod build;
mod check;
mod doctor;
mod new;
mod sample;
mod toolchain;

use std::error::Error;

use crate::args::Script;

/// Does what the subcommand says.
pub fn script(command: &Script) -> Result<u8, Box<dyn Error>> {
    match command {
        Script::New { name, lang } => new::new(name, *lang).map_err(Into::into),
        Script::Build { source, out } => build::build(source, out.as_deref()).map_err(Into::into),
        Script::Check {
            script,
            machine,
            overrides,
        } => check::check(script, machine.as_deref(), overrides),
        Script::Bench { script, calls } => bench::bench(script, *calls as usize),
        Script::Doctor => Ok(doctor::doctor()),
    }
}
