//! Machines of several drivers that are refused at their start, by the names of driver and joints.

use tandem_host::{Run, Switches, check_program};
use tandem_sdk::{Attached, AxisVector, JointState};

use crate::mirror::{Mirror, Own, mirrors, registry, text};
use crate::{machine, program};

/// Where it is not known where a joint stands, nobody knows how skew its gantry is: homing and jogging may go on.
#[test]
fn the_skew_of_a_gantry_is_judged_by_joints_that_know_where_they_stand() {
    for (known, skew) in [(u32::MAX, true), (0b11101, false), (0b11110, false)] {
        let mut attached = Attached {
            known,
            ..Attached::at(AxisVector::ZERO)
        };
        attached.position[1] = 50.0;
        mirrors().insert(
            "skew".to_string(),
            Mirror {
                attached,
                ..Mirror::default()
            },
        );
        let gantry = "[driver]\nplugin = \"mirror\"\noptions = { name = \"skew\" }\n\
                      [joints.x1]\naxis = \"x\"\n[joints.x2]\naxis = \"x\"\n";
        let switches = Switches {
            unhomed: true,
            ..Switches::default()
        };
        let run = Run::prepare(machine(gantry), &registry(), program("G21\nM2\n"), switches);
        let refused = run.err().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(
            refused.contains("the gantry is skew"),
            skew,
            "{known:b}: {refused}"
        );
    }
}

/// Nothing that a start says wrongly is enabled: it is refused with the driver, its joints, and what is wrong.
#[test]
fn a_start_that_makes_no_sense_is_refused_by_the_names_of_driver_and_joints_and_stopped() {
    type Change = fn(&mut Attached);
    let mostly: [(&str, Change, Option<&str>); 9] = [
        (
            "number",
            |own| own.position[1] = f64::NAN,
            Some("its start gives no finite number as the position of x"),
        ),
        (
            "state",
            |own| own.state[0] = JointState(99),
            Some("its start gives a number as the state of z that stands for none"),
        ),
        (
            "delay",
            |own| own.delay_periods = [16; 8],
            Some("the feedback of x, z is more than 15 fine periods behind"),
        ),
        ("delay-at-limit", |own| own.delay_periods = [15; 8], None),
        (
            "lost",
            |own| own.state[1] = JointState::Lost,
            Some("the drive of x cannot be reached"),
        ),
        (
            "unknown",
            |own| (own.known, own.homed) = (0, 0),
            Some("it is not known where x, z stands: home the machine first"),
        ),
        ("homed", |own| (own.known, own.homed) = (0, 0b11), None),
        (
            "faulty",
            |own| (own.state[1], own.fault_code[1]) = (JointState::Fault, 7),
            Some("the drive of x stands in fault 7 (1 of faulty-bus)"),
        ),
        ("reset", |own| own.state[1] = JointState::Fault, None),
    ];
    for (name, change, words) in mostly {
        let own = |driver: &str, joints: &[usize]| Own {
            name: format!("{name}-{driver}"),
            joints: joints.to_vec(),
            ..Own::default()
        };
        let all = [own("bus", &[2, 0]), own("arm", &[3, 1])];
        for own in &all {
            let mut attached = Attached::at(AxisVector::ZERO);
            // What is wrong with both is told of one.
            if own.name.ends_with("bus") || ["delay", "unknown"].contains(&name) {
                change(&mut attached);
            }
            mirrors().insert(
                own.name.clone(),
                Mirror {
                    attached,
                    ..Mirror::default()
                },
            );
        }
        let switches = Switches {
            reset: name == "reset",
            ..Switches::default()
        };
        let run = Run::prepare(
            machine(&text(&all)),
            &registry(),
            program("G21\nG1 X1 F600\nM2\n"),
            switches,
        );
        let refused = run.as_ref().err().map(ToString::to_string);
        let expected = words.map(|words| format!("driver {name}-bus (mirror): {words}"));
        let (is, told) = (
            refused.clone().unwrap_or_default(),
            expected.clone().unwrap_or_default(),
        );
        assert!(
            refused.is_some() == expected.is_some() && is.contains(&told),
            "{name}: {is}"
        );
        drop(run);
        for own in &all {
            let mirror = mirrors()[&own.name].clone();
            assert_eq!(mirror.stops, 1, "{name}: all are let go of");
            assert_eq!(
                mirror.context.unwrap().real_time,
                1,
                "{name}: real drives live in real time"
            );
        }
    }
}

/// A time that nobody can wait for is refused by a check and by a run, with the driver and the time, before anything is opened.
#[test]
fn a_driver_that_may_take_for_ever_is_refused_by_its_name() {
    let times = [f64::INFINITY, f64::NAN, 0.0, -1.0, 1e6];
    for (n, time_s) in times.into_iter().enumerate() {
        for (at, key) in ["enable_s", "disable_s"].into_iter().enumerate() {
            let (bus, arm) = (format!("ever-{n}-{at}"), format!("soon-{n}-{at}"));
            let deal = |name: &str, joints: &[usize]| Own {
                name: name.to_string(),
                joints: joints.to_vec(),
                ..Own::default()
            };
            let mut times_s = [1.0, 1.0];
            times_s[at] = time_s;
            let stated = Mirror {
                times_s: Some(times_s),
                ..Mirror::default()
            };
            mirrors().insert(bus.clone(), stated);
            mirrors().insert(arm.clone(), Mirror::default());
            let text = text(&[deal(&arm, &[0, 1, 2]), deal(&bus, &[3])]);
            let part = || program("G21\nG1 X1 F600\nM2\n");
            let run = Run::prepare(machine(&text), &registry(), part(), Switches::default());
            let check =
                check_program(machine(&text), &registry(), part(), Switches::default()).map(|_| ());
            for refused in [run.map(|_| ()), check] {
                let words = refused.unwrap_err().to_string();
                let told = format!(
                    "drivers.{bus}.plugin: driver {bus} (mirror) says that its {key} is {time_s} s"
                );
                assert!(words.contains(&told), "{words}");
            }
            assert!(mirrors()[&bus].context.is_none(), "it was opened");
        }
    }
}
