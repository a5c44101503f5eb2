//! Kinematics that are not linear, after a fault: where a joint cannot follow the axes, it goes to rest by its own limit.

use crate::common;

use std::sync::atomic::Ordering::Relaxed;

use common::{Bench, PERIOD_S};
use tandem_fine::FaultKind;
use tandem_rings::{MachineState, Sample};
use tandem_sdk::{AxisVector, Kinematics, PluginError};

/// Joint 0 is x + x²/1000: it slows down harder than the axis does.
struct Bent;

impl Kinematics for Bent {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        joints[0] += axes[0] * axes[0] / 1000.0;
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        axes[0] = 500.0 * ((1.0 + joints[0] / 250.0).sqrt() - 1.0);
        axes
    }
}

/// All samples until the machine rests in a fault.
fn until_fault(bench: &mut Bench) -> Vec<Sample> {
    let mut samples = vec![];
    for _ in 0..1000 {
        bench.fine.tick();
        samples.extend(std::iter::from_fn(|| bench.host.samples.pop().ok()));
        if bench.state() == MachineState::Fault {
            return samples;
        }
    }
    panic!("no fault");
}

#[test]
fn the_joint_keeps_its_limit_and_the_place_where_it_rests_is_known() {
    let mut bench = Bench::with_curved(Box::new(Bent));
    bench.accelerate();
    bench.cruise(3.0);
    for _ in 0..1500 {
        bench.fine.tick();
        while bench.host.samples.pop().is_ok() {}
    }
    assert!(!bench.fine.joints_went_alone());
    bench.host.controls.emergency_stop.store(true, Relaxed);
    let samples = until_fault(&mut bench);
    assert!(bench.fine.joints_went_alone());
    let joints: Vec<f64> = samples
        .iter()
        .map(|sample| Bent.to_joints(&sample.feedback)[0])
        .collect();
    let speeds: Vec<f64> = joints
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / PERIOD_S)
        .collect();
    let most = speeds.windows(2).fold(0.0, |most: f64, pair| {
        most.max((pair[1] - pair[0]).abs() / PERIOD_S)
    });
    assert!((990.0..1000.01).contains(&most), "{most} mm/s² of 1000");
    let (last, sent) = (samples.last().unwrap(), bench.fine.sent());
    assert!(
        (last.feedback[0] - sent[0]).abs() < 1e-9,
        "{} mm, said to be {}",
        last.feedback[0],
        sent[0]
    );
    assert!(
        (last.command[0] - sent[0]).abs() > 1e-3,
        "the axis was to be at {} mm",
        last.command[0]
    );
    bench.fine.reset();
    assert!(!bench.fine.joints_went_alone(), "the axes lead them again");
}

/// It finds no joints beyond 0.5 mm, and says so.
struct Lost;

impl Kinematics for Lost {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        if axes[0] > 0.5 {
            joints[0] = f64::NAN;
        }
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        *joints
    }

    fn health(&self) -> Result<(), PluginError> {
        Err(PluginError::fixed("the elbow is lost"))
    }
}

#[test]
fn kinematics_that_find_no_joints_are_a_fault_with_their_own_words() {
    let mut bench = Bench::with_curved(Box::new(Lost));
    bench.accelerate();
    bench.cruise(1.0);
    until_fault(&mut bench);
    assert!(bench.fine.fault().is_some());
    let said = bench.fine.plugin_error().map(ToString::to_string);
    assert!(said.is_some_and(|said| said.contains("the elbow is lost")));
}

/// It finds no axes for joints beyond 100 mm.
struct Short;

impl Kinematics for Short {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        *axes
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        if joints[0] > 100.0 {
            AxisVector::from_slice(&[f64::NAN])
        } else {
            *joints
        }
    }
}

/// A drive that says it has caught the edge of a probe where the machine cannot be: from such a place nothing is planned.
#[test]
fn an_edge_that_was_caught_where_there_are_no_axes_is_a_fault_and_the_drives_are_let_go() {
    for (caught_mm, is_fault) in [(1.0, false), (900.0, true)] {
        let mut bench = Bench::with_curved(Box::new(Short));
        bench.probe();
        bench.accelerate();
        bench.cruise(1.0);
        for _ in 0..200 {
            bench.fine.tick();
        }
        bench.catch_edge(caught_mm);
        for _ in 0..200 {
            bench.fine.tick();
        }
        let kind = bench.fine.fault().map(|fault| fault.kind);
        let ends_in_fault = bench.state() == MachineState::Fault;
        assert_eq!(ends_in_fault, is_fault, "{caught_mm} mm");
        assert_eq!(kind, is_fault.then_some(FaultKind::WayBack { axis: 0 }));
        assert_eq!(bench.quick_stops() > 0, is_fault, "{caught_mm} mm");
    }
}
