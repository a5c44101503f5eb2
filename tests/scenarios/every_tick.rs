//! Hold, abort, emergency stop and failing exchange in every fine period of one program, of which a run of the gate takes a quarter,
//! and the ring run dry wherever the rough loop can be late. After each the oracle judges, and the state is the one that the table
//! of states says.
//!
//! `TANDEM_TICK=n` replays one tick, `TANDEM_EVERY=1` takes all. The program has lines, corners, arcs, a helix, chords, a rapid and an
//! exact stop.

use std::collections::BTreeSet;

use tandem_fine::FaultKind;
use tandem_rings::{MachineState, Sample};

use crate::bench::{Bench, Ran, passed};
use crate::harness::root;
use crate::plan::Plan;
use crate::replay::{for_each_tick, some_of};

const PROGRAM: &str = "tests/fixtures/programs/every-tick.ngc";
/// Where a run that is held goes on, ticks after the hold: every stop is over by then.
const PAUSE: usize = 400;

fn bench() -> Bench {
    Bench::of(&root().join(PROGRAM))
}

/// What a hold must do, told from the samples of the free run and of the held one.
struct HoldCheck<'a> {
    free: &'a [Sample],
    plan: Plan,
    acceleration: Vec<f64>,
    period_s: f64,
}

impl<'a> HoldCheck<'a> {
    fn new(bench: &Bench, free: &'a Ran) -> Self {
        let axes = &bench.judging.axes;
        Self {
            free: &free.samples,
            plan: Plan::new(&free.segments),
            acceleration: axes
                .iter()
                .map(|axis| axis.max_acceleration_mm_per_s2)
                .collect(),
            period_s: bench.judging.fine_period_s,
        }
    }

    /// The path coordinate after each sample, mm.
    fn path_mm(&self, samples: &[Sample]) -> Vec<f64> {
        let step = |at: &mut f64, sample: &Sample| {
            *at += sample.feed_mm_per_s * self.period_s;
            Some(*at)
        };
        samples.iter().scan(0.0, step).collect()
    }

    /// A hold in period `tick`, in which the sample `tick` is made, on the way to `until`.
    ///
    /// Up to the sample before, both runs are the same. The sample `tick` is slower already, unless an axis brakes at
    /// its limit in that period of the plan, or nothing moves. From there to the standstill the held run is later than
    /// the free one, and at the same tick it may stand before a corner that the free one has passed. So speeds are
    /// compared at the same place of the path: between two samples no more program time passes than in the free run,
    /// which is one period, and less from sample to sample, again unless an axis of the plan brakes at its limit.
    fn check(&self, held: &[Sample], tick: usize, until: usize) -> Result<(), String> {
        if held[..tick] != self.free[..tick] {
            return Err("the runs differ before the hold".to_string());
        }
        let (now, free) = (held[tick].feed_mm_per_s, self.free[tick].feed_mm_per_s);
        if now >= free && !self.is_excused(held, tick) {
            return Err(format!(
                "sample {tick} is at {now} mm/s, {free} without the hold"
            ));
        }
        self.slows_to_rest(&self.path_mm(held), tick, until)?;
        let rest = &held[tick + PAUSE / 2..until];
        let quiet = rest
            .iter()
            .all(|sample| sample.feed_mm_per_s == 0.0 && sample.state == MachineState::Holding);
        quiet
            .then_some(())
            .ok_or("it does not stand still in the state holding".to_string())
    }

    /// Whether the sample `tick` need not be slower: an axis brakes at its limit, or nothing moves.
    fn is_excused(&self, held: &[Sample], tick: usize) -> bool {
        let from_s = self.plan.time_s(self.path_mm(held)[tick - 1]);
        self.free[tick].feed_mm_per_s == 0.0 || self.may_keep(from_s, from_s + self.period_s)
    }

    /// Whether the plan is such between two program times that a held machine need not be slower than before.
    fn may_keep(&self, from_s: f64, until_s: f64) -> bool {
        self.plan
            .brakes_at_limit(from_s, until_s, &self.acceleration)
            || self.plan.rests(from_s, until_s)
    }

    fn slows_to_rest(&self, path_mm: &[f64], tick: usize, until: usize) -> Result<(), String> {
        let mut last_s = self.period_s;
        for index in tick..until {
            if path_mm[index] == path_mm[index - 1] {
                break;
            }
            let (from_s, to_s) = (
                self.plan.time_s(path_mm[index - 1]),
                self.plan.time_s(path_mm[index]),
            );
            let passed_s = to_s - from_s;
            let slower = passed_s < last_s || self.may_keep(from_s, from_s + self.period_s);
            // Path coordinates are sums of a thousand samples; near a rest a rounding of them is much program time.
            if !slower || passed_s > last_s + TIME_TOLERANCE * self.period_s {
                return Err(format!(
                    "sample {index} passes {passed_s} s of the plan, the one before {last_s}"
                ));
            }
            last_s = passed_s;
        }
        Ok(())
    }
}

/// Share of a period by which program time found from path coordinates may be wrong.
const TIME_TOLERANCE: f64 = 1e-3;

#[test]
fn hold_at_every_tick() {
    let bench = bench();
    let free = bench.run("");
    free.expect_clean().unwrap();
    let check = HoldCheck::new(&bench, &free);
    let mut late_ones_seen = 0;
    for_each_tick(
        "hold_at_every_tick",
        some_of(4, "hold_at_every_tick", 1..free.samples.len() - 1),
        |tick| {
            let held = |at: usize| bench.run(&format!("{at},hold\n{},resume", tick + PAUSE));
            let ran = held(tick);
            ran.expect_clean()?;
            ran.expect_known_changes()?;
            check.check(&ran.samples, tick, tick + PAUSE)?;
            passed(&bench.judge(&ran, |_| ()))?;
            // A hold that comes one period late must not pass for one that comes in time.
            let seen = check
                .check(&held(tick + 1).samples, tick, tick + PAUSE)
                .is_err();
            late_ones_seen += usize::from(seen);
            let excused = check.is_excused(&ran.samples, tick);
            (seen || excused)
                .then_some(())
                .ok_or("a hold one period later passes the same check".to_string())
        },
    );
    println!("a hold one period late was noticed in {late_ones_seen} periods");
}

#[test]
fn emergency_stop_at_every_tick() {
    let bench = bench();
    let free = bench.run("");
    for_each_tick(
        "emergency_stop_at_every_tick",
        some_of(4, "emergency_stop_at_every_tick", 1..free.samples.len() - 1),
        |tick| {
            let ran = bench.run(&format!("{tick},emergency-stop"));
            // The stop comes before the sample of its period is made.
            expect_fault(&bench, &ran, FaultKind::EmergencyStop, tick, tick - 1)
        },
    );
}

#[test]
fn abort_at_every_tick() {
    let bench = bench();
    let free = bench.run("");
    for_each_tick(
        "abort_at_every_tick",
        some_of(4, "abort_at_every_tick", 1..free.samples.len() - 1),
        |tick| {
            let ran = bench.run(&format!("{tick},abort"));
            ran.expect_known_changes()?;
            ran.expect_aborted()?;
            passed(&bench.judge(&ran, |options| options.ends_early = true))
        },
    );
}

#[test]
fn failing_exchange_at_every_tick() {
    let bench = bench();
    let free = bench.run("");
    for_each_tick(
        "failing_exchange_at_every_tick",
        some_of(
            4,
            "failing_exchange_at_every_tick",
            1..free.samples.len() - 1,
        ),
        |tick| {
            let wrap = format!("[{{kind = \"fail\", from_tick = {tick}}}]");
            let ran = bench.run_with("", &[("faults.wrap", &wrap)]);
            expect_fault(&bench, &ran, FaultKind::Driver, tick, tick)
        },
    );
}

/// A fault of that kind in that period; on the path up to `path_until`, within limits to the standstill, and faulted.
fn expect_fault(
    bench: &Bench,
    ran: &Ran,
    kind: FaultKind,
    tick: usize,
    path_until: usize,
) -> Result<(), String> {
    let fault = ran.outcome.fault.ok_or("no fault")?;
    if (fault.kind, fault.tick) != (kind, tick as u64) {
        return Err(format!("{fault:?}"));
    }
    ran.expect_known_changes()?;
    ran.expect_rest_in(MachineState::Fault)?;
    passed(&bench.judge(ran, |options| {
        options.ends_early = true;
        options.path_until_s = Some((path_until as f64 + 0.5) * bench.judging.fine_period_s);
    }))
}

#[test]
fn the_ring_runs_dry_wherever_the_rough_loop_can_be_late() {
    let bench = bench();
    let free = bench.run("");
    let mut places = BTreeSet::new();
    let rough = 8;
    for_each_tick(
        "the_ring_runs_dry",
        (0..free.samples.len()).step_by(rough),
        |tick| {
            let ran = bench.run(&format!("{tick},stall-rough,60"));
            ran.expect_clean()?;
            ran.expect_known_changes()?;
            places.extend(starved_at(&ran));
            if ran.ends() != free.ends() {
                return Err("it ends elsewhere".to_string());
            }
            passed(&bench.judge(&ran, |_| ()))
        },
    );
    println!(
        "the ring ran dry at {} places of {} segments",
        places.len(),
        free.segments.len()
    );
    assert!(
        places.len() > 20 || std::env::var("TANDEM_TICK").is_ok(),
        "{places:?}"
    );
}

/// The lines and path coordinates, µm, at which the machine stood because the queue was dry.
fn starved_at(ran: &Ran) -> BTreeSet<(u32, u64)> {
    let mut path_um = 0.0;
    let standing = |sample: &Sample| {
        path_um += sample.feed_mm_per_s;
        let starved = sample.state == MachineState::Starved && sample.feed_mm_per_s == 0.0;
        starved.then_some((sample.line, path_um as u64))
    };
    ran.samples.iter().filter_map(standing).collect()
}

/// A planner that declares twice the deceleration it leaves gets a ring of depth v/(2a). That does for a plan that
/// cruises; one that brakes uses its queue up faster, and meets the end of it in motion.
#[test]
fn half_the_depth_of_the_ring_is_not_enough() {
    let bench =
        Bench::text("G21 G90 G64\nF5000\nG1 X40\nG1 X0\nG1 X40\nG1 X0\nG1 X40\nG1 X0\nM2\n");
    let wrong = |planner: &str| {
        let mut counts = (0, 0);
        for tick in (20..3000).step_by(16) {
            let ran = bench.run_with(
                &format!("{tick},stall-rough,60"),
                &[("planner.plugin", planner)],
            );
            let ended = ran
                .expect_clean()
                .and_then(|()| passed(&bench.judge(&ran, |_| ())));
            let starved = usize::from(ran.outcome.summary.starvations > 0);
            counts = (
                counts.0 + starved,
                counts.1 + starved * usize::from(ended.is_err()),
            );
        }
        counts
    };
    let (right_depth, half_depth) = (wrong("watched"), wrong("boastful"));
    println!(
        "starved runs, and how many went wrong: right depth {right_depth:?}, half of it {half_depth:?}"
    );
    assert!(right_depth.0 > 50 && right_depth.1 == 0);
    assert!(half_depth.1 > 5);
}
