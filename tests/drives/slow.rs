//! A device on a slow line beside drives that answer in every period.

use tandem_host::{Clock, Run, Switches};
use tandem_rings::StopCause;

use crate::double::log;
use crate::{Samples, machine, program, registry};

/// Four joints on a bus, and a spindle whose driver takes `slow_ms` an answer; fine periods of 10 ms.
fn with_spindle(name: &str, spindle: &str) -> String {
    format!(
        "[loops]\nfine_period_ms = 10\nrough_period_ms = 80\nmax_missed_periods = 100000\nmax_missed_share = 1\n\
         [drivers.bus]\nplugin = \"double\"\noptions = {{ name = \"{name}-bus\" }}\njoints = [\"x\", \"y\", \"z\", \"a\"]\n\
         [drivers.line]\nplugin = \"double\"\noptions = {{ name = \"{name}-line\"{spindle} }}\nspindle = true\n"
    )
}

const TURNS: &str = "G21 G90 G94 F600\nM3 S1000\nG1 X20\nM2\n";

fn prepared(text: &str) -> Run {
    let machine = machine(text);
    Run::prepare(machine, &registry(), program(TURNS), Switches::default()).unwrap()
}

/// 200 ms an answer, and after six of them none: the exchange with the others waits for neither.
#[test]
fn a_slow_device_delays_no_exchange_also_where_it_falls_silent() {
    let text = with_spindle("slow", ", slow_ms = 200, silent_after = 6");
    let run = prepared(&text);
    let mut samples = Samples::default();
    let summary = run.drive(Clock::Wall, &[], &mut samples).unwrap().summary;
    let (bus, line) = (log("slow-bus"), log("slow-line"));
    let waits = samples
        .0
        .iter()
        .position(|sample| sample.cause == StopCause::Spindle)
        .expect("its answer takes 200 ms");
    let moves = samples
        .0
        .iter()
        .position(|sample| sample.command[0] > 0.0)
        .expect("it comes");
    assert!(
        waits < moves
            && samples.0[moves..]
                .iter()
                .all(|sample| sample.cause != StopCause::Spindle)
    );
    assert!(
        (2..=6).contains(&line.exchanges),
        "{} answers",
        line.exchanges
    );
    assert!(line.turned, "it was told to turn");
    // Twenty fine periods fit into one of its answers; a loop that waited for it would have none there. A busy computer
    // misses some of them.
    for (began, ended) in &line.calls {
        let meanwhile = bus
            .calls
            .iter()
            .filter(|(at, _)| at > began && at < ended)
            .count();
        assert!(
            meanwhile >= 3,
            "{meanwhile} exchanges with the others while it answered"
        );
    }
    let fault = summary.fault.unwrap();
    assert!(
        fault.contains("its device does not answer"),
        "it cannot be let go of: {fault}"
    );
}

/// The device answers once, before it is told to turn.
#[test]
fn a_slow_spindle_that_falls_silent_ends_the_run_by_its_name_before_anything_cuts() {
    let text = with_spindle("dumb", ", slow_ms = 200, silent_after = 1")
        + "[spindle]\nat_speed_within_s = 1\n";
    let run = prepared(&text);
    let mut samples = Samples::default();
    let summary = run.drive(Clock::Wall, &[], &mut samples).unwrap().summary;
    let fault = summary.fault.unwrap();
    assert!(
        fault.contains("driver line (double): the spindle is not at speed within 1 s"),
        "{fault}"
    );
    assert!(samples.0.iter().all(|sample| sample.command[0] == 0.0));
    let waits = samples
        .0
        .iter()
        .filter(|sample| sample.cause == StopCause::Spindle)
        .count();
    let missed = summary.missed_periods;
    assert!(
        waits <= 100 && waits as u64 + missed >= 95,
        "a hundred periods, of which {missed} were missed: {waits}"
    );
}

#[test]
fn on_the_virtual_clock_a_slow_driver_is_called_in_line() {
    let text = with_spindle("in-line", ", slow_ms = 1");
    let run = prepared(&text);
    assert_eq!(
        run.drive(Clock::Virtual, &[], &mut ())
            .unwrap()
            .summary
            .fault,
        None
    );
    let (bus, line) = (log("in-line-bus"), log("in-line-line"));
    assert_eq!(bus.exchanges, line.exchanges);
}

#[test]
fn a_slow_device_that_is_to_move_a_joint_is_refused() {
    let text = "[driver]\nplugin = \"double\"\noptions = { name = \"slow-joint\", slow_ms = 1 }\n";
    let refused = Run::prepare(
        machine(text),
        &registry(),
        program(TURNS),
        Switches::default(),
    )
    .err()
    .unwrap()
    .to_string();
    assert!(
        refused.contains("takes longer than a fine period to answer: it can move no joint"),
        "{refused}"
    );
}
