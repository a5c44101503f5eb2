//! Changes written into the tables.

use std::collections::BTreeMap;
use std::path::Path;

use rusqlite::{Connection, OptionalExtension, Transaction, params};
use tandem_gcode::{PersistentData, WORK_SYSTEMS, system_code};
use tandem_sdk::{Axes, AxisVector, MAX_AXES};

use crate::change::Change;
use crate::data::{
    Driven, Job, JobEnd, PERSISTENT_PARAMETERS, PersistentState, Tool, ToolLife, USER_PARAMETERS,
    WorkOffsets,
};
use crate::error::StateError;
use crate::rows::{G92, G92_STORED, LAST, REFERENCES, Rows};

/// Jobs and alarms that are kept, so that the file stays bounded: years of a busy machine, some ten MB.
pub(crate) const MAX_HISTORY: i64 = 20_000;
/// Tools that a file may hold, as many as the interpreter takes.
pub const MAX_TOOLS: usize = 10_000;
/// Highest number of a tool that T can call.
pub const MAX_TOOL_NUMBER: u32 = 99_999;
/// Longest text, bytes: longer ones are refused.
const MAX_TEXT_BYTES: usize = 64 * 1024;

/// Whether a parameter is a program's own.
pub(crate) fn is_user_parameter(number: usize) -> bool {
    (USER_PARAMETERS.0..=USER_PARAMETERS.1).contains(&number)
}

/// Why a change cannot be kept; judged before anything is written, so that no change of several fails alone.
pub(crate) fn judge(change: &Change) -> Result<(), StateError> {
    match change {
        Change::Program(persistent) => judge_program(persistent),
        Change::ForgetReference(which) => below("a reference position", *which, REFERENCES.len()),
        Change::ListParameter { number, value } => judge_parameter(*number, *value),
        Change::Tool(tool) => judge_tool(tool),
        Change::ToolLife { number, life } => judge_life(*number, life),
        Change::ForgetTool(_) | Change::Acknowledged { .. } => Ok(()),
        Change::Turns { axis, .. } => below("the turns of an axis", *axis, MAX_AXES),
        Change::PolicyParameter { name, value } => {
            text("the name of a policy parameter", name)?;
            finite(&format!("the policy parameter {name}"), *value)
        }
        Change::LastPosition(position) => vector("the last position", position),
        Change::JobBegan(job) => {
            judge_end(job.end.as_ref())?;
            text("the program of a job", &job.program)?;
            text("the hash of a job", &job.hash)
        }
        Change::JobEnded { end, .. } => judge_end(Some(end)),
        Change::Raised(alarm) => {
            text("the code of an alarm", &alarm.code)?;
            text("the text of an alarm", &alarm.text)
        }
        Change::Whole(state) => judge_state(state),
    }
}

fn judge_program(persistent: &PersistentData) -> Result<(), StateError> {
    judge_offsets(&offsets_of(persistent))?;
    for (name, place) in REFERENCES.iter().zip(&persistent.reference) {
        vector(name, place)?;
    }
    persistent
        .parameters
        .iter()
        .try_for_each(|(number, value)| finite(&format!("#{number}"), *value))?;
    persistent.tools.iter().try_for_each(|tool| {
        let mut row = Tool::default();
        row.measure(tool);
        judge_tool(&row)
    })
}

fn judge_offsets(offsets: &WorkOffsets) -> Result<(), StateError> {
    for system in 0..WORK_SYSTEMS {
        let name = system_code(system);
        vector(&name, &offsets.origins[system])?;
        finite(
            &format!("the rotation of {name}"),
            offsets.rotations_rad[system],
        )?;
    }
    below("a coordinate system", offsets.active_system, WORK_SYSTEMS)?;
    vector("the offset of G92", &offsets.g92)?;
    vector("what G92.3 restores", &offsets.g92_stored)
}

fn offsets_of(persistent: &PersistentData) -> WorkOffsets {
    WorkOffsets {
        origins: persistent.origins,
        rotations_rad: persistent.rotations_rad,
        active_system: persistent.active_system,
        g92: persistent.g92,
        g92_stored: persistent.g92_stored,
    }
}

fn judge_parameter(number: usize, value: f64) -> Result<(), StateError> {
    if !is_user_parameter(number) {
        let why = format!(
            "the parameters that last are #{} to #{}",
            USER_PARAMETERS.0, USER_PARAMETERS.1
        );
        return Err(StateError::Value {
            what: format!("#{number}"),
            why,
        });
    }
    finite(&format!("#{number}"), value)
}

fn judge_tool(tool: &Tool) -> Result<(), StateError> {
    let what = format!("tool {}", tool.number);
    if !(1..=MAX_TOOL_NUMBER).contains(&tool.number) {
        return Err(StateError::Value {
            what,
            why: format!("tools are numbered from 1 to {MAX_TOOL_NUMBER}"),
        });
    }
    vector(&format!("the offset of {what}"), &tool.offset)?;
    vector(&format!("the wear of {what}"), &tool.wear)?;
    for (name, value) in [
        ("the diameter", tool.diameter_mm),
        ("the wear of the diameter", tool.wear_diameter_mm),
        ("the corner radius", tool.corner_radius_mm),
        ("the front angle", tool.front_angle_deg),
        ("the back angle", tool.back_angle_deg),
    ] {
        finite(&format!("{name} of {what}"), value)?;
    }
    text(&format!("the name of {what}"), &tool.name)?;
    text(&format!("the remark of {what}"), &tool.remark)?;
    judge_life(tool.number, &tool.life)
}

fn judge_life(number: u32, life: &ToolLife) -> Result<(), StateError> {
    let what = format!("the life of tool {number}");
    finite(&what, life.used_s)?;
    finite(&what, life.limit_s.unwrap_or(0.0))?;
    counted(&what, life.uses)?;
    counted(&what, life.limit_uses.unwrap_or(0))
}

fn judge_end(end: Option<&JobEnd>) -> Result<(), StateError> {
    let Some(end) = end else { return Ok(()) };
    finite("the time of a job", end.motion_s)?;
    counted("the stops of a job", end.stops)?;
    end.limited_by_s
        .iter()
        .try_for_each(|(name, seconds)| finite(&format!("the time limited by {name}"), *seconds))
}

fn judge_state(state: &PersistentState) -> Result<(), StateError> {
    judge_offsets(&state.offsets)?;
    for (name, place) in REFERENCES.iter().zip(&state.reference) {
        vector(name, &place.unwrap_or_default())?;
    }
    vector(
        "the last position",
        &state.last_position.unwrap_or_default(),
    )?;
    state
        .parameters
        .iter()
        .try_for_each(|(number, value)| judge_parameter(*number, *value))?;
    for (name, value) in &state.policy_parameters {
        text("the name of a policy parameter", name)?;
        finite(&format!("the policy parameter {name}"), *value)?;
    }
    if state.tools.len() > MAX_TOOLS {
        let what = format!("a table of {} tools", state.tools.len());
        return Err(StateError::Value {
            what,
            why: format!("{MAX_TOOLS} are the most"),
        });
    }
    state.tools.values().try_for_each(judge_tool)
}

fn finite(what: &str, value: f64) -> Result<(), StateError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(StateError::Value {
        what: what.into(),
        why: format!("{value} is no number to go on with"),
    })
}

fn vector(what: &str, value: &AxisVector) -> Result<(), StateError> {
    value.0.iter().try_for_each(|value| finite(what, *value))
}

fn below(what: &str, index: usize, count: usize) -> Result<(), StateError> {
    if index < count {
        return Ok(());
    }
    Err(StateError::Value {
        what: what.into(),
        why: format!("there are {count}, and no index {index}"),
    })
}

fn counted(what: &str, count: u64) -> Result<(), StateError> {
    if i64::try_from(count).is_ok() {
        return Ok(());
    }
    Err(StateError::Value {
        what: what.into(),
        why: format!("a count of {count} is beyond all sense"),
    })
}

fn text(what: &str, value: &str) -> Result<(), StateError> {
    if value.len() <= MAX_TEXT_BYTES {
        return Ok(());
    }
    let why = format!(
        "it has {} bytes, {MAX_TEXT_BYTES} are the most",
        value.len()
    );
    Err(StateError::Value {
        what: what.into(),
        why,
    })
}

/// Writes changes within one transaction.
pub(crate) struct Writer<'a> {
    transaction: Transaction<'a>,
    axes: &'a Axes,
    home: &'a AxisVector,
}

type Done = rusqlite::Result<()>;

impl<'a> Writer<'a> {
    pub fn begin(
        connection: &'a mut Connection,
        axes: &'a Axes,
        home: &'a AxisVector,
    ) -> rusqlite::Result<Self> {
        let transaction =
            connection.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate)?;
        Ok(Self {
            transaction,
            axes,
            home,
        })
    }

    /// On disk when this returns.
    pub fn commit(self) -> Done {
        self.transaction.commit()
    }

    fn run(&self, statement: &str, values: impl rusqlite::Params) -> Done {
        self.transaction
            .prepare(statement)?
            .execute(values)
            .map(|_| ())
    }

    pub fn write(&self, change: &Change) -> Done {
        match change {
            Change::Program(persistent) => self.program(persistent),
            Change::ForgetReference(which) => self.forget_place(REFERENCES[*which]),
            Change::ListParameter { number, value } => self.parameter(*number, *value),
            Change::Tool(tool) => self.tool(tool),
            Change::ToolLife { number, life } => self.tool_life(*number, life),
            Change::ForgetTool(number) => {
                self.run("DELETE FROM tool WHERE number = ?1", [number])?;
                self.run("DELETE FROM tool_offset WHERE tool = ?1", [number])
            }
            Change::Turns { axis, turns } => self.turns(*axis, *turns),
            Change::PolicyParameter { name, value } => {
                self.run("INSERT OR REPLACE INTO policy_parameter VALUES (?1, ?2)", params![name, value])
            }
            Change::LastPosition(position) => self.place(LAST, position),
            Change::JobBegan(job) => self.job(job),
            Change::JobEnded { id, end } => self.job_end(*id, end),
            Change::Raised(alarm) => {
                self.run(
                    "INSERT OR REPLACE INTO alarm VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
                    params![
                        alarm.id,
                        alarm.raised_unix_ms,
                        alarm.code,
                        alarm.text,
                        alarm.job,
                        alarm.acknowledged_unix_ms
                    ],
                )?;
                self.run("DELETE FROM alarm WHERE id <= ?1 - ?2", params![alarm.id, MAX_HISTORY])
            }
            Change::Acknowledged { id, at_unix_ms } => self.run(
                "UPDATE alarm SET acknowledged_unix_ms = ?2 WHERE id = ?1 AND acknowledged_unix_ms IS NULL",
                params![id, at_unix_ms],
            ),
            Change::Whole(state) => self.whole(state),
        }
    }

    /// What differs from the rows is written: they are read instead of being kept, because a request may have changed them too.
    fn program(&self, persistent: &PersistentData) -> Done {
        self.offsets(&offsets_of(persistent))?;
        for (name, place) in REFERENCES.iter().zip(&persistent.reference) {
            let stored = "SELECT 1 FROM place WHERE name = ?1";
            let is_stored = self
                .transaction
                .query_row(stored, [name], |_| Ok(()))
                .optional()?
                .is_some();
            if is_stored || place != self.home {
                self.place(name, place)?;
            }
        }
        self.number("tool_in_spindle", f64::from(persistent.tool_in_spindle))?;
        self.program_parameters(persistent)?;
        self.measured(persistent)
    }

    fn program_parameters(&self, persistent: &PersistentData) -> Done {
        let mut rows = self
            .transaction
            .prepare("SELECT number, value FROM parameter")?;
        let rows = rows.query_map([], |row| Ok((row.get::<_, u32>(0)?, row.get::<_, f64>(1)?)))?;
        let rows = rows.collect::<rusqlite::Result<BTreeMap<_, _>>>()?;
        for (number, value) in &rows {
            let now = persistent.parameters.get(number).copied().unwrap_or(0.0);
            if now != *value {
                self.parameter(*number as usize, now)?;
            }
        }
        let lasts = PERSISTENT_PARAMETERS.0 as u32..=PERSISTENT_PARAMETERS.1 as u32;
        let new = persistent
            .parameters
            .range(lasts)
            .filter(|(number, _)| !rows.contains_key(number));
        new.into_iter()
            .try_for_each(|(number, value)| self.parameter(*number as usize, *value))
    }

    fn offsets(&self, offsets: &WorkOffsets) -> Done {
        for system in 0..WORK_SYSTEMS {
            let name = system_code(system);
            self.place(&name, &offsets.origins[system])?;
            self.number(&name, offsets.rotations_rad[system])?;
        }
        self.number("active", offsets.active_system as f64)?;
        self.place(G92, &offsets.g92)?;
        self.place(G92_STORED, &offsets.g92_stored)
    }

    fn number(&self, name: &str, value: f64) -> Done {
        // What stays as it is costs no page of the disk.
        let row = "INSERT INTO number VALUES (?1, ?2) ON CONFLICT DO UPDATE SET value = ?2 WHERE value <> ?2";
        self.run(row, params![name, value])
    }

    fn parameter(&self, number: usize, value: f64) -> Done {
        self.run(
            "INSERT OR REPLACE INTO parameter VALUES (?1, ?2)",
            params![number, value],
        )
    }

    fn place(&self, name: &str, vector: &AxisVector) -> Done {
        for axis in 0..self.axes.count() {
            let letter = self.axes.letter(axis).to_string();
            let row = "INSERT INTO place VALUES (?1, ?2, ?3) ON CONFLICT DO UPDATE SET value = ?3 WHERE value <> ?3";
            self.run(row, params![name, letter, vector[axis]])?;
        }
        Ok(())
    }

    /// For all letters, those that the machine has no more among them.
    fn forget_place(&self, name: &str) -> Done {
        self.run("DELETE FROM place WHERE name = ?1", [name])
    }

    fn turns(&self, axis: usize, turns: i64) -> Done {
        if axis >= self.axes.count() {
            return Ok(());
        }
        let letter = self.axes.letter(axis).to_string();
        self.run(
            "UPDATE axis SET turns = ?2 WHERE letter = ?1",
            params![letter, turns],
        )
    }

    fn tool(&self, tool: &Tool) -> Done {
        self.run(
            "INSERT OR REPLACE INTO tool VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14)",
            params![
                tool.number,
                tool.pocket,
                tool.name,
                tool.diameter_mm,
                tool.wear_diameter_mm,
                tool.corner_radius_mm,
                tool.front_angle_deg,
                tool.back_angle_deg,
                tool.orientation,
                tool.life.used_s,
                tool.life.limit_s,
                tool.life.uses,
                tool.life.limit_uses,
                tool.remark,
            ],
        )?;
        self.tool_offsets(tool.number, &tool.offset, &tool.wear)
    }

    fn tool_offsets(&self, number: u32, offset: &AxisVector, wear: &AxisVector) -> Done {
        for axis in 0..self.axes.count() {
            let letter = self.axes.letter(axis).to_string();
            let row = params![number, letter, offset[axis], wear[axis]];
            self.run(
                "INSERT OR REPLACE INTO tool_offset VALUES (?1, ?2, ?3, ?4)",
                row,
            )?;
        }
        Ok(())
    }

    fn tool_life(&self, number: u32, life: &ToolLife) -> Done {
        self.run(
            "UPDATE tool SET used_s = ?2, limit_s = ?3, uses = ?4, limit_uses = ?5 WHERE number = ?1",
            params![number, life.used_s, life.limit_s, life.uses, life.limit_uses],
        )
    }

    /// What [`Tool::measure`] does, where a row of the table says something else.
    fn measured(&self, persistent: &PersistentData) -> Done {
        let rows = Rows {
            connection: &self.transaction,
            path: Path::new(""),
            axes: self.axes,
        };
        let mut tools = rows.tools()?;
        for measured in &persistent.tools {
            let row = tools.entry(measured.number).or_default();
            let seen = row.to_program();
            if (seen.number, seen.offset, seen.diameter_mm)
                != (measured.number, measured.offset, measured.diameter_mm)
            {
                row.measure(measured);
                self.tool(row)?;
            }
        }
        Ok(())
    }

    fn job(&self, job: &Job) -> Done {
        self.run(
            "INSERT OR REPLACE INTO job (id, kind, program, hash, started_unix_ms) VALUES (?1, ?2, ?3, ?4, ?5)",
            params![job.id, job.kind.word(), job.program, job.hash, job.started_unix_ms],
        )?;
        self.run(
            "DELETE FROM job WHERE id <= ?1 - ?2",
            params![job.id, MAX_HISTORY],
        )?;
        self.run(
            "DELETE FROM job_time WHERE job <= ?1 - ?2",
            params![job.id, MAX_HISTORY],
        )?;
        job.end
            .as_ref()
            .map_or(Ok(()), |end| self.job_end(job.id, end))
    }

    fn job_end(&self, id: u64, end: &JobEnd) -> Done {
        self.run(
            "UPDATE job SET ended_unix_ms = ?2, outcome = ?3, motion_s = ?4, stops = ?5 WHERE id = ?1",
            params![id, end.at_unix_ms, end.outcome.word(), end.motion_s, end.stops],
        )?;
        self.run("DELETE FROM job_time WHERE job = ?1", [id])?;
        for (name, seconds) in &end.limited_by_s {
            self.run(
                "INSERT INTO job_time VALUES (?1, ?2, ?3)",
                params![id, name, seconds],
            )?;
        }
        Ok(())
    }

    fn whole(&self, state: &PersistentState) -> Done {
        for table in [
            "place",
            "number",
            "parameter",
            "policy_parameter",
            "tool",
            "tool_offset",
        ] {
            self.run(&format!("DELETE FROM {table}"), [])?;
        }
        self.offsets(&state.offsets)?;
        for (name, place) in REFERENCES.iter().zip(&state.reference) {
            place
                .as_ref()
                .map_or(Ok(()), |place| self.place(name, place))?;
        }
        state
            .last_position
            .as_ref()
            .map_or(Ok(()), |position| self.place(LAST, position))?;
        self.number("tool_in_spindle", f64::from(state.tool_in_spindle))?;
        state
            .parameters
            .iter()
            .try_for_each(|(number, value)| self.parameter(*number, *value))?;
        for (name, value) in &state.policy_parameters {
            self.run(
                "INSERT INTO policy_parameter VALUES (?1, ?2)",
                params![name, value],
            )?;
        }
        for (axis, turns) in state.turns.iter().enumerate() {
            self.turns(axis, *turns)?;
        }
        state.tools.values().try_for_each(|tool| self.tool(tool))?;
        self.note("filled", "yes")
    }

    /// A text about the whole file.
    pub fn note(&self, name: &str, value: &str) -> Done {
        self.run("INSERT OR REPLACE INTO note VALUES (?1, ?2)", [name, value])
    }

    /// The line that is driven.
    pub fn driven(&self, driven: &Driven) -> Done {
        self.run(
            "INSERT OR REPLACE INTO driven VALUES (1, ?1, ?2, ?3, ?4)",
            params![driven.job, driven.hash, driven.line, driven.epoch],
        )
    }

    /// The axes are those of the machine; letters of before keep their values.
    pub fn axes(&self) -> Done {
        self.run("UPDATE axis SET nth = NULL", [])?;
        for axis in 0..self.axes.count() {
            self.run(
                "INSERT INTO axis (letter, nth, rotary) VALUES (?1, ?2, ?3) ON CONFLICT (letter) DO UPDATE SET nth = ?2",
                params![self.axes.letter(axis).to_string(), axis, self.axes.is_rotary(axis)],
            )?;
        }
        Ok(())
    }

    /// Jobs that a process that is gone has left open.
    pub fn lose_open_jobs(&self, now_unix_ms: i64) -> Done {
        self.run(
            "UPDATE job SET ended_unix_ms = ?1, outcome = ?2, motion_s = 0, stops = 0 WHERE ended_unix_ms IS NULL",
            params![now_unix_ms, crate::data::Outcome::Lost.word()],
        )
    }
}
