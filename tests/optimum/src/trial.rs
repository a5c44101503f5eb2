//! One program on one machine: its time as it was driven, and the shortest.

use std::path::Path;
use std::sync::Arc;

use tandem_campaign::case::{Case, MachineText};
use tandem_campaign::run::{Ran, drive, registry};
use tandem_campaign::verdict::judge;
use tandem_host::{Switches, each_block, planner};
use tandem_machine::Machine;
use tandem_oracle::Row;
use tandem_rig::{Away, Given, processor_time, stream};

use crate::best::best;
use crate::course::{Course, Limits};

/// The machine of a row: three equal linear axes with 250 mm/s.
#[derive(Clone, Debug)]
pub struct Mill {
    /// Of each axis, mm/s².
    pub acceleration: f64,
    /// Of each axis, mm/s³.
    pub jerk: f64,
    /// Path tolerance, mm.
    pub tolerance: f64,
    /// Fine period, ms.
    pub period_ms: f64,
    /// The planner.
    pub planner: &'static str,
    /// Its options.
    pub options: Vec<(String, String)>,
}

/// Of each axis, mm/s.
const SPEED: f64 = 250.0;
/// Chord error that `nurbs` keeps where none is stated, mm.
const CHORD_ERROR_MM: f64 = 1e-3;

impl Mill {
    fn text(&self) -> MachineText {
        let mut text = MachineText::default();
        text.key("format", 1);
        text.table("[machine]");
        text.key("name", "\"mill\"");
        text.table("[loops]");
        text.key("rough_period_ms", 8);
        text.key("fine_period_ms", self.period_ms);
        text.table("[motion]");
        text.key("path_tolerance_mm", self.tolerance);
        text.key("time_constant_ms", 50);
        text.key("allowable_speed_difference_mm_per_min", 0);
        for axis in ["x", "y", "z"] {
            text.table(&format!("[axes.{axis}]"));
            text.key("travel_mm", "[-500, 500]");
            text.key("max_feed_mm_per_min", 60.0 * SPEED);
            text.key("max_rapid_mm_per_min", 60.0 * SPEED);
            text.key("max_acceleration_mm_per_s2", self.acceleration);
            text.key("max_jerk_mm_per_s3", self.jerk);
        }
        text.table("[planner]");
        text.key("plugin", format!("\"{}\"", self.planner));
        text.table("[planner.options]");
        for (key, value) in &self.options {
            text.key(key, value);
        }
        text.table("[driver]");
        text.key("plugin", "\"sim\"");
        text.table("[guard]");
        text.key("mode", "\"stop\"");
        text
    }
}

/// A program as it was driven.
#[derive(Clone, Debug)]
pub struct Driven {
    /// From the first sample that moves to the last, s; not a number where it was not driven.
    pub time_s: f64,
    /// `clean`, or what the judge says.
    pub verdict: String,
}

/// Processor time for which a program is planned again and again, s: the system counts it in steps of milliseconds.
const PLANNED_S: f64 = 0.1;

/// Drives `program` on `mill` and has it judged. Its files are left in `folder`.
pub fn driven(program: &str, mill: &Mill, folder: &Path) -> Driven {
    let case = Case {
        program: program.to_string(),
        machine: mill.text(),
        commands: String::new(),
    };
    let run = match drive(&case, folder, &registry()) {
        Ok(run) => run,
        Err(report) => {
            return Driven {
                time_s: f64::NAN,
                verdict: format!("{}: {}", report.kind, report.why),
            };
        }
    };
    let report = judge(&run.ran, &case, &run.judging, &run.asked);
    let time_s = moving_s(&run.ran, mill.period_ms / 1000.0);
    Driven {
        time_s,
        verdict: if report.is_failure() {
            format!("{}: {}", report.kind, report.why)
        } else {
            report.kind
        },
    }
}

/// The blocks of `program`, which stands beside its machine file.
fn blocks(program: &Path) -> Option<(Machine, Vec<Given>)> {
    let machine = Machine::read(&program.with_file_name("machine.toml"), &[]).ok()?;
    let mut parsed = tandem_gcode::Program::open(program).ok()?;
    let mut blocks = vec![];
    each_block(
        &machine,
        &mut parsed,
        Switches::default(),
        &mut |block, curve| blocks.push((*block, curve.map(|curve| Arc::new(curve.to_data())))),
    )
    .ok()?;
    Some((machine, blocks))
}

/// Time of motion by processor time of planning `program` by itself, streaming, from its blocks to the last segment. The program has
/// been driven, and was clean.
pub fn planning_speed(program: &Path) -> Option<f64> {
    let (machine, blocks) = blocks(program)?;
    let registry = registry();
    let (mut motion_s, mut planning_s) = (0.0, 0.0);
    while planning_s < PLANNED_S {
        let mut planner = planner(&machine, &registry).ok()?;
        let mut away = Away::default();
        let started = processor_time();
        stream(planner.as_mut(), &blocks, machine.rough_period_s, &mut away);
        planning_s += processor_time().saturating_sub(started).as_secs_f64();
        motion_s += away.duration_s;
    }
    Some(motion_s / planning_s)
}

fn moving_s(ran: &Ran, period_s: f64) -> f64 {
    let moves = |pair: &[Row]| pair[0].command != pair[1].command;
    let pairs = ran.rows.windows(2);
    let first = pairs.clone().position(moves);
    let last = pairs.clone().rposition(moves);
    first.zip(last).map_or(f64::NAN, |(first, last)| {
        (last - first + 1) as f64 * period_s
    })
}

/// The shortest time along the one curve of `program`, s; none where that is not what it has, or where no motion was found
/// whose samples keep the limits.
pub fn best_along_curve(program: &Path, mill: &Mill, chord: bool) -> Option<f64> {
    let (machine, blocks) = blocks(program)?;
    let moving = blocks
        .iter()
        .filter(|(block, curve)| curve.is_some() || block.length_mm > 0.0);
    let [(block, Some(data))] = moving.collect::<Vec<_>>()[..] else {
        return None;
    };
    let course = Course::new(data, &machine.axes).ok()?;
    let lanes = machine.axes.count();
    let limits = Limits {
        feed_mm_per_s: block.feed_mm_per_s,
        speed_mm_per_s: vec![SPEED; lanes],
        acceleration_mm_per_s2: vec![mill.acceleration; lanes],
        jerk_mm_per_s3: vec![mill.jerk; lanes],
        chord_error_mm: if chord { CHORD_ERROR_MM } else { f64::INFINITY },
        period_s: mill.period_ms / 1000.0,
    };
    let build_up_s = (mill.acceleration / mill.jerk).min(0.02);
    let found = best(&course, &limits, (build_up_s / 25.0).max(0.25e-3));
    found.kept_s.is_finite().then_some(found.kept_s)
}
