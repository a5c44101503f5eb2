//! The conformance kit finds small defects too: each of these plugins breaks one promise, by a little.

#![allow(clippy::unnecessary_wraps)] // the form of constructors

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use tandem_conformance::{Setup, judge};
use tandem_sdk::{
    Accepted, Advanced, Answer, Attached, AxisVector, Block, BlockReport, Curve, Driver,
    DriverContext, DriverDescription, FeedStrategy, Feedback, JointState, Kinematics,
    KinematicsContext, Planner, PlannerContext, PlannerDescription, Plugin, PluginError, Segment,
    SegmentFlags, SegmentSink, Setpoint, StrategyContext, Window, local_plugin,
};

tandem_sdk::options! {
    struct Options {
        /// The defect.
        defect: String = String::new(),
    }
}

/// A defect, and the number of this instance among all: what no plugin may depend on.
#[derive(Clone)]
struct Defect(String, f64);

impl Defect {
    fn new(options: &Options) -> Self {
        static MADE: AtomicU64 = AtomicU64::new(0);
        Self(options.defect.clone(), MADE.fetch_add(1, Relaxed) as f64)
    }

    fn is(&self, name: &str) -> bool {
        self.0 == name
    }
}

/// The look-ahead planner with a defect.
struct Plans {
    inner: Box<dyn Planner>,
    defect: Defect,
    emitted: u64,
}

impl Plans {
    fn open(options: &Options, context: &PlannerContext) -> Result<Self, PluginError> {
        let (defect, mut context) = (Defect::new(options), *context);
        for axis in &mut context.limits.axes {
            axis.acceleration_mm_per_s2 *= if defect.is("acceleration") { 1.01 } else { 1.0 };
            let faster = if defect.is("velocity") { 1.01 } else { 1.0 };
            (axis.feed_mm_per_s, axis.rapid_mm_per_s) =
                (axis.feed_mm_per_s * faster, axis.rapid_mm_per_s * faster);
        }
        for joint in &mut context.limits.axes[3..] {
            joint.acceleration_mm_per_s2 *= if defect.is("joints") { 1.01 } else { 1.0 };
        }
        Ok(Self {
            inner: tandem_look_ahead::PLUGIN.planner("", &context)?,
            defect,
            emitted: 0,
        })
    }
}

struct Outlet<'a>(&'a mut dyn SegmentSink, &'a Defect, &'a mut u64);

impl SegmentSink for Outlet<'_> {
    fn segment(&mut self, segment: &Segment) {
        let (mut segment, defect) = (*segment, self.1);
        *self.2 += 1;
        if defect.is("gap") && self.2.is_multiple_of(7) {
            segment.coefficients[1][0] += 2e-6;
        }
        if defect.is("end") && segment.flags.contains(SegmentFlags::ENDS_AT_REST) {
            segment.coefficients[0][0] += 1e-10;
        }
        if defect.is("moody") {
            segment.coefficients[0][0] += 1e-9 * defect.1;
        }
        if defect.is("no stop") {
            segment.stop_deceleration_mm_per_s2 = -1.0;
        }
        self.0.segment(&segment);
    }

    fn block(&mut self, report: &BlockReport) {
        if !self.1.is("silent") || report.block != 5 {
            self.0.block(report);
        }
    }
}

impl Planner for Plans {
    fn describe(&self) -> PlannerDescription {
        self.inner.describe()
    }
    fn check(&self, block: &Block, curve: Option<Curve<'_>>) -> Result<(), PluginError> {
        self.inner.check(block, curve)
    }
    fn accept(&mut self, block: &Block, curve: Option<Curve<'_>>) -> Result<Accepted, PluginError> {
        let faster = if self.defect.is("feed") { 1.01 } else { 1.0 };
        self.inner.accept(
            &Block {
                feed_mm_per_s: faster * block.feed_mm_per_s,
                ..*block
            },
            curve,
        )
    }
    fn finish(&mut self) {
        self.inner.finish();
    }
    fn advance(
        &mut self,
        duration_s: f64,
        sink: &mut dyn SegmentSink,
    ) -> Result<Advanced, PluginError> {
        let wanted_s = if self.defect.is("short") {
            0.9 * duration_s
        } else {
            duration_s
        };
        let advanced = self
            .inner
            .advance(wanted_s, &mut Outlet(sink, &self.defect, &mut self.emitted))?;
        let more_s = if self.defect.is("boast") { 1e-3 } else { 0.0 };
        Ok(Advanced {
            duration_s: advanced.duration_s + more_s,
            ..advanced
        })
    }
    fn reset(&mut self, position: &AxisVector) {
        if !self.defect.is("forgetful") {
            self.inner.reset(position);
        }
    }
}

struct Feeds(Defect, f64);

impl Feeds {
    fn open(options: &Options, _context: &StrategyContext) -> Result<Self, PluginError> {
        Ok(Self(Defect::new(options), 1.0))
    }
}

impl FeedStrategy for Feeds {
    fn signals(&self) -> &'static [&'static str] {
        if self.0.is("name") {
            &["Load A"]
        } else {
            &["load_a"]
        }
    }
    fn max_ratio_change_per_s(&self) -> f64 {
        if self.0.is("fast") { 0.99 } else { 1.0 }
    }
    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        let load_a = window
            .samples()
            .iter()
            .fold(0.0, |most: f64, sample| most.max(sample.current_a[0]));
        let wanted = if load_a > 1.0 {
            0.5
        } else {
            1.0 + if self.0.is("high") { 1.0 } else { 0.0 }
        };
        self.1 += (wanted - self.1).clamp(-0.008, 0.008);
        let moody = if self.0.is("moody") { self.0.1 } else { 0.0 };
        let signal = if self.0.is("signal") && load_a > 50.0 {
            f64::INFINITY
        } else {
            load_a + moody
        };
        Ok(Answer::of_ratio(self.1).with_signals(&[signal]))
    }
}

struct Drives(Defect, usize, AxisVector);

impl Drives {
    fn open(options: &Options) -> Result<Self, PluginError> {
        Ok(Self(Defect::new(options), 0, AxisVector::ZERO))
    }
}

impl Driver for Drives {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        (self.1, self.2) = (context.joint_count as usize, context.start_position);
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(self.2))
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        feedback.follow(setpoint, self.1);
        feedback.position[0] += if self.0.is("moody") {
            1e-9 * self.0.1
        } else {
            0.0
        };
        if self.0.is("off") {
            feedback.state[self.1 - 1] = JointState::Disabled;
        }
        if self.0.is("speed") && setpoint.tick == 900 {
            feedback.speed[1] = f64::NAN;
        }
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

/// Joint 0 is x + y²/1000.
struct Bends(Defect);

impl Bends {
    fn open(options: &Options, _context: &KinematicsContext) -> Result<Self, PluginError> {
        Ok(Self(Defect::new(options)))
    }
}

impl Kinematics for Bends {
    fn joint_count(&self, axis_count: usize) -> usize {
        if self.0.is("few") {
            axis_count - 1
        } else {
            axis_count
        }
    }
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = *axes;
        joints[0] += axes[1] * axes[1] / 1000.0
            + if self.0.is("moody") {
                1e-10 * self.0.1
            } else {
                0.0
            };
        joints
    }
    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = *joints;
        axes[0] -= joints[1] * joints[1] / 1000.0 * if self.0.is("back") { 1.000_001 } else { 1.0 };
        axes
    }
}

fn assert_found(plugin: Plugin, defects: &[(&str, &str)]) {
    assert!(
        judge(plugin, &Setup::default()).conforms(),
        "{}",
        judge(plugin, &Setup::default())
    );
    for (defect, check) in defects {
        let report = judge(
            plugin,
            &Setup {
                options: format!("defect = \"{defect}\"\n"),
                ..Setup::default()
            },
        );
        assert!(
            report
                .findings()
                .iter()
                .any(|finding| finding.check == *check),
            "{defect}: {check}\n{report}"
        );
    }
}

#[test]
fn defects_of_planners_are_found() {
    let found = [
        ("acceleration", "limits"),
        ("velocity", "limits"),
        ("feed", "feed"),
        ("joints", "limits of joints"),
        ("gap", "segments"),
        ("no stop", "segments"),
        ("end", "end points"),
        ("silent", "reports"),
        ("moody", "determinism"),
        ("forgetful", "reset"),
        ("short", "progress"),
        ("boast", "progress"),
    ];
    assert_found(local_plugin!(planner "plans" = Plans::open), &found);
}

#[test]
fn defects_of_strategies_drivers_and_kinematics_are_found() {
    let found = [
        ("name", "signals"),
        ("fast", "ratio changes as declared"),
        ("high", "ratio in range"),
        ("signal", "signals are numbers"),
        ("moody", "determinism"),
    ];
    assert_found(local_plugin!(feed_strategy "feeds" = Feeds::open), &found);
    let found = [
        ("off", "enabling"),
        ("speed", "feedback"),
        ("moody", "determinism"),
    ];
    assert_found(local_plugin!(driver "drives" = Drives::open), &found);
    let found = [
        ("few", "joints"),
        ("back", "there and back"),
        ("moody", "determinism"),
    ];
    assert_found(local_plugin!(kinematics "bends" = Bends::open), &found);
}
