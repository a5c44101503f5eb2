//! Drivers that say they are real: what they are never asked, and what is refused.

use tandem_estimate::{Choice, estimate};
use tandem_gcode::Program;
use tandem_host::{Clock, Run, Switches, check_program, with_stand_ins};
use tandem_recorder::Summary;

use crate::double::log;
use crate::{SQUARE, machine, program, registry, try_machine};

/// One real driver with this name, and what its plan says beside it.
fn real(name: &str, plan: &str) -> String {
    format!("[driver]\nplugin = \"double\"\noptions = {{ name = \"{name}\", real = true{plan} }}\n")
}

fn short() -> Program {
    program("G21 G90 G94 F6000\nM3 S1000\nM8\nG1 X1\nM2\n")
}

/// `virtual` was the default clock, and a real driver was driven on it.
#[test]
fn the_virtual_clock_is_refused_and_the_wall_clock_is_the_default() {
    let on = |clock| Switches {
        clock,
        ..Switches::default()
    };
    let machine = machine(&real("clock", ""));
    let refused = Run::prepare(
        machine.clone(),
        &registry(),
        short(),
        on(Some(Clock::Virtual)),
    )
    .err()
    .unwrap()
    .to_string();
    assert!(
        refused.contains("driver.plugin: double moves metal: it is refused on the virtual clock"),
        "{refused}"
    );
    assert_eq!(
        log("clock").opened,
        0,
        "it is refused before anything is opened"
    );
    let run = Run::prepare(machine, &registry(), short(), on(None)).unwrap();
    assert_eq!(run.clock(), Clock::Wall);
    assert!(
        run.drive(Clock::Virtual, &[], &mut ()).is_err(),
        "whatever it was prepared for"
    );
    let log = log("clock");
    assert_eq!((log.exchanges, log.stopped), (0, 1));
}

/// An estimate says that nothing moves; it drove the drives. What stands in for them is driven instead, and that is said.
#[test]
fn an_estimate_replaces_real_drivers_and_never_opens_them() {
    let machine = machine(&real("estimate", ""));
    let (replaced, notes) = with_stand_ins(&machine, &registry(), Some("sim")).unwrap();
    assert_eq!(notes, ["driver double moves metal: sim stands in for it"]);
    let (registry, choice) = (registry(), Choice::named("simulate", &machine).unwrap());
    let refused = estimate(
        &machine,
        &registry,
        program(SQUARE),
        Switches::default(),
        &choice,
    );
    assert!(refused.is_err(), "the driver itself is refused");
    let found = estimate(
        &replaced,
        &registry,
        program(SQUARE),
        Switches::default(),
        &choice,
    )
    .unwrap();
    assert!(found.estimated_s > 1.0, "{}", found.estimated_s);
    let log = log("estimate");
    assert_eq!((log.opened, log.exchanges), (0, 0));
}

#[test]
fn simulated_drivers_are_not_replaced_and_a_real_stand_in_is_refused() {
    let simulated = machine("[driver]\nplugin = \"double\"\noptions = { name = \"not-real\" }\n");
    let (same, notes) = with_stand_ins(&simulated, &registry(), Some("sim")).unwrap();
    assert_eq!((&same.drivers, notes), (&simulated.drivers, vec![]));
    let stands = real("replaced", "")
        + "[driver.stand_in]\nplugin = \"double\"\noptions = { name = \"stand-in\" }\n";
    let (replaced, _) = with_stand_ins(&machine(&stands), &registry(), Some("sim")).unwrap();
    assert_eq!(replaced.drivers[0].choice.plugin, "double");
    let is_real = stands.replace("name = \"stand-in\"", "name = \"stand-in\", real = true");
    let refused = with_stand_ins(&machine(&is_real), &registry(), Some("sim"))
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("driver.stand_in.plugin: double moves metal itself"),
        "{refused}"
    );
    // A calibration measures, so what stands in for the drives is to be stated.
    let refused = with_stand_ins(&machine(&real("lone", "")), &registry(), None)
        .err()
        .unwrap()
        .to_string();
    assert!(
        refused.contains("driver double moves metal, and nothing stands in for it"),
        "{refused}"
    );
}

/// What stands in for real drives has nothing to touch.
#[test]
fn an_estimate_assumes_the_edges_that_its_stand_in_does_not_have() {
    let probing = real("probing", "") + "[probe]\ninput = 3\n";
    let (replaced, _) = with_stand_ins(&machine(&probing), &registry(), Some("sim")).unwrap();
    let text = "G21 G90 G94 F600\nG38.2 Z-10\nG1 X#5061 Z[#5063 + 5]\nM2\n";
    let choice = Choice::named("simulate", &replaced).unwrap();
    let with = |assumes_edges| {
        let switches = Switches {
            assumes_edges,
            ..Switches::default()
        };
        estimate(&replaced, &registry(), program(text), switches, &choice)
    };
    assert!(with(false).is_err(), "nothing is touched");
    let found = with(true).unwrap();
    assert_eq!(found.assumed_edges, 1);
    assert!(
        found.estimated_s > 1.4,
        "ten millimetres down and five up at 10 mm/s: {}",
        found.estimated_s
    );
}

/// What is 1 as long as nothing trips it is so on ideal drives: an inverted probe is not touched from the start, and no door of a
/// closed chain is open.
#[test]
fn ideal_drives_that_stand_in_trip_no_input_that_is_inverted_or_normally_closed() {
    let tables = "[probe]\ninput = 3\ninvert = true\n[inputs.guard]\ninput = 9\nrole = \"door\"\n\
                  [inputs.button]\ninput = 10\nrole = \"emergency-stop\"\n";
    let several = "[drivers.bus]\nplugin = \"double\"\noptions = { name = \"levels\", real = true }\n\
                   joints = [\"x\", \"y\", \"z\", \"a\"]\ninputs = [9, 10, 3]\n";
    let text = "G21 G90 G94 F600\nG38.2 Z-10\nG1 X#5061 Z[#5063 + 5]\nM2\n";
    for drivers in [real("levels", ""), several.to_string()] {
        let (replaced, _) =
            with_stand_ins(&machine(&(drivers + tables)), &registry(), Some("sim")).unwrap();
        let choice = Choice::named("simulate", &replaced).unwrap();
        let switches = Switches {
            assumes_edges: true,
            ..Switches::default()
        };
        let found = estimate(&replaced, &registry(), program(text), switches, &choice).unwrap();
        assert_eq!(found.assumed_edges, 1);
        assert!(found.estimated_s > 1.4, "{}", found.estimated_s);
    }
}

/// A check makes drivers, so that their options are judged, and opens none.
#[test]
fn a_check_makes_drivers_and_opens_none() {
    let report = check_program(
        machine(&real("check", "")),
        &registry(),
        program(SQUARE),
        Switches::default(),
    )
    .unwrap();
    assert!(report.is_ok());
    let told = log("check");
    assert_eq!((told.checked, told.opened, told.started), (1, 0, 0));
    let wrong = machine(&real("check", ", unheard_of = 1"));
    let refused = check_program(wrong, &registry(), program(SQUARE), Switches::default())
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("driver.options.unheard_of"), "{refused}");
}

/// A dry run drives the real machine in real time, and switches nothing.
#[test]
fn a_dry_run_moves_the_machine_with_its_outputs_off() {
    let drive = |name: &str, dry_run| {
        let switches = Switches {
            dry_run,
            ..Switches::default()
        };
        let patient = real(name, "") + "[loops]\nmax_missed_periods = 100000\n";
        let run = Run::prepare(machine(&patient), &registry(), short(), switches).unwrap();
        assert_eq!(run.clock(), Clock::Wall);
        let outcome = run.drive(Clock::Wall, &[], &mut ()).unwrap();
        assert_eq!(outcome.summary.fault, None);
        let log = log(name);
        assert!(
            log.enabled > 50 && (log.positions[0] - 1.0).abs() < 1e-12,
            "{log:?}"
        );
        (log.outputs, log.turned)
    };
    assert_eq!(drive("dry", true), (0, false));
    assert_eq!(drive("wet", false), (1 << 63, true));
}

/// A drive that stands at 37.5 mm was enabled at 0: a step of 37.5 mm in a millisecond.
#[test]
fn drives_are_enabled_where_they_stand() {
    let text = real("stands", ", stands_at = [37.5, -3.0, 12.25, 0.5]")
        + "[loops]\nmax_missed_periods = 100000\n";
    let run = Run::prepare(machine(&text), &registry(), short(), Switches::default()).unwrap();
    let outcome = run.drive(Clock::Wall, &[], &mut ()).unwrap();
    assert_eq!(outcome.summary.fault, None);
    let log = log("stands");
    let max_mm = 100.0 * 0.001;
    assert!(
        log.largest_step <= max_mm * (1.0 + 1e-9),
        "{} mm in a period",
        log.largest_step
    );
    assert_eq!(log.positions, [1.0, -3.0, 12.25, 0.5]);
}

/// A drive that never enables was waited for in silence for ever.
#[test]
fn a_drive_that_never_enables_is_named() {
    let text = real("never", ", never_enables = true") + "[loops]\nmax_missed_periods = 100000\n";
    let run = Run::prepare(machine(&text), &registry(), short(), Switches::default()).unwrap();
    let fault = run
        .drive(Clock::Wall, &[], &mut ())
        .unwrap()
        .summary
        .fault
        .unwrap();
    assert!(
        fault.contains("driver double: axis X was not enabled within 0.1 s: its drive is enabling"),
        "{fault}"
    );
}

/// A faulted drive stayed faulted through a new run; its code was decimal, without words.
#[test]
fn a_drive_that_stands_in_fault_refuses_the_run_until_it_is_reset() {
    let text = real("faulty", ", faulty = true") + "[loops]\nmax_missed_periods = 100000\n";
    let prepare = |reset| {
        Run::prepare(
            machine(&text),
            &registry(),
            short(),
            Switches {
                reset,
                ..Switches::default()
            },
        )
    };
    let refused = prepare(false).err().unwrap().to_string();
    let words = "the drive of x stands in fault 0x7210 (following error of amplifier 0 of faulty); --reset clears it";
    assert!(refused.contains(words), "{refused}");
    assert_eq!(log("faulty").exchanges, 0);
    assert_eq!(
        prepare(true)
            .unwrap()
            .drive(Clock::Wall, &[], &mut ())
            .unwrap()
            .summary
            .fault,
        None
    );
}

/// A drive that left its operational state in mid-motion ended with exit 0.
#[test]
fn a_drive_that_is_lost_in_motion_is_a_fault() {
    let text =
        real("lost", ", fails_at = 20, how = \"lost\"") + "[loops]\nmax_missed_periods = 100000\n";
    let run = Run::prepare(machine(&text), &registry(), short(), Switches::default()).unwrap();
    let fault = run
        .drive(Clock::Wall, &[], &mut ())
        .unwrap()
        .summary
        .fault
        .unwrap();
    assert!(
        fault.starts_with("driver double: the drive of axis X is lost"),
        "{fault}"
    );
}

/// A driver was told nothing of the joints that it moves.
#[test]
fn a_driver_knows_the_joints_by_name() {
    let run = Run::prepare(
        machine(&real("named", "")),
        &registry(),
        short(),
        Switches::default(),
    )
    .unwrap();
    drop(run);
    let log = log("named");
    assert_eq!(
        (log.joints, log.names),
        (4, ["x", "y", "z", "a"].map(String::from).to_vec())
    );
}

/// The joints of a gantry keep their skew; too much of it is refused with both positions.
#[test]
fn a_gantry_that_is_too_skew_is_refused_with_both_positions() {
    let gantry = "[joints.x1]\naxis = \"x\"\n[joints.x2]\naxis = \"x\"\n[loops]\nmax_missed_periods = 100000\n";
    let at = |name: &str, x2: f64| {
        let text = real(
            name,
            &format!(", stands_at = [10.0, {x2:?}, 0.0, 0.0, 0.0]"),
        ) + gantry;
        Run::prepare(machine(&text), &registry(), short(), Switches::default())
    };
    let refused = at("skew", 11.5).err().unwrap().to_string();
    let words = "axes.x.max_skew_mm: the gantry is skew: x1 stands at 10.0000 mm, x2 stands at 11.5000 mm; at most 1 mm";
    assert!(refused.contains(words), "{refused}");
    assert_eq!(log("skew").stopped, 1, "what was started is let go of");
    // What is allowed is not too much, whichever joint is ahead.
    for x2 in [11.0, 9.0] {
        assert_eq!(at("at-most", x2).err().map(|error| error.to_string()), None);
    }
    let behind = at("behind", 8.5).err().unwrap().to_string();
    let words = "x2 stands at 8.5000 mm, x1 stands at 10.0000 mm; at most 1 mm";
    assert!(behind.contains(words), "{behind}");
    assert_eq!(
        at("little", 10.5)
            .unwrap()
            .drive(Clock::Wall, &[], &mut ())
            .unwrap()
            .summary
            .fault,
        None
    );
    let log = log("little");
    assert!(
        (log.positions[1] - log.positions[0] - 0.5).abs() < 1e-9,
        "it keeps its skew: {:?}",
        log.positions
    );
    assert!(log.largest_step < 0.11, "{}", log.largest_step);
}

#[test]
fn several_drivers_leave_no_joint_without_one() {
    let text = "[drivers.bus]\nplugin = \"double\"\noptions = { name = \"bus\" }\njoints = [\"x\", \"y\", \"z\"]\n";
    let refused = try_machine(text).unwrap_err();
    assert!(
        refused.contains(
            "axes.a: no driver has joint a: it is in no list of [drivers.*], which are bus"
        ),
        "{refused}"
    );
}

/// A stall of two seconds, where half of one in a row is too much: no computer stalls so long by itself.
fn stalled(name: &str, plan: &str) -> (Summary, String) {
    let loops = "[loops]\nmax_missed_periods = 500\nmax_missed_share = 1\n";
    let text = real(name, &format!(", stall_ms = 2000{plan}")) + loops;
    let dwells = program("G21 G90 G94 F6000\nG1 X1\nG4 P0.2\nG1 X2\nM2\n");
    let run = Run::prepare(machine(&text), &registry(), dwells, Switches::default()).unwrap();
    let summary = run.drive(Clock::Wall, &[], &mut ()).unwrap().summary;
    let told = summary.warnings().concat();
    (summary, told)
}

/// Everything at rest was the fault "the drives saw a step", which nobody saw.
#[test]
fn periods_that_are_missed_while_real_drives_rest_are_counted_and_told_and_no_fault() {
    let (summary, told) = stalled("stalls-at-rest", ", stalls_at_rest = true");
    assert_eq!(
        (summary.fault, log("stalls-at-rest").positions[0]),
        (None, 2.0)
    );
    assert!(
        summary.missed_periods >= 1999,
        "a period is a millisecond: {}",
        summary.missed_periods
    );
    assert!(
        summary.missed_in_motion <= summary.missed_periods - 1999,
        "{} in motion",
        summary.missed_in_motion
    );
    let words = format!(
        "{} fine periods went by without a sample",
        summary.missed_periods
    );
    assert!(
        told.starts_with(&words)
            && told.contains("the driver's exchange took longer than the period"),
        "{told}"
    );
}

#[test]
fn periods_that_are_missed_while_real_drives_move_are_a_fault_that_names_its_key_and_its_cause() {
    let (summary, told) = stalled("stalls-in-motion", "");
    let fault = summary.fault.unwrap();
    assert!(
        fault.contains("fine periods in a row") && fault.contains("max_missed_periods"),
        "{fault}"
    );
    assert!(
        fault.contains("the driver's exchange took longer than the period of 1 ms"),
        "{fault}"
    );
    assert!(
        summary.missed_in_motion >= 1999,
        "{}",
        summary.missed_in_motion
    );
    assert!(told.contains("of them in motion"), "{told}");
    assert!(
        log("stalls-in-motion").positions[0] < 1.0,
        "it came to rest in the first move"
    );
}
