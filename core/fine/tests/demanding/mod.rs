//! A fine loop whose drives are as demanding as real ones, and fail as a test wants them to.

mod script;

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, MutexGuard};

use tandem_fine::{FaultKind, FineConfig, FineLoop};
use tandem_rings::{HostEnd, MachineState, Queued, Rest, RoughEnd, Sizes, bridge};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, Event, EventKind, JointState, Kinematics, Limits, MAX_AXES,
    Segment, SegmentFlags, Setpoint, StopOn,
};

#[allow(unused_imports)] // each test needs some of it
pub use script::{Drives, FAULT_CODE, HOMING_CODE, Script};

/// Fine period where a test draws none, s.
pub const PERIOD_S: f64 = 0.001;
/// What the axes may accelerate with, mm/s².
pub const ACCELERATION_MM_PER_S2: f64 = 1000.0;
/// Feed and rapid of the axes, mm/s.
pub const FEED_MM_PER_S: f64 = 100.0;
/// What the plan accelerates with, mm/s².
const PLANNED_MM_PER_S2: f64 = 500.0;

/// A machine of `axes` axes that is to move as real ones do.
pub fn config(axes: usize) -> FineConfig {
    let axis = AxisLimits {
        min_mm: -1000.0,
        max_mm: 1000.0,
        feed_mm_per_s: FEED_MM_PER_S,
        rapid_mm_per_s: FEED_MM_PER_S,
        acceleration_mm_per_s2: ACCELERATION_MM_PER_S2,
        jerk_mm_per_s3: f64::INFINITY,
        speed_difference_mm_per_s: 0.0,
    };
    FineConfig {
        max_following_error_mm: AxisVector([0.01; MAX_AXES]),
        enable_periods: 500,
        disable_periods: 100,
        plans_from_rest: true,
        ..FineConfig::new(PERIOD_S, Limits::new(&[axis; MAX_AXES][..axes]).unwrap())
    }
}

/// The fine loop, with both other ends and the drives in the test's hands.
pub struct Bench {
    pub fine: FineLoop,
    pub rough: RoughEnd,
    pub host: HostEnd,
    pub script: Arc<Mutex<Script>>,
    pub epoch: u32,
    /// Where what is queued ends.
    pub position: AxisVector,
    pub start_s: f64,
    /// What is queued is a rapid.
    pub rapid: bool,
}

impl Bench {
    /// Joints that are axes, which stand where `script` has them.
    pub fn new(config: &FineConfig, script: Script) -> Self {
        Self::with(config, script, None)
    }

    /// The same with kinematics.
    pub fn with(
        config: &FineConfig,
        script: Script,
        kinematics: Option<Box<dyn Kinematics>>,
    ) -> Self {
        let attached = Attached {
            position: script.position,
            ..config.attached
        };
        let script = Arc::new(Mutex::new(script));
        let (rough, end, host) = bridge(Sizes {
            segments: 64,
            samples: 1 << 14,
        });
        let drives = Box::new(Drives(Arc::clone(&script)));
        let mut fine = FineLoop::new(
            &FineConfig {
                attached,
                ..*config
            },
            end,
            drives,
            kinematics,
        );
        fine.reset();
        Self {
            fine,
            rough,
            host,
            script,
            epoch: 0,
            position: AxisVector::ZERO,
            start_s: 0.0,
            rapid: false,
        }
    }

    pub fn script(&self) -> MutexGuard<'_, Script> {
        self.script.lock().unwrap()
    }

    pub fn ticks(&mut self, count: u64) {
        (0..count).for_each(|_| self.fine.tick());
    }

    pub fn fault(&self) -> Option<FaultKind> {
        self.fine.fault().map(|fault| fault.kind)
    }

    pub fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    /// What the drives were told last.
    pub fn told(&self) -> Setpoint {
        self.script().last()
    }

    /// Ticks until a rest is reported, which begins the next epoch.
    pub fn rest(&mut self, most: u64) -> Option<Rest> {
        for _ in 0..most {
            self.fine.tick();
            if let Ok(rest) = self.rough.rests.pop() {
                (self.epoch, self.start_s, self.position) =
                    (rest.epoch + 1, rest.program_time_s, rest.position);
                self.rough.depth.begin(self.epoch, self.start_s);
                return Some(rest);
            }
        }
        None
    }

    /// Queues a piece: where it begins, with which speed, and half of its acceleration along each axis.
    pub fn piece(&mut self, motion: [AxisVector; 2], duration_s: f64, last: bool, stop_on: StopOn) {
        let mut segment = Segment::rest(&self.position, duration_s);
        for (axis, coefficients) in segment.coefficients.iter_mut().enumerate() {
            *coefficients = [
                self.position[axis],
                motion[0][axis],
                motion[1][axis],
                0.0,
                0.0,
                0.0,
            ];
        }
        segment.path = segment.coefficients[0];
        segment.flags = if last {
            SegmentFlags::ENDS_AT_REST
        } else {
            SegmentFlags::default()
        };
        if self.rapid {
            segment.flags = segment.flags.with(SegmentFlags::RAPID);
        }
        (segment.epoch, segment.feed_mm_per_s, segment.stop_on) =
            (self.epoch, FEED_MM_PER_S, stop_on);
        segment.stop_deceleration_mm_per_s2 = PLANNED_MM_PER_S2;
        self.rough
            .segments
            .push(Queued::Segment {
                start_s: self.start_s,
                segment,
            })
            .unwrap();
        self.position = segment.position(duration_s);
        self.start_s += duration_s;
        self.go();
    }

    /// Queues motion of the `axis` for `cruise_s` at the speed that `ramp_s` of acceleration gives, and to rest again.
    pub fn queue(&mut self, axis: usize, ramp_s: f64, cruise_s: f64, stop_on: StopOn) {
        let along = |amount: f64| {
            let mut vector = AxisVector::ZERO;
            vector[axis] = amount;
            vector
        };
        let (speed, half) = (
            along(PLANNED_MM_PER_S2 * ramp_s),
            along(PLANNED_MM_PER_S2 / 2.0),
        );
        self.piece([AxisVector::ZERO, half], ramp_s, false, stop_on);
        if cruise_s > 0.0 {
            self.piece([speed, AxisVector::ZERO], cruise_s, false, stop_on);
        }
        self.piece([speed, AxisVector::ZERO - half], ramp_s, true, stop_on);
    }

    pub fn queue_event(&mut self, kind: EventKind, index: i32, value: f64) {
        let event = Event::new(kind, 1, 0, index, value);
        let event = Event {
            program_time_s: self.start_s,
            epoch: self.epoch,
            ..event
        };
        self.rough.segments.push(Queued::Event(event)).unwrap();
        self.go();
    }

    /// Everything that is needed is queued.
    fn go(&self) {
        self.rough
            .depth
            .stop_deceleration_mm_per_s2
            .store(PLANNED_MM_PER_S2);
        self.rough.depth.wall_s.store(f64::INFINITY);
        self.rough.depth.required_s.store(0.0);
    }

    /// No joint that did not hold was told to be more than `count_mm` from where it stood, and one that held stayed until all
    /// did. A joint in its drive's hands is told to be where it is.
    pub fn assert_bumpless(&self, count_mm: f64) {
        let script = self.script();
        let mut held = [None; MAX_AXES];
        for (index, (setpoint, before)) in script.told.iter().enumerate() {
            let all = before.state[..script.joints]
                .iter()
                .all(|state| *state == JointState::Enabled);
            for (joint, held) in held.iter_mut().enumerate().take(script.joints) {
                let at = setpoint.position[joint];
                let own =
                    setpoint.homing >> joint & 1 == 1 || before.state[joint] == JointState::Homing;
                if before.state[joint] == JointState::Enabled && setpoint.enable != 0 && !own {
                    let stays = held.unwrap_or(script.told[index - 1].0.position[joint]);
                    let homed = index > 0 && script.told[index - 1].0.homing >> joint & 1 == 1;
                    assert!(
                        all || homed || at == stays,
                        "exchange {index}: joint {joint} moved before all held"
                    );
                    *held = Some(stays).filter(|_| !all);
                } else {
                    *held = None;
                    let known = if index == 0 {
                        at
                    } else {
                        before.position[joint]
                    };
                    assert!(
                        (at - known).abs() <= count_mm,
                        "exchange {index}: joint {joint} was told {at}, stood at {known}"
                    );
                }
            }
        }
    }
}
