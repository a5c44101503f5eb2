//! `tandem state`: what lasts of a machine, to look at and to exchange with LinuxCNC.

mod show;

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use tandem_machine::Machine;
use tandem_state::{AtLine, Change, LinuxCnc, Owner, PersistentState, Reader, Store, default_path};

use crate::args::{Files, Of, State};

/// Does what the subcommand says.
pub fn state(command: &State) -> Result<u8, Box<dyn Error>> {
    match command {
        State::Show { of, last } => show::show(&file(of)?.1, usize::from(*last)),
        State::Export { of, files } => export(of, files),
        State::Import { of, files } => import(of, files),
    }
}

/// The machine, and where its state lies.
fn file(of: &Of) -> Result<(Machine, PathBuf), Box<dyn Error>> {
    let machine = Machine::read(&of.machine.path, &of.machine.overrides)?;
    let path = of
        .state
        .clone()
        .map_or_else(|| default_path(&machine.name), Ok)?;
    Ok((machine, path))
}

fn export(of: &Of, files: &Files) -> Result<u8, Box<dyn Error>> {
    let (machine, path) = file(of)?;
    let reader = Reader::open(&path)?;
    let state = reader.state()?;
    let format = LinuxCnc {
        axes: reader.axes(),
        unit: files.unit.into(),
    };
    if let Some(variables) = &files.variables {
        write(variables, &format.variables(&state, &machine.home))?;
    }
    if let Some(tools) = &files.tools {
        write(tools, &format.tools(&state))?;
        if state
            .tools
            .values()
            .any(|tool| tool.to_program().offset != tool.offset || tool.wear_diameter_mm != 0.0)
        {
            say!(
                "{}: LinuxCNC has no place for wear: it is added to offsets and diameters",
                tools.display()
            );
        }
    }
    Ok(0)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

fn import(of: &Of, files: &Files) -> Result<u8, Box<dyn Error>> {
    let (machine, path) = file(of)?;
    let store = Store::open(&path, Owner::of(&machine))?;
    let mut state = if store.is_new() {
        PersistentState::initial(&machine)
    } else {
        store.load().clone()
    };
    let format = LinuxCnc {
        axes: &machine.axes,
        unit: files.unit.into(),
    };
    let mut left = 0;
    let mut take = |path: &Path, read: &mut dyn FnMut(&str) -> Result<Vec<AtLine>, AtLine>| {
        let shown = path.display();
        let text = fs::read_to_string(path).map_err(|error| format!("{shown}: {error}"))?;
        let not_taken =
            read(&text).map_err(|at| format!("{shown}:{}: error: {}", at.line, at.why))?;
        for at in &not_taken {
            say!("{shown}:{}: warning: {}", at.line, at.why);
        }
        left += not_taken.len();
        Ok::<_, String>(())
    };
    if let Some(variables) = &files.variables {
        take(variables, &mut |text| {
            format.read_variables(text, &mut state)
        })?;
    }
    if let Some(tools) = &files.tools {
        take(tools, &mut |text| format.read_tools(text, &mut state))?;
    }
    let (tools, parameters) = (state.tools.len(), state.parameters.len());
    store.commit(vec![Change::Whole(Box::new(state))])?;
    store.close()?;
    say!(
        "{}: {tools} tools, {parameters} parameters, {left} values not taken over",
        path.display()
    );
    Ok(0)
}
