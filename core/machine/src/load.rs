//! From files and overrides to one table: reading, includes, paths.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use toml::de::DeTable;

use crate::convert::Convert;
use crate::node::{Node, Table, Value, merge};
use crate::paths::{beside, resolve_paths};
use crate::problems::{Origin, Problems};
use crate::shown::shorten;

/// The number of the file format.
const FORMAT: i64 = 1;

/// Longest file that is read, in bytes: anything longer is not a configuration.
const LONGEST_FILE: u64 = 1 << 20;

/// Most files that one machine is made of.
const MAX_FILES: usize = 64;

/// Reads files; `None` wherever something is so wrong that looking further would only add noise.
pub struct Loader<'a> {
    problems: &'a Problems,
    open: Vec<(PathBuf, PathBuf)>,
    files: usize,
}

impl<'a> Loader<'a> {
    /// A loader that notes what is wrong in `problems`.
    pub fn new(problems: &'a Problems) -> Self {
        Self {
            problems,
            open: Vec::new(),
            files: 0,
        }
    }

    /// The table of `path` with everything that it includes. `from` is where the name was written, if it was.
    pub fn machine(&mut self, path: &Path, from: Option<Named>) -> Option<Table> {
        let own = self.file(path, from)?;
        self.check_format(&own.table, own.source, from.is_none())?;
        let mut table = Table::new();
        self.open.push((own.canonical, path.to_owned()));
        let included = own
            .table
            .get("include")
            .map(|node| self.includes(node, path, &mut table));
        self.open.pop();
        included.unwrap_or(Some(()))?;
        let mut above = own.table;
        above.remove("include");
        resolve_paths(&mut above, path);
        merge(&mut table, above);
        Some(table)
    }

    /// The table of a tool table.
    pub fn tools(&mut self, path: &Path, from: Named) -> Option<Table> {
        let own = self.file(path, Some(from))?;
        self.check_format(&own.table, own.source, false)?;
        Some(own.table)
    }

    fn includes(&mut self, list: &Node, path: &Path, table: &mut Table) -> Option<()> {
        let Some(files) = list.array() else {
            self.problems.report(
                list.origin,
                "include",
                format!("must be an array of files, not {}", list.kind()),
            );
            return None;
        };
        for file in files {
            let Some(name) = file.text() else {
                self.problems.report(
                    file.origin,
                    "include",
                    format!("must name files, not {}", file.kind()),
                );
                return None;
            };
            merge(
                table,
                self.machine(
                    &beside(path, name),
                    Some(Named {
                        origin: file.origin,
                        key: "include",
                    }),
                )?,
            );
        }
        Some(())
    }

    fn file(&mut self, path: &Path, from: Option<Named>) -> Option<Loaded> {
        let canonical = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        self.refuse_cycle(&canonical, path, from)?;
        self.files += 1;
        let bytes = match read(path) {
            Ok(bytes) if self.files <= MAX_FILES => bytes,
            Ok(_) => {
                return self.refuse(
                    path,
                    from,
                    &format!("the machine is made of more than {MAX_FILES} files"),
                );
            }
            Err(error) => return self.refuse(path, from, &format!("cannot be read: {error}")),
        };
        self.parse(path, bytes).map(|(source, table)| Loaded {
            source,
            table,
            canonical,
        })
    }

    fn parse(&self, path: &Path, bytes: Vec<u8>) -> Option<(usize, Table)> {
        let (source, text) = self.decode(path, bytes)?;
        match DeTable::parse(&text) {
            Ok(table) => Some((
                source,
                Convert::new(source, self.problems, Vec::new()).table(table.get_ref()),
            )),
            Err(error) => {
                let span = error.span().unwrap_or_default();
                let what = syntax(error.message(), text.get(span.clone()).unwrap_or_default());
                self.problems.report(
                    Origin {
                        source,
                        offset: span.start,
                    },
                    "",
                    what,
                );
                None
            }
        }
    }

    fn decode(&self, path: &Path, bytes: Vec<u8>) -> Option<(usize, String)> {
        match String::from_utf8(bytes) {
            Ok(text) => Some((self.problems.add_file(path, text.clone()), text)),
            Err(error) => {
                let offset = error.utf8_error().valid_up_to();
                let source = self
                    .problems
                    .add_file(path, String::from_utf8_lossy(error.as_bytes()).into_owned());
                self.problems
                    .report(Origin { source, offset }, "", "not UTF-8 text");
                None
            }
        }
    }

    fn check_format(&self, table: &Table, source: usize, required: bool) -> Option<()> {
        let Some(node) = table.get("format") else {
            if required {
                let origin = Origin { source, offset: 0 };
                self.problems.report(
                    origin,
                    "format",
                    format!("missing; this version reads format = {FORMAT}"),
                );
            }
            return (!required).then_some(());
        };
        let stated = match &node.value {
            Value::Integer(FORMAT) => return Some(()),
            Value::Integer(number) => number.to_string(),
            _ => node.kind().to_owned(),
        };
        let what = format!("this version reads format {FORMAT}, and the file states {stated}");
        self.problems.report(node.origin, "format", what);
        None
    }

    fn refuse_cycle(&self, canonical: &Path, path: &Path, from: Option<Named>) -> Option<()> {
        let Some(start) = self.open.iter().position(|(open, _)| open == canonical) else {
            return Some(());
        };
        let mut names: Vec<_> = self.open[start..]
            .iter()
            .map(|(_, name)| name.display().to_string())
            .collect();
        names.push(path.display().to_string());
        self.refuse(
            path,
            from,
            &format!("includes itself: {}", names.join(" → ")),
        )
    }

    fn refuse<T>(&self, path: &Path, from: Option<Named>, what: &str) -> Option<T> {
        if let Some(Named { origin, key }) = from {
            self.problems
                .report(origin, key, format!("{}: {what}", path.display()));
        } else {
            let source = self.problems.add_unreadable(path);
            self.problems.report(Origin { source, offset: 0 }, "", what);
        }
        None
    }
}

/// Where a file's name was written, and as the value of which key.
#[derive(Clone, Copy)]
pub struct Named {
    pub origin: Origin,
    pub key: &'static str,
}

struct Loaded {
    source: usize,
    table: Table,
    canonical: PathBuf,
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?
        .take(LONGEST_FILE + 1)
        .read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LONGEST_FILE {
        return Err(io::Error::other(format!(
            "longer than {LONGEST_FILE} bytes"
        )));
    }
    Ok(bytes)
}

/// The TOML reader's words; a key set twice is named.
fn syntax(message: &str, text: &str) -> String {
    match message {
        "duplicate key" => format!("`{}` is set twice", shorten(text)),
        message => format!("not TOML: {message}"),
    }
}
