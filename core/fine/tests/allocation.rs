//! No fine period touches the heap, whatever happens in it.

#[allow(dead_code)] // what other tests need of it
mod common;
#[path = "../../../tests/counting_allocator.rs"]
mod counting_allocator;

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use common::{Bench, PERIOD_S};
use counting_allocator::{HeapUse, heap_use_of};
use tandem_fine::{FaultKind, GuardMode};
use tandem_rings::{MachineState, Ratio};
use tandem_sdk::{
    Axes, AxisVector, EventKind, Kinematics, KinematicsContext, NoOptions, local_plugin,
};

/// Runs `periods` fine periods; none may allocate or free.
fn tick(bench: &mut Bench, periods: u32) {
    for _ in 0..periods {
        let used = heap_use_of(|| bench.fine.tick());
        assert_eq!(
            used,
            HeapUse::default(),
            "the heap was used in state {:?}",
            bench.state()
        );
    }
}

/// Runs until the machine is in `state`.
fn tick_until(bench: &mut Bench, state: MachineState) {
    for _ in 0..10_000 {
        if bench.state() == state {
            return;
        }
        tick(bench, 1);
    }
    panic!(
        "{state:?} is not reached: {:?}, {:?}",
        bench.state(),
        bench.fine.fault()
    );
}

#[test]
fn the_counter_counts() {
    let used = heap_use_of(|| drop(std::hint::black_box(Box::new(1))));
    assert_eq!(
        used,
        HeapUse {
            allocations: 1,
            frees: 1
        }
    );
}

#[test]
fn a_program_with_events_hold_and_overrides() {
    let mut bench = Bench::new(GuardMode::Stop);
    tick(&mut bench, 5);
    bench.accelerate();
    for number in 0..20 {
        bench.event(EventKind::DigitalOutput, number, 1.0);
        bench.cruise(0.05);
    }
    bench.event(EventKind::Spindle, 0, 100.0);
    bench.brake();
    bench.event(EventKind::ProgramEnd, 0, 0.0);
    tick_until(&mut bench, MachineState::Running);
    tick(&mut bench, 150);
    bench.host.controls.hold.store(true, Relaxed);
    tick(&mut bench, 300);
    assert_eq!(bench.host.status.feed_mm_per_s.load(), 0.0, "it is held");
    bench.host.controls.hold.store(false, Relaxed);
    tick(&mut bench, 200);
    bench.host.controls.feed_override.store(0.4);
    tick(&mut bench, 200);
    bench.host.controls.feed_override.store(1.0);
    bench
        .host
        .ratios
        .push(Ratio {
            tick: 0,
            ratio: 0.7,
        })
        .unwrap();
    for _ in 0..10_000 {
        tick(&mut bench, 1);
        if bench.fine.is_over() {
            break;
        }
    }
    assert!(bench.fine.is_over());
    assert_eq!(
        (bench.fine.fault(), bench.fine.counters().late_ratios),
        (None, 1)
    );
}

#[test]
fn starvation_and_going_on() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(0.5);
    tick_until(&mut bench, MachineState::Starved);
    tick(&mut bench, 300);
    assert_eq!(
        bench.host.status.feed_mm_per_s.load(),
        0.0,
        "it waits on the path"
    );
    bench.cruise(0.3);
    bench.brake();
    tick_until(&mut bench, MachineState::Running);
    tick_until(&mut bench, MachineState::Standstill);
    assert_eq!(
        (bench.fine.fault(), bench.fine.counters().starvations),
        (None, 1)
    );
}

#[test]
fn an_abort_and_the_next_epoch() {
    let mut bench = Bench::new(GuardMode::Stop);
    bench.accelerate();
    bench.cruise(0.1);
    bench.event(EventKind::DigitalOutput, 3, 1.0);
    bench.cruise(1.0);
    tick_until(&mut bench, MachineState::Running);
    tick(&mut bench, 120);
    bench.host.controls.abort.store(true, Relaxed);
    tick_until(&mut bench, MachineState::Standstill);
    tick(&mut bench, 300);
    assert_eq!(
        bench.host.status.feed_mm_per_s.load(),
        0.0,
        "what is queued is of the old epoch"
    );
    bench.go_on();
    bench.accelerate();
    bench.brake();
    bench.event(EventKind::ProgramEnd, 0, 0.0);
    tick_until(&mut bench, MachineState::Running);
    tick_until(&mut bench, MachineState::Standstill);
    tick(&mut bench, 5);
    assert!(bench.fine.is_over() && bench.fine.fault().is_none());
}

#[test]
fn every_way_into_a_fault_and_the_ramp_out() {
    for cause in 0..4 {
        let mut bench = Bench::new(GuardMode::Stop);
        bench.accelerate();
        bench.cruise(1.0);
        tick_until(&mut bench, MachineState::Running);
        tick(&mut bench, 200);
        match cause {
            0 => bench.host.controls.emergency_stop.store(true, Relaxed),
            1 => bench.host.controls.soft_fault.store(true, Relaxed),
            2 => bench.fine.missed(3, 3),
            _ => bench.fail_drives(),
        }
        tick_until(&mut bench, MachineState::Fault);
        tick(&mut bench, 10);
        assert!(bench.fine.fault().is_some(), "{cause}");
    }
}

#[test]
fn the_guard_stops_or_counts() {
    for mode in [GuardMode::Stop, GuardMode::Count] {
        let mut bench = Bench::new(mode);
        bench.accelerate();
        bench.cruise(0.2);
        // Eleven times the speed from one sample to the next.
        bench.leap(0.1);
        bench.brake();
        tick_until(&mut bench, MachineState::Running);
        tick(&mut bench, (1.0 / PERIOD_S) as u32);
        let guard = matches!(
            bench.fine.fault().map(|f| f.kind),
            Some(FaultKind::Guard { .. })
        );
        assert_eq!(guard, mode == GuardMode::Stop);
        assert_eq!(
            bench.fine.counters().limit_violations > 0,
            mode == GuardMode::Count
        );
    }
}

/// Joint 0 is x + x²/1000, until it is no number.
struct Bent {
    calls: AtomicU32,
    fails_at: u32,
}

impl Kinematics for Bent {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        let fails = self.calls.fetch_add(1, Relaxed) >= self.fails_at;
        joints[0] = if fails {
            f64::NAN
        } else {
            axes[0] + axes[0] * axes[0] / 1000.0
        };
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        axes[0] = 500.0 * ((1.0 + joints[0] / 250.0).sqrt() - 1.0);
        axes
    }
}

/// Through the table of a plugin, as they are loaded; what a panic leaves is made once and is not judged.
#[test]
fn kinematics_that_are_asked_and_kinematics_that_fail() {
    let plugin = local_plugin!(kinematics "bent" = |_: &NoOptions, _: &KinematicsContext| {
        Ok(Bent { calls: AtomicU32::new(0), fails_at: 200 })
    });
    let context =
        KinematicsContext::new(Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap());
    let mut bench = Bench::with_curved(plugin.kinematics("", &context).unwrap());
    bench.accelerate();
    bench.cruise(1.0);
    tick_until(&mut bench, MachineState::Running);
    tick(&mut bench, 150);
    assert!(bench.host.status.feed_mm_per_s.load() > 10.0, "it moves");
    tick_until(&mut bench, MachineState::Fault);
    assert!(matches!(
        bench.fine.fault().unwrap().kind,
        FaultKind::Kinematics { joint: 0 }
    ));
}
