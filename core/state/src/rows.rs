//! The tables read into plain data.

use std::collections::BTreeMap;
use std::path::Path;

use rusqlite::{Connection, Row};
use tandem_gcode::{WORK_SYSTEMS, system_code};
use tandem_sdk::{Axes, AxisVector};

use crate::data::{Alarm, Driven, Job, JobEnd, JobKind, Outcome, PersistentState, Tool, ToolLife};
use crate::error::StateError;

/// Names of the places of G28 and G30.
pub(crate) const REFERENCES: [&str; 2] = ["G28", "G30"];
/// Names of the offsets of G92: in force, and what G92.3 restores.
pub(crate) const G92: &str = "G92";
pub(crate) const G92_STORED: &str = "G92.3";
/// Name of the last position among the places.
pub(crate) const LAST: &str = "last";

/// Reads from an open file.
pub(crate) struct Rows<'a> {
    pub connection: &'a Connection,
    pub path: &'a Path,
    pub axes: &'a Axes,
}

type Read<T> = Result<T, StateError>;

impl Rows<'_> {
    fn error(&self, error: &rusqlite::Error) -> StateError {
        StateError::reading(self.path, error)
    }

    fn damaged(&self, what: String) -> StateError {
        StateError::Damaged {
            path: self.path.into(),
            what,
        }
    }

    /// All rows of a query.
    fn all<T>(
        &self,
        query: &str,
        limit: i64,
        row: impl FnMut(&Row<'_>) -> rusqlite::Result<T>,
    ) -> Read<Vec<T>> {
        let read = || {
            let mut statement = self.connection.prepare(query)?;
            statement
                .query_map([limit], row)?
                .collect::<rusqlite::Result<Vec<T>>>()
        };
        read().map_err(|error| self.error(&error))
    }

    /// The state as a whole, as one instant saw it.
    pub fn state(&self) -> Read<PersistentState> {
        let at_once = self
            .connection
            .unchecked_transaction()
            .map_err(|error| self.error(&error))?;
        let mut state = PersistentState::default();
        self.places(&mut state)?;
        self.numbers(&mut state)?;
        let parameters = "SELECT number, value FROM parameter LIMIT ?1";
        let parameters = self.all(parameters, -1, |row| {
            Ok((row.get::<_, i64>(0)?, row.get(1)?))
        })?;
        for (number, value) in parameters {
            let known = usize::try_from(number)
                .ok()
                .filter(|n| crate::write::is_user_parameter(*n));
            let number =
                known.ok_or_else(|| self.damaged(format!("it has a parameter #{number}")))?;
            state.parameters.insert(number, value);
        }
        let policy = "SELECT name, value FROM policy_parameter LIMIT ?1";
        state.policy_parameters = self
            .all(policy, -1, |row| Ok((row.get(0)?, row.get(1)?)))?
            .into_iter()
            .collect();
        let turns = self.all("SELECT letter, turns FROM axis LIMIT ?1", -1, |row| {
            Ok((row.get::<_, String>(0)?, row.get(1)?))
        })?;
        for (letter, turns) in turns {
            if let Some(axis) = self.axis(&letter) {
                state.turns[axis] = turns;
            }
        }
        state.tools = self.tools().map_err(|error| self.error(&error))?;
        state.driven = self.driven()?;
        state.alarms = self.alarms("WHERE acknowledged_unix_ms IS NULL ORDER BY id", -1)?;
        drop(at_once);
        Ok(state)
    }

    /// The axis with a letter of the file; none where the machine has it no more.
    fn axis(&self, letter: &str) -> Option<usize> {
        self.axes.index(letter.chars().next()?)
    }

    fn places(&self, state: &mut PersistentState) -> Read<()> {
        let rows = "SELECT name, letter, value FROM place LIMIT ?1";
        let rows = self.all(rows, -1, |row| {
            Ok((
                row.get::<_, String>(0)?,
                row.get::<_, String>(1)?,
                row.get(2)?,
            ))
        })?;
        for (name, letter, value) in rows {
            let system = (0..WORK_SYSTEMS).find(|system| system_code(*system) == name);
            let reference = REFERENCES.iter().position(|known| *known == name);
            let vector = match (system, reference, name.as_str()) {
                (Some(system), ..) => &mut state.offsets.origins[system],
                (_, Some(which), _) => state.reference[which].get_or_insert(AxisVector::ZERO),
                (.., G92) => &mut state.offsets.g92,
                (.., G92_STORED) => &mut state.offsets.g92_stored,
                (.., LAST) => state.last_position.get_or_insert(AxisVector::ZERO),
                _ => return Err(self.damaged(format!("it has a place \"{name}\""))),
            };
            if let Some(axis) = self.axis(&letter) {
                vector[axis] = value;
            }
        }
        Ok(())
    }

    fn numbers(&self, state: &mut PersistentState) -> Read<()> {
        let rows = "SELECT name, value FROM number LIMIT ?1";
        let rows = self.all(rows, -1, |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, f64>(1)?))
        })?;
        for (name, value) in rows {
            let whole =
                |to: f64| Some(value).filter(|v| v.fract() == 0.0 && (0.0..=to).contains(v));
            let known = match name.as_str() {
                "active" => whole(8.0).map(|value| state.offsets.active_system = value as usize),
                "tool_in_spindle" => {
                    whole(f64::from(u32::MAX)).map(|value| state.tool_in_spindle = value as u32)
                }
                name => (0..WORK_SYSTEMS)
                    .find(|system| system_code(*system) == name)
                    .map(|system| state.offsets.rotations_rad[system] = value),
            };
            known.ok_or_else(|| self.damaged(format!("it has \"{name}\" = {value}")))?;
        }
        Ok(())
    }

    /// The tool table.
    pub fn tools(&self) -> rusqlite::Result<BTreeMap<u32, Tool>> {
        let mut tools = BTreeMap::new();
        for row in self.connection.prepare(TOOL)?.query_map([], tool)? {
            let tool = row?;
            tools.insert(tool.number, tool);
        }
        let mut offsets = self
            .connection
            .prepare("SELECT tool, letter, value, wear FROM tool_offset")?;
        for row in offsets.query_map([], tool_offset)? {
            let (number, letter, value, wear) = row?;
            if let (Some(tool), Some(axis)) = (tools.get_mut(&number), self.axis(&letter)) {
                tool.offset[axis] = value;
                tool.wear[axis] = wear;
            }
        }
        Ok(tools)
    }

    fn driven(&self) -> Read<Option<Driven>> {
        let rows = self.all(
            "SELECT job, hash, line, epoch FROM driven LIMIT ?1",
            1,
            |row| {
                Ok(Driven {
                    job: row.get(0)?,
                    hash: row.get(1)?,
                    line: row.get(2)?,
                    epoch: row.get(3)?,
                })
            },
        )?;
        Ok(rows.into_iter().next())
    }

    /// Alarms that a clause selects and sorts.
    fn alarms(&self, clause: &str, limit: i64) -> Read<Vec<Alarm>> {
        let query = format!(
            "SELECT id, raised_unix_ms, code, words, job, acknowledged_unix_ms FROM alarm {clause} LIMIT ?1"
        );
        self.all(&query, limit, |row| {
            Ok(Alarm {
                id: row.get(0)?,
                raised_unix_ms: row.get(1)?,
                code: row.get(2)?,
                text: row.get(3)?,
                job: row.get(4)?,
                acknowledged_unix_ms: row.get(5)?,
            })
        })
    }

    /// The last alarms, the latest first.
    pub fn last_alarms(&self, count: usize) -> Read<Vec<Alarm>> {
        self.alarms("ORDER BY id DESC", count as i64)
    }

    /// The last jobs, the latest first.
    pub fn last_jobs(&self, count: usize) -> Read<Vec<Job>> {
        let rows = "SELECT id, kind, program, hash, started_unix_ms, ended_unix_ms, outcome, motion_s, stops FROM job \
                    ORDER BY id DESC LIMIT ?1";
        let rows = self.all(rows, count as i64, |row| {
            let job = Job {
                id: row.get(0)?,
                kind: JobKind::Program,
                program: row.get(2)?,
                hash: row.get(3)?,
                started_unix_ms: row.get(4)?,
                end: None,
            };
            let end: Option<i64> = row.get(5)?;
            let end = end.map(|at_unix_ms| {
                Ok::<_, rusqlite::Error>((
                    at_unix_ms,
                    row.get::<_, String>(6)?,
                    row.get(7)?,
                    row.get(8)?,
                ))
            });
            Ok((job, row.get::<_, String>(1)?, end.transpose()?))
        })?;
        let jobs = rows.into_iter().map(|(mut job, kind, end)| {
            job.kind = JobKind::of_word(&kind)
                .ok_or_else(|| self.damaged(format!("it has a job \"{kind}\"")))?;
            if let Some((at_unix_ms, outcome, motion_s, stops)) = end {
                let known = Outcome::of_word(&outcome);
                let outcome = known
                    .ok_or_else(|| self.damaged(format!("it has an outcome \"{outcome}\"")))?;
                let times = "SELECT name, seconds FROM job_time WHERE job = ?1";
                let times = self.all(times, job.id as i64, |row| {
                    Ok((row.get::<_, String>(0)?, row.get(1)?))
                })?;
                let limited_by_s = times.into_iter().collect();
                job.end = Some(JobEnd {
                    at_unix_ms,
                    outcome,
                    motion_s,
                    limited_by_s,
                    stops,
                });
            }
            Ok(job)
        });
        jobs.collect()
    }

    /// The highest number in use of a table's rows.
    pub fn highest(&self, table: &str) -> Read<u64> {
        let query = format!("SELECT coalesce(max(id), 0) FROM {table} LIMIT ?1");
        Ok(self
            .all(&query, 1, |row| row.get(0))?
            .first()
            .copied()
            .unwrap_or(0))
    }

    /// A text about the whole file.
    pub fn note(&self, name: &str) -> Read<Option<String>> {
        let read =
            self.connection
                .query_row("SELECT value FROM note WHERE name = ?1", [name], |row| {
                    row.get(0)
                });
        match read {
            Ok(text) => Ok(Some(text)),
            Err(rusqlite::Error::QueryReturnedNoRows) => Ok(None),
            Err(error) => Err(self.error(&error)),
        }
    }
}

const TOOL: &str = "SELECT number, pocket, name, diameter_mm, wear_diameter_mm, corner_radius_mm, front_angle_deg, \
                    back_angle_deg, orientation, used_s, limit_s, uses, limit_uses, remark FROM tool";

fn tool(row: &Row<'_>) -> rusqlite::Result<Tool> {
    Ok(Tool {
        number: row.get(0)?,
        pocket: row.get(1)?,
        name: row.get(2)?,
        offset: AxisVector::ZERO,
        wear: AxisVector::ZERO,
        diameter_mm: row.get(3)?,
        wear_diameter_mm: row.get(4)?,
        corner_radius_mm: row.get(5)?,
        front_angle_deg: row.get(6)?,
        back_angle_deg: row.get(7)?,
        orientation: row.get(8)?,
        life: ToolLife {
            used_s: row.get(9)?,
            limit_s: row.get(10)?,
            uses: row.get(11)?,
            limit_uses: row.get(12)?,
        },
        remark: row.get(13)?,
    })
}

/// Tool, letter, offset and wear.
fn tool_offset(row: &Row<'_>) -> rusqlite::Result<(u32, String, f64, f64)> {
    Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
}

/// The axes that a file was last opened with; none where it never was.
pub(crate) fn axes_of(connection: &Connection, path: &Path) -> Read<Option<Axes>> {
    let read = || {
        let mut statement = connection
            .prepare("SELECT letter, rotary FROM axis WHERE nth IS NOT NULL ORDER BY nth")?;
        let rows = statement.query_map([], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, bool>(1)?))
        })?;
        rows.collect::<rusqlite::Result<Vec<_>>>()
    };
    let rows = read().map_err(|error| StateError::reading(path, &error))?;
    if rows.is_empty() {
        return Ok(None);
    }
    let axes: Vec<_> = rows
        .iter()
        .map(|(letter, rotary)| (letter.chars().next().unwrap_or('?'), *rotary))
        .collect();
    Axes::new(&axes)
        .map(Some)
        .map_err(|what| StateError::Damaged {
            path: path.into(),
            what,
        })
}

/// The letters that a file knows, with whether they turn, those that the machine has no more among them.
pub(crate) fn letters_of(connection: &Connection, path: &Path) -> Read<BTreeMap<char, bool>> {
    let read = || {
        let mut statement = connection.prepare("SELECT letter, rotary FROM axis")?;
        let rows = statement.query_map([], |row| {
            Ok((row.get::<_, String>(0)?, row.get::<_, bool>(1)?))
        })?;
        rows.collect::<rusqlite::Result<Vec<_>>>()
    };
    let rows = read().map_err(|error| StateError::reading(path, &error))?;
    Ok(rows
        .into_iter()
        .filter_map(|(letter, rotary)| Some((letter.chars().next()?, rotary)))
        .collect())
}
