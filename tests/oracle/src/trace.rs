//! The trace: what was sent to the drives, one row per fine period.

use std::{fs::File, io::Read, path::Path};

use csv::{ReaderBuilder, StringRecord};

use crate::{Axes, Error, LETTERS, Position, axis::axis_of_name};

/// The samples of a run. Row 0 is the machine at rest before the first period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// The axes that have a command column.
    pub axes: Axes,
    /// Those of them whose commands are in degrees.
    pub degrees: Axes,
    /// The samples in order.
    pub rows: Vec<Row>,
    /// Values beside the commands (feedback, feed, sigma, ratio) that are no finite numbers: row, column, value.
    pub not_finite: Vec<(usize, String, f64)>,
}

/// One sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Tick times fine period, s.
    pub t_s: f64,
    /// Line of the part program that the host says it is executing.
    pub line: u32,
    /// Commanded machine coordinates, mm or degrees.
    pub command: Position,
}

/// Where the columns of interest stand.
struct Columns {
    t_s: usize,
    line: usize,
    commands: Vec<(usize, usize)>,
    others: Vec<(usize, String)>,
}

impl Trace {
    /// Reads a trace CSV file.
    ///
    /// # Errors
    /// The file cannot be opened, a column is missing or a value is no number.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let name = path.display().to_string();
        let file = File::open(path).map_err(|cause| Error::open(&name, cause.to_string()))?;
        Self::from_reader(file, &name)
    }

    /// Reads a trace CSV from any source; `name` stands for the file in errors.
    ///
    /// # Errors
    /// A column is missing or a value is no number.
    pub fn from_reader(source: impl Read, name: &str) -> Result<Self, Error> {
        let mut reader = ReaderBuilder::new().comment(Some(b'#')).from_reader(source);
        let headers = reader
            .headers()
            .map_err(|cause| csv_error(name, &cause))?
            .clone();
        let columns = Columns::find(&headers, name)?;
        let axes = columns.commands.iter().map(|&(axis, _)| axis).collect();
        let mut trace = Self {
            axes,
            degrees: degrees(&headers),
            ..Self::default()
        };
        let mut record = StringRecord::new();
        while reader
            .read_record(&mut record)
            .map_err(|cause| csv_error(name, &cause))?
        {
            columns.append(&mut trace, &record, &headers, name)?;
        }
        Ok(trace)
    }

    /// A trace of samples at a constant period, as tests build it; every row carries line 0, and A, B and C turn.
    pub fn from_samples(axes: &[usize], fine_period_s: f64, samples: &[Position]) -> Self {
        let row = |(tick, &command)| Row {
            t_s: tick as f64 * fine_period_s,
            line: 0,
            command,
        };
        let degrees = axes
            .iter()
            .copied()
            .filter(|&axis| matches!(LETTERS[axis], 'A'..='C'))
            .collect();
        let rows = samples.iter().enumerate().map(row).collect();
        Self {
            axes: axes.to_vec(),
            degrees,
            rows,
            not_finite: Vec::new(),
        }
    }
}

impl Columns {
    fn find(headers: &StringRecord, name: &str) -> Result<Self, Error> {
        let column = |wanted: &str| headers.iter().position(|header| header == wanted);
        let need = |wanted| {
            column(wanted).ok_or_else(|| Error::line(name, 1, format!("no column `{wanted}`")))
        };
        let commands = commands(headers);
        if commands.is_empty() {
            return Err(Error::line(
                name,
                1,
                "no column `<axis>_cmd_mm` or `<axis>_cmd_deg`",
            ));
        }
        if let Some(axis) = twice(&commands) {
            return Err(Error::line(
                name,
                1,
                format!("two command columns for axis {}", LETTERS[axis]),
            ));
        }
        let others = headers
            .iter()
            .enumerate()
            .filter(|(_, header)| is_other(header));
        let others = others
            .map(|(index, header)| (index, header.to_owned()))
            .collect();
        Ok(Self {
            t_s: need("t_s")?,
            line: need("line")?,
            commands,
            others,
        })
    }

    fn append(
        &self,
        trace: &mut Trace,
        record: &StringRecord,
        headers: &StringRecord,
        name: &str,
    ) -> Result<(), Error> {
        let at_line = record.position().map_or(0, csv::Position::line);
        let wrong = |column: usize, kind: &str| {
            let cause = format!(
                "column `{}`: `{}` is no {kind}",
                &headers[column], &record[column]
            );
            Error::line(name, at_line, cause)
        };
        let number = |column: usize| {
            record[column]
                .trim()
                .parse::<f64>()
                .map_err(|_| wrong(column, "number"))
        };
        let line = record[self.line]
            .trim()
            .parse()
            .map_err(|_| wrong(self.line, "line number"))?;
        let mut row = Row {
            t_s: number(self.t_s)?,
            line,
            ..Row::default()
        };
        for &(axis, column) in &self.commands {
            row.command[axis] = number(column)?;
        }
        for (column, header) in &self.others {
            let value = number(*column)?;
            if !value.is_finite() {
                trace
                    .not_finite
                    .push((trace.rows.len(), header.clone(), value));
            }
        }
        trace.rows.push(row);
        Ok(())
    }
}

fn commands(headers: &StringRecord) -> Vec<(usize, usize)> {
    let axis = |header: &str| {
        let (axis, rest) = header.split_once('_')?;
        matches!(rest, "cmd_mm" | "cmd_deg")
            .then(|| axis_of_name(axis))
            .flatten()
    };
    headers
        .iter()
        .enumerate()
        .filter_map(|(column, header)| Some((axis(header)?, column)))
        .collect()
}

fn degrees(headers: &StringRecord) -> Axes {
    headers
        .iter()
        .filter_map(|header| axis_of_name(header.strip_suffix("_cmd_deg")?))
        .collect()
}

fn twice(commands: &[(usize, usize)]) -> Option<usize> {
    let seen = |index: usize| {
        commands[..index]
            .iter()
            .any(|&(axis, _)| axis == commands[index].0)
    };
    (0..commands.len())
        .find(|&index| seen(index))
        .map(|index| commands[index].0)
}

/// Columns that are not judged but must hold finite numbers.
fn is_other(header: &str) -> bool {
    matches!(header, "feed_mm_s" | "sigma" | "ratio")
        || header.ends_with("_fb_mm")
        || header.ends_with("_fb_deg")
}

fn csv_error(name: &str, cause: &csv::Error) -> Error {
    Error::line(
        name,
        cause.position().map_or(0, csv::Position::line),
        cause.to_string(),
    )
}
