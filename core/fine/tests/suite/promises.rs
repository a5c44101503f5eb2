//! Promises of the fine loop that nothing else of this package would miss.

use crate::{common, demanding};

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use common::{Bench, PERIOD_S};
use demanding::Script;
use tandem_fine::{FaultKind, GuardMode};
use tandem_rings::{MachineState, Ratio, RestCause, Sample, StopCause};
use tandem_sdk::{EventKind, StopOn};

fn tick(bench: &mut Bench, periods: u32) -> Vec<Sample> {
    let mut samples = vec![];
    for _ in 0..periods {
        bench.fine.tick();
        samples.extend(std::iter::from_fn(|| bench.host.samples.pop().ok()));
    }
    samples
}

/// At the feed, with seconds of it ahead.
fn cruising() -> Bench {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(3.0);
    bench.brake();
    tick(&mut bench, 300);
    assert_eq!(bench.state(), MachineState::Running);
    bench
}

#[test]
fn a_ramp_ends_in_one_quick_stop_of_the_drives_and_not_before() {
    let mut bench = cruising();
    bench.host.controls.emergency_stop.store(true, Relaxed);
    // 20 mm/s at 1000 mm/s²: 20 periods.
    tick(&mut bench, 19);
    assert_eq!(
        (bench.state(), bench.quick_stops()),
        (MachineState::Stopping, 0)
    );
    tick(&mut bench, 30);
    assert_eq!(
        (bench.state(), bench.quick_stops()),
        (MachineState::Fault, 1)
    );
}

#[test]
fn feedback_that_is_no_number_while_ramping_goes_no_further_and_changes_no_cause() {
    let mut bench = cruising();
    bench.host.controls.emergency_stop.store(true, Relaxed);
    tick(&mut bench, 5);
    bench.spoil_feedback();
    let samples = tick(&mut bench, 10);
    assert!(
        samples.len() == 10
            && samples
                .iter()
                .all(|sample| sample.feedback.0.iter().all(|v| v.is_finite()))
    );
    assert!(
        samples
            .iter()
            .all(|sample| sample.feedback == samples[0].feedback),
        "the last number there was"
    );
    assert_eq!(
        bench.fine.fault().map(|fault| fault.kind),
        Some(FaultKind::EmergencyStop)
    );
}

#[test]
fn feedback_that_is_no_number_faults_a_machine_that_moves() {
    let mut bench = cruising();
    bench.spoil_feedback();
    tick(&mut bench, 1);
    assert_eq!(
        bench.fine.fault().map(|fault| fault.kind),
        Some(FaultKind::Feedback { joint: Some(0) })
    );
}

#[test]
fn a_jog_is_let_go_in_the_period_in_which_its_keep_alive_is_late() {
    for most in [1, 2, 50] {
        let mut bench = cruising();
        let jog = &bench.host.controls.jog;
        jog.max_periods.store(most, Relaxed);
        jog.beats.fetch_add(1, Relaxed);
        tick(&mut bench, 1);
        // The beat is seen in this period; `most` periods later nobody has said anything.
        tick(&mut bench, most as u32 - 1);
        assert!(
            !bench.host.controls.jog.let_go.load(Relaxed),
            "{most} periods"
        );
        tick(&mut bench, 1);
        assert!(
            bench.host.controls.jog.let_go.load(Relaxed),
            "{most} periods"
        );
    }
}

#[test]
fn missed_periods_count_for_the_keep_alive_and_are_counted_to_one() {
    let mut bench = cruising();
    // At rest, where they are no fault.
    bench.host.controls.hold.store(true, Relaxed);
    tick(&mut bench, 100);
    let jog = &bench.host.controls.jog;
    jog.max_periods.store(50, Relaxed);
    jog.beats.fetch_add(1, Relaxed);
    tick(&mut bench, 1);
    bench.fine.missed(48, 48);
    assert_eq!(bench.fine.counters().missed_periods, 48);
    assert!(bench.fine.fault().is_none());
    tick(&mut bench, 1);
    assert!(!bench.host.controls.jog.let_go.load(Relaxed));
    tick(&mut bench, 1);
    assert!(bench.host.controls.jog.let_go.load(Relaxed));
}

/// One that another may follow leaves the drives enabled; the last one is done when they have let go.
#[test]
fn a_job_is_done_when_its_program_has_ended_and_it_keeps_no_drives_that_it_is_to_let_go() {
    for stays in [true, false] {
        let mut bench = Bench::new(GuardMode::Stop);
        if stays {
            bench.fine.stay();
        }
        bench.peak(20.0);
        bench.dwell(0.01);
        bench.event(EventKind::ProgramEnd, 0, 0.0);
        for _ in 0..400 {
            let fine = &bench.fine;
            let is_done = fine.has_ended() && (stays || fine.is_over());
            assert_eq!(fine.is_done(), is_done, "stays enabled: {stays}");
            tick(&mut bench, 1);
        }
        assert!(bench.fine.is_done() && bench.fine.is_over() != stays);
    }
}

#[test]
fn a_job_takes_over_the_drives_of_the_one_before_while_they_hold() {
    let mut first = Bench::new(GuardMode::Stop);
    first.fine.stay();
    first.peak(20.0);
    first.event(EventKind::DigitalOutput, 2, 1.0);
    // Homing calls the place otherwise, which the drives do not see.
    first.event(EventKind::Correct, 0, 1.5);
    tick(&mut first, 200);
    first.go_on();
    first.dwell(0.01);
    first.event(EventKind::ProgramEnd, 0, 0.0);
    tick(&mut first, 200);
    assert!(first.fine.has_ended() && first.fine.is_done() && !first.fine.is_over());
    let stands = first.fine.told_to_joints();
    assert!(stands[0] > 0.1);

    let mut next = Bench::new(GuardMode::Stop);
    next.fine.succeed(&mut first.fine, false);
    assert!(!next.fine.is_attaching(), "they hold");
    assert_eq!(
        (next.fine.told_to_joints(), next.fine.sent()),
        (stands, stands)
    );
    next.go_on();
    next.peak(20.0);
    let samples = tick(&mut next, 60);
    assert_eq!(next.fine.fault(), None);
    assert!(
        next.fine.told_to_joints()[0] > stands[0],
        "it moves on from there"
    );
    let outputs = samples.iter().map(|sample| sample.switched.outputs);
    assert!(
        !samples.is_empty() && outputs.min() == Some(1 << 2),
        "what was on stays on"
    );
    next.fail_drives();
    tick(&mut next, 1);
    assert_eq!(
        next.fine.fault(),
        None,
        "its own drives are those of the job before"
    );
    first.fail_drives();
    tick(&mut next, 1);
    assert_eq!(
        next.fine.fault().map(|fault| fault.kind),
        Some(FaultKind::Driver)
    );
}

#[test]
fn a_plan_beyond_its_limits_counts_as_governed_unless_something_asks_for_less() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(2.0);
    bench.leap(1.0);
    tick(&mut bench, 300);
    bench.host.controls.feed_override.store(0.5);
    tick(&mut bench, 100);
    bench.host.controls.feed_override.store(1.0);
    tick(&mut bench, 300);
    assert_eq!(
        bench.fine.counters().governed_samples,
        0,
        "half the feed was asked for"
    );
    tick(&mut bench, 2000);
    assert!(bench.fine.counters().governed_samples > 0);
}

/// What stands where it was told to end, and not before, is at rest: an abort and an edge that comes stop the machine within its limits first.
#[test]
fn a_stop_for_good_ends_in_a_rest_that_is_told_where_the_machine_has_come_to() {
    for (cause, later) in [
        (RestCause::Abort, 0),
        (RestCause::Abort, 7),
        (RestCause::Abort, 150),
        (RestCause::Edge, 0),
        (RestCause::Edge, 150),
    ] {
        let mut bench = Bench::new(GuardMode::Stop);
        if cause == RestCause::Edge {
            bench.probe();
        }
        bench.accelerate();
        bench.cruise(3.0);
        bench.brake();
        // 60 mm/s² are 12 mm/s after 60 periods.
        tick(&mut bench, 60 + later);
        if cause == RestCause::Edge {
            bench.catch_edge(bench.fine.sent()[0]);
        } else {
            bench.host.controls.abort.store(true, Relaxed);
        }
        let samples = tick(&mut bench, 60);
        let speeds: Vec<_> = samples
            .windows(2)
            .map(|pair| (pair[1].command[0] - pair[0].command[0]) / PERIOD_S)
            .collect();
        for pair in speeds.windows(2) {
            let change = (pair[1] - pair[0]).abs() / PERIOD_S;
            assert!(change < 1000.0 * (1.0 + 1e-6), "{change} mm/s², {cause:?}");
        }
        assert!(
            speeds[0] > 10.0 && speeds.last() == Some(&0.0),
            "{speeds:?}"
        );
        assert_eq!(bench.fine.fault(), None);
        let rest = bench.go_on();
        assert_eq!(rest.cause, cause);
        assert_eq!(rest.position, samples.last().unwrap().command);
    }
}

#[test]
fn a_stop_of_the_program_is_the_cause_of_the_hold_that_it_is() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.peak(20.0);
    bench.event(EventKind::ProgramStop, 0, 0.0);
    bench.peak(20.0);
    let samples = tick(&mut bench, 200);
    assert_eq!(bench.state(), MachineState::Holding);
    let held: Vec<_> = samples
        .iter()
        .filter(|sample| sample.state == MachineState::Holding)
        .collect();
    let by_program = |sample: &&Sample| sample.cause == StopCause::ProgramStop;
    assert!(held.len() > 50 && held.iter().all(by_program));
    // Nothing behind the stop has begun.
    let ends_mm = 20.0 * 20.0 / 999.0;
    let stands = |sample: &&Sample| (sample.command[0] - ends_mm).abs() < 1e-9;
    assert!(held.iter().all(stands), "{ends_mm} mm");
    let controls = &bench.host.controls;
    controls.program_hold.store(false, Relaxed);
    let samples = tick(&mut bench, 20);
    assert_eq!(bench.state(), MachineState::Running);
    assert_eq!(
        samples.last().map(|sample| sample.cause),
        Some(StopCause::None)
    );
}

/// The feed of a sample is that of its period, and beside it stands the one with which the period ends.
#[test]
fn a_sample_says_how_fast_the_path_was_driven_in_its_period_and_at_its_end() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(0.2);
    bench.brake();
    let samples = tick(&mut bench, 500);
    for pair in samples.windows(2) {
        let driven = (pair[1].command[0] - pair[0].command[0]) / PERIOD_S;
        let off = (pair[1].feed_mm_per_s - driven).abs();
        assert!(off < 1e-9, "{} for {driven} mm/s", pair[1].feed_mm_per_s);
        let ends = [pair[0].end_feed_mm_per_s, pair[1].end_feed_mm_per_s];
        let mean = f64::midpoint(ends[0], ends[1]);
        // In a period the plan accelerates by 0.2 mm/s.
        assert!((mean - driven).abs() < 0.11, "{ends:?} for {driven} mm/s");
    }
    let fastest = samples.iter().map(|sample| sample.end_feed_mm_per_s);
    assert!((fastest.fold(0.0, f64::max) - 20.0).abs() < 1e-9);
}

/// Samples come to the host later than the word that nothing moves: who reads both can tell which samples are older than the rest.
#[test]
fn the_first_period_behind_a_motion_is_told_and_stays() {
    for hold in [true, false] {
        let mut bench = cruising();
        let status = Arc::clone(&bench.host.status);
        let now = status.tick.load(Relaxed);
        assert_eq!(status.rests_from_tick.load(Relaxed), now);
        if hold {
            bench.host.controls.hold.store(true, Relaxed);
        } else {
            bench.host.controls.emergency_stop.store(true, Relaxed);
        }
        let samples = tick(&mut bench, 500);
        let moves = |sample: &&Sample| {
            sample.end_feed_mm_per_s != 0.0 || sample.state == MachineState::Stopping
        };
        let last = samples.iter().rfind(moves).unwrap();
        assert_eq!(
            status.rests_from_tick.load(Relaxed),
            last.tick + 1,
            "hold {hold}"
        );
        assert!(last.tick + 1 < status.tick.load(Relaxed));
        let place = samples.last().unwrap().command;
        let behind = samples.iter().filter(|sample| sample.tick > last.tick + 1);
        assert!(behind.into_iter().all(|sample| sample.command == place));
    }
}

/// Drives that count the beats of their bus notice no change of jobs.
#[test]
fn the_number_of_the_exchange_goes_on_from_one_job_to_the_next() {
    let job = || demanding::Bench::new(&demanding::config(1), Script::new(1));
    let work = |bench: &mut demanding::Bench| {
        bench.rest(50).expect("the joint holds");
        bench.queue(0, 0.05, 0.0, StopOn::default());
        bench.queue_event(EventKind::ProgramEnd, 0, 0.0);
        bench.ticks(200);
        assert!(bench.fine.has_ended());
    };
    let mut first = job();
    first.fine.stay();
    work(&mut first);
    let before = first.script().told.len();
    let mut next = job();
    next.fine.succeed(&mut first.fine, false);
    work(&mut next);
    let script = first.script();
    assert!(script.told.len() > before + 200, "the drives are its");
    let beats: Vec<_> = script.told.iter().map(|(told, _)| told.tick).collect();
    let begins = beats.iter().rposition(|beat| *beat == 0).unwrap();
    assert!(begins < before, "{begins} of {before}");
    for pair in beats[begins..].windows(2) {
        assert_eq!(pair[1], pair[0] + 1);
    }
}

#[test]
fn ratios_that_come_after_their_tick_are_counted() {
    let mut bench = cruising();
    let next = bench.fine.next_tick();
    let mut late = 0;
    for (tick_of, is_late) in [(next + 5, false), (3, true), (next + 20, false), (7, true)] {
        let ratio = Ratio {
            tick: tick_of,
            ratio: 0.8,
        };
        bench.host.ratios.push(ratio).unwrap();
        tick(&mut bench, 10);
        late += u64::from(is_late);
        assert_eq!(bench.fine.counters().late_ratios, late);
    }
}

/// Where the plan rests on its way the machine runs; where nothing follows it stands.
#[test]
fn a_machine_runs_until_the_last_rest_of_what_is_queued() {
    let mut bench = Bench::new(GuardMode::Stop);
    for _ in 0..3 {
        bench.peak(20.0);
        bench.dwell(0.01);
    }
    let samples = tick(&mut bench, 250);
    let last = samples.last().unwrap();
    let moves = samples
        .iter()
        .take_while(|sample| sample.command != last.command)
        .map(|sample| sample.state)
        .skip_while(|state| *state == MachineState::Standstill)
        .collect::<Vec<_>>();
    let runs = |state: &MachineState| *state == MachineState::Running;
    assert!(moves.len() > 120 && moves.iter().all(runs), "{moves:?}");
    assert_eq!(last.state, MachineState::Standstill);
}
