//! Objects that are read and written while drives move: neither what they are told nor what they answer changes by it.

use crate::common;

use std::fmt::Write;

use tandem_ethercat::{EthercatDrives, Object, Options, Request, Value};
use tandem_ethercat_emulator::What;
use tandem_rig::Random;
use tandem_sdk::{Driver, DriverContext, Feedback, JointState, Name, PluginOptions, Setpoint};

/// Periods in which an object is to be read or written.
const MAX_PERIODS: u32 = 10;

/// Frames behind which a start is disturbed.
const MAX_FRAMES: u64 = 600;

/// Torque of all joints while they are homed, percent of the rated one.
const HOMING_PERCENT: f64 = 17.5;

/// Drives that hold, on a bus drawn from a seed.
struct Rig {
    driver: EthercatDrives,
    setpoint: Setpoint,
    feedback: Feedback,
    drives: usize,
    period_s: f64,
}

impl Rig {
    fn new(sync: &str, random: &mut Random) -> Self {
        let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
        let drives = 1 + random.below(6) as usize;
        let period_s = random.pick(&[0.001, 0.002, 0.004]);
        let mut text = format!("interface = \"emulated\"\nsync = \"{sync}\"\nwatchdog_ms = 40\n");
        for (position, name) in names.iter().enumerate().take(drives) {
            let counts = 1000 + random.below(9000);
            let _ = write!(
                text,
                "[[devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{name}\"\ncounts_per_mm = {counts}\n"
            );
        }
        let mut context = DriverContext::new(drives, period_s);
        for (joint, name) in context.joints.iter_mut().zip(names) {
            (joint.name, joint.homing_torque_percent) = (Name::new(name), HOMING_PERCENT);
        }
        let mut driver = EthercatDrives::new(&Options::read(&text).unwrap()).unwrap();
        driver.open(&context).unwrap();
        let attached = driver.start().unwrap();
        let (mut setpoint, feedback) = common::begin(&attached);
        setpoint.enable = 1;
        let mut rig = Self {
            driver,
            setpoint,
            feedback,
            drives,
            period_s,
        };
        let holds = |rig: &Self| {
            rig.feedback.state[..drives]
                .iter()
                .all(|state| *state == JointState::Enabled)
        };
        while !holds(&rig) {
            rig.go(0.0);
        }
        rig
    }

    /// A period in which all joints move by so much.
    fn go(&mut self, step: f64) {
        self.setpoint.tick += 1;
        for joint in 0..self.drives {
            self.setpoint.position[joint] += step;
            self.setpoint.velocity[joint] = step / self.period_s;
        }
        self.driver
            .exchange(&self.setpoint, &mut self.feedback)
            .unwrap();
    }

    /// Exchanges in motion until what was asked is answered; the answer, and how many that took.
    fn until_answered(&mut self, said: &mut Vec<Feedback>) -> (Result<Value, String>, u32) {
        for exchanges in 1..5000 {
            self.go(0.01);
            said.push(self.feedback);
            if let Some(answer) = self.driver.answer() {
                return (answer, exchanges);
            }
        }
        panic!("no answer");
    }
}

fn quick_stop_deceleration(place: usize, value: Option<u32>) -> Request {
    Request {
        object: Object {
            place,
            index: 0x6085,
            sub: 0,
        },
        value: value.map(|number| Value { number, bits: 32 }),
    }
}

#[test]
fn objects_are_read_and_written_in_motion_within_ten_periods_and_no_answer_of_a_joint_changes() {
    for seed in 1..=10_u64 {
        let sync = if seed % 2 == 0 { "dc" } else { "free-run" };
        let mut rig = Rig::new(sync, &mut Random::new(seed));
        let mut random = Random::new(seed);
        let mut undisturbed = Rig::new(sync, &mut random);
        let (mut said, mut expected) = (vec![], vec![]);
        for n in 0..60 {
            let place = random.below(rig.drives as u64) as usize;
            let written = 1_000_000 + random.below(1 << 24) as u32;
            let case = format!("seed {seed}, {sync}, {n}, device {place}");
            for value in [Some(written), None] {
                let request = quick_stop_deceleration(place, value);
                rig.driver.ask(&request).unwrap();
                let busy = rig.driver.ask(&request).unwrap_err();
                assert!(busy.contains("another object is being asked for"), "{busy}");
                let (answer, exchanges) = rig.until_answered(&mut said);
                let of_both = if value.is_some() { 2 } else { 1 };
                assert!(
                    exchanges <= MAX_PERIODS * of_both,
                    "{case}: {exchanges} exchanges"
                );
                let value = answer.unwrap_or_else(|why| panic!("{case}: {why}"));
                assert_eq!((value.number, value.bits), (written, 32), "{case}");
            }
            for _ in 0..random.below(4) {
                rig.go(0.01);
                said.push(rig.feedback);
            }
        }
        for _ in 0..said.len() {
            undisturbed.go(0.01);
            expected.push(undisturbed.feedback);
        }
        for (period, (said, expected)) in said.iter().zip(&expected).enumerate() {
            // The frame's own place in its period is the bus's, not the joints'.
            let joints = |feedback: &Feedback| {
                (
                    feedback.position,
                    feedback.speed,
                    feedback.state,
                    feedback.age_periods,
                )
            };
            assert_eq!(
                joints(said),
                joints(expected),
                "seed {seed}, period {period}"
            );
        }
        let counters = rig.driver.counters();
        assert_eq!((counters.lost, counters.short, counters.strays), (0, 0, 0));
        let empty: u64 = rig
            .driver
            .with_emulator(|wire| {
                let devices = wire.bus().devices().iter();
                devices
                    .map(|device| device.counters().sync0_without_outputs)
                    .sum()
            })
            .unwrap();
        assert_eq!(empty, 0, "seed {seed}: a SYNC0 without a new setpoint");
    }
}

/// What cannot be done is said, and the exchanges go on meanwhile.
#[test]
fn what_a_device_refuses_or_the_driver_writes_itself_is_said_and_a_silent_mailbox_keeps_nobody_waiting()
 {
    let mut random = Random::new(5);
    let mut rig = Rig::new("free-run", &mut random);
    let ask = |rig: &mut Rig, place: usize, index: u16, value: Option<u32>| {
        let request = Request {
            object: Object {
                place,
                index,
                sub: 0,
            },
            value: value.map(|number| Value { number, bits: 32 }),
        };
        rig.driver.ask(&request)?;
        rig.until_answered(&mut vec![]).0.map(|value| value.number)
    };
    assert!(ask(&mut rig, 0, 0x6502, None).is_ok());
    let refused = ask(&mut rig, 0, 0x5FFF, None).unwrap_err();
    assert!(refused.contains("reading 5FFF:00: it refuses"), "{refused}");
    let refused = ask(&mut rig, 0, 0x6502, Some(1)).unwrap_err();
    assert!(refused.contains("writing 6502:00: it refuses"), "{refused}");
    let refused = ask(&mut rig, 0, 0x607A, Some(1)).unwrap_err();
    assert!(refused.contains("607A is the driver's own"), "{refused}");
    let none = ask(&mut rig, 99, 0x6502, None).unwrap_err();
    assert!(none.contains("there is no device 99"), "{none}");
    // Emergency messages between question and answer: asked again, and told where they do not end. `ethercrab` takes the low bits of
    // their code for the command of an answer: with the one it finds none, with the other its assertion fails.
    let cases = [(3, true), (1000, false), (0, true)];
    let codes = [0x6100, 0x7320];
    let cases = cases
        .iter()
        .flat_map(|case| codes.map(|code| (*case, code)));
    for ((messages, answers), code) in cases {
        let told = What::Emergencies {
            device: 0,
            messages,
            code,
        };
        rig.driver
            .with_emulator(|wire| wire.inject(told, None).unwrap());
        let answer = ask(&mut rig, 0, 0x6502, None);
        assert_eq!(
            answer.is_ok(),
            answers,
            "{messages} of {code:#x}: {answer:?}"
        );
        let why = answer.err().unwrap_or_default();
        assert!(
            answers || why.contains("an emergency message in place of each answer"),
            "{why}"
        );
    }
    let silent = What::SilentMailbox { device: 0 };
    rig.driver
        .with_emulator(|wire| wire.inject(silent, None).unwrap());
    let silent = ask(&mut rig, 0, 0x6502, None).unwrap_err();
    assert!(silent.contains("its mailbox does not answer"), "{silent}");
    let counters = rig.driver.counters();
    assert_eq!((counters.lost, counters.short, counters.strays), (0, 0, 0));
    assert_eq!(rig.feedback.state[0], JointState::Enabled);
    // Who is stopped in the midst of it says so.
    rig.driver.ask(&quick_stop_deceleration(0, None)).unwrap();
    rig.driver.stop().unwrap();
    let stopped = rig.driver.answer().unwrap().unwrap_err();
    assert!(stopped.contains("the bus was stopped"), "{stopped}");
    assert!(rig.driver.ask(&quick_stop_deceleration(0, None)).is_err());
}

/// The torque that homing may use is the drive's most torque (6072) as long as its joint is to be limited, and no longer.
#[test]
fn a_joint_that_is_limited_has_the_torque_of_homing_and_its_own_again_behind_it() {
    for seed in 1..=4 {
        let mut rig = Rig::new("free-run", &mut Random::new(seed));
        let max_torque = |rig: &mut Rig, place: usize| {
            let object = Object {
                place,
                index: 0x6072,
                sub: 0,
            };
            let request = Request {
                object,
                value: None,
            };
            rig.driver.ask(&request).unwrap();
            rig.until_answered(&mut vec![]).0.unwrap().number
        };
        for limited in 0..1 << rig.drives {
            rig.setpoint.limited = limited;
            rig.go(0.0);
            for place in 0..rig.drives {
                let expected = if limited >> place & 1 == 1 { 175 } else { 3000 };
                assert_eq!(
                    max_torque(&mut rig, place),
                    expected,
                    "seed {seed}, device {place}, limited {limited:b}"
                );
            }
        }
    }
}

/// An emergency message in place of any answer on the way up, also of those that `ethercrab` awaits by itself, for the process data.
#[test]
fn an_emergency_message_behind_any_frame_of_the_start_keeps_no_bus_down() {
    for sync in ["free-run", "dc"] {
        let start = |behind: Option<u64>| {
            let fault = behind.map_or_else(String::new, |frame| {
                // The one is read as no answer, the other fails an assertion.
                let code = [0x6100, 0x7320][frame as usize % 2];
                format!(
                    "[[emulated.faults]]\nat = {{ frame = {frame} }}\n\
                     what = {{ kind = \"emergencies\", device = 0, messages = 1, code = {code} }}\n"
                )
            });
            let text = format!(
                "interface = \"emulated\"\nsync = \"{sync}\"\n\
                 [[devices]]\nposition = 0\nproduct = \"0x0e1a:0x0402\"\njoint = \"x\"\ncounts_per_mm = 1000\n\
                 [[emulated.devices]]\nkind = \"drive\"\n{fault}"
            );
            let mut context = DriverContext::new(1, 0.001);
            context.joints[0].name = Name::new("x");
            let mut driver = EthercatDrives::new(&Options::read(&text).unwrap()).unwrap();
            driver.open(&context).unwrap();
            driver
                .start()
                .unwrap_or_else(|why| panic!("{sync}, behind frame {behind:?}: {why}"));
            driver
                .with_emulator(|wire| wire.frames_and_cycles().0)
                .unwrap()
        };
        let undisturbed = start(None);
        // Before the last of them clocks are brought to one time. A question and its answer take more frames than a step.
        let first = undisturbed.saturating_sub(MAX_FRAMES);
        let steps = (first..undisturbed).step_by(5);
        let count = steps.clone().count() as u64;
        let asked_again = steps
            .filter(|frame| start(Some(*frame)) > undisturbed)
            .count() as u64;
        println!("{sync}: {asked_again} of {count} starts asked again");
        assert!(asked_again > count / 2, "{sync}: {asked_again} of {count}");
    }
}
