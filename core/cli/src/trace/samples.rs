//! Samples of a trace in either format, column by column.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use tandem_recorder::{SWITCHED_COLUMNS, TraceCsv, age, outputs_word, rpm};
use tandem_trace::{MAGIC, Record, has_age, has_switched};

use super::binary::Binary;
use super::sink::is_binary_name;

/// The columns of a trace that hold words; all others hold numbers.
const WORDS: [&str; 3] = ["state", "coolant", "outputs"];

/// What stands in a column of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A number.
    Number(f64),
    /// A word.
    Word(Cow<'static, str>),
}

/// One sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the fine period, where it is known.
    pub tick: Option<u64>,
    /// Its time, s.
    pub t_s: f64,
    /// One for each of the columns.
    pub cells: Vec<Cell>,
}

/// A trace whose samples are read.
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
        file.take(MAGIC.len() as u64)
            .read_to_end(&mut start)
            .map_err(|e| format!("{}: {e}", path.display()))?;
        if is_binary_name(path) || start == MAGIC {
            return Ok(Self::Binary(Box::new(Binary::open(path)?)));
        }
        Ok(Self::Csv(Box::new(Csv::open(path)?)))
    }

    /// Whether rotary axes come in rad, bit for bit, where `shown` is not asked for.
    pub fn is_binary(&self) -> bool {
        matches!(self, Self::Binary(_))
    }

    /// Names of the columns, without that of time; `shown` as in a CSV, where rotary axes are in degrees and blocks have
    /// no column, instead of as stored.
    pub fn columns(&self, shown: bool) -> Vec<String> {
        match self {
            Self::Csv(csv) => csv.columns.iter().map(|(name, _)| name.clone()).collect(),
            Self::Binary(binary) => {
                let header = binary.header();
                let axes = header.axes;
                let unit = |axis| match (axes.is_rotary(axis), shown) {
                    (false, _) => "mm",
                    (true, true) => "deg",
                    (true, false) => "rad",
                };
                let mut names: Vec<String> = ["block", "line"][usize::from(shown)..]
                    .iter()
                    .map(|n| (*n).into())
                    .collect();
                for kind in ["cmd", "fb"] {
                    let name = |axis| {
                        format!(
                            "{}_{kind}_{}",
                            axes.letter(axis).to_ascii_lowercase(),
                            unit(axis)
                        )
                    };
                    names.extend((0..axes.count()).map(name));
                }
                names.extend(["feed_mm_s", "sigma", "state", "ratio"].map(String::from));
                let switched = switched_columns(binary.format());
                names.extend(
                    SWITCHED_COLUMNS[..switched]
                        .iter()
                        .copied()
                        .map(String::from),
                );
                names.extend(header.signals.iter().map(|signal| format!("sig_{signal}")));
                names
            }
        }
    }

    /// The next row; `shown` as for [`Samples::columns`].
    ///
    /// # Errors
    /// The path with the place and the cause.
    pub fn next(&mut self, shown: bool) -> Result<Option<Row>, String> {
        match self {
            Self::Csv(csv) => csv.next(),
            Self::Binary(binary) => Ok(binary.next()?.map(|record| row(binary, &record, shown))),
        }
    }

    /// Exit status once all is read: 1 where not every sample could be, which is then said.
    pub fn conclude(&self) -> u8 {
        match self {
            Self::Binary(binary) => binary.conclude(),
            Self::Csv(_) => 0,
        }
    }
}

/// How many of [`SWITCHED_COLUMNS`] a trace of this format has.
pub fn switched_columns(format: u32) -> usize {
    match (has_switched(format), has_age(format)) {
        (false, _) => 0,
        (true, false) => SWITCHED_COLUMNS.len() - 1,
        (true, true) => SWITCHED_COLUMNS.len(),
    }
}

/// The row of a record of a binary trace.
fn row(binary: &Binary, record: &Record, shown: bool) -> Row {
    let header = binary.header();
    let (axes, sample) = (header.axes, &record.sample);
    let mut numbers = if shown {
        vec![]
    } else {
        vec![sample.block as f64]
    };
    numbers.push(f64::from(sample.line));
    for position in [&sample.command, &sample.feedback] {
        let value = |axis| {
            if axes.is_rotary(axis) && shown {
                position[axis].to_degrees()
            } else {
                position[axis]
            }
        };
        numbers.extend((0..axes.count()).map(value));
    }
    numbers.extend([sample.feed_mm_per_s, sample.sigma]);
    let mut cells: Vec<Cell> = numbers.into_iter().map(Cell::Number).collect();
    cells.push(Cell::Word(sample.state.name().into()));
    cells.push(Cell::Number(sample.ratio));
    if has_switched(binary.format()) {
        let switched = &sample.switched;
        cells.push(Cell::Number(rpm(switched.spindle_rad_per_s)));
        cells.extend([
            Cell::Word(switched.coolant().into()),
            Cell::Word(outputs_word(switched).into()),
        ]);
        cells.push(Cell::Number(
            sample.phase_ns.map_or(f64::NAN, |ns| ns as f64),
        ));
    }
    if has_age(binary.format()) {
        cells.push(Cell::Number(f64::from(age(sample))));
    }
    cells.extend(
        record.signals[..header.signals.len()]
            .iter()
            .copied()
            .map(Cell::Number),
    );
    Row {
        tick: Some(sample.tick),
        t_s: TraceCsv::t_s(sample.tick, header.fine_period_s),
        cells,
    }
}

/// A trace CSV.
pub struct Csv {
    path: PathBuf,
    rows: csv::StringRecordsIntoIter<File>,
    time: usize,
    /// Name and place of each column but that of time.
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
        let time =
            time.ok_or_else(|| format!("{}: no trace: it has no column t_s", path.display()))?;
        let others = head.iter().enumerate().filter(|(index, _)| *index != time);
        let columns = others
            .map(|(index, name)| (name.to_string(), index))
            .collect();
        let rows = reader.into_records();
        Ok(Self {
            path: path.to_owned(),
            rows,
            time,
            columns,
            last_t_s: None,
            period_s: None,
        })
    }

    fn next(&mut self) -> Result<Option<Row>, String> {
        let Some(row) = self.rows.next() else {
            return Ok(None);
        };
        let row = row.map_err(|e| format!("{}: {e}", self.path.display()))?;
        let number = |index: usize| {
            let text = &row[index];
            let line = row.position().map_or(0, csv::Position::line);
            text.parse::<f64>()
                .map_err(|_| format!("{}:{line}: {text:?} is no number", self.path.display()))
        };
        let cell = |(name, index): &(String, usize)| {
            if WORDS.contains(&name.as_str()) {
                Ok(Cell::Word(row[*index].to_string().into()))
            } else {
                number(*index).map(Cell::Number)
            }
        };
        let t_s = number(self.time)?;
        let cells = self.columns.iter().map(cell).collect::<Result<_, _>>()?;
        self.period_s = self
            .period_s
            .or_else(|| self.last_t_s.map(|last_t_s| t_s - last_t_s));
        self.last_t_s = Some(t_s);
        let tick = if t_s == 0.0 {
            Some(0)
        } else {
            self.period_s
                .map(|period_s| (t_s / period_s).round() as u64)
        };
        Ok(Some(Row { tick, t_s, cells }))
    }
}
