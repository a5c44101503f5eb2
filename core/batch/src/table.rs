//! Results as a table: a row a job, a column a number.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

use rusqlite::types::Value;
use rusqlite::{Connection, params_from_iter};

use crate::folder::Listed;
use crate::job::Build;
use crate::result::{Ended, JobResult};

/// The table.
pub struct Table {
    columns: Vec<String>,
    /// How many of the columns hold numbers; they are the last.
    numbers: usize,
    rows: Vec<Vec<Cell>>,
    /// Jobs without a result.
    pub missing: usize,
    /// Jobs that gave no numbers: their place in the list, and why.
    pub without_numbers: Vec<(usize, String)>,
    /// Places in the list of jobs to which two builds or computers gave different results.
    pub differing: Vec<usize>,
}

#[derive(Clone)]
enum Cell {
    Text(String),
    Number(Option<f64>),
}

/// Columns before the keys that were set and the numbers.
const FIRST: [&str; 6] = [
    "job",
    "program",
    "machine",
    "ended",
    "cause",
    "builds_differ",
];

impl Table {
    /// The table of `jobs` in their order. Where a job has results of several builds that of `build` counts, else the first.
    pub fn new(jobs: &[Listed], results: &BTreeMap<String, Vec<JobResult>>, build: &Build) -> Self {
        let mut keys: Vec<&str> = vec![];
        for (key, _) in jobs.iter().flat_map(|listed| &listed.job.set) {
            if !keys.contains(&key.as_str()) {
                keys.push(key);
            }
        }
        let of_job = |listed: &Listed| results.get(&listed.job.id());
        let chosen = |all: &'_ Vec<JobResult>| -> Option<JobResult> {
            let own = all.iter().find(|result| result.build == *build);
            own.or(all.first()).cloned()
        };
        let chosen: Vec<Option<JobResult>> = jobs
            .iter()
            .map(|listed| of_job(listed).and_then(chosen))
            .collect();
        let of_numbers = chosen
            .iter()
            .flatten()
            .filter_map(|result| result.ended.numbers());
        let names: BTreeSet<&String> = of_numbers.flat_map(BTreeMap::keys).collect();
        let mut table = Self {
            columns: FIRST
                .iter()
                .chain(&keys)
                .map(ToString::to_string)
                .chain(names.iter().map(ToString::to_string))
                .collect(),
            numbers: names.len(),
            rows: vec![],
            missing: 0,
            without_numbers: vec![],
            differing: vec![],
        };
        for (place, (listed, result)) in jobs.iter().zip(&chosen).enumerate() {
            let Some(result) = result else {
                table.missing += 1;
                continue;
            };
            let differ = of_job(listed)
                .is_some_and(|all| all.iter().any(|other| other.ended != result.ended));
            if differ {
                table.differing.push(place);
            }
            if let Some(cause) = result.ended.cause() {
                table.without_numbers.push((place, cause.to_string()));
            }
            let text = |text: &str| Cell::Text(text.to_string());
            let mut row = vec![
                text(&result.job),
                text(&listed.program),
                text(&listed.machine),
                text(result.ended.word()),
                text(result.ended.cause().unwrap_or_default()),
                Cell::Number(Some(f64::from(u8::from(differ)))),
            ];
            row.extend(keys.iter().map(|key| {
                let set = listed.job.set.iter().rev().find(|(name, _)| name == key);
                text(set.map_or("", |(_, value)| value))
            }));
            let number = |name: &&String| Cell::Number(number(&result.ended, name));
            row.extend(names.iter().map(number));
            table.rows.push(row);
        }
        table
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Writes it as CSV with a head, numbers with every digit.
    ///
    /// # Errors
    /// Writing fails.
    pub fn write_csv(&self, out: impl Write) -> Result<(), String> {
        let mut csv = csv::Writer::from_writer(out);
        let words = |e: csv::Error| e.to_string();
        csv.write_record(&self.columns).map_err(words)?;
        for row in &self.rows {
            csv.write_record(row.iter().map(Cell::text))
                .map_err(words)?;
        }
        csv.flush().map_err(|e| e.to_string())
    }

    /// Writes it into a new database at `path` as the table `results`.
    ///
    /// # Errors
    /// There is a file already, or the database cannot be written.
    pub fn write_sqlite(&self, path: &Path) -> Result<(), String> {
        let words = |e: rusqlite::Error| format!("{}: {e}", path.display());
        if path.exists() {
            return Err(format!("{}: the file is there already", path.display()));
        }
        let mut database = Connection::open(path).map_err(words)?;
        let text = self.columns.len() - self.numbers;
        let column = |(index, name): (usize, &String)| {
            let kind = if index >= text || name == "builds_differ" {
                "REAL"
            } else if index < FIRST.len() {
                "TEXT"
            } else {
                // What varies: numbers are compared as numbers, and words stay words.
                "NUMERIC"
            };
            format!("\"{}\" {kind}", name.replace('"', "\"\""))
        };
        let columns: Vec<String> = self.columns.iter().enumerate().map(column).collect();
        let transaction = database.transaction().map_err(words)?;
        transaction
            .execute(
                &format!("CREATE TABLE results ({})", columns.join(", ")),
                [],
            )
            .map_err(words)?;
        {
            let marks = vec!["?"; self.columns.len()].join(", ");
            let mut insert = transaction
                .prepare(&format!("INSERT INTO results VALUES ({marks})"))
                .map_err(words)?;
            for row in &self.rows {
                insert
                    .execute(params_from_iter(row.iter().map(Cell::value)))
                    .map_err(words)?;
            }
        }
        transaction.commit().map_err(words)
    }
}

fn number(ended: &Ended, name: &str) -> Option<f64> {
    ended.numbers()?.get(name).copied()
}

impl Cell {
    fn text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(number) => number.map(|number| number.to_string()).unwrap_or_default(),
        }
    }

    fn value(&self) -> Value {
        match self {
            Self::Text(text) => Value::Text(text.clone()),
            Self::Number(number) => number.map_or(Value::Null, Value::Real),
        }
    }
}
