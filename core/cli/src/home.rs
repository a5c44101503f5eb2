//! `tandem home`.

use std::error::Error;

use tandem_host::{Apart, Run, RunObserver, Switches};
use tandem_machine::{AxisHoming, Machine};
use tandem_rings::Sample;
use tandem_sdk::{Event, EventKind};
use tandem_session::HOMING;

use crate::broken::Broken;
use crate::report::Collector;
use crate::trace::TraceSink;
use crate::warnings::tell_warnings;
use crate::{FAULT, args, built_in, clock};

/// Homes the axes of a machine.
pub fn home(options: &args::Home) -> Result<u8, Box<dyn Error>> {
    let mut machine = options.place.machine()?;
    if let Some(letter) = options.axis {
        let axis = machine.axes.index(letter.to_ascii_uppercase());
        machine.homing.retain(|homing| Some(homing.axis) == axis);
        if machine.homing.is_empty() {
            return Err(format!(
                "the machine has no [homing.{}]",
                letter.to_ascii_lowercase()
            )
            .into());
        }
    }
    let registry = built_in::registry()?;
    if let Some(apart) = Apart::of(&machine, &registry)? {
        // Its joints are shown by their names, and recorded as axes of their own.
        machine = apart.machine;
    }
    let clock = clock::of(options.clock, &machine, &registry);
    let switches = Switches {
        reset: options.reset,
        clock: Some(clock),
        ..Switches::default()
    };
    let run = Run::home(machine.clone(), &registry, HOMING, switches)?;
    let trace = options
        .trace
        .as_ref()
        .map(|path| TraceSink::create(path, &machine, "(homing)", &run, false));
    let report = options
        .report
        .as_ref()
        .map(|_| Collector::new(&machine, "homing", &[], run.allows_steps()));
    let (corrections, broken) = (Corrections::new(&machine), Broken::default());
    let mut observer = Observer {
        corrections,
        trace: trace.transpose()?,
        report,
        broken,
    };
    let outcome = run.drive(clock, &[], &mut observer)?;
    let Observer {
        trace,
        report,
        mut broken,
        ..
    } = observer;
    broken.note(trace.map_or(Ok(()), TraceSink::finish));
    if let (Some(report), Some(path)) = (report, &options.report) {
        broken.note(report.write(path, &outcome.summary));
    }
    broken.tell();
    for failure in outcome.summary.fault.iter().chain(&outcome.summary.stopped) {
        say!("fault: {failure}");
    }
    tell_warnings(&outcome.summary);
    let failed =
        outcome.summary.fault.is_some() || outcome.summary.stopped.is_some() || broken.is_any();
    Ok(if failed { FAULT } else { 0 })
}

struct Observer {
    corrections: Corrections,
    trace: Option<TraceSink>,
    report: Option<Collector>,
    broken: Broken,
}

impl RunObserver for Observer {
    fn broken_record(&mut self) -> Option<String> {
        self.broken.tell()
    }

    fn note(&mut self, note: &str) {
        say!("{note}");
    }

    fn event(&mut self, event: &Event) {
        self.corrections.event(event);
    }

    fn needs_each_deviation(&self) -> bool {
        self.report.is_some()
    }

    fn sample(&mut self, sample: &Sample, deviation_mm: f64, signals: &[f64]) {
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.sample(sample, signals));
        }
        if let Some(report) = &mut self.report {
            report.sample(sample, deviation_mm, signals);
        }
    }
}

/// Says where each axis was found.
pub struct Corrections {
    /// Name, home position, internal units a unit of messages, and that unit, per axis.
    axes: Vec<(String, f64, f64, &'static str)>,
}

impl Corrections {
    pub fn new(machine: &Machine) -> Self {
        let name = |axis: usize| {
            let foot = |of: &&AxisHoming| of.axis == axis && of.foot.is_some();
            let joint = machine.homing.iter().find(foot);
            joint.map_or_else(
                || machine.axes.letter(axis).to_ascii_lowercase().to_string(),
                |of| of.table(&machine.axes, &machine.joints),
            )
        };
        let axis = |axis: usize| {
            let rotary = machine.axes.is_rotary(axis);
            let (scale, unit) = if rotary {
                (1f64.to_radians(), "deg")
            } else {
                (1.0, "mm")
            };
            (name(axis), machine.home[axis], scale, unit)
        };
        Self {
            axes: (0..machine.axes.count()).map(axis).collect(),
        }
    }

    pub fn event(&self, event: &Event) {
        let Some((name, home, scale, unit)) = self.axes.get(event.index.unsigned_abs() as usize)
        else {
            return;
        };
        match event.kind {
            EventKind::Correct => {
                say!(
                    "homing {name}: the switch is found; the axis stood {:+.6} {unit} off",
                    event.value / scale
                );
            }
            EventKind::HomeByDrive => {
                say!("homing {name}: by its drive, within {} s", event.value);
            }
            EventKind::Homed => say!("homing {name}: goes home, to {:.6} {unit}", home / scale),
            _ => {}
        }
    }
}
