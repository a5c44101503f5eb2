//! The tables, and how older files become what this version knows.

use std::path::{Path, PathBuf};

use rusqlite::Connection;

use crate::error::StateError;

/// `application_id` of our files: "TNDM".
pub(crate) const APPLICATION_ID: i64 = 0x544e_444d;

/// How each format is made from the one before; the first from an empty file. A format that has been published is never
/// changed: another one is appended.
pub(crate) const FORMATS: &[&str] = &[r"
-- Text about the whole file: 'machine' is the machine's name, 'filled' says that the initial values are in.
CREATE TABLE note (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT, WITHOUT ROWID;
-- The axes of the machine, in their order; nth is NULL for one that the machine had once.
CREATE TABLE axis (letter TEXT PRIMARY KEY, nth INTEGER, rotary INTEGER NOT NULL, turns INTEGER NOT NULL DEFAULT 0)
  STRICT, WITHOUT ROWID;
-- Vectors, mm or rad, by name: 'G54' to 'G59.3', 'G92' and what G92.3 restores, 'G28', 'G30', 'last' (position).
CREATE TABLE place (name TEXT NOT NULL, letter TEXT NOT NULL, value REAL NOT NULL, PRIMARY KEY (name, letter))
  STRICT, WITHOUT ROWID;
-- Single numbers: 'active', 'tool_in_spindle', and the rotation of each system in rad by its name.
CREATE TABLE number (name TEXT PRIMARY KEY, value REAL NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE parameter (number INTEGER PRIMARY KEY, value REAL NOT NULL) STRICT;
CREATE TABLE policy_parameter (name TEXT PRIMARY KEY, value REAL NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE tool (
  number INTEGER PRIMARY KEY, pocket INTEGER, name TEXT NOT NULL, diameter_mm REAL NOT NULL,
  wear_diameter_mm REAL NOT NULL, corner_radius_mm REAL NOT NULL, front_angle_deg REAL NOT NULL,
  back_angle_deg REAL NOT NULL, orientation INTEGER NOT NULL, used_s REAL NOT NULL, limit_s REAL,
  uses INTEGER NOT NULL, limit_uses INTEGER, remark TEXT NOT NULL) STRICT;
-- Offset and wear of each tool by axis, mm or rad.
CREATE TABLE tool_offset (
  tool INTEGER NOT NULL, letter TEXT NOT NULL, value REAL NOT NULL, wear REAL NOT NULL, PRIMARY KEY (tool, letter))
  STRICT, WITHOUT ROWID;
CREATE TABLE job (
  id INTEGER PRIMARY KEY, kind TEXT NOT NULL, program TEXT NOT NULL, hash TEXT NOT NULL,
  started_unix_ms INTEGER NOT NULL, ended_unix_ms INTEGER, outcome TEXT, motion_s REAL, stops INTEGER) STRICT;
CREATE TABLE job_time (job INTEGER NOT NULL, name TEXT NOT NULL, seconds REAL NOT NULL, PRIMARY KEY (job, name))
  STRICT, WITHOUT ROWID;
CREATE TABLE alarm (
  id INTEGER PRIMARY KEY, raised_unix_ms INTEGER NOT NULL, code TEXT NOT NULL, words TEXT NOT NULL, job INTEGER,
  acknowledged_unix_ms INTEGER) STRICT;
-- The line that is driven: one row.
CREATE TABLE driven (
  one INTEGER PRIMARY KEY CHECK (one = 1), job INTEGER NOT NULL, hash TEXT NOT NULL, line INTEGER NOT NULL,
  epoch INTEGER NOT NULL) STRICT;
"];

/// Refuses what is not ours, damaged or of a later version; true where the file is new.
pub(crate) fn examine(connection: &Connection, path: &Path) -> Result<bool, StateError> {
    let reading = |error: rusqlite::Error| StateError::reading(path, &error);
    let number =
        |pragma: &str| connection.pragma_query_value(None, pragma, |row| row.get::<_, i64>(0));
    let application = number("application_id").map_err(reading)?;
    let format = number("user_version").map_err(reading)?;
    let objects = "SELECT count(*) FROM sqlite_master";
    let objects = connection
        .query_row(objects, [], |row| row.get::<_, i64>(0))
        .map_err(reading)?;
    if application == 0 && format == 0 && objects == 0 {
        return Ok(true);
    }
    if application != APPLICATION_ID {
        let what = "it is a database of another program".into();
        return Err(StateError::Foreign {
            path: path.into(),
            what,
        });
    }
    let known = FORMATS.len() as i64;
    if format > known {
        return Err(StateError::Newer {
            path: path.into(),
            found: format,
            known,
        });
    }
    let damaged = |what: String| StateError::Damaged {
        path: path.into(),
        what,
    };
    if format < 1 {
        return Err(damaged(format!("its format is {format}")));
    }
    let verdict =
        connection.pragma_query_value(None, "integrity_check", |row| row.get::<_, String>(0));
    match verdict.map_err(reading)?.as_str() {
        "ok" => Ok(false),
        what => Err(damaged(what.lines().next().unwrap_or_default().to_owned())),
    }
}

/// Brings the file to the last of `formats`, all or nothing; a file that had an older one is copied first. Where the copy
/// is.
pub(crate) fn bring_up(
    connection: &mut Connection,
    path: &Path,
    formats: &[&str],
) -> Result<Option<PathBuf>, StateError> {
    let writing = |error: rusqlite::Error| StateError::writing(path, &error);
    let format = connection
        .pragma_query_value(None, "user_version", |row| row.get::<_, i64>(0))
        .map_err(writing)?;
    let format = format as usize;
    if format == formats.len() {
        return Ok(None);
    }
    let copy = (format > 0).then(|| copy_path(path, format));
    if let Some(copy) = &copy {
        keep_copy(connection, path, copy)?;
    }
    let transaction = connection.transaction().map_err(writing)?;
    for step in &formats[format..] {
        transaction.execute_batch(step).map_err(writing)?;
    }
    transaction
        .pragma_update(None, "application_id", APPLICATION_ID)
        .map_err(writing)?;
    transaction
        .pragma_update(None, "user_version", formats.len() as i64)
        .map_err(writing)?;
    transaction.commit().map_err(writing)?;
    Ok(copy)
}

/// The copy of a file that had format `format`.
fn copy_path(path: &Path, format: usize) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".format-{format}"));
    name.into()
}

/// A copy that is whole and on disk before anything changes. One that an earlier attempt has left is replaced.
fn keep_copy(connection: &Connection, path: &Path, copy: &Path) -> Result<(), StateError> {
    let failed = |why: String| StateError::Write {
        path: path.into(),
        why: format!(
            "its format is older, and the copy {} that is made first cannot be written: {why}",
            copy.display()
        ),
    };
    let mut fresh = copy.as_os_str().to_owned();
    fresh.push(".new");
    let fresh = PathBuf::from(fresh);
    let _ = std::fs::remove_file(&fresh);
    let text = fresh
        .to_str()
        .ok_or_else(|| failed("its name is no UTF-8".into()))?;
    connection
        .execute("VACUUM INTO ?1", [text])
        .map_err(|error| failed(error.to_string()))?;
    let on_disk = || -> std::io::Result<()> {
        std::fs::File::open(&fresh)?.sync_all()?;
        std::fs::rename(&fresh, copy)?;
        let folder = copy
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        std::fs::File::open(folder.unwrap_or_else(|| Path::new(".")))?.sync_all()
    };
    on_disk().map_err(|error| failed(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEXT: &str = "ALTER TABLE tool ADD COLUMN coolant INTEGER NOT NULL DEFAULT 0;";

    fn file_of_format_one(path: &Path) -> Connection {
        let mut connection = Connection::open(path).unwrap();
        assert_eq!(bring_up(&mut connection, path, FORMATS).unwrap(), None);
        connection
            .execute("INSERT INTO parameter VALUES (500, 1.25)", [])
            .unwrap();
        connection
    }

    fn parameter(connection: &Connection) -> f64 {
        connection
            .query_row(
                "SELECT value FROM parameter WHERE number = 500",
                [],
                |row| row.get(0),
            )
            .unwrap()
    }

    #[test]
    fn an_older_file_is_brought_up_and_a_copy_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mill.sqlite");
        let mut connection = file_of_format_one(&path);
        let formats = [FORMATS[0], NEXT];
        let copy = bring_up(&mut connection, &path, &formats)
            .unwrap()
            .expect("a copy was made");
        assert_eq!(
            connection
                .query_row("SELECT count(coolant) FROM tool", [], |row| row
                    .get::<_, i64>(0))
                .unwrap(),
            0
        );
        assert_eq!(parameter(&connection), 1.25);
        let old = Connection::open(&copy).unwrap();
        assert!(!examine(&old, &copy).unwrap());
        assert_eq!(parameter(&old), 1.25);
        assert!(
            old.prepare("SELECT coolant FROM tool").is_err(),
            "the copy has the old format"
        );
        // What the new version has made is later than what this one knows, and the copy's name is in the refusal.
        let refusal = examine(&connection, &path).unwrap_err();
        assert!(
            matches!(
                refusal,
                StateError::Newer {
                    found: 2,
                    known: 1,
                    ..
                }
            ),
            "{refusal}"
        );
        assert!(
            refusal.to_string().contains(copy.to_str().unwrap()),
            "{refusal}"
        );
    }

    #[test]
    fn a_step_that_fails_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mill.sqlite");
        let mut connection = file_of_format_one(&path);
        let formats = [FORMATS[0], NEXT, "ALTER TABLE nothing ADD COLUMN x;"];
        assert!(bring_up(&mut connection, &path, &formats).is_err());
        assert!(connection.prepare("SELECT coolant FROM tool").is_err());
        assert!(!examine(&connection, &path).unwrap());
        // The copy of the attempt is in nobody's way.
        assert!(
            bring_up(&mut connection, &path, &formats[..2])
                .unwrap()
                .is_some()
        );
    }

    #[test]
    fn without_its_copy_a_file_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mill.sqlite");
        let mut connection = file_of_format_one(&path);
        // A folder with content stands where the copy would go.
        std::fs::create_dir_all(copy_path(&path, 1).join("kept")).unwrap();
        let refusal = bring_up(&mut connection, &path, &[FORMATS[0], NEXT]).unwrap_err();
        assert!(
            refusal.to_string().contains(".format-1 that is made first"),
            "{refusal}"
        );
        assert!(connection.prepare("SELECT coolant FROM tool").is_err());
    }
}
