//! Machines whose joints, lines and spindle are dealt out to drivers at random: each driver is told of its own, in its
//! own numbers, and what it answers comes back in those of the machine.

use std::fmt::Write;

use tandem_host::attached_driver;
use tandem_rig::Random;
use tandem_sdk::{Arm, Attached, Feedback, JointState, Latch, Setpoint};

use crate::machine;
use crate::mirror::{AXES, Mirror, Own, drawn_answer, mirrors, registry, text};

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
        let homed_by: Vec<u32> = (0..64).filter(|i| !claimed.contains(i)).take(2).collect();
        let homing = if let &[switch, index] = &homed_by[..]
            && random.below(2) == 0
        {
            _ = writeln!(
                tables,
                "[homing.x]\ninput = {switch}\nsearch_mm_per_min = -60\nlatch_mm_per_min = 30\nback_off_mm = 1\n\
                 index_input = {index}\nindex_mm = 1\nindex_within_mm = 5"
            );
            1 << switch | 1 << index
        } else {
            0
        };
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
            let mask = claimed
                .iter()
                .fold(homing, |mask, input| mask | 1_u64 << input);
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
