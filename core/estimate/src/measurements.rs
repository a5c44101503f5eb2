//! Times noted at a control, as CSV: `n,side_mm,repetitions,seconds`, `feed_mm_per_min` where it was not 5000, `reading_error_s`
//! where it is known how far a reading may be off, `axis` of lines there and back, and `exact_stop`, 1 where it was driven under G61.

use std::io::Read as _;
use std::path::Path;

use serde::Deserialize;

use crate::diagnose::Corner;
use crate::polygon::{FEED_MM_PER_MIN, PlaneAxis, Polygon, STROKE, Timed};

/// A row as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    n: u32,
    side_mm: f64,
    repetitions: u32,
    seconds: f64,
    feed_mm_per_min: Option<f64>,
    reading_error_s: Option<f64>,
    axis: Option<String>,
    exact_stop: Option<u8>,
}

/// Reads the measurements in the file at `path`. Lines that begin with # are left out.
///
/// # Errors
/// What cannot be read, with file, line and cause.
pub fn read(path: &Path) -> Result<Vec<Timed>, String> {
    let (name, bytes) = bytes(path)?;
    parse(&name, &bytes)
}

/// What stands in the file at `path`, and what refusals call it. `-` is what is typed in.
fn bytes(path: &Path) -> Result<(String, Vec<u8>), String> {
    if path == Path::new("-") {
        let mut bytes = vec![];
        let read = std::io::stdin().read_to_end(&mut bytes);
        return read
            .map(|_| ("standard input".to_string(), bytes))
            .map_err(|e| format!("standard input: {e}"));
    }
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|e| format!("{name}: {e}"))?;
    Ok((name, bytes))
}

/// A minimum feed as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CornerRow {
    turn_deg: f64,
    feed_mm_per_min: f64,
    min_feed_mm_per_min: f64,
    reading_error_mm_per_min: Option<f64>,
}

impl CornerRow {
    fn corner(&self) -> Result<Corner, String> {
        let error = self.reading_error_mm_per_min.unwrap_or(0.0);
        if !(0.0..=90.0).contains(&self.turn_deg) {
            return Err(format!("turn_deg: {} is not from 0 to 90", self.turn_deg));
        }
        if !(self.feed_mm_per_min > 0.0 && self.feed_mm_per_min.is_finite()) {
            return Err(format!(
                "feed_mm_per_min: {} is not above zero",
                self.feed_mm_per_min
            ));
        }
        // A panel may read a little more than is programmed.
        let most = 1.1 * self.feed_mm_per_min + error;
        if !(0.0..=most).contains(&self.min_feed_mm_per_min) {
            let read = self.min_feed_mm_per_min;
            return Err(format!(
                "min_feed_mm_per_min: {read} is not from 0 to the feed"
            ));
        }
        if !(error >= 0.0 && error.is_finite()) {
            return Err(format!("reading_error_mm_per_min: {error} is below zero"));
        }
        Ok(Corner {
            turn_rad: self.turn_deg.to_radians(),
            feed_mm_per_s: self.feed_mm_per_min / 60.0,
            min_mm_per_s: self.min_feed_mm_per_min / 60.0,
            reading_error_mm_per_s: error / 60.0,
        })
    }
}

/// Reads the minimum feeds of V paths in the file at `path`: `turn_deg,feed_mm_per_min,min_feed_mm_per_min` and, where it is
/// known, `reading_error_mm_per_min`.
///
/// # Errors
/// What cannot be read, with file, line and cause.
pub fn read_corners(path: &Path) -> Result<Vec<Corner>, String> {
    let (name, bytes) = bytes(path)?;
    parse_corners(&name, &bytes)
}

/// Reads minimum feeds from `bytes`; `name` is for refusals.
///
/// # Errors
/// What is no minimum feed, with file, line and cause.
pub fn parse_corners(name: &str, bytes: &[u8]) -> Result<Vec<Corner>, String> {
    let mut all = vec![];
    each_row(name, bytes, |row: CornerRow| {
        all.push(row.corner()?);
        Ok(())
    })?;
    Ok(all)
}

/// When a line of the program moved, as a control has logged it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct LogRow {
    /// Time, s.
    pub t_s: f64,
    /// Line of the program.
    pub line: u32,
}

/// Reads the log of a control at `path`: the columns `t_s` and `line` of a CSV file, such as a trace; others are left out, and lines
/// that begin with #.
///
/// # Errors
/// What cannot be read, with file, line and cause; times or lines that go back.
pub fn read_log(path: &Path) -> Result<Vec<LogRow>, String> {
    let (name, bytes) = bytes(path)?;
    parse_log(&name, &bytes)
}

/// Reads a log from `bytes`; `name` is for refusals.
///
/// # Errors
/// What is no log, with file, line and cause.
pub fn parse_log(name: &str, bytes: &[u8]) -> Result<Vec<LogRow>, String> {
    let mut log: Vec<LogRow> = vec![];
    each_row(name, bytes, |row: LogRow| {
        if let Some(last) = log.last() {
            if row.t_s.is_nan() || row.t_s < last.t_s {
                return Err(format!("t_s: {} comes after {}", row.t_s, last.t_s));
            }
            if row.line < last.line {
                return Err(format!("line: {} comes after {}", row.line, last.line));
            }
        } else if !row.t_s.is_finite() {
            return Err(format!("t_s: {} is no time", row.t_s));
        }
        log.push(row);
        Ok(())
    })?;
    Ok(log)
}

/// What a program took at a control.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramTime {
    /// The program, as its file is called.
    pub program: String,
    /// Time, s.
    pub seconds: f64,
    /// How far the reading may be off, s.
    #[serde(default)]
    pub reading_error_s: f64,
}

/// Reads what programs took from the CSV file at `path`: `program,seconds` and, where it is known, `reading_error_s`.
///
/// # Errors
/// What cannot be read, with file, line and cause.
pub fn read_programs(path: &Path) -> Result<Vec<ProgramTime>, String> {
    let (name, bytes) = bytes(path)?;
    let mut all = vec![];
    each_row(&name, &bytes, |row: ProgramTime| {
        let known = row.reading_error_s.is_finite() && row.reading_error_s >= 0.0;
        if !(row.seconds.is_finite() && row.seconds > 0.0) {
            return Err(format!("seconds: {} is not above zero", row.seconds));
        }
        if !known {
            return Err(format!(
                "reading_error_s: {} is below zero",
                row.reading_error_s
            ));
        }
        all.push(row);
        Ok(())
    })?;
    Ok(all)
}

/// Hands each row of a CSV file to `take`; lines that begin with # are left out.
fn each_row<T: serde::de::DeserializeOwned>(
    name: &str,
    bytes: &[u8],
    mut take: impl FnMut(T) -> Result<(), String>,
) -> Result<(), String> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let headers = reader
        .headers()
        .map_err(|e| format!("{name}: {e}"))?
        .clone();
    for record in reader.records() {
        let record = record.map_err(|e| format!("{name}: {e}"))?;
        let line = record.position().map_or(0, csv::Position::line);
        let row: T = record
            .deserialize(Some(&headers))
            .map_err(|e| format!("{name}:{line}: {}", cause(&e, &headers)))?;
        take(row).map_err(|cause| format!("{name}:{line}: {cause}"))?;
    }
    Ok(())
}

/// Reads measurements from `bytes`; `name` is for refusals.
///
/// # Errors
/// What is no measurement, with file, line and cause.
pub fn parse(name: &str, bytes: &[u8]) -> Result<Vec<Timed>, String> {
    let mut all = vec![];
    each_row(name, bytes, |row: Row| {
        all.push(row.timed()?);
        Ok(())
    })?;
    if all.len() < 6 {
        return Err(format!(
            "{name}: {} measurements do not make a calibration; there should be 6 at least",
            all.len()
        ));
    }
    Ok(all)
}

/// What is wrong with a row, by the name of its column.
fn cause(error: &csv::Error, headers: &csv::StringRecord) -> String {
    let csv::ErrorKind::Deserialize { err, .. } = error.kind() else {
        return error.to_string();
    };
    match err.field().and_then(|field| headers.get(field as usize)) {
        Some(column) => format!("{column}: {}", err.kind()),
        None => err.to_string(),
    }
}

impl Row {
    /// The axis of a stroke, which has to be stated; other polygons begin along X.
    fn along(&self) -> Result<PlaneAxis, String> {
        let axis = self.axis.as_deref().unwrap_or_default();
        match (self.n, axis) {
            (STROKE, "X" | "x") => Ok(PlaneAxis::X),
            (STROKE, "Y" | "y") => Ok(PlaneAxis::Y),
            (STROKE, _) => Err(format!(
                "axis: \"{axis}\" is neither X nor Y; two corners are a line there and back along one of them"
            )),
            (_, "") => Ok(PlaneAxis::X),
            (n, _) => Err(format!(
                "axis: \"{axis}\" belongs to lines there and back, n = 2, and not to n = {n}"
            )),
        }
    }

    fn timed(&self) -> Result<Timed, String> {
        let feed_mm_per_min = self.feed_mm_per_min.unwrap_or(FEED_MM_PER_MIN);
        let positive = [
            ("side_mm", self.side_mm),
            ("seconds", self.seconds),
            ("feed_mm_per_min", feed_mm_per_min),
        ];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{name}: {value} is not above zero"));
            }
        }
        let reading_error_s = self.reading_error_s.unwrap_or(0.0);
        if !(0.0..self.seconds).contains(&reading_error_s) {
            return Err(format!(
                "reading_error_s: {reading_error_s} is not from 0 to the time itself"
            ));
        }
        if self.n < STROKE || self.repetitions == 0 {
            return Err(
                "n: a polygon has 2 corners at least, and is gone round once at least".to_string(),
            );
        }
        if self
            .n
            .checked_mul(self.repetitions)
            .is_none_or(|blocks| blocks > 10_000_000)
        {
            return Err("repetitions: more blocks than anybody times".to_string());
        }
        let polygon = Polygon {
            corners: self.n,
            side_mm: self.side_mm,
            rounds: self.repetitions,
            along: self.along()?,
            feed_mm_per_s: feed_mm_per_min / 60.0,
            exact_stop: match self.exact_stop {
                None | Some(0) => false,
                Some(1) => true,
                Some(other) => return Err(format!("exact_stop: {other} is neither 0 nor 1")),
            },
        };
        Ok(Timed {
            polygon,
            time_s: self.seconds,
            reading_error_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_named_by_line_and_column() {
        let file = tempfile::NamedTempFile::new().unwrap();
        for (text, expected) in [
            (
                "n,side_mm,repetitions,seconds\n3,0.1,10,1\n4,wide,1,1\n",
                ":3: side_mm: invalid float literal",
            ),
            (
                "n,side,repetitions,seconds\n3,0.1,10,1\n",
                ":2: unknown field `side`, expected one of `n`, `side_mm`",
            ),
            (
                "n,side_mm,repetitions,seconds\n3,-1,10,1\n",
                ":2: side_mm: -1 is not above zero",
            ),
        ] {
            std::fs::write(file.path(), text).unwrap();
            let found = read(file.path()).unwrap_err();
            assert!(found.contains(expected), "{found}");
        }
    }
}
