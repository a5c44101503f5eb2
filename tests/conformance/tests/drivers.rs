//! The kit finds drivers that break one promise of the contract each, and has nothing against one that keeps them.

#![allow(clippy::unnecessary_wraps)] // the form of constructors

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

use tandem_conformance::{Setup, judge};
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, Latch,
    Plugin, PluginError, Setpoint, Words, local_plugin,
};

tandem_sdk::options! {
    struct Options {
        /// The promise that is broken; none where it is empty.
        defect: String = String::new(),
        /// Whether they say that they move metal.
        is_real: bool = false,
    }
}

/// The shortest time between two exchanges of drives that say they move metal, ns.
static SHORTEST_NS: AtomicU64 = AtomicU64::new(u64::MAX);

/// Joint 1 goes into a fault in mid-motion, once; beyond that the drives follow exactly, and take five periods to come up.
struct Drives {
    defect: String,
    joints: usize,
    stands: AxisVector,
    coming: u64,
    exchanges: u64,
    is_faulty: bool,
    last: Feedback,
    is_real: bool,
    exchanged: Option<Instant>,
}

/// Exchanges after which the fault comes, and for how long a drive is not heard.
const FAULT: u64 = 700;
const UNHEARD: std::ops::Range<u64> = 400..1400;

impl Drives {
    fn open(options: &Options) -> Result<Self, PluginError> {
        Ok(Self {
            defect: options.defect.clone(),
            joints: 0,
            stands: AxisVector::ZERO,
            coming: 0,
            exchanges: 0,
            is_faulty: false,
            last: Feedback::default(),
            is_real: options.is_real,
            exchanged: None,
        })
    }

    fn is(&self, defect: &str) -> bool {
        self.defect == defect
    }

    fn power(&mut self, setpoint: &Setpoint) -> JointState {
        let forgets = self.is("forgets its fault") && setpoint.enable == 0;
        self.is_faulty |= self.exchanges == FAULT;
        self.is_faulty &= !(forgets || setpoint.reset != 0 && !self.is("ignores reset"));
        let goes_on = self.is("never lets go") && self.coming > 0;
        let most = if self.is("never comes up") { 4 } else { 5 };
        self.coming = if setpoint.enable != 0 || goes_on {
            (self.coming + 1).min(most)
        } else {
            0
        };
        match self.coming {
            _ if self.is_faulty => JointState::Fault,
            0 => JointState::Disabled,
            5 => JointState::Enabled,
            _ => JointState::Enabling,
        }
    }

    fn answer(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) {
        let state = self.power(setpoint);
        if state == JointState::Enabled {
            let by = if self.is("jumps") { 1.0 } else { 0.0 };
            let speed = (setpoint.position - self.stands) * 1000.0;
            (self.stands, feedback.speed) = (setpoint.position, speed);
            self.stands[0] += by;
        }
        feedback.position = self.stands;
        feedback.state[..self.joints].fill(state);
        feedback.fault_code = [if state == JointState::Fault { 7 } else { 0 }; 8];
        feedback.latches[0] = Latch::default();
        let armed = setpoint.arm;
        let edge = if self.is("latches unarmed") {
            (500, 2)
        } else {
            (500, armed.edge)
        };
        if self.exchanges == edge.0 && edge.1 != 0 {
            feedback.latches[0] = Latch {
                input: 0,
                edge: edge.1,
                joints: 1,
                position: self.stands,
                ..Latch::default()
            };
        }
    }
}

impl Driver for Drives {
    fn describe(&self) -> DriverDescription {
        DriverDescription {
            enable_s: 0.1,
            disable_s: 0.1,
            simulated: u32::from(!self.is_real),
            ..DriverDescription::simulated()
        }
    }

    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        assert_eq!(context.real_time != 0, self.is_real);
        (self.joints, self.stands) = (context.joint_count as usize, context.start_position);
        Ok(())
    }

    fn start(&mut self) -> Result<Attached, PluginError> {
        (self.coming, self.exchanged) = (0, None);
        let mut attached = Attached::at(self.stands);
        if self.is("stands nowhere") {
            attached.position[2] = f64::NAN;
        }
        if self.is("forgets where it stands") && self.exchanges > 0 {
            attached.position[2] += 1.0;
        }
        if self.is("is enabled unasked") {
            attached.state[1] = JointState::Enabled;
        }
        Ok(attached)
    }

    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.exchanges += 1;
        let now = Instant::now();
        if let Some(before) = self.exchanged.replace(now).filter(|_| self.is_real) {
            SHORTEST_NS.fetch_min((now - before).as_nanos() as u64, Relaxed);
        }
        self.answer(setpoint, feedback);
        let unheard = UNHEARD.contains(&self.exchanges);
        let lost = self.is("repeats old as new") || self.is("hides a lost joint");
        if unheard && lost {
            (feedback.position[1], feedback.speed[1]) = (self.last.position[1], self.last.speed[1]);
            feedback.state[1] = self.last.state[1];
        }
        feedback.age_periods[1] = if unheard && self.is("hides a lost joint") {
            self.last.age_periods[1] + 1
        } else {
            0
        };
        self.last = *feedback;
        Ok(())
    }

    fn quick_stop(&mut self) {}

    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }

    fn explain(&self, _joint: u32, code: u32) -> Words {
        assert!(
            !self.is("does not know its codes") || code < 10,
            "code {code}?"
        );
        Words::default()
    }
}

fn judged(plugin: Plugin, defect: &str) -> tandem_conformance::Report {
    judge(
        plugin,
        &Setup {
            options: format!("defect = \"{defect}\"\n"),
            ..Setup::default()
        },
    )
}

#[test]
fn each_broken_promise_is_found() {
    let plugin = local_plugin!(driver "drives" = Drives::open);
    let good = judged(plugin, "");
    assert!(
        good.conforms() && good.checks().contains(&"reset of faults"),
        "{good}"
    );
    let found = [
        ("stands nowhere", "where the joints stand"),
        ("is enabled unasked", "where the joints stand"),
        ("forgets where it stands", "where the joints stand"),
        ("jumps", "no jump when enabled"),
        ("never comes up", "enabling"),
        ("never lets go", "letting go"),
        ("repeats old as new", "age of feedback"),
        ("hides a lost joint", "lost joints"),
        ("ignores reset", "reset of faults"),
        ("forgets its fault", "reset of faults"),
        ("latches unarmed", "latches"),
        ("does not know its codes", "words for codes"),
    ];
    for (defect, check) in found {
        let report = judged(plugin, defect);
        assert!(
            report
                .findings()
                .iter()
                .any(|finding| finding.check == check),
            "{defect}: {check}\n{report}"
        );
    }
}

/// What is told to real drives sooner than a period after the setpoint before asks for more speed than it says.
#[test]
fn drives_that_move_metal_are_not_told_anything_sooner_than_a_period_later() {
    let plugin = local_plugin!(driver "drives" = Drives::open);
    let setup = Setup {
        options: "is_real = true\n".to_string(),
        moves_metal: true,
        ..Setup::default()
    };
    let report = judge(plugin, &setup);
    assert!(report.conforms(), "{report}");
    let shortest_ns = SHORTEST_NS.load(Relaxed);
    assert!(
        (1_000_000..u64::MAX).contains(&shortest_ns),
        "{shortest_ns} ns"
    );
}
