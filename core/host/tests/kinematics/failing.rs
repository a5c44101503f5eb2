//! Kinematics that fail in motion, in every way that is no hang: no joint leaves its limits on the way to rest.

use std::cell::RefCell;
use std::f64::consts::TAU;

use tandem_rig::Echo;
use tandem_sdk::{AxisVector, Kinematics, Plugin, PluginError, Setpoint, local_plugin};

use super::{ARM, Arm, run};

tandem_sdk::options! {
    struct Options {
        /// What goes wrong.
        how: String = "never".to_string(),
        /// The period from which on it does. Planning asks too, and ahead: a count of calls would tell nothing of the motion.
        period: usize = 1,
    }
}

/// The arm, until it fails.
struct Failing(Options);

pub fn kinematics() -> Plugin {
    local_plugin!(kinematics "failing" = |options: &Options, _: &_| Ok(Failing(options.clone())))
}

impl Failing {
    /// How many periods it has been failing for, from 0: the drives have been told so often.
    fn failing(&self) -> Option<usize> {
        RECORDED.with_borrow(Vec::len).checked_sub(self.0.period)
    }
}

impl Kinematics for Failing {
    fn to_joints(&self, axes: &AxisVector) -> AxisVector {
        let mut joints = Arm.to_joints(axes);
        let Some(periods) = self.failing().filter(|_| !self.0.how.starts_with("back")) else {
            return joints;
        };
        match self.0.how.as_str() {
            "panic" => panic!("as it was told"),
            "no number" => joints[1] = f64::NAN,
            "no number once" if periods == 0 => joints[0] = f64::INFINITY,
            "far" => joints[0] += 1e6,
            "a turn" => joints[1] += TAU,
            "a little" => joints[0] += 0.05,
            "each second" => joints[0] += (periods % 2) as f64,
            "stuck" => joints = Arm.to_joints(&AxisVector::ZERO),
            _ => {}
        }
        joints
    }

    fn to_axes(&self, joints: &AxisVector) -> AxisVector {
        let mut axes = Arm.to_axes(joints);
        match self.0.how.as_str() {
            "back: panic" if self.failing().is_some() => panic!("as it was told"),
            "back: no number" if self.failing().is_some() => axes[0] = f64::NAN,
            _ => {}
        }
        axes
    }
}

thread_local! {
    static RECORDED: RefCell<Vec<Setpoint>> = const { RefCell::new(vec![]) };
}

tandem_sdk::options! {
    struct Drives {
        /// The exchange that fails; none does with 0.
        fails_at: usize = 0,
    }
}

/// Drives that keep what they are told. On the virtual clock everything runs on one thread.
pub fn driver() -> Plugin {
    local_plugin!(driver "recorder" = |options: &Drives| Ok(recorder(options.fails_at)))
}

fn recorder(fails_at: usize) -> Echo {
    Echo::new(move |setpoint, _| {
        let exchanges = RECORDED.with_borrow_mut(|recorded| {
            recorded.push(*setpoint);
            recorded.len()
        });
        if exchanges == fails_at {
            Err(PluginError::fixed("the wire is cut"))
        } else {
            Ok(())
        }
    })
}

/// Velocity and acceleration of the drives of [`ARM`], mm or rad.
fn limits() -> [[f64; 2]; 3] {
    [
        [150.0, 1600.0],
        [30.0, 300.0].map(f64::to_radians),
        [50.0, 500.0],
    ]
}

/// The greatest share of a limit that any joint has used in any period, from the positions that were sent alone.
fn judge(recorded: &[Setpoint]) -> f64 {
    let (mut most, period_s) = (0.0f64, 0.001);
    for (joint, [fastest, steepest]) in limits().into_iter().enumerate() {
        let at: Vec<f64> = recorded
            .iter()
            .map(|setpoint| setpoint.position[joint])
            .collect();
        let speeds: Vec<f64> = at
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / period_s)
            .collect();
        let (first, last) = (speeds.first().unwrap(), speeds.last().unwrap());
        assert!(
            *first == 0.0 && *last == 0.0 && at.iter().all(|at| at.is_finite()),
            "from rest to rest"
        );
        most = speeds
            .iter()
            .fold(most, |most, speed| most.max(speed.abs() / fastest));
        most = speeds.windows(2).fold(most, |most, pair| {
            most.max((pair[1] - pair[0]).abs() / period_s / steepest)
        });
    }
    most
}

/// What was recorded of a run along an arc, and its fault.
fn arc(how: &str, period: usize, more: &[(&str, &str)]) -> (Vec<Setpoint>, Option<String>) {
    let period = period.to_string();
    let ours = [
        ("kinematics.plugin", "failing"),
        ("kinematics.options.how", how),
        ("kinematics.options.period", &period),
        ("driver.plugin", "recorder"),
        ("motion.allowable_speed_difference_mm_per_min", "0.001"),
    ];
    RECORDED.take();
    let settings: Vec<_> = ARM
        .into_iter()
        .chain(ours)
        .chain(more.iter().copied())
        .collect();
    let outcome = run(
        "G21 G90\nF6000\nG3 X0 Y60 I0 J30\nG3 X0 Y0 I0 J-30\nM2\n",
        &settings,
    )
    .unwrap();
    (RECORDED.take(), outcome.summary.fault)
}

#[test]
fn sound_ones_are_driven_within_limits() {
    let (recorded, fault) = arc("never", 1, &[]);
    let share = judge(&recorded);
    assert!(fault.is_none() && recorded.len() > 1000, "{fault:?}");
    assert!((0.3..=1.0).contains(&share), "{share} of the limits");
    let mut moved = recorded;
    moved[700].position[0] += 0.002;
    assert!(
        judge(&moved) > 1.0,
        "one sample moved by two thousandths is found out"
    );
}

/// In each of these joint a moves at tens of mm/s when it happens.
const PERIODS: [usize; 4] = [300, 700, 1150, 1500];

#[test]
fn joints_keep_their_limits_on_the_way_to_rest() {
    for (how, words) in [
        ("panic", "failing panicked in to_joints"),
        (
            "no number",
            "the position of joint 1 (b) is not a finite number",
        ),
        (
            "no number once",
            "the position of joint 0 (a) is not a finite number",
        ),
        ("far", "guard: kinematics failing asks for joint a position"),
        (
            "a turn",
            "guard: kinematics failing asks for joint b position",
        ),
        ("a little", "guard: kinematics failing asks for joint a"),
        ("each second", "guard: kinematics failing asks for joint a"),
        ("stuck", "guard: kinematics failing asks for joint"),
        ("back: panic", "failing panicked in to_axes"),
        (
            "back: no number",
            "the position of axis X is not a finite number",
        ),
    ] {
        for period in PERIODS {
            let (recorded, fault) = arc(how, period, &[]);
            let fault = fault.unwrap_or_else(|| panic!("{how} from period {period} is no fault"));
            assert!(fault.contains(words), "{how} from period {period}: {fault}");
            let share = judge(&recorded);
            assert!(
                share <= 1.0 + 2e-6,
                "{how} from period {period}: {share} of a joint's limit; {fault}"
            );
            let before = recorded[period - 1].velocity[0];
            assert!(before.abs() > 10.0, "it failed in motion: {before} mm/s");
        }
    }
}

/// The driver fails first, and the kinematics on the way to rest, or never.
#[test]
fn after_another_fault_too() {
    for how in [
        "never",
        "panic",
        "no number once",
        "far",
        "a turn",
        "each second",
        "stuck",
        "back: panic",
    ] {
        for period in [801, 815, 840] {
            let (recorded, fault) = arc(how, period, &[("driver.options.fails_at", "800")]);
            let (share, fault) = (judge(&recorded), fault.unwrap());
            assert!(
                fault.contains("the wire is cut") && recorded.len() > 820,
                "{fault}"
            );
            assert!(
                share <= 1.0 + 2e-6,
                "{how} from period {period}: {share} of a joint's limit"
            );
        }
    }
}
