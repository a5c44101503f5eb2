//! A program, a machine and commands as the texts that `tandem run` reads.

use std::fmt::Write;
use std::path::Path;

/// What is run and judged.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Case {
    /// The part program.
    pub program: String,
    /// The machine file. It includes no other.
    pub machine: MachineText,
    /// Operator commands, a line each as in `--commands`.
    pub commands: String,
}

/// The names of the three files in a folder.
const FILES: [&str; 3] = ["program.ngc", "machine.toml", "commands.csv"];

impl Case {
    /// Reads a folder with `program.ngc`, `machine.toml` and, where there are commands, `commands.csv`.
    ///
    /// # Errors
    /// The file that cannot be read, and why.
    pub fn read(folder: &Path) -> Result<Self, String> {
        let read = |name: &str| {
            let path = folder.join(name);
            std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
        };
        let commands = if folder.join(FILES[2]).exists() {
            read(FILES[2])?
        } else {
            String::new()
        };
        Ok(Self {
            program: read(FILES[0])?,
            machine: MachineText::parse(&read(FILES[1])?),
            commands,
        })
    }

    /// Writes the files to a folder, which is made where it is not there.
    ///
    /// # Errors
    /// The file that cannot be written, and why.
    pub fn write(&self, folder: &Path) -> Result<(), String> {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        for (name, text) in
            FILES
                .into_iter()
                .zip([&self.program, &self.machine.text(), &self.commands])
        {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        }
        Ok(())
    }

    /// The command that replays the files of a folder.
    pub fn replay(folder: &Path) -> String {
        let at = |name: &str| folder.join(name).display().to_string();
        let [program, machine, commands] = FILES.map(at);
        format!("tandem run {program} --machine {machine} --commands {commands}")
    }
}

/// A machine file table by table and key by key, so that it can be made smaller.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MachineText {
    /// The tables in their order; the first one has no head.
    pub tables: Vec<TableText>,
}

/// One table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TableText {
    /// The line that begins it, as `[axes.x]`; empty for the keys before the first table.
    pub head: String,
    /// Keys and values as they are written.
    pub keys: Vec<(String, String)>,
}

impl MachineText {
    /// Takes a file apart: a line is a head, a key, or left out.
    pub fn parse(text: &str) -> Self {
        let mut machine = Self {
            tables: vec![TableText::default()],
        };
        for line in text
            .lines()
            .map(str::trim)
            .filter(|line| !line.starts_with('#'))
        {
            if line.starts_with('[') {
                machine.table(line);
            } else if let Some((key, value)) = line.split_once('=') {
                machine.key(key.trim(), value.trim());
            }
        }
        machine
    }

    /// Begins a table.
    pub fn table(&mut self, head: &str) {
        self.tables.push(TableText {
            head: head.to_string(),
            keys: vec![],
        });
    }

    /// Adds a key to the last table.
    pub fn key(&mut self, key: &str, value: impl std::fmt::Display) {
        if self.tables.is_empty() {
            self.tables.push(TableText::default());
        }
        let last = self.tables.len() - 1;
        self.tables[last]
            .keys
            .push((key.to_string(), value.to_string()));
    }

    /// The file.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for table in &self.tables {
            if !table.head.is_empty() {
                writeln!(text, "{}", table.head).expect("a text takes what is written");
            }
            for (key, value) in &table.keys {
                writeln!(text, "{key} = {value}").expect("a text takes what is written");
            }
        }
        text
    }
}
