//! Command samples of a trace in either format.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use tandem_host::TraceCsv;
use tandem_trace::MAGIC;

use super::binary::Binary;
use super::sink::is_binary_name;

/// One command sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the fine period, where it is known.
    pub tick: Option<u64>,
    /// Its time, s.
    pub t_s: f64,
    /// One value for each of the columns.
    pub values: Vec<f64>,
}

/// A trace whose command samples are read.
pub enum Samples {
    /// In the binary format.
    Binary(Box<Binary>),
    /// As CSV.
    Csv(Box<Csv>),
}

impl Samples {
    /// Opens a trace of either format: binary where its name or its first bytes say so.
    ///
    /// # Errors
    /// The path with the place and the cause.
    pub fn open(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let mut start = vec![];
        file.take(MAGIC.len() as u64).read_to_end(&mut start).map_err(|e| format!("{}: {e}", path.display()))?;
        if is_binary_name(path) || start == MAGIC {
            return Ok(Self::Binary(Box::new(Binary::open(path)?)));
        }
        Ok(Self::Csv(Box::new(Csv::open(path)?)))
    }

    /// Whether rotary axes come in rad, bit for bit, where `shown` is not asked for.
    pub fn is_binary(&self) -> bool {
        matches!(self, Self::Binary(_))
    }

    /// Names of the command columns; `shown` as in a CSV, in degrees, instead of as stored, in rad.
    pub fn columns(&self, shown: bool) -> Vec<String> {
        match self {
            Self::Csv(csv) => csv.columns.iter().map(|(name, _)| name.clone()).collect(),
            Self::Binary(binary) => {
                let axes = binary.header().axes;
                let unit = |axis| match (axes.is_rotary(axis), shown) {
                    (false, _) => "mm",
                    (true, true) => "deg",
                    (true, false) => "rad",
                };
                let name = |axis| format!("{}_cmd_{}", axes.letter(axis).to_ascii_lowercase(), unit(axis));
                (0..axes.count()).map(name).collect()
            }
        }
    }

    /// The next row; `shown` as in a CSV, in degrees, instead of as stored, in rad.
    ///
    /// # Errors
    /// The path with the place and the cause.
    pub fn next(&mut self, shown: bool) -> Result<Option<Row>, String> {
        let binary = match self {
            Self::Csv(csv) => return csv.next(),
            Self::Binary(binary) => binary,
        };
        let Some(record) = binary.next()? else { return Ok(None) };
        let (axes, period_s) = (binary.header().axes, binary.header().fine_period_s);
        let command = record.sample.command;
        let value = |axis| if axes.is_rotary(axis) && shown { command[axis].to_degrees() } else { command[axis] };
        let values = (0..axes.count()).map(value).collect();
        let tick = record.sample.tick;
        Ok(Some(Row { tick: Some(tick), t_s: TraceCsv::t_s(tick, period_s), values }))
    }

    /// Exit status once all is read: 1 where not every sample could be, which is then said.
    pub fn conclude(&self) -> u8 {
        match self {
            Self::Binary(binary) => binary.conclude(),
            Self::Csv(_) => 0,
        }
    }
}

/// A trace CSV.
pub struct Csv {
    path: PathBuf,
    rows: csv::StringRecordsIntoIter<File>,
    time: usize,
    /// Name and place of each command column.
    columns: Vec<(String, usize)>,
    /// Time of the row before, s.
    last_t_s: Option<f64>,
    /// Fine period, s, as the first two rows tell it.
    period_s: Option<f64>,
}

impl Csv {
    fn open(path: &Path) -> Result<Self, String> {
        let say = |error: csv::Error| format!("{}: {error}", path.display());
        let mut reader = csv::Reader::from_path(path).map_err(say)?;
        let head = reader.headers().map_err(say)?;
        let time = head.iter().position(|name| name == "t_s");
        let time = time.ok_or_else(|| format!("{}: no trace: it has no column t_s", path.display()))?;
        let commands = head.iter().enumerate().filter(|(_, name)| name.contains("_cmd_"));
        let columns = commands.map(|(index, name)| (name.to_string(), index)).collect();
        let rows = reader.into_records();
        Ok(Self { path: path.to_owned(), rows, time, columns, last_t_s: None, period_s: None })
    }

    fn next(&mut self) -> Result<Option<Row>, String> {
        let Some(row) = self.rows.next() else { return Ok(None) };
        let row = row.map_err(|e| format!("{}: {e}", self.path.display()))?;
        let number = |index: usize| {
            let text = &row[index];
            let line = row.position().map_or(0, csv::Position::line);
            text.parse::<f64>().map_err(|_| format!("{}:{line}: {text:?} is no number", self.path.display()))
        };
        let t_s = number(self.time)?;
        let values = self.columns.iter().map(|(_, index)| number(*index)).collect::<Result<_, _>>()?;
        self.period_s = self.period_s.or_else(|| self.last_t_s.map(|last_t_s| t_s - last_t_s));
        self.last_t_s = Some(t_s);
        let tick = if t_s == 0.0 { Some(0) } else { self.period_s.map(|period_s| (t_s / period_s).round() as u64) };
        Ok(Some(Row { tick, t_s, values }))
    }
}
