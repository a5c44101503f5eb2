//! What a machine file says, in internal units.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use crate::common::{fixtures, read};
use tandem_machine::{FineThread, GuardMode, JerkMode, Machine, Role, ValuePlace};

fn full() -> Machine {
    read(&fixtures().join("good/full.toml"), &[]).unwrap()
}

fn example_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples/machines")
        .join(name)
}

fn example(name: &str) -> Machine {
    read(&example_file(name), &[]).unwrap()
}

fn letters(machine: &Machine) -> String {
    (0..machine.axes.count())
        .map(|i| machine.axes.letter(i))
        .collect()
}

fn close(left: f64, right: f64) -> bool {
    (left - right).abs() <= 1e-12 * right.abs()
}

#[test]
fn three_axis_mill() {
    let machine = example("mill-3axis.toml");
    assert_eq!(
        (machine.name.as_str(), letters(&machine).as_str()),
        ("three-axis mill", "XYZ")
    );
    assert_eq!(
        (machine.rough_period_s, machine.fine_period_s),
        (0.008, 0.001)
    );
    assert_eq!(
        (machine.fine_periods_per_rough, machine.max_missed_periods),
        (8, 2)
    );
    assert_eq!(machine.max_missed_share, 0.01);
    assert_eq!(
        (
            machine.motion.path_tolerance_mm,
            machine.motion.time_constant_s
        ),
        (0.01, 0.05)
    );
    assert_eq!(
        (machine.motion.jerk, machine.guard),
        (JerkMode::Report, GuardMode::Stop)
    );
    let z = machine.limits.axes()[2];
    assert_eq!(
        (z.min_mm, z.max_mm, z.feed_mm_per_s, z.rapid_mm_per_s),
        (-100.0, 100.0, 250.0, 250.0)
    );
    assert_eq!(
        (z.acceleration_mm_per_s2, z.jerk_mm_per_s3),
        (1000.0, 20000.0)
    );
    assert_eq!(z.speed_difference_mm_per_s, 100.0 / 60.0);
    assert_eq!(
        (
            machine.planner.plugin.as_str(),
            machine.planner.library.clone()
        ),
        ("look-ahead", None)
    );
    assert_eq!(
        (
            machine.kinematics.plugin.as_str(),
            machine.kinematics.options.as_str()
        ),
        ("identity", "")
    );
}

#[test]
fn two_step_loop() {
    let machine = example("two-step-loop.toml");
    assert_eq!(
        (
            machine.rough_period_s,
            machine.fine_period_s,
            letters(&machine).as_str()
        ),
        (0.005, 0.0005, "XYZ")
    );
    let x = machine.limits.axes()[0];
    assert_eq!(
        (x.acceleration_mm_per_s2, x.jerk_mm_per_s3, x.rapid_mm_per_s),
        (355.0, f64::INFINITY, 250.0)
    );
    assert_eq!(machine.planner.options, "junction = \"tangent\"\n");
    assert_eq!(machine.guard, GuardMode::Count);
}

#[test]
fn linear_axes() {
    let machine = full();
    assert_eq!(
        letters(&machine),
        "XZC",
        "included axes come first, an override keeps its place"
    );
    let [x, z] = [machine.limits.axes()[0], machine.limits.axes()[1]];
    assert_eq!(
        (x.min_mm, x.max_mm, x.feed_mm_per_s, x.rapid_mm_per_s),
        (-300.0, 300.0, 200.0, 300.0)
    );
    assert_eq!((z.rapid_mm_per_s, z.jerk_mm_per_s3), (100.0, f64::INFINITY));
    assert_eq!(x.speed_difference_mm_per_s, 2.0);
    assert_eq!(
        (
            machine.start[0],
            machine.home[0],
            machine.start[1],
            machine.home[1]
        ),
        (-10.0, 20.0, 0.0, 0.0)
    );
}

#[test]
fn rotary_axes_are_in_radians() {
    let machine = full();
    let c = machine.limits.axes()[2];
    assert!(machine.axes.is_rotary(2) && !machine.axes.is_rotary(0));
    assert_eq!(
        (c.min_mm, c.max_mm, machine.start[2], machine.home[2]),
        (-PI, PI, PI / 2.0, PI / 4.0)
    );
    assert!(close(c.feed_mm_per_s, PI / 3.0) && close(c.rapid_mm_per_s, 2.0 * PI / 3.0));
    assert!(close(c.acceleration_mm_per_s2, 5.0 * PI) && close(c.jerk_mm_per_s3, 100.0 * PI));
    assert!(close(c.speed_difference_mm_per_s, PI / 120.0));
    let following = machine.max_following_error_mm;
    assert_eq!(
        (following[0], following[1]),
        (0.5, f64::INFINITY),
        "there is no limit where none is stated"
    );
    assert!(close(following[2], PI / 200.0));
}

#[test]
fn a_speed_difference_in_mm_counts_for_rotary_axes_in_degrees() {
    let machine = read(
        &fixtures().join("parts/mill.toml"),
        &["motion.allowable_speed_difference_mm_per_min=180"],
    );
    let motion = machine.unwrap().motion;
    assert_eq!(motion.speed_difference_mm_per_s, 3.0);
    assert!(close(motion.speed_difference_rad_per_s, PI / 60.0));
}

#[test]
fn the_fine_thread() {
    let machine = full();
    assert_eq!(
        machine.fine_thread,
        FineThread {
            core: Some(3),
            priority: 70
        }
    );
    assert_eq!(
        example("mill-3axis.toml").fine_thread,
        FineThread {
            core: None,
            priority: 80
        }
    );
}

#[test]
fn joints_take_from_their_axis_what_they_do_not_state() {
    let machine = full();
    let [x1, x2, c1, ..] = machine.joints.as_slice() else {
        panic!("three joints")
    };
    assert_eq!(
        (x1.name.as_str(), x1.axis, x1.limits, x1.home),
        ("x1", Some(0), machine.limits.axes()[0], 20.0)
    );
    assert_eq!(
        (
            x2.limits.max_mm,
            x2.limits.feed_mm_per_s,
            x2.limits.rapid_mm_per_s
        ),
        (301.0, 100.0, 200.0)
    );
    assert_eq!(
        (
            x2.limits.acceleration_mm_per_s2,
            x2.limits.jerk_mm_per_s3,
            x2.home
        ),
        (500.0, 5000.0, 2.5)
    );
    assert_eq!(
        (c1.axis, c1.rotary, c1.limits.max_mm),
        (Some(2), true, PI / 2.0)
    );
    assert!(close(c1.home, PI / 20.0) && close(c1.limits.jerk_mm_per_s3, 2.0 * PI));
}

#[test]
fn a_joint_without_an_axis_is_its_own() {
    let machine = full();
    let [.., belt, table] = machine.joints.as_slice() else {
        panic!("joints")
    };
    assert_eq!(
        (
            belt.axis,
            belt.rotary,
            belt.home,
            belt.max_following_error_mm
        ),
        (None, false, 0.0, f64::INFINITY)
    );
    assert_eq!(
        (belt.limits.min_mm, belt.limits.max_mm),
        (f64::NEG_INFINITY, f64::INFINITY)
    );
    assert_eq!(
        (belt.limits.rapid_mm_per_s, belt.limits.jerk_mm_per_s3),
        (150.0, f64::INFINITY)
    );
    assert_eq!((table.axis, table.rotary), (None, true));
    assert!(
        close(table.limits.feed_mm_per_s, PI) && close(table.max_following_error_mm, PI / 360.0)
    );
    assert!(close(table.limits.speed_difference_mm_per_s, PI / 120.0));
}

#[test]
fn plugins() {
    let machine = full();
    let library = fixtures().join("good/plugins/libsmooth.so");
    assert_eq!(
        machine.planner.library.as_ref(),
        Some(&library),
        "relative to the file that states it"
    );
    assert_eq!(PathBuf::from(&machine.planner.plugin), library);
    assert_eq!(
        machine.drivers[0].choice.library,
        Some(fixtures().join("good/shared/driver.so")),
        "also in an included file"
    );
    let options: toml::Table = machine.planner.options.parse().unwrap();
    let stated =
        "zeta = 1\nalpha = [1, 2.5, \"three\"]\ninner = { deep = { deeper = true } }".parse();
    assert_eq!(options, stated.unwrap());
    assert_eq!(machine.kinematics.options, "arm_mm = 12.5\n");
    assert_eq!(
        machine.feed_strategy.unwrap().options,
        "load_percent = 80\n"
    );
}

#[test]
fn the_other_tables() {
    let machine = full();
    assert_eq!(
        (machine.fine_periods_per_rough, machine.max_missed_periods),
        (16, 3)
    );
    assert_eq!(machine.max_missed_share, 0.05);
    assert_eq!(machine.motion.max_feed_ratio, 1.5);
    assert_eq!(machine.faults.unwrap()["seed"].as_integer(), Some(7));
    let policy = machine.policy.unwrap();
    assert_eq!(policy.script, fixtures().join("good/corner.wasm"));
    assert_eq!(policy.parameters["corner_error_um"].as_integer(), Some(20));
    let [c, x] = machine.homing[..] else {
        panic!("two axes home: {:?}", machine.homing)
    };
    let [by_c, by_x] = [c, x].map(|homing| *homing.switch().expect("a switch"));
    assert!(
        machine.require_homing
            && c.sequence == Some(1)
            && !by_c.inverted
            && close(by_c.switch_mm, PI)
    );
    assert_eq!((x.axis, by_x.input, by_x.inverted), (0, 10, true));
    assert_eq!((by_x.search_mm_per_s, by_x.latch_mm_per_s), (-10.0, 1.0));
    assert_eq!((by_x.back_off_mm, by_x.switch_mm), (3.0, -305.0));
    assert_eq!(
        machine.unhomed_max_feed_mm_per_s[0], 10.0,
        "the search feed"
    );
    let probe = machine.probe.unwrap();
    assert_eq!((probe.input, probe.inverted), (5, true));
    assert!(
        close(machine.spindle.min_rad_per_s, 2.0 * PI)
            && close(machine.spindle.max_rad_per_s, 400.0 * PI)
    );
}

#[test]
fn outputs() {
    let machine = full();
    let [vacuum, lamp] = &machine.outputs[..] else {
        panic!("two outputs: {:?}", machine.outputs)
    };
    assert_eq!(
        (vacuum.name.as_str(), vacuum.output, vacuum.kept),
        ("vacuum", 7, true)
    );
    assert_eq!(
        (lamp.name.as_str(), lamp.output, lamp.kept),
        ("lamp", 61, false)
    );
    assert_eq!(machine.kept_outputs(), 1 << 7);
}

#[test]
fn homing_by_the_drive() {
    let set = |x: &str| {
        read(
            &fixtures().join("parts/mill.toml"),
            &[&format!("homing.x={x}")],
        )
    };
    let machine = set("{drive_method = 35, drive_within_s = 4}").unwrap();
    let [x] = machine.homing[..] else {
        panic!("one axis homes: {:?}", machine.homing)
    };
    assert_eq!(
        x.drive().map(|drive| (drive.method, drive.within_s)),
        Some((35, 4.0))
    );
    assert!(x.switch().is_none());
    assert_eq!(
        machine.unhomed_max_feed_mm_per_s[0], 25.0,
        "a tenth of its feed"
    );
    let words = set("{drive_method = 35, input = 3}")
        .unwrap_err()
        .to_string();
    assert!(
        words.contains("homing.x.input: is of a switch that the host looks for"),
        "{words}"
    );
    let words = set("{drive_method = 0}").unwrap_err().to_string();
    assert!(
        words.contains("homing.x.drive_method: must be from 1 to 127, not 0"),
        "{words}"
    );
}

#[test]
fn inputs() {
    let machine = full();
    let [vacuum, touch, lamp] = &machine.inputs[..] else {
        panic!("three inputs: {:?}", machine.inputs)
    };
    assert_eq!(
        (vacuum.name.as_str(), vacuum.input, vacuum.role),
        ("vacuum", 9, Some(Role::FeedHold))
    );
    assert_eq!((vacuum.normally_closed, vacuum.max_age_s), (false, 0.025));
    assert_eq!(
        (touch.input, touch.role, touch.normally_closed),
        (5, Some(Role::Probe), true)
    );
    assert_eq!((lamp.role, lamp.max_age_s), (None, 0.01));
}

#[test]
fn tools() {
    let machine = full();
    assert_eq!(
        machine.tools.path,
        Some(fixtures().join("good/shared/tools.toml"))
    );
    let [mill, probe] = [1, 12].map(|number| machine.tools.get(number).unwrap());
    assert_eq!(
        (
            mill.pocket,
            mill.name.as_str(),
            mill.diameter_mm,
            mill.offset.0[..3].to_vec()
        ),
        (1, "", 0.0, vec![0.0, 50.0, 0.0])
    );
    assert_eq!(
        (probe.pocket, probe.name.as_str(), probe.diameter_mm),
        (3, "probe", 6.0)
    );
    assert_eq!(probe.offset.0[..3], [1.5, -2.0, PI]);
    assert!(machine.tools.get(2).is_none());
    assert_eq!(
        (&machine.tools.change_sub, machine.tools.retract_z_mm),
        (&None, None)
    );
}

#[test]
fn how_tools_are_changed() {
    let path = example_file("mill-3axis.toml");
    let changed = |set: &[&str]| read(&path, set).map(|machine| machine.tools);
    let tools = changed(&[
        "tools.change=\"sub:Tool-change_2\"",
        "tools.retract_z_mm=-5.5",
    ])
    .unwrap();
    assert_eq!(tools.change_sub.as_deref(), Some("tool-change_2"));
    assert_eq!(tools.retract_z_mm, Some(-5.5));
    // That says nothing of lengths.
    assert!(tools.tools.is_empty() && !tools.zero_without_table);
    let both = ["tools.change=\"ask\"", "tools.without_table=\"zero\""];
    let tools = changed(&both).unwrap();
    assert!(tools.zero_without_table && tools.change_sub.is_none());
    for wrong in ["sub", "sub:", "sub:../x", "sub:a b", "hand"] {
        let set = format!("tools.change=\"{wrong}\"");
        let words = changed(&[&set]).unwrap_err().to_string();
        assert!(words.contains("tools.change"), "{wrong}: {words}");
    }
}

#[test]
fn places() {
    let machine = read(
        &fixtures().join("good/full.toml"),
        &["planner.options.zeta=2"],
    )
    .unwrap();
    let place = |key: &str| {
        machine
            .place(key)
            .to_string()
            .replace(&format!("{}/", fixtures().display()), "")
    };
    assert_eq!(place("axes.x.travel_mm"), "good/full.toml:27:1");
    assert_eq!(
        place("axes.x.max_jerk_mm_per_s3"),
        "good/shared/axes.toml:9:1"
    );
    assert_eq!(
        place("planner.options.gamma"),
        "good/full.toml:79:10",
        "the table, where the key is absent"
    );
    assert_eq!(place("guard.severity"), "good/shared/drives.toml:10:2");
    assert_eq!(place("coolant"), "good/full.toml:1:1");
    assert_eq!(
        machine.place("planner.options.zeta"),
        ValuePlace::Override("planner.options.zeta".to_owned())
    );
}

#[test]
fn the_name_defaults_to_that_of_the_file() {
    assert_eq!(
        read(&fixtures().join("parts/mill.toml"), &[]).unwrap().name,
        "mill"
    );
}

#[test]
fn each_of_several_drivers_has_its_part_of_the_machine_in_its_own_order() {
    let machine = read(&fixtures().join("good/drivers.toml"), &[]).unwrap();
    let bus = &machine.drivers[0];
    assert_eq!(
        (bus.name.as_deref(), bus.section(), bus.title()),
        (Some("bus"), "drivers.bus".into(), "bus (sim)".into())
    );
    let owns = bus.owns.as_ref().unwrap();
    assert_eq!(
        (&owns.joints[..], &owns.inputs[..], owns.spindle),
        (&["z".to_owned(), "x".to_owned()][..], &[3, 1][..], false)
    );
    let spindle = &machine.drivers[1];
    let library = fixtures().join("good/spindle.so");
    assert_eq!(
        spindle.choice.library.as_ref(),
        Some(&library),
        "beside the file"
    );
    assert_eq!(
        spindle.stand_in.as_ref().unwrap().options.trim(),
        "seed = 7"
    );
    assert!(spindle.owns.as_ref().unwrap().spindle);
    assert_eq!(machine.analog[0].signal(), "force_N");
    assert_eq!(
        (&machine.inputs[0].name[..], machine.outputs[0].output),
        ("door", 5)
    );
    let one = read(
        &fixtures().join("parts/mill.toml"),
        &["driver.stand_in.plugin=sim"],
    )
    .unwrap();
    assert_eq!(
        (
            one.drivers.len(),
            &one.drivers[0].owns,
            one.drivers[0].section()
        ),
        (1, &None, "driver".to_owned())
    );
    assert_eq!(one.drivers[0].stand_in.as_ref().unwrap().plugin, "sim");
}
