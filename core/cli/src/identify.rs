//! `tandem identify`: inertia and friction of an axis, from air runs.

use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use tandem_force_control::fit::{Fit, Point, stribeck};
use tandem_force_control::inertia::{Differences, Rls};
use tandem_gcode::Program;
use tandem_host::{Run, RunObserver, Switches};
use tandem_machine::Machine;
use tandem_recorder::Output;
use tandem_rings::Sample;

use crate::warnings::tell_warnings;
use crate::{FAULT, args, built_in, clock};

/// Speeds of the air runs, rad/s: down to those of cutting, where friction is not viscous.
const SPEEDS_RAD_PER_S: [f64; 8] = [0.26, 0.52, 1.05, 2.1, 4.2, 8.4, 16.8, 31.4];
/// How long an air run takes where the travel is long enough, and at least, s.
const AIR_RUN_S: (f64, f64) = (1.5, 0.3);
/// Share of a run after which the speed is steady, and before which it still is.
const STEADY: (f64, f64) = (0.5, 0.95);
/// Highest speed of the strokes, rad/s, how long each goes on at it, s, and their number.
const STROKE: (f64, f64, usize) = (60.0, 0.1, 40);
/// Periods over which differences are taken.
const SPAN: usize = 20;
/// Below this share of the strokes' speed samples are left out, and never above this, rad/s.
const NEAR_REVERSAL: (f64, f64) = (0.2, 10.0);

/// What a line of the program is for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Purpose {
    Positioning,
    AirRun(f64),
    Stroke,
}

/// The axis, and what the machine file says of its motor.
struct Motor {
    letter: char,
    index: usize,
    turns: f64,
    torque_constant_nm_per_a: f64,
}

/// Line, place in mm, speed in mm/s and current in A of a sample.
type Row = (u32, f64, f64, f64);

/// The samples of the axis.
struct Record {
    index: usize,
    rows: Vec<Row>,
}

impl RunObserver for Record {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        let i = self.index;
        self.rows.push((
            sample.line,
            sample.feedback[i],
            sample.speed[i],
            sample.current_a[i],
        ));
    }
}

/// Finds inertia and friction of an axis and writes them.
pub fn identify(options: &args::Identify) -> Result<u8, Box<dyn Error>> {
    let mut machine = Machine::read(&options.machine, &options.overrides)?;
    let motor = Motor::of(&machine, options.axis)?;
    // What is to be identified is not there yet, and nothing may change the feed.
    (machine.feed_strategy, machine.policy) = (None, None);
    let (text, purposes) = program(&machine, &motor)?;
    let rows = drive(machine.clone(), &text, options, motor.index)?;
    let points = air_runs(&rows, &purposes, &motor);
    let fit =
        stribeck(&points, true).ok_or("too few air runs fit into travel and feed of the axis")?;
    let inertia = inertia(&rows, &purposes, &motor, &fit, machine.fine_period_s)?;
    let path = options
        .out
        .clone()
        .unwrap_or_else(|| beside(&options.machine, motor.letter));
    // A reader that has gone away is no reason to fail.
    let _ = std::io::stdout().write_all(shown(&motor, &points, &fit, &inertia).as_bytes());
    if let Err(cause) = write(&path, &file(&motor, &fit, &inertia, &machine)) {
        // The machine has moved, and what it has found stands above.
        say!("error: {cause}");
        return Ok(FAULT);
    }
    let _ = writeln!(
        std::io::stdout(),
        "written: {}; include it in the machine file",
        path.display()
    );
    Ok(0)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    let mut out = Output::create(path)?;
    out.write_all(text.as_bytes())
        .map_err(|e| format!("{}: {e}", path.display()))?;
    out.finish()
}

impl Motor {
    fn of(machine: &Machine, letter: char) -> Result<Self, String> {
        let index = machine
            .axes
            .index(letter.to_ascii_uppercase())
            .ok_or(format!("the machine has no axis {letter}"))?;
        if machine.axes.is_rotary(index) || !joints_are_axes(machine) {
            return Err(format!(
                "axis {letter}: only linear axes are identified, on machines where each axis has one motor of its own"
            ));
        }
        let letter = letter.to_ascii_lowercase();
        let table = format!("feed_strategy.options.axes.{letter}");
        let options = machine
            .feed_strategy
            .as_ref()
            .map_or("", |strategy| &strategy.options);
        let options: toml::Table = options
            .parse()
            .map_err(|e| format!("feed_strategy.options: {e}"))?;
        let axis = options
            .get("axes")
            .and_then(|axes| axes.get(letter.to_string()));
        let number = |key: &str| {
            let value = axis.and_then(|axis| axis.get(key));
            let number =
                value.and_then(|v| v.as_float().or_else(|| v.as_integer().map(|v| v as f64)));
            let missing = format!(
                "{}: {table}.{key}: missing, and an identification needs it",
                machine.place(&table)
            );
            number.filter(|value| *value > 0.0).ok_or(missing)
        };
        let turns = TAU / number("lead_mm")?;
        Ok(Self {
            letter,
            index,
            turns,
            torque_constant_nm_per_a: number("torque_constant_nm_per_a")?,
        })
    }
}

/// Whether current i is that of axis i: no kinematics, and no axis with two motors.
fn joints_are_axes(machine: &Machine) -> bool {
    let motors = |axis: usize| {
        machine
            .joints
            .iter()
            .filter(|joint| joint.axis == Some(axis))
            .count()
    };
    machine.kinematics.plugin == "identity"
        && (0..machine.axes.count()).all(|axis| motors(axis) <= 1)
}

/// The experiment, and what each of its lines is for.
fn program(machine: &Machine, motor: &Motor) -> Result<(String, Vec<Purpose>), String> {
    let limits = &machine.limits.axes()[motor.index];
    let middle = f64::midpoint(limits.min_mm, limits.max_mm);
    let room = 0.9 * (limits.max_mm - limits.min_mm);
    if !(middle.is_finite() && room > 0.0) {
        return Err(format!(
            "axis {}: it states no travel to move in",
            motor.letter
        ));
    }
    let mut text = "G21 G90 G94 G61\n".to_string();
    let mut purposes = vec![Purpose::Positioning; 2];
    let mut line = |place_mm: f64, mm_per_s: Option<f64>, purpose: Purpose| {
        let letter = motor.letter.to_ascii_uppercase();
        let feed = mm_per_s.map(|v| v * 60.0);
        let _ = match feed {
            Some(feed) => writeln!(text, "G1 {letter}{place_mm:.6} F{feed:.6}"),
            None => writeln!(text, "G0 {letter}{place_mm:.6}"),
        };
        purposes.push(purpose);
    };
    for speed in SPEEDS_RAD_PER_S {
        let mm_per_s = speed / motor.turns;
        let length = (mm_per_s * AIR_RUN_S.0).min(room);
        if mm_per_s > limits.feed_mm_per_s || length < mm_per_s * AIR_RUN_S.1 {
            continue;
        }
        line(middle - length / 2.0, None, Purpose::Positioning);
        line(
            middle + length / 2.0,
            Some(mm_per_s),
            Purpose::AirRun(speed),
        );
        line(
            middle - length / 2.0,
            Some(mm_per_s),
            Purpose::AirRun(-speed),
        );
    }
    let (mm_per_s, length) = stroke(
        limits.feed_mm_per_s,
        limits.acceleration_mm_per_s2,
        room,
        motor,
    );
    for stroke in 0..STROKE.2 {
        let side = if stroke % 2 == 0 { 0.5 } else { -0.5 };
        line(
            middle + side * length,
            Some(mm_per_s),
            if stroke == 0 {
                Purpose::Positioning
            } else {
                Purpose::Stroke
            },
        );
    }
    Ok((text + "M2\n", purposes))
}

/// Speed, mm/s, and length, mm, of the strokes.
fn stroke(
    feed_mm_per_s: f64,
    acceleration_mm_per_s2: f64,
    room_mm: f64,
    motor: &Motor,
) -> (f64, f64) {
    let length = |v: f64| v * v / acceleration_mm_per_s2 + v * STROKE.1;
    let mut mm_per_s = (STROKE.0 / motor.turns).min(0.95 * feed_mm_per_s);
    while length(mm_per_s) > room_mm {
        mm_per_s *= 0.9;
    }
    (mm_per_s, length(mm_per_s))
}

fn drive(
    machine: Machine,
    text: &str,
    options: &args::Identify,
    index: usize,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let program = Program::spool("identify", text.as_bytes())?;
    let registry = built_in::registry()?;
    let clock = clock::of(options.clock, &machine, &registry);
    let run = Run::prepare(
        machine,
        &registry,
        program,
        Switches {
            clock: Some(clock),
            ..Switches::default()
        },
    )?;
    let mut record = Record {
        index,
        rows: vec![],
    };
    let summary = run.drive(clock, &[], &mut record)?.summary;
    tell_warnings(&summary);
    match summary.fault.or(summary.stopped) {
        Some(cause) => Err(cause.into()),
        None => Ok(record.rows),
    }
}

fn purpose_of(purposes: &[Purpose], line: u32) -> Purpose {
    purposes
        .get(line as usize)
        .copied()
        .unwrap_or(Purpose::Positioning)
}

/// The mean torque of each air run while its speed is steady.
fn air_runs(rows: &[Row], purposes: &[Purpose], motor: &Motor) -> Vec<Point> {
    let mean = |(line, purpose): (usize, &Purpose)| {
        let Purpose::AirRun(speed_rad_per_s) = *purpose else {
            return None;
        };
        let of_line: Vec<f64> = rows
            .iter()
            .filter(|row| row.0 as usize == line)
            .map(|row| row.3)
            .collect();
        let at = |share: f64| (share * of_line.len() as f64) as usize;
        let steady = &of_line[at(STEADY.0)..at(STEADY.1)];
        let current_a = steady.iter().sum::<f64>() / steady.len() as f64;
        let torque_nm = motor.torque_constant_nm_per_a * current_a;
        torque_nm.is_finite().then_some(Point {
            speed_rad_per_s,
            torque_nm,
        })
    };
    purposes.iter().enumerate().filter_map(mean).collect()
}

/// Inertia, kg·m², and the half-width of its 95 % interval, %.
struct Inertia {
    kg_m2: f64,
    doubt_percent: f64,
    samples: usize,
}

/// Least squares over the strokes, the friction taken out.
fn inertia(
    rows: &[Row],
    purposes: &[Purpose],
    motor: &Motor,
    fit: &Fit,
    period_s: f64,
) -> Result<Inertia, String> {
    let strokes: Vec<_> = rows
        .iter()
        .filter(|row| purpose_of(purposes, row.0) == Purpose::Stroke)
        .collect();
    let fastest = strokes
        .iter()
        .map(|row| (row.2 * motor.turns).abs())
        .fold(0.0, f64::max);
    let mut differences = Differences::new(
        SPAN,
        period_s,
        (NEAR_REVERSAL.0 * fastest).min(NEAR_REVERSAL.1),
    );
    let (mut rls, mut samples, mut last) = (Rls::new(0.0, 1.0, 1.0), 0, None);
    for (_, place, _, current_a) in strokes {
        let angle = place * motor.turns;
        let speed = last
            .replace(angle)
            .map_or(0.0, |last| (angle - last) / period_s);
        let free_nm = motor.torque_constant_nm_per_a * current_a - fit.model.torque_nm(speed);
        if let Some((acceleration, torque_nm)) = differences.push(angle, free_nm) {
            rls.update(acceleration, torque_nm);
            samples += 1;
        }
    }
    // Neighbouring differences share most of their samples: so many of them count as one.
    let doubt = 1.96 * rls.deviation() * (2.0 * SPAN as f64).sqrt();
    let kg_m2 = rls.value();
    if samples < 10 * SPAN || kg_m2 <= 0.0 || kg_m2.is_nan() {
        return Err(format!(
            "the strokes gave {samples} samples away from reversals: no inertia can be found"
        ));
    }
    Ok(Inertia {
        kg_m2,
        doubt_percent: 100.0 * doubt / kg_m2,
        samples,
    })
}

fn beside(machine: &Path, letter: char) -> PathBuf {
    let stem = machine.file_stem().unwrap_or_default().to_string_lossy();
    machine.with_file_name(format!("{stem}-{letter}.toml"))
}

/// The file that the machine file includes.
fn file(motor: &Motor, fit: &Fit, inertia: &Inertia, machine: &Machine) -> String {
    let model = &fit.model;
    format!(
        "# Written by tandem identify for axis {letter} of {name}; include it in the machine file.\n\
         [feed_strategy.options.axes.{letter}]\n\
         inertia_kg_m2 = {:.5e}\n\
         [feed_strategy.options.axes.{letter}.friction]\n\
         coulomb_nm = {:.6}\nviscous_nm_s_per_rad = {:.4e}\nstribeck_nm = {:.6}\nstribeck_speed_rad_per_s = {:.4}\n\
         constant_nm = {:.6}\n\
         [feed_strategy.options.axes.{letter}.confidence]    # half-widths of 95 % intervals; residual of the friction model\n\
         inertia_percent = {:.3}\ncoulomb_nm = {:.6}\nfriction_rms_nm = {:.6}\n",
        inertia.kg_m2,
        model.coulomb_nm.max(0.0),
        model.viscous_nm_s_per_rad,
        model.stribeck_nm,
        model.stribeck_speed_rad_per_s,
        model.constant_nm,
        inertia.doubt_percent,
        1.96 * fit.deviations[0],
        fit.rms_nm,
        letter = motor.letter,
        name = machine.name,
    )
}

fn shown(motor: &Motor, points: &[Point], fit: &Fit, inertia: &Inertia) -> String {
    let mut text = format!(
        "axis {}\n  speed, rad/s   torque, N·m    model, N·m\n",
        motor.letter
    );
    for Point {
        speed_rad_per_s,
        torque_nm,
    } in points
    {
        let model_nm = fit.model.torque_nm(*speed_rad_per_s);
        let _ = writeln!(
            text,
            "{speed_rad_per_s:14.2} {torque_nm:13.5} {model_nm:13.5}"
        );
    }
    let (model, d) = (&fit.model, &fit.deviations);
    let _ = writeln!(
        text,
        "Coulomb   {:.5} ± {:.5} N·m",
        model.coulomb_nm,
        1.96 * d[0]
    );
    let _ = writeln!(
        text,
        "viscous   {:.3e} ± {:.1e} N·m·s/rad",
        model.viscous_nm_s_per_rad,
        1.96 * d[1]
    );
    let _ = writeln!(
        text,
        "Stribeck  {:.5} N·m at {:.3} rad/s",
        model.stribeck_nm, model.stribeck_speed_rad_per_s
    );
    let _ = writeln!(
        text,
        "constant  {:.5} ± {:.5} N·m, residual {:.5} N·m rms",
        model.constant_nm,
        1.96 * d[2],
        fit.rms_nm
    );
    let (kg_m2, percent, samples) = (inertia.kg_m2, inertia.doubt_percent, inertia.samples);
    let _ = writeln!(
        text,
        "inertia   {kg_m2:.4e} kg·m² ± {percent:.2} %, from {samples} samples"
    );
    text
}
