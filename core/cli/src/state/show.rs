//! `tandem state show`.

use std::error::Error;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use tandem_gcode::system_code;
use tandem_sdk::{Axes, AxisVector};
use tandem_state::{Job, Reader, Tool};

/// Prints what the file at `path` holds, and the `last` jobs and alarms.
pub fn show(path: &Path, last: usize) -> Result<u8, Box<dyn Error>> {
    let reader = Reader::open(path)?;
    let (state, axes) = (reader.state()?, reader.axes());
    let mut text = format!("{}: {}\n", path.display(), reader.machine());
    let offsets = &state.offsets;
    for (system, origin) in offsets.origins.iter().enumerate() {
        let rotation_deg = offsets.rotations_rad[system].to_degrees();
        let is_active = system == offsets.active_system;
        if is_active || *origin != AxisVector::ZERO || rotation_deg != 0.0 {
            let _ = write!(text, "{}{}", system_code(system), place(axes, origin));
            let _ = if rotation_deg == 0.0 {
                Ok(())
            } else {
                write!(text, "  turned_deg {rotation_deg:.4}")
            };
            let _ = writeln!(text, "{}", if is_active { "  in force" } else { "" });
        }
    }
    if offsets.g92_stored != AxisVector::ZERO {
        let suspended = if offsets.g92 == AxisVector::ZERO {
            "  suspended"
        } else {
            ""
        };
        let _ = writeln!(text, "G92{}{suspended}", place(axes, &offsets.g92_stored));
    }
    for (name, stored) in ["G28", "G30"].iter().zip(&state.reference) {
        let stored = stored
            .as_ref()
            .map_or("  home of the machine file".into(), |stored| {
                place(axes, stored)
            });
        let _ = writeln!(text, "{name}{stored}");
    }
    for (number, value) in state.parameters.iter().filter(|(_, value)| **value != 0.0) {
        let _ = writeln!(text, "#{number} = {value}");
    }
    for tool in state.tools.values() {
        let in_spindle = if tool.number == state.tool_in_spindle {
            "  in the spindle"
        } else {
            ""
        };
        let _ = writeln!(text, "{}{in_spindle}", shown(axes, tool));
    }
    for job in reader.jobs(last)? {
        let _ = writeln!(text, "{}", job_line(&job));
    }
    for alarm in reader.alarms(last)? {
        let open = if alarm.acknowledged_unix_ms.is_none() {
            "  not acknowledged"
        } else {
            ""
        };
        let _ = writeln!(
            text,
            "alarm {} {}: {}{open}",
            alarm.id, alarm.code, alarm.text
        );
    }
    // A reader that has gone away is no reason to fail.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(0)
}

fn place(axes: &Axes, vector: &AxisVector) -> String {
    (0..axes.count()).fold(String::new(), |mut text, axis| {
        let letter = axes.letter(axis).to_ascii_lowercase();
        let _ = if axes.is_rotary(axis) {
            write!(text, "  {letter}_deg {:.4}", vector[axis].to_degrees())
        } else {
            write!(text, "  {letter}_mm {:.4}", vector[axis])
        };
        text
    })
}

fn shown(axes: &Axes, tool: &Tool) -> String {
    let seen = tool.to_program();
    let mut text = format!(
        "T{}{}  diameter_mm {:.4}",
        tool.number,
        place(axes, &seen.offset),
        seen.diameter_mm
    );
    for words in [&tool.name, &tool.remark]
        .into_iter()
        .filter(|words| !words.is_empty())
    {
        let _ = write!(text, "  {}", words.escape_debug());
    }
    if tool.life.is_over() {
        text.push_str("  worn out");
    }
    text
}

fn job_line(job: &Job) -> String {
    let outcome = job.end.as_ref().map_or("goes on".to_owned(), |end| {
        format!(
            "{}, {:.1} s, {} stops",
            end.outcome.word(),
            end.motion_s,
            end.stops
        )
    });
    format!(
        "job {} {} {}: {outcome}",
        job.id,
        job.kind.word(),
        job.program.escape_debug()
    )
}
