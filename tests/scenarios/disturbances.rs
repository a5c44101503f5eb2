//! Random programs, disturbed at random ticks, and disturbances of every n-th exchange.

use std::fmt::Write;

use tandem_fine::FaultKind;
use tandem_rings::MachineState;

use crate::bench::{Bench, Ran, passed};
use crate::harness::{Scenario, root};
use crate::random::{Random, program};
use crate::replay::{for_each, for_each_seed};

/// Overrides and holds in order of their ticks up to `until`, and everything as it was at the end.
fn steps(random: &mut Random, until: u64) -> String {
    let mut lines = String::new();
    let mut tick = 0;
    while tick < until {
        let ratio = random.between(0.0, 1.0);
        match random.below(5) {
            0 => write!(lines, "{tick},hold\n{},resume\n", tick + random.below(120)).unwrap(),
            1 | 2 => writeln!(lines, "{tick},rapid-override,{ratio:.3}").unwrap(),
            _ => writeln!(lines, "{tick},feed-override,{ratio:.3}").unwrap(),
        }
        tick += 120 + random.below(until / 4 + 1);
    }
    write!(lines, "{tick},feed-override,1\n{tick},rapid-override,1\n").unwrap();
    lines
}

#[test]
fn override_steps_at_random_ticks() {
    for_each_seed("override_steps_at_random_ticks", 80, |seed| {
        let bench = Bench::text(&program(seed));
        let free = bench.run("");
        let ran = bench.run(&steps(
            &mut Random::new(seed ^ 1 << 41),
            free.samples.len() as u64,
        ));
        ran.expect_clean()?;
        ran.expect_known_changes()?;
        if ran.ends() != free.ends() {
            return Err("it ends elsewhere".to_string());
        }
        passed(&bench.judge(&ran, |_| ()))
    });
}

#[test]
fn stops_at_random_ticks() {
    for_each_seed("stops_at_random_ticks", 100, |seed| {
        let bench = Bench::text(&program(seed));
        let free = bench.run("").samples.len() as u64;
        let mut random = Random::new(seed ^ 1 << 42);
        let tick = 1 + random.below(free);
        let (before, abort) = (steps(&mut random, tick), random.below(2) == 0);
        let stop = format!("{tick},{}", if abort { "abort" } else { "emergency-stop" });
        let lines: Vec<&str> = before
            .lines()
            .filter(|line| at(line) < tick)
            .chain([stop.as_str()])
            .collect();
        let ran = bench.run(&lines.join("\n"));
        ran.expect_known_changes()?;
        if abort {
            ran.expect_aborted()
        } else {
            ran.expect_rest_in(MachineState::Fault)
        }?;
        on_the_path_until(&bench, &ran, if abort { u64::MAX } else { tick - 1 })
    });
}

/// The tick of a command.
fn at(line: &str) -> u64 {
    line.split(',')
        .next()
        .and_then(|tick| tick.parse().ok())
        .unwrap()
}

/// Within limits to the standstill, and on the path up to `tick`.
fn on_the_path_until(bench: &Bench, ran: &Ran, tick: u64) -> Result<(), String> {
    passed(&bench.judge(ran, |options| {
        options.ends_early = true;
        options.path_until_s = Some((tick as f64 + 0.5) * bench.judging.fine_period_s);
    }))
}

#[test]
fn the_bench_runs_what_the_command_runs() {
    let (path, commands) = (
        root().join(EVERY_TICK),
        "300,hold\n500,resume\n700,feed-override,0.4\n900,stall-rough,40\n",
    );
    let (ran, done) = (
        Bench::of(&path).run(commands),
        Scenario::of(&path).commands(commands).run(),
    );
    for (axis, name) in ["x_cmd_mm", "y_cmd_mm", "z_cmd_mm"].into_iter().enumerate() {
        let expected: Vec<u64> = done.column(name).into_iter().map(f64::to_bits).collect();
        assert!(
            ran.samples
                .iter()
                .map(|sample| sample.command[axis].to_bits())
                .eq(expected),
            "{name}"
        );
    }
    assert!(
        ran.samples
            .iter()
            .map(|sample| sample.state.name())
            .eq(done.cells("state"))
    );
}

const EVERY_TICK: &str = "tests/fixtures/programs/every-tick.ngc";

#[test]
fn every_nth_exchange_lost_late_or_wrong_changes_no_command() {
    let bench = Bench::of(&root().join(EVERY_TICK));
    let free = bench.run("");
    for_each(
        "TANDEM_NTH",
        "every_nth_exchange_lost",
        2..=60,
        |nth: &u64| {
            for (kind, more) in [
                ("drop", ""),
                ("freeze", ""),
                ("duplicate", ""),
                ("corrupt", ", magnitude_mm = 0.3"),
            ] {
                let wrap = format!("[{{kind = \"{kind}\", every = {nth}{more}}}]");
                let ran = bench.run_with("", &[("faults.wrap", &wrap)]);
                ran.expect_clean()?;
                let same = ran
                    .samples
                    .iter()
                    .zip(&free.samples)
                    .all(|(a, b)| a.command == b.command && a.state == b.state);
                if !same || ran.samples.len() != free.samples.len() {
                    return Err(format!("{wrap} changes the commands"));
                }
            }
            Ok(())
        },
    );
}

#[test]
fn every_nth_exchange_fails() {
    let bench = Bench::of(&root().join(EVERY_TICK));
    for_each(
        "TANDEM_NTH",
        "every_nth_exchange_fails",
        (1..100).chain((100..1400).step_by(37)),
        |nth: &u64| {
            let ran = bench.run_with(
                "",
                &[(
                    "faults.wrap",
                    &format!("[{{kind = \"fail\", every = {nth}}}]"),
                )],
            );
            let fault = ran.outcome.fault.ok_or("no fault")?;
            if fault.kind != FaultKind::Driver || fault.tick >= *nth {
                return Err(format!("{fault:?}"));
            }
            let [.., last] = &ran.samples[..] else {
                return Ok(());
            };
            if last.state != MachineState::Fault {
                return Err(format!("ends {:?}", last.state));
            }
            on_the_path_until(&bench, &ran, fault.tick)
        },
    );
}
