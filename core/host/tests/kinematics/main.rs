//! Kinematics of others: linear ones whose planner is defective, and ones that are not linear.

mod failing;

use std::path::{Path, PathBuf};

use tandem_gcode::Program;
use tandem_host::{Clock, HostError, Outcome, Registry, Run, RunObserver, Switches};
use tandem_look_ahead::{LookAhead, Options};
use tandem_machine::Machine;
use tandem_recorder::JointPeaks;
use tandem_rig::Bent;
use tandem_sdk::{
    AxisVector, Kinematics, KinematicsContext, NoOptions, PlannerContext, PluginError,
};

/// A turning arm: joint 0 is its length, joint 1 its angle about a pivot 400 mm in front of the table.
struct Arm;

impl Kinematics for Arm {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let (x, y) = (axes[0], axes[1] + 400.0);
        AxisVector::from_slice(&[x.hypot(y), x.atan2(y), axes[2]])
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let (sin, cos) = joints[1].sin_cos();
        AxisVector::from_slice(&[joints[0] * sin, joints[0] * cos - 400.0, joints[2]])
    }
}

/// Two motors whose way back is wrong, or that go astray beyond 100 mm.
struct Belts {
    back: f64,
    astray: f64,
}

impl Kinematics for Belts {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let lost = if axes[0] > 100.0 { self.astray } else { 0.0 };
        AxisVector::from_slice(&[axes[0] + axes[1], axes[0] - axes[1] + lost, axes[2]])
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let [a, b] = [joints[0], joints[1]];
        AxisVector::from_slice(&[self.back * (a + b), self.back * (a - b), joints[2]])
    }
}

type Opened<T> = Result<T, PluginError>;

macro_rules! opens {
    ($name:ident, $plugin:expr, $kind:ty) => {
        #[allow(clippy::unnecessary_wraps)] // the form of a constructor
        fn $name(_: &NoOptions, _: &KinematicsContext) -> Opened<$kind> {
            Ok($plugin)
        }
    };
}

opens!(arm, Arm, Arm);
opens!(
    belts,
    Belts {
        back: 0.5,
        astray: 0.0
    },
    Belts
);
opens!(
    one_way,
    Belts {
        back: 0.51,
        astray: 0.0
    },
    Belts
);
opens!(
    astray,
    Belts {
        back: 0.5,
        astray: f64::NAN
    },
    Belts
);

/// The look-ahead planner, which takes the joints for 1 % faster than they are.
fn too_fast(options: &Options, context: &PlannerContext) -> Opened<LookAhead> {
    let mut context = *context;
    context.limits.axes[3..]
        .iter_mut()
        .for_each(|joint| joint.feed_mm_per_s *= 1.01);
    LookAhead::new(options, &context)
}

/// The look-ahead planner, 1 % too far in X.
fn too_far(options: &Options, context: &PlannerContext) -> Opened<Bent> {
    let inner = LookAhead::new(options, context)?;
    Ok(Bent::new(inner)
        .emits(|segment| segment.coefficients[0].iter_mut().for_each(|c| *c *= 1.01)))
}

struct Nobody;

impl RunObserver for Nobody {}

fn corexy() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/corexy.toml")
}

/// The drives of the arm, instead of those of the belts.
const ARM: [(&str, &str); 3] = [
    ("kinematics.plugin", "arm"),
    (
        "joints.a",
        "{travel_mm = [300, 500], max_feed_mm_per_min = 9000, max_acceleration_mm_per_s2 = 1600}",
    ),
    (
        "joints.b",
        "{kind = \"rotary\", travel_deg = [-20, 20], max_feed_deg_per_min = 1800, max_acceleration_deg_per_s2 = 300}",
    ),
];

fn run(text: &str, settings: &[(&str, &str)]) -> Result<Outcome, HostError> {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("program.ngc");
    std::fs::write(&program, text).unwrap();
    let settings: Vec<_> = settings
        .iter()
        .map(|(key, value)| ((*key).to_string(), (*value).to_string()))
        .collect();
    let machine = Machine::read(&corexy(), &settings).unwrap();
    let mut registry = Registry::default();
    let kinematics = [
        tandem_sdk::local_plugin!(kinematics "arm" = arm),
        tandem_sdk::local_plugin!(kinematics "corexy" = belts),
        tandem_sdk::local_plugin!(kinematics "one-way" = one_way),
        tandem_sdk::local_plugin!(kinematics "astray" = astray),
        failing::kinematics(),
    ];
    let planners = [
        tandem_sdk::local_plugin!(planner "too-fast" = too_fast),
        tandem_sdk::local_plugin!(planner "too-far" = too_far),
    ];
    for plugin in kinematics.into_iter().chain(planners) {
        registry.register(plugin).unwrap();
    }
    registry.register(tandem_look_ahead::PLUGIN).unwrap();
    registry.register(tandem_sim::PLUGIN).unwrap();
    registry.register(failing::driver()).unwrap();
    let run = Run::prepare(
        machine,
        &registry,
        Program::open(&program).unwrap(),
        Switches::default(),
    )?;
    run.drive(Clock::Virtual, &[], &mut Nobody)
}

/// What is said of a program or machine that is refused.
fn refusal(text: &str, settings: &[(&str, &str)]) -> String {
    match run(text, settings) {
        Err(HostError::Check(report)) => {
            report.diagnostics.iter().map(ToString::to_string).collect()
        }
        Err(refused) => refused.to_string(),
        Ok(outcome) => panic!("it ran: {:?}", outcome.summary.fault),
    }
}

/// Largest velocity and acceleration of a joint that slides, mm and s.
fn linear(peaks: &JointPeaks) -> [f64; 2] {
    match *peaks {
        JointPeaks::Linear {
            max_velocity_mm_s,
            max_acceleration_mm_s2,
            ..
        } => [max_velocity_mm_s, max_acceleration_mm_s2],
        JointPeaks::Rotary { .. } => panic!("the joint turns: {peaks:?}"),
    }
}

const DIAGONAL: &str = "G21 G90\nF20000\nG1 X60 Y60\nG1 X0 Y0\nM2\n";

#[test]
fn a_planner_that_takes_joints_for_faster_is_governed() {
    let sound = run(DIAGONAL, &[]).unwrap();
    assert_eq!(
        (
            sound.summary.governed_samples,
            sound.summary.guard_stops,
            &sound.summary.fault
        ),
        (0, 0, &None)
    );
    let outcome = run(DIAGONAL, &[("planner.plugin", "too-fast")]).unwrap();
    assert!(
        outcome.summary.governed_samples > 0,
        "one percent is too much for joint a"
    );
    let peaks = outcome.summary.joints.unwrap();
    assert!(linear(&peaks["a"])[0] <= 250.0 * (1.0 + 1e-6), "{peaks:?}");
    let counted = run(
        DIAGONAL,
        &[("planner.plugin", "too-fast"), ("guard.mode", "count")],
    )
    .unwrap();
    assert!(
        counted.summary.limit_violations > 0
            && linear(&counted.summary.joints.unwrap()["a"])[0] > 251.0
    );
}

#[test]
fn the_guard_names_the_joint_that_would_leave_its_travel() {
    let settings = [("planner.plugin", "too-far")];
    let outcome = run("G21 G90\nF6000\nG1 X124.5 Y125\nM2\n", &settings).unwrap();
    let fault = outcome.summary.fault.unwrap();
    assert!(
        fault.contains("guard: planner too-far asks for joint a position 250."),
        "{fault}"
    );
    assert!(fault.contains("travel ends at 250.000000 mm"), "{fault}");
    let peaks = outcome.summary.joints.unwrap();
    assert!(linear(&peaks["a"])[1] <= 1500.0 * 1.7, "{peaks:?}");
}

#[test]
fn kinematics_that_do_not_lead_back_or_end_somewhere_are_refused() {
    let words = refusal(DIAGONAL, &[("kinematics.plugin", "one-way")]);
    assert!(
        words.contains("one-way: axes at") && words.contains("lead back to"),
        "{words}"
    );
    let words = refusal(DIAGONAL, &[("kinematics.plugin", "astray")]);
    assert!(
        words.contains("astray: joint 1 is no finite number"),
        "{words}"
    );
}

#[test]
fn of_kinematics_that_are_not_linear_the_joints_are_planned_for() {
    let slow = "G21 G90\nF3000\nG1 X60 Y20\nG3 X-60 Y20 I-60 J-100\nG1 X0 Y0\nM2\n";
    let outcome = run(slow, &ARM).unwrap();
    assert_eq!(
        (outcome.summary.fault, outcome.summary.governed_samples),
        (None, 0)
    );
    let peaks = outcome.summary.joints.unwrap();
    // Joint b turns, and what is said of it is called so: it stood under mm/s.
    let said = serde_json::to_value(&peaks).unwrap();
    let turning_deg_s = said["b"]["max_velocity_deg_s"].as_f64().unwrap();
    assert!(turning_deg_s > 5.0 && turning_deg_s < 30.0, "{said}");
    assert!(
        said["b"]["max_velocity_mm_s"].is_null() && said["a"]["max_velocity_mm_s"].is_f64(),
        "{said}"
    );
    // 200 mm/s across the arm of 400 mm are 28 deg/s; outwards they are 200 mm/s of 150: the joint is driven at its limit.
    let outcome = run("G21 G90\nF12000\nG1 Y100\nM2\n", &ARM).unwrap();
    let summary = &outcome.summary;
    assert_eq!((&summary.fault, summary.guard_stops), (&None, 0));
    let fastest = linear(&outcome.summary.joints.unwrap()["a"])[0];
    assert!(
        (149.0..=150.0 * (1.0 + 1e-6)).contains(&fastest),
        "{fastest}"
    );
    let words = refusal("G21 G90\nF3000\nG1 Y0\nG1 X148 Y-20\nM2\n", &ARM);
    assert!(
        words.contains("joint b would reach 20.") && words.contains("of -20 to 20 deg"),
        "{words}"
    );
}
