//! A panic of a plugin that is linked in prints nothing, and the error has its place and words; the host's own panics are
//! told as ever. One test, because the hook is the process's.

use std::panic::catch_unwind;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tandem_sdk::{
    Accepted, Advanced, Axes, AxisLimits, AxisVector, Block, BlockReport, Curve, Kinematics,
    KinematicsContext, Limits, NoOptions, Planner, PlannerContext, PlannerDescription, PluginError,
    Segment, SegmentSink, local_plugin,
};

static TOLD: AtomicU32 = AtomicU32::new(0);

struct Panics;

impl Kinematics for Panics {
    fn to_joints(&self, _axes: &AxisVector) -> AxisVector {
        panic!("no joints there")
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        *joints
    }
}

/// Emits one segment whenever it is asked.
struct Emits;

impl Planner for Emits {
    fn describe(&self) -> PlannerDescription {
        PlannerDescription::order_2()
    }
    fn check(&self, _block: &Block, _curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        Ok(())
    }
    fn accept(
        &mut self,
        _block: &Block,
        _curve: Option<Curve<'_>>,
    ) -> Result<Accepted, PluginError> {
        Ok(Accepted::Full)
    }
    fn finish(&mut self) {}
    fn advance(
        &mut self,
        _duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        sink.segment(&Segment::rest(&AxisVector::ZERO, 1.0));
        Ok(Advanced {
            duration_s: 1.0,
            done: 0,
        })
    }
    fn reset(&mut self, _position: &AxisVector) {}
}

/// The host's, and it panics.
struct Broken;

impl SegmentSink for Broken {
    fn segment(&mut self, _segment: &Segment) {
        panic!("the host's own")
    }
    fn block(&mut self, _report: &BlockReport) {}
}

fn context(axes: Axes) -> PlannerContext {
    let ends = AxisLimits {
        min_mm: -1.0,
        max_mm: 1.0,
        feed_mm_per_s: 1.0,
        rapid_mm_per_s: 1.0,
        acceleration_mm_per_s2: 1.0,
        jerk_mm_per_s3: 1.0,
        speed_difference_mm_per_s: 0.0,
    };
    PlannerContext {
        axes,
        limits: Limits::new(&[ends]).unwrap(),
        fine_period_s: 0.001,
        rough_period_s: 0.008,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position: AxisVector::ZERO,
        joint_lanes: None,
    }
}

#[test]
fn panics_of_plugins_are_quiet_and_those_of_the_host_are_not() {
    std::panic::set_hook(Box::new(|_| {
        TOLD.fetch_add(1, Relaxed);
    }));
    tandem_sdk::abi::quiet_linked_panics();

    let axes = Axes::new(&[('X', false)]).unwrap();
    let plugin =
        local_plugin!(kinematics "panics" = |_: &NoOptions, _: &KinematicsContext| Ok(Panics));
    let kinematics = plugin
        .kinematics("", &KinematicsContext::new(axes))
        .unwrap();
    assert!(kinematics.to_joints(&AxisVector::ZERO)[0].is_nan());
    let words = kinematics.health().unwrap_err().to_string();
    assert!(
        words.starts_with("panics panicked in to_joints (") && words.contains("quiet.rs:"),
        "{words}"
    );
    assert!(words.ends_with("no joints there"), "{words}");
    assert_eq!(TOLD.load(Relaxed), 0, "a plugin's panic is in its error");

    assert!(catch_unwind(|| panic!("the host's own")).is_err());
    assert_eq!(TOLD.load(Relaxed), 1, "the host's panic is told");

    let plugin = local_plugin!(planner "emits" = |_: &NoOptions, _: &PlannerContext| Ok(Emits));
    let mut planner = plugin.planner("", &context(axes)).unwrap();
    assert!(
        catch_unwind(std::panic::AssertUnwindSafe(
            || planner.advance(1.0, &mut Broken)
        ))
        .is_err()
    );
    assert_eq!(
        TOLD.load(Relaxed),
        2,
        "the host's panic inside a plugin's call is told"
    );
}
