//! Several drivers on one machine.

use std::env;

use tandem_host::{Clock, Run, Switches, attached_driver, check_program};
use tandem_rig::Random;
use tandem_sdk::{Feedback, JointState, Setpoint};

use crate::counting_allocator::{HeapUse, heap_use_of};
use crate::double::log;
use crate::{SQUARE, Samples, machine, program, registry};

/// A bus with three joints in its own order, and an amplifier with one; `bus` and `arm` are what their plans say beside the name.
fn two(name: &str, bus: &str, arm: &str) -> String {
    format!(
        "[drivers.bus]\nplugin = \"double\"\noptions = {{ name = \"{name}-bus\"{bus} }}\njoints = [\"z\", \"x\", \"y\"]\n\
         inputs = [8, 9, 3]\noutputs = [5]\n\
         [drivers.arm]\nplugin = \"double\"\noptions = {{ name = \"{name}-arm\"{arm} }}\njoints = [\"a\"]\nspindle = true\n\
         outputs = [62, 63]\n"
    )
}

#[test]
fn each_driver_is_told_of_its_own_joints_in_its_own_order() {
    let machine = machine(&two("order", "", ""));
    let run = Run::prepare(
        machine,
        &registry(),
        program("G21 G90 G94 F4000\nG1 X10 Y20 Z30 A40\nM2\n"),
        Switches::default(),
    );
    let outcome = run.unwrap().drive(Clock::Virtual, &[], &mut ()).unwrap();
    assert_eq!(outcome.summary.fault, None);
    let (bus, arm) = (log("order-bus"), log("order-arm"));
    assert_eq!(
        (bus.names, bus.joints),
        (vec!["z".to_string(), "x".into(), "y".into()], 3)
    );
    assert_eq!((arm.names, arm.joints), (vec!["a".to_string()], 1));
    assert_eq!(bus.positions, [30.0, 10.0, 20.0]);
    assert!(
        (arm.positions[0] - 40f64.to_radians()).abs() < 1e-12,
        "{:?}",
        arm.positions
    );
    assert_eq!((bus.stopped, arm.stopped), (1, 1));
    assert_eq!(bus.exchanges, arm.exchanges);
}

/// What composing does to the numbers: nothing, whatever the order of the joints.
#[test]
fn two_drivers_are_driven_exactly_as_one() {
    let samples = |drivers: &str| {
        let mut samples = Samples::default();
        let run = Run::prepare(
            machine(drivers),
            &registry(),
            program(SQUARE),
            Switches::default(),
        )
        .unwrap();
        assert_eq!(
            run.drive(Clock::Virtual, &[], &mut samples)
                .unwrap()
                .summary
                .fault,
            None
        );
        samples.0
    };
    let (one, two) = (
        samples("[driver]\nplugin = \"double\"\noptions = { name = \"one\" }\n"),
        samples(&two("as-one", "", "")),
    );
    assert!(
        one.len() > 100 && one.len() == two.len(),
        "{} and {} samples",
        one.len(),
        two.len()
    );
    for (one, two) in one.iter().zip(&two) {
        assert_eq!(
            (one.tick, one.command, one.feedback, one.speed),
            (two.tick, two.command, two.feedback, two.speed)
        );
    }
}

/// One of two drivers fails in any tick, in any way: the machine comes to rest within its limits, and who failed is named.
#[test]
fn where_one_of_two_fails_the_others_ramp_to_rest_within_their_limits() {
    let count = env::var("TANDEM_SEEDS")
        .ok()
        .and_then(|count| count.parse().ok())
        .unwrap_or(24);
    for seed in 0..count {
        let mut random = Random::new(7000 + seed);
        let (tick, how) = (
            1 + random.below(2200),
            random.pick(&["exchange", "fault", "lost"]),
        );
        let (fails, name) = (random.below(2), format!("fails-{seed}"));
        let plan = format!(", fails_at = {tick}, how = \"{how}\"");
        let (bus, arm) = if fails == 0 {
            (plan.as_str(), "")
        } else {
            ("", plan.as_str())
        };
        let case = format!("seed {seed}: {how} of driver {fails} at tick {tick}");
        let machine = machine(&two(&name, bus, arm));
        let (limits, period_s) = (machine.limits, machine.fine_period_s);
        let run = Run::prepare(machine, &registry(), program(SQUARE), Switches::default()).unwrap();
        let mut samples = Samples::default();
        let outcome = run.drive(Clock::Virtual, &[], &mut samples).unwrap();
        let Some(words) = outcome.summary.fault else {
            assert!(samples.0.last().unwrap().tick < tick, "{case}: no fault");
            continue;
        };
        let (title, other) = if fails == 0 {
            ("bus (double)", "arm")
        } else {
            ("arm (double)", "bus")
        };
        assert!(
            words.starts_with(&format!("driver {title}: ")),
            "{case}: {words}"
        );
        if how == "fault" {
            let (joint, driver) = if fails == 0 {
                ("axis Z", "bus")
            } else {
                ("axis A", "arm")
            };
            let told = format!(
                "the drive of {joint} reports fault 0x7210 (following error of amplifier 0 of {name}-{driver})"
            );
            assert!(words.contains(&told), "{case}: {words}");
        }
        let (commands, last) = (samples.0.windows(3), samples.0.len() - 1);
        for window in commands {
            for axis in 0..4 {
                let at = |i: usize| window[i].command[axis];
                let (before, after) = ((at(1) - at(0)) / period_s, (at(2) - at(1)) / period_s);
                let limit = limits.axes()[axis];
                assert!(
                    after.abs() <= limit.feed_mm_per_s * (1.0 + 1e-9),
                    "{case}: axis {axis}: {after}"
                );
                let change = (after - before).abs() / period_s;
                assert!(
                    change <= limit.acceleration_mm_per_s2 * (1.0 + 1e-6),
                    "{case}: axis {axis}: {change}"
                );
            }
        }
        assert_eq!(
            samples.0[last].command,
            samples.0[last - 1].command,
            "{case}: it is at rest"
        );
        let well = log(&format!("{name}-{other}"));
        assert_eq!((well.started, well.stopped), (1, 1), "{case}");
    }
}

#[test]
fn a_driver_that_cannot_start_leaves_none_started() {
    let machine = machine(&two("down", "", ", refuses_to_start = true"));
    let refused = Run::prepare(machine, &registry(), program(SQUARE), Switches::default())
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("drivers.arm.plugin: driver arm (double): the bus is down"),
        "{refused}"
    );
    let (bus, arm) = (log("down-bus"), log("down-arm"));
    assert_eq!((bus.started, bus.stopped, arm.stopped), (1, 1, 0));
    assert_eq!((bus.exchanges, arm.exchanges), (0, 0));
}

#[test]
fn a_refused_option_is_told_where_its_driver_states_it() {
    let machine = machine(&two("option", "", ", refuses_to_open = true"));
    let refused = Run::prepare(machine, &registry(), program(SQUARE), Switches::default())
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("drivers.arm.options.name: driver arm (double): it is not there"),
        "{refused}"
    );
}

#[test]
fn two_drivers_that_pace_the_loop_are_refused_before_anything_is_opened() {
    let machine = machine(&two("phases", ", phase = true", ", phase = true"));
    let refused = Run::prepare(machine, &registry(), program(SQUARE), Switches::default())
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains(
            "the exchange of arm (double) has a phase of its own, as that of bus (double) has"
        ),
        "{refused}"
    );
    assert_eq!((log("phases-bus").opened, log("phases-arm").opened), (0, 0));
    let one = crate::machine(&two("phase", "", ", phase = true"));
    assert!(Run::prepare(one, &registry(), program(SQUARE), Switches::default()).is_ok());
}

#[test]
fn composing_allocates_nothing_also_where_one_fails() {
    let (mut driver, _) = attached_driver(
        &machine(&two("heap", ", fails_at = 50, how = \"exchange\"", "")),
        &registry(),
    )
    .unwrap();
    let (mut setpoint, mut feedback) = (
        Setpoint {
            enable: 1,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    for tick in 0..10 {
        // The double's own log grows to its size.
        setpoint.tick = tick;
        driver.exchange(&setpoint, &mut feedback).unwrap();
    }
    let mut failed = 0;
    let used = heap_use_of(|| {
        for tick in 10..100 {
            setpoint.tick = tick;
            failed += usize::from(driver.exchange(&setpoint, &mut feedback).is_err());
        }
        driver.quick_stop();
    });
    assert_eq!((used, failed), (HeapUse::default(), 1), "it is told once");
    let states = &feedback.state[..4];
    assert_eq!(
        states,
        [
            JointState::Lost,
            JointState::Lost,
            JointState::Lost,
            JointState::Enabled
        ]
    );
    assert!(
        feedback.age_periods[0] >= 50 && feedback.age_periods[3] == 0,
        "{:?}",
        feedback.age_periods
    );
}

/// A word that switches or reads a line which nobody has did nothing, and nobody was told.
#[test]
fn a_line_that_no_driver_has_is_refused_with_its_word_and_with_what_there_is() {
    let tables = "[drivers.bus]\nplugin = \"double\"\noptions = { name = \"lines\" }\n\
                  joints = [\"x\", \"y\", \"z\", \"a\"]\ninputs = [4]\n\
                  [drivers.io]\nplugin = \"double\"\noptions = { name = \"lines-io\" }\noutputs = [0, 7, 63]\n\
                  [outputs.clamp]\noutput = 7\n";
    let all = "[driver]\nplugin = \"double\"\noptions = { name = \"lines-all\" }\n";
    let told = |drivers: &str, line: &str| {
        let text = format!("G21 G90\n{line}\nM2\n");
        let report = check_program(
            machine(drivers),
            &registry(),
            program(&text),
            Switches::default(),
        )
        .unwrap();
        report
            .diagnostics
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("\n")
    };
    for (line, words) in [
        ("M62 P1", "no driver has output 1; there are 0, 7 (clamp)"),
        ("M65 P61", "no driver has output 61; there are 0, 7 (clamp)"),
        ("M66 P5 L0", "no driver has input 5; there are 4"),
    ] {
        let found = told(tables, line);
        assert!(
            found.contains(words) && found.contains(":2:5"),
            "{line}: {found}"
        );
        assert_eq!(told(all, line), "", "one driver has the whole machine");
    }
    for line in ["M63 P0", "M64 P7", "M66 P4 L0", "M8"] {
        assert_eq!(told(tables, line), "", "{line}");
    }
}
