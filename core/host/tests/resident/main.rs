//! Jobs on a machine that stays, against runs of their own.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use tandem_gcode::{Interpreter, Program};
use tandem_host::{
    Clock, JobOutcome, Memory, Registry, Resident, Run, RunObserver, Switches, interpreter_config,
};
use tandem_machine::Machine;
use tandem_rings::{Sample, Switched};

/// Periods of the process before a job: ten million seconds.
const LONG_S: f64 = 1e7;

#[derive(Default)]
struct Kept {
    samples: Vec<Sample>,
    /// Gives an abort before the sample of this tick.
    abort_at: Option<(u64, Arc<tandem_rings::Controls>)>,
    stop_at: Option<(u64, Arc<tandem_rings::Controls>)>,
    reached: Option<tandem_gcode::StateTags>,
}

impl RunObserver for Kept {
    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.samples.push(*sample);
        if let Some(state_tags) = &self.reached {
            state_tags.reach(sample.block);
        }
        let is_at = |at: &Option<(u64, Arc<tandem_rings::Controls>)>| {
            at.as_ref().is_some_and(|(tick, _)| *tick == sample.tick)
        };
        if is_at(&self.abort_at) {
            self.abort_at.take().unwrap().1.abort.store(true, Relaxed);
        }
        if is_at(&self.stop_at) {
            self.stop_at
                .take()
                .unwrap()
                .1
                .emergency_stop
                .store(true, Relaxed);
        }
    }
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

fn registry() -> Registry {
    let mut registry = Registry::default();
    for plugin in [
        tandem_look_ahead::PLUGIN,
        tandem_block_overlap::PLUGIN,
        tandem_sim::PLUGIN,
    ] {
        registry.register(plugin).unwrap();
    }
    registry
}

fn machine() -> Machine {
    Machine::read(&examples().join("machines/mill-3axis.toml"), &[]).unwrap()
}

fn program(text: &str) -> Program {
    Program::spool("part.ngc", text.as_bytes()).unwrap()
}

fn memory(machine: &Machine) -> Memory {
    let interpreter = Interpreter::new(interpreter_config(machine, true, Switches::default()));
    Memory {
        persistent: Arc::new(interpreter.persistent_data()),
        ..Memory::default()
    }
}

fn alone(machine: &Machine, text: &str) -> Vec<Sample> {
    let registry = registry();
    let run = Run::prepare(
        machine.clone(),
        &registry,
        program(text),
        Switches::default(),
    )
    .unwrap();
    let mut kept = Kept::default();
    let outcome = run.drive(Clock::Virtual, &[], &mut kept).unwrap();
    assert_eq!(outcome.summary.fault, None);
    kept.samples
}

fn driven(resident: &mut Resident<'_>, text: &str, kept: &mut Kept) -> JobOutcome {
    let memory = memory(resident.machine());
    let job = resident
        .program(program(text), Switches::default(), &memory, &mut |_, _| ())
        .unwrap();
    resident.drive(job, kept).unwrap()
}

fn assert_same(ours: &[Sample], theirs: &[Sample]) {
    assert_eq!(ours.len(), theirs.len());
    for (ours, theirs) in ours.iter().zip(theirs) {
        // Who has switched off what is off is remembered from the job before; a trace does not keep it.
        let switched = Switched {
            by: theirs.switched.by,
            ..ours.switched
        };
        assert_eq!(&Sample { switched, ..*ours }, theirs);
    }
}

const PART: &str = "G21 F900\nG1 X10 Y5\nG2 X20 I5\nM3 S1000\nG1 Z2\nG0 X0 Y0 Z0\nM2\n";

#[test]
fn a_job_is_the_same_alone_after_others_and_after_a_long_uptime() {
    let (machine, registry) = (machine(), registry());
    let expected = alone(&machine, PART);
    let mut resident = Resident::attach(machine.clone(), &registry, Clock::Virtual).unwrap();
    assert_eq!(resident.enable(false, &mut ()).unwrap().summary.fault, None);
    for uptime_s in [0.0, 1.0, LONG_S] {
        resident.begin_at((uptime_s / machine.fine_period_s) as u64);
        let mut kept = Kept::default();
        let outcome = driven(&mut resident, PART, &mut kept);
        assert_eq!(
            (outcome.summary.fault, outcome.position),
            (None, machine.start)
        );
        assert_same(&kept.samples, &expected);
        for _ in 0..100 {
            assert_eq!(resident.idle(&mut ()).unwrap(), None);
        }
    }
    resident.stop(&mut ()).unwrap();
}

#[test]
fn after_an_abort_a_fault_and_letting_go_the_next_job_begins_where_the_machine_stands() {
    let (machine, registry) = (machine(), registry());
    let mut resident = Resident::attach(machine.clone(), &registry, Clock::Virtual).unwrap();
    resident.enable(false, &mut ()).unwrap();
    let controls = Arc::clone(resident.controls());
    let mut kept = Kept {
        abort_at: Some((300, Arc::clone(&controls))),
        ..Kept::default()
    };
    let outcome = driven(&mut resident, PART, &mut kept);
    assert!(outcome.aborted && outcome.fault.is_none());
    assert_eq!(outcome.position, kept.samples.last().unwrap().command);
    assert_ne!(outcome.position, machine.start);
    // From there, as a run of its own from there.
    let there = resident.machine().clone();
    let mut kept = Kept::default();
    driven(&mut resident, PART, &mut kept);
    assert_same(&kept.samples, &alone(&there, PART));

    let mut kept = Kept {
        stop_at: Some((200, Arc::clone(&controls))),
        ..Kept::default()
    };
    let outcome = driven(&mut resident, PART, &mut kept);
    assert!(outcome.summary.fault.is_some() && !resident.is_enabled());
    assert_eq!(outcome.position, kept.samples.last().unwrap().command);
    assert!(
        resident
            .enable(true, &mut ())
            .unwrap()
            .summary
            .fault
            .is_some(),
        "the stop is in force until it is taken back"
    );
    controls.emergency_stop.store(false, Relaxed);
    assert_eq!(resident.enable(true, &mut ()).unwrap().summary.fault, None);
    assert!(resident.is_enabled());
    let off_mm = resident.machine().start - outcome.position;
    assert!(
        off_mm.0.iter().all(|mm| mm.abs() < 1e-3),
        "the drives say where their own quick stop ended: {off_mm:?}"
    );
    let there = resident.machine().clone();
    let mut kept = Kept::default();
    driven(&mut resident, PART, &mut kept);
    assert_same(&kept.samples, &alone(&there, PART));

    while !resident.disable() {
        assert_eq!(resident.idle(&mut ()).unwrap(), None);
    }
    assert_eq!(resident.enable(false, &mut ()).unwrap().summary.fault, None);
    let mut kept = Kept::default();
    driven(&mut resident, PART, &mut kept);
    assert_same(&kept.samples, &alone(&machine, PART));
    resident.stop(&mut ()).unwrap();
}

#[test]
fn an_abort_that_comes_before_the_drives_are_handed_over_stops_the_job_that_takes_them_over() {
    let (machine, registry) = (machine(), registry());
    let mut resident = Resident::attach(machine.clone(), &registry, Clock::Virtual).unwrap();
    resident.enable(false, &mut ()).unwrap();
    let controls = Arc::clone(resident.controls());
    for first in ["M2\n", "G1 F900 X1\nM2\n", "G1 F900 X0\nX1\nM30\n"] {
        driven(&mut resident, first, &mut Kept::default());
        let stands = resident.machine().start;
        controls.abort.store(true, Relaxed);
        // The loop of the job before is still at the drives, and looks.
        assert_eq!(resident.idle(&mut ()).unwrap(), None);
        let outcome = driven(&mut resident, PART, &mut Kept::default());
        assert!(
            outcome.aborted && outcome.fault.is_none(),
            "after {first:?}"
        );
        assert_eq!(outcome.position, stands);
        let outcome = driven(&mut resident, "G1 F900 X2\nM2\n", &mut Kept::default());
        assert!(!outcome.aborted, "one abort, one job");
    }
    resident.stop(&mut ()).unwrap();
}

#[test]
fn on_the_wall_clock_one_thread_lives_through_all_jobs() {
    // What the computer that tests is late with is another test's.
    let (mut machine, registry) = (machine(), registry());
    (machine.max_missed_periods, machine.max_missed_share) = (u32::MAX, 1.0);
    let mut resident = Resident::attach(machine.clone(), &registry, Clock::Wall).unwrap();
    assert_eq!(resident.enable(false, &mut ()).unwrap().summary.fault, None);
    let text = "F6000\nG1 X2\nX0\nM2\n";
    let mut before = 0;
    for _ in 0..3 {
        let mut kept = Kept::default();
        let outcome = driven(&mut resident, text, &mut kept);
        assert_eq!(
            (outcome.summary.fault, outcome.position),
            (None, machine.start)
        );
        assert_eq!(kept.samples.first().map(|sample| sample.tick), Some(0));
        let periods = resident.uptime_periods();
        assert!(
            periods > before + kept.samples.len() as u64,
            "periods go on between jobs"
        );
        before = periods;
    }
    let mut kept = Kept {
        stop_at: Some((20, Arc::clone(resident.controls()))),
        ..Kept::default()
    };
    assert!(driven(&mut resident, text, &mut kept).fault.is_some());
    resident.controls().emergency_stop.store(false, Relaxed);
    assert_eq!(resident.enable(true, &mut ()).unwrap().summary.fault, None);
    assert_eq!(
        driven(&mut resident, text, &mut Kept::default())
            .summary
            .fault,
        None
    );
    resident.stop(&mut ()).unwrap();
}
