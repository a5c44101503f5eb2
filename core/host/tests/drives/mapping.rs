//! Machines whose joints, lines and spindle are dealt out to drivers at random: each driver is told of its own, in its
//! own numbers, and what it answers comes back in those of the machine.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tandem_host::{Run, Switches, attached_driver, check_program};
use tandem_rig::Random;
use tandem_sdk::{
    Arm, Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState,
    Latch, Plugin, PluginError, RawOptions, Setpoint, Words, local_plugin,
};

use crate::{machine, program};

const AXES: [&str; 4] = ["x", "y", "z", "a"];

/// A driver that keeps what it is told, and answers what it is to.
#[derive(Clone, Debug, Default)]
struct Mirror {
    context: Option<DriverContext>,
    sent: Option<Setpoint>,
    sends: u32,
    told: Option<Setpoint>,
    /// It has nothing to begin before its exchange.
    sends_nothing: bool,
    attached: Attached,
    answer: Feedback,
    fails: bool,
    quick_stops: u32,
    stops: u32,
    explained: Option<u32>,
    /// Times that it states for enabling and disabling, s; those of a real driver where none.
    times_s: Option<[f64; 2]>,
}

static MIRRORS: Mutex<BTreeMap<String, Mirror>> = Mutex::new(BTreeMap::new());

fn mirrors() -> MutexGuard<'static, BTreeMap<String, Mirror>> {
    MIRRORS.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Reflecting(String);

impl Reflecting {
    fn with<T>(&self, what: impl FnOnce(&mut Mirror) -> T) -> T {
        what(mirrors().entry(self.0.clone()).or_default())
    }
}

#[allow(clippy::unnecessary_wraps)] // the form of a constructor
fn made(options: &RawOptions) -> Result<Reflecting, PluginError> {
    Ok(Reflecting(
        options.0.split('"').nth(1).unwrap_or_default().to_string(),
    ))
}

fn plugin() -> Plugin {
    local_plugin!(driver "mirror" = made)
}

impl Driver for Reflecting {
    fn describe(&self) -> DriverDescription {
        let real = DriverDescription::real();
        let times_s = self.with(|mirror| mirror.times_s);
        let [enable_s, disable_s] = times_s.unwrap_or([real.enable_s, real.disable_s]);
        DriverDescription {
            watches_following: 1,
            enable_s,
            disable_s,
            ..real
        }
    }
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        self.with(|mirror| mirror.context = Some(*context));
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(self.with(|mirror| mirror.attached))
    }
    fn send(&mut self, setpoint: &Setpoint) -> bool {
        self.with(|mirror| {
            mirror.sends += 1;
            mirror.sent = Some(*setpoint);
            !mirror.sends_nothing
        })
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.with(|mirror| {
            mirror.told = Some(*setpoint);
            if mirror.fails {
                return Err(PluginError::new(format!("the line of {} is cut", self.0)));
            }
            *feedback = mirror.answer;
            Ok(())
        })
    }
    fn quick_stop(&mut self) {
        self.with(|mirror| mirror.quick_stops += 1);
    }
    fn stop(&mut self) -> Result<(), PluginError> {
        self.with(|mirror| mirror.stops += 1);
        Err(PluginError::fixed("the brake is not on"))
    }
    fn explain(&self, joint: u32, _code: u32) -> Words {
        self.with(|mirror| mirror.explained = Some(joint));
        Words::new(format!("{} of {}", joint, self.0))
    }
}

/// What a driver has of the machine, by the machine's numbers.
#[derive(Clone, Debug, Default)]
struct Own {
    name: String,
    joints: Vec<usize>,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    analog: Vec<usize>,
    spindle: bool,
}

/// What is told and answered in one numbering, as sets and lists that know nothing of runs and masks.
impl Own {
    fn bits(&self, of: impl Fn(usize) -> bool) -> u32 {
        self.joints
            .iter()
            .enumerate()
            .fold(0, |bits, (own, joint)| bits | u32::from(of(*joint)) << own)
    }
    fn vector(&self, of: &AxisVector) -> AxisVector {
        let own: Vec<f64> = self.joints.iter().map(|joint| of[*joint]).collect();
        AxisVector::from_slice(&own)
    }
    fn lines(numbers: &[u32], of: u64) -> u64 {
        numbers
            .iter()
            .enumerate()
            .fold(0, |own, (i, number)| own | (of >> number & 1) << i)
    }
}

/// Deals everything out to two or three drivers, in any order.
fn dealt(random: &mut Random, seed: u64) -> Vec<Own> {
    let count = 2 + random.below(2) as usize;
    let mut all: Vec<Own> = (0..count)
        .map(|i| Own {
            name: format!("m{seed}-{i}"),
            ..Own::default()
        })
        .collect();
    let mut shuffled = |count: u64| {
        let mut left: Vec<u64> = (0..count).collect();
        let mut order = vec![];
        while !left.is_empty() {
            order.push((
                left.remove(random.below(left.len() as u64) as usize),
                random.below(1 << 32) as usize % 97,
            ));
        }
        order
    };
    for (joint, to) in shuffled(4) {
        all[to % count].joints.push(joint as usize);
    }
    for (line, to) in shuffled(64) {
        all[to % count].inputs.push(line as u32);
    }
    for (line, to) in shuffled(64) {
        all[to % count].outputs.push(line as u32);
    }
    for (analog, to) in shuffled(4) {
        all[to % count].analog.push(analog as usize);
    }
    let turns = seed as usize % count;
    all[turns].spindle = true;
    // Some have no input, though they may have analog values.
    if seed % 4 == 1 {
        let (first, others) = all.split_at_mut(1);
        first[0]
            .inputs
            .extend(others.iter_mut().flat_map(|own| own.inputs.drain(..)));
    }
    // Some have their lines in one run, as most have.
    if seed.is_multiple_of(3) {
        for own in &mut all {
            own.inputs.sort_unstable();
        }
    }
    all
}

fn text(all: &[Own]) -> String {
    let mut text = String::new();
    for own in all {
        let joints: Vec<_> = own.joints.iter().map(|joint| AXES[*joint]).collect();
        let _ = writeln!(
            text,
            "[drivers.{}]\nplugin = \"mirror\"\noptions = {{ name = \"{}\" }}\njoints = {joints:?}\ninputs = {:?}\n\
             outputs = {:?}\nanalog = {:?}\nspindle = {}",
            own.name, own.name, own.inputs, own.outputs, own.analog, own.spindle
        );
    }
    text
}

fn drawn_answer(random: &mut Random) -> Feedback {
    let mut answer = Feedback {
        homed: random.below(256) as u32,
        inputs: random.below(u64::MAX),
        ..Feedback::default()
    };
    for joint in 0..8 {
        answer.state[joint] = random.pick(&[
            JointState::Enabled,
            JointState::Homing,
            JointState::QuickStop,
        ]);
        (answer.fault_code[joint], answer.age_periods[joint]) =
            (random.below(99) as u32, random.below(9) as u32);
        answer.position[joint] = random.unit();
        (answer.speed[joint], answer.current_a[joint]) = (random.unit(), random.unit());
    }
    answer.input_age_periods = std::array::from_fn(|_| random.below(9) as u16);
    answer.analog = std::array::from_fn(|_| random.unit());
    answer.latches[0] = Latch {
        input: random.below(20) as u32,
        edge: random.below(3) as u32,
        joints: random.below(16) as u32,
        position: AxisVector::from_slice(&[1.0, 2.0, 3.0, 4.0]),
        ..Latch::default()
    };
    (
        answer.spindle_rad_per_s,
        answer.spindle_angle_rad,
        answer.spindle_at_speed,
    ) = (random.unit(), random.unit(), 1);
    answer
}

/// The setpoint behind `last`: any one thing of it may change alone, or nothing but the numbers of the joints.
fn drawn_setpoint(random: &mut Random, last: &Setpoint) -> Setpoint {
    let mut setpoint = Setpoint {
        tick: random.below(1000),
        ..*last
    };
    let changed = random.below(12);
    let all = changed == 0;
    if all || changed == 1 {
        setpoint.enable = random.below(2) as u32;
    }
    if all || changed == 2 {
        setpoint.homing = random.below(16) as u32;
    }
    if all || changed == 3 {
        setpoint.limited = random.below(16) as u32;
    }
    if all || changed == 4 {
        setpoint.outputs = random.below(u64::MAX);
    }
    if all || changed == 5 {
        setpoint.arm = Arm {
            input: random.below(64) as u32,
            edge: random.below(3) as u32,
        };
    }
    if all || changed == 6 {
        setpoint.spindle_rad_per_s = random.unit();
    }
    setpoint.reset = u32::from(changed == 7);
    if changed == 8 {
        (setpoint.homing, setpoint.limited, setpoint.arm) = (0, 0, Arm::default());
    }
    for joint in 0..4 {
        setpoint.position[joint] = random.unit();
        (setpoint.velocity[joint], setpoint.acceleration[joint]) = (random.unit(), random.unit());
    }
    setpoint
}

/// The exchange of the `first` comes next and sends by itself.
fn assert_told(own: &Own, whole: &Setpoint, first: bool, case: &str) {
    let mirror = mirrors()[&own.name].clone();
    let told = mirror.told.unwrap();
    if mirror.sends_nothing {
        assert_eq!(mirror.sends, u32::from(!first), "{case}: asked once");
    } else {
        assert_eq!(
            mirror.sent,
            Some(told).filter(|_| !first),
            "{case}: sent to all before anybody is received from"
        );
    }
    assert_eq!(
        (told.enable, told.reset, told.tick),
        (whole.enable, whole.reset, whole.tick),
        "{case}"
    );
    assert_eq!(
        told.homing,
        own.bits(|joint| whole.homing >> joint & 1 == 1),
        "{case}"
    );
    assert_eq!(
        told.limited,
        own.bits(|joint| whole.limited >> joint & 1 == 1),
        "{case}"
    );
    assert_eq!(
        told.outputs,
        Own::lines(&own.outputs, whole.outputs),
        "{case}"
    );
    let armed = own
        .inputs
        .iter()
        .position(|input| *input == whole.arm.input)
        .filter(|_| whole.arm.edge != 0);
    let arm = armed.map_or(Arm::default(), |input| Arm {
        input: input as u32,
        edge: whole.arm.edge,
    });
    assert_eq!(told.arm, arm, "{case}");
    assert_eq!(
        told.spindle_rad_per_s,
        if own.spindle {
            whole.spindle_rad_per_s
        } else {
            0.0
        },
        "{case}"
    );
    assert_eq!(
        [told.position, told.velocity, told.acceleration],
        [&whole.position, &whole.velocity, &whole.acceleration].map(|vector| own.vector(vector)),
        "{case}"
    );
}

/// What came of the answer of one driver; the latches of all are looked at together.
fn assert_answered(own: &Own, whole: &Feedback, latches: &mut Vec<Latch>, case: &str) {
    let answer = mirrors()[&own.name].answer;
    for (i, joint) in own.joints.iter().enumerate() {
        assert_eq!(whole.homed >> joint & 1, answer.homed >> i & 1, "{case}");
        assert_eq!(
            (whole.state[*joint], whole.fault_code[*joint]),
            (answer.state[i], answer.fault_code[i]),
            "{case}"
        );
        assert_eq!(whole.age_periods[*joint], answer.age_periods[i], "{case}");
        assert_eq!(
            [
                whole.position[*joint],
                whole.speed[*joint],
                whole.current_a[*joint]
            ],
            [answer.position[i], answer.speed[i], answer.current_a[i]],
            "{case}"
        );
    }
    for (i, input) in own.inputs.iter().enumerate() {
        assert_eq!(
            whole.inputs >> input & 1,
            answer.inputs >> i & 1,
            "{case}: input {input}"
        );
        assert_eq!(
            whole.input_age_periods[*input as usize], answer.input_age_periods[i],
            "{case}: input {input}"
        );
    }
    for (i, analog) in own.analog.iter().enumerate() {
        assert_eq!(whole.analog[*analog], answer.analog[i], "{case}");
    }
    if own.spindle {
        let (is, of) = (whole, answer);
        assert_eq!(
            (is.spindle_rad_per_s, is.spindle_angle_rad),
            (of.spindle_rad_per_s, of.spindle_angle_rad),
            "{case}"
        );
        assert_eq!(is.spindle_at_speed, of.spindle_at_speed, "{case}");
    }
    let caught = answer.latches[0];
    let Some(input) = own
        .inputs
        .get(caught.input as usize)
        .filter(|_| caught.edge != 0)
    else {
        return;
    };
    let mut latch = Latch {
        input: *input,
        joints: 0,
        ..caught
    };
    for (i, joint) in own.joints.iter().enumerate() {
        latch.joints |= (caught.joints >> i & 1) << joint;
        latch.position[*joint] = caught.position[i];
    }
    latches.push(latch);
}

fn registry() -> tandem_host::Registry {
    let mut registry = tandem_host::Registry::default();
    for plugin in [tandem_look_ahead::PLUGIN, plugin()] {
        registry.register(plugin).unwrap();
    }
    registry
}

#[test]
fn each_driver_is_told_and_answers_in_its_own_numbers() {
    for seed in 0..60 {
        let mut random = Random::new(300 + seed);
        let all = dealt(&mut random, seed);
        let claimed: Vec<u32> = (0..64).filter(|_| random.below(4) == 0).collect();
        let mut tables = text(&all);
        for input in &claimed {
            _ = writeln!(tables, "[inputs.i{input}]\ninput = {input}");
        }
        let measured: Vec<usize> = (0..4).filter(|_| random.below(2) == 0).collect();
        for analog in &measured {
            _ = writeln!(tables, "[analog.s{analog}]\ninput = {analog}");
        }
        let mut stands = Attached::default();
        for own in &all {
            let mut attached = Attached {
                known: random.below(16) as u32,
                homed: random.below(16) as u32,
                ..stands
            };
            for joint in 0..4 {
                attached.position[joint] = random.unit();
                attached.state[joint] = random.pick(&[JointState::Disabled, JointState::Fault]);
                (attached.fault_code[joint], attached.delay_periods[joint]) =
                    (random.below(99) as u32, random.below(9) as u32);
            }
            mirrors().insert(
                own.name.clone(),
                Mirror {
                    attached,
                    sends_nothing: random.below(3) == 0,
                    ..Mirror::default()
                },
            );
        }
        let (mut driver, attached) = attached_driver(&machine(&tables), &registry()).unwrap();
        for own in &all {
            let (context, stood) = mirrors()
                .get(&own.name)
                .map(|own| (own.context.unwrap(), own.attached))
                .unwrap();
            let names: Vec<_> = context.joints[..context.joint_count as usize]
                .iter()
                .map(|of| of.name.as_str().to_string())
                .collect();
            assert_eq!(
                names,
                own.joints
                    .iter()
                    .map(|joint| AXES[*joint])
                    .collect::<Vec<_>>(),
                "seed {seed}"
            );
            let mask = claimed.iter().fold(0_u64, |mask, input| mask | 1 << input);
            assert_eq!(context.inputs, Own::lines(&own.inputs, mask), "seed {seed}");
            assert_eq!(
                context.outputs,
                Own::lines(&own.outputs, u64::MAX),
                "seed {seed}"
            );
            assert_eq!(context.spindle, u32::from(own.spindle), "seed {seed}");
            let wanted = own
                .analog
                .iter()
                .enumerate()
                .filter(|(_, analog)| measured.contains(analog));
            assert_eq!(
                u64::from(context.analog),
                wanted.fold(0, |mask, (i, _)| mask | 1 << i),
                "seed {seed}"
            );
            for (i, joint) in own.joints.iter().enumerate() {
                assert_eq!(
                    (attached.known >> joint & 1, attached.homed >> joint & 1),
                    (stood.known >> i & 1, stood.homed >> i & 1)
                );
                assert_eq!(
                    (attached.position[*joint], attached.state[*joint]),
                    (stood.position[i], stood.state[i])
                );
                assert_eq!(
                    (attached.fault_code[*joint], attached.delay_periods[*joint]),
                    (stood.fault_code[i], stood.delay_periods[i])
                );
                let words = driver.explain(*joint as u32, 7);
                assert_eq!(
                    words.as_str(),
                    format!("{i} of {}", own.name),
                    "seed {seed}"
                );
            }
        }
        stands = attached;
        let mut feedback = Feedback {
            position: stands.position,
            ..Feedback::default()
        };
        let mut whole = Setpoint::default();
        for period in 0..60 {
            whole = drawn_setpoint(&mut random, &whole);
            let case = format!("seed {seed}, period {period}");
            for own in &all {
                mirrors().get_mut(&own.name).unwrap().answer = drawn_answer(&mut random);
            }
            driver.exchange(&whole, &mut feedback).unwrap();
            let mut latches = vec![];
            for (i, own) in all.iter().enumerate() {
                assert_told(own, &whole, i == 0, &case);
                assert_answered(own, &feedback, &mut latches, &case);
            }
            let given: Vec<_> = feedback
                .latches
                .iter()
                .filter(|latch| latch.edge != 0)
                .copied()
                .collect();
            assert_eq!(given.len(), latches.len(), "{case}");
            for (given, latch) in given.iter().zip(&latches) {
                assert_eq!(
                    (given.input, given.edge, given.joints),
                    (latch.input, latch.edge, latch.joints),
                    "{case}"
                );
                let caught = (0..4).filter(|joint| latch.joints >> joint & 1 == 1);
                caught.for_each(|joint| {
                    assert_eq!(given.position[joint], latch.position[joint], "{case}");
                });
            }
        }
    }
}

/// A driver whose line is cut says nothing new, and that is told once; a reset that finds it again begins anew. At the
/// end all are stopped, whoever could not be.
#[test]
fn one_whose_line_is_cut_is_old_and_lost_until_a_reset_finds_it_again() {
    let mut random = Random::new(77);
    let deal = |name: &str, joints: &[usize], inputs: &[u32], spindle| Own {
        name: name.to_string(),
        joints: joints.to_vec(),
        inputs: inputs.to_vec(),
        spindle,
        ..Own::default()
    };
    let all = [
        deal("cut-none", &[2, 0], &[7], false),
        deal("cut", &[3, 1], &[40, 3], true),
    ];
    for own in &all {
        let mut answer = Feedback {
            homed: 3,
            ..drawn_answer(&mut random)
        };
        (answer.age_periods, answer.input_age_periods) = ([0; 8], [0; 64]);
        answer.latches[0] = Latch {
            input: 0,
            edge: 1,
            joints: 1,
            ..Latch::default()
        };
        (answer.has_phase, answer.phase_ns) = (u32::from(own.spindle), 9);
        mirrors().insert(
            own.name.clone(),
            Mirror {
                answer,
                ..Mirror::default()
            },
        );
    }
    let (mut driver, _) = attached_driver(&machine(&text(&all)), &registry()).unwrap();
    let (mut setpoint, mut feedback) = (
        Setpoint {
            enable: 1,
            ..Setpoint::default()
        },
        Feedback::default(),
    );
    driver.exchange(&setpoint, &mut feedback).unwrap();
    assert_eq!(
        (feedback.homed, feedback.has_phase, feedback.phase_ns),
        (0b1111, 1, 9)
    );
    assert_eq!(
        feedback
            .latches
            .iter()
            .filter(|latch| latch.edge != 0)
            .count(),
        2
    );
    mirrors().get_mut("cut").unwrap().fails = true;
    let failed = (1..=30_u32)
        .filter(|_| driver.exchange(&setpoint, &mut feedback).is_err())
        .count();
    assert_eq!((failed, feedback.spindle_at_speed), (1, 0));
    let (states, ages) = (feedback.state, feedback.age_periods);
    assert_eq!(
        (states[3], states[1], ages),
        (
            JointState::Lost,
            JointState::Lost,
            [0, 30, 0, 30, 0, 0, 0, 0]
        )
    );
    let inputs = feedback.input_age_periods;
    assert_eq!((inputs[40], inputs[3], inputs[7]), (30, 30, 0));
    let given: Vec<_> = feedback
        .latches
        .iter()
        .filter(|latch| latch.edge != 0)
        .map(|latch| latch.input)
        .collect();
    assert_eq!(given, [7], "an edge of before is not caught again");
    let mut mirror = mirrors();
    let cut = mirror.get_mut("cut").unwrap();
    (cut.fails, cut.answer.homed, cut.answer.has_phase) = (false, 0, 0);
    cut.answer.latches = Feedback::default().latches;
    drop(mirror);
    driver.exchange(&setpoint, &mut feedback).unwrap();
    assert_eq!(feedback.state[3], JointState::Lost, "nobody has reset it");
    setpoint.reset = 1;
    driver.exchange(&setpoint, &mut feedback).unwrap();
    assert_eq!(
        (feedback.state[3], feedback.age_periods[3]),
        (mirrors()["cut"].answer.state[0], 0)
    );
    assert_eq!(
        (feedback.homed, feedback.has_phase),
        (0b101, 0),
        "what it says no more"
    );
    // Where several fail in one period, the first of them is told.
    for own in &all {
        mirrors().get_mut(&own.name).unwrap().fails = true;
    }
    let told = driver.exchange(&setpoint, &mut feedback).unwrap_err();
    assert_eq!(told.message(), "the line of cut-none is cut");
    driver.quick_stop();
    assert!(driver.stop().is_err());
    for own in &all {
        let mirror = mirrors()[&own.name].clone();
        assert_eq!((mirror.quick_stops, mirror.stops), (1, 1), "{}", own.name);
    }
    // A start is as the first one: nobody has failed, and each is asked whether it has anything to begin.
    for own in &all {
        let mut mirrors = mirrors();
        let mirror = mirrors.get_mut(&own.name).unwrap();
        (mirror.fails, mirror.sends_nothing, mirror.sends) = (false, true, 0);
    }
    setpoint.reset = 0;
    for starts in 1..=3 {
        driver.start().unwrap();
        for _ in 0..5 {
            driver.exchange(&setpoint, &mut feedback).unwrap();
        }
        assert_ne!(feedback.state[3], JointState::Lost);
        let all = mirrors();
        assert_eq!((all["cut-none"].sends, all["cut"].sends), (0, starts));
    }
}

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
