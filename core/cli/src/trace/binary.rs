//! A binary trace that is read from a file, and what is wrong with it.

use std::fs::File;
use std::path::{Path, PathBuf};

use tandem_trace::{Damage, Ending, Header, Item, Reader, Record};

/// Damaged places that are told one by one.
const TOLD: u64 = 20;

/// Reads a trace and tells of damage as it comes.
pub struct Binary {
    path: PathBuf,
    reader: Reader<File>,
    /// Damaged places so far.
    places: u64,
    /// Records that they are known to have cost.
    lost_records: u64,
    /// The operator's commands so far, as lines of a command file.
    pub commands: Vec<String>,
}

impl Binary {
    /// Opens a trace.
    ///
    /// # Errors
    /// The path with the byte and the cause.
    pub fn open(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let reader = Reader::new(file).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Self {
            path: path.to_owned(),
            reader,
            places: 0,
            lost_records: 0,
            commands: vec![],
        })
    }

    /// What the trace is of.
    pub fn header(&self) -> &Header {
        self.reader.header()
    }

    /// Number of the format that it is written in.
    pub fn format(&self) -> u32 {
        self.reader.format()
    }

    /// The next sound record.
    ///
    /// # Errors
    /// The path with the byte and the system's words.
    pub fn next(&mut self) -> Result<Option<Record>, String> {
        loop {
            match self
                .reader
                .next()
                .transpose()
                .map_err(|e| format!("{}: {e}", self.path.display()))?
            {
                Some(Item::Damage(damage)) => self.tell(&damage),
                Some(Item::Command(line)) => self.commands.push(line),
                Some(Item::Record(record)) => return Ok(Some(record)),
                None => return Ok(None),
            }
        }
    }

    /// Whether every record was read up to the closing one; known once all is read.
    pub fn is_whole(&self) -> bool {
        self.places == 0 && self.reader.ending() == Some(Ending::Complete)
    }

    /// How the trace is, in words; known once all is read.
    pub fn verdict(&self) -> String {
        let damage = match self.places {
            0 => String::new(),
            places => format!(
                ", damaged in {places} places, at least {} records lost",
                self.lost_records
            ),
        };
        match self.reader.ending() {
            Some(Ending::Truncated { byte }) => {
                format!("truncated at byte {byte}: the closing record is missing{damage}")
            }
            _ => format!("complete{damage}"),
        }
    }

    /// Says on standard error what is wrong, if anything is. Exit status 0 for a whole trace, 1 for another.
    pub fn conclude(&self) -> u8 {
        if self.is_whole() {
            return 0;
        }
        say!("{}: {}", self.path.display(), self.verdict());
        crate::REFUSED
    }

    fn tell(&mut self, damage: &Damage) {
        let Damage {
            from,
            to,
            lost_records,
            cause,
        } = damage;
        self.places += 1;
        self.lost_records += lost_records.unwrap_or(0);
        if self.places <= TOLD {
            let lost =
                lost_records.map_or("the rest".to_string(), |count| format!("{count} records"));
            say!(
                "{}: bytes {from} to {to}: {cause}; {lost} lost",
                self.path.display()
            );
        }
    }
}
