//! Dotted keys of a TOML file and of the files it includes.

use std::path::Path;

use toml::{Table, Value};

use crate::Error;

/// Files that include each other would never end.
const DEEPEST_INCLUDE: usize = 16;

pub struct Keys {
    file: String,
    table: Table,
}

impl Keys {
    pub fn read(path: &Path) -> Result<Self, Error> {
        Ok(Self {
            file: path.display().to_string(),
            table: load(path, 0)?,
        })
    }

    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        Ok(Self {
            file: file.into(),
            table: parse(text, file)?,
        })
    }

    pub fn error(&self, key: &str, cause: &str) -> Error {
        Error::key(&self.file, key, cause)
    }

    pub fn need(&self, key: &str) -> Result<f64, Error> {
        self.number(key)?.ok_or_else(|| self.error(key, "missing"))
    }

    pub fn number(&self, key: &str) -> Result<Option<f64>, Error> {
        let Some(value) = self.find(key) else {
            return Ok(None);
        };
        as_number(value)
            .map(Some)
            .ok_or_else(|| self.error(key, "no finite number"))
    }

    pub fn range(&self, key: &str) -> Result<[f64; 2], Error> {
        match self.pair(key)? {
            [low, high] if low <= high => Ok([low, high]),
            _ => Err(self.error(key, "not two numbers in ascending order")),
        }
    }

    pub fn pair(&self, key: &str) -> Result<[f64; 2], Error> {
        let value = self.find(key).ok_or_else(|| self.error(key, "missing"))?;
        let numbers: Option<Vec<f64>> = value
            .as_array()
            .and_then(|ends| ends.iter().map(as_number).collect());
        match numbers.as_deref() {
            Some(&[first, second]) => Ok([first, second]),
            _ => Err(self.error(key, "not two numbers in ascending order")),
        }
    }

    pub fn text(&self, key: &str) -> Option<String> {
        self.find(key).and_then(Value::as_str).map(str::to_owned)
    }

    pub fn has(&self, key: &str) -> bool {
        self.find(key).is_some()
    }

    pub fn texts(&self, key: &str) -> Option<Vec<String>> {
        let each = self
            .find(key)?
            .as_array()?
            .iter()
            .map(|value| value.as_str().map(str::to_owned));
        each.collect()
    }

    /// In the order of the file.
    pub fn names(&self, key: &str) -> Vec<String> {
        self.find(key)
            .and_then(Value::as_table)
            .map(|table| table.keys().cloned().collect())
            .unwrap_or_default()
    }

    fn find(&self, key: &str) -> Option<&Value> {
        let (first, rest) = key
            .split_once('.')
            .map_or((key, None), |(first, rest)| (first, Some(rest)));
        let mut value = self.table.get(first)?;
        for name in rest.into_iter().flat_map(|rest| rest.split('.')) {
            value = value.as_table()?.get(name)?;
        }
        Some(value)
    }
}

fn as_number(value: &Value) -> Option<f64> {
    let number = value
        .as_float()
        .or_else(|| value.as_integer().map(|whole| whole as f64))?;
    number.is_finite().then_some(number)
}

fn parse(text: &str, file: &str) -> Result<Table, Error> {
    text.parse::<Table>().map_err(|cause| {
        let before = cause
            .span()
            .map_or("", |span| &text[..span.start.min(text.len())]);
        Error::line(
            file,
            1 + before.matches('\n').count() as u64,
            cause.message(),
        )
    })
}

fn load(path: &Path, depth: usize) -> Result<Table, Error> {
    let file = path.display().to_string();
    if depth > DEEPEST_INCLUDE {
        return Err(Error::key(&file, "include", "files include each other"));
    }
    let text =
        std::fs::read_to_string(path).map_err(|cause| Error::open(&file, cause.to_string()))?;
    let own = parse(&text, &file)?;
    let mut merged = Table::new();
    for name in own
        .get("include")
        .and_then(Value::as_array)
        .into_iter()
        .flatten()
    {
        let name = name
            .as_str()
            .ok_or_else(|| Error::key(&file, "include", "not a file name"))?;
        merge(&mut merged, load(&path.with_file_name(name), depth + 1)?);
    }
    merge(&mut merged, own);
    Ok(merged)
}

/// Later keys replace earlier ones; tables are merged key by key.
fn merge(into: &mut Table, from: Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => merge(below, above),
            (_, value) => drop(into.insert(key, value)),
        }
    }
}
