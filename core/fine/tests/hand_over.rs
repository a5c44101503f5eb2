//! Homing by the drive: a joint is handed over, neither followed nor judged, and adopted where its drive says that it is.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use tandem_fine::{FaultKind, FineConfig, FineLoop, GuardMode, Joints, MissedLimits, Roles};
use tandem_rig::Random;
use tandem_rings::{HostEnd, MachineState, Queued, Rest, RestCause, RoughEnd, Sizes, bridge};
use tandem_sdk::{
    Attached, AxisLimits, AxisVector, Driver, DriverContext, DriverDescription, Event, EventKind, Feedback, JointState,
    Limits, MAX_AXES, PluginError, Segment, SegmentFlags, Setpoint,
};

const PERIOD_S: f64 = 0.001;
const JOINTS: usize = 2;
const HOMED: usize = 1;

/// Drives of which one homes by itself: it moves at 50 mm/s for some periods, then calls where it is otherwise.
struct Script {
    /// Exchanges that homing takes; the drive says at once that it is homed with 0.
    takes: u64,
    /// Where it is then, mm.
    is_then_mm: f64,
    /// Says from the beginning that it is homed, of an older homing.
    was_homed: bool,
    never: bool,
    fault_after: Option<u64>,
    homing_for: u64,
    position: AxisVector,
    homed: bool,
    told: Vec<Setpoint>,
}

struct Drives(Arc<Mutex<Script>>);

impl Driver for Drives {
    fn describe(&self) -> DriverDescription {
        DriverDescription::real()
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::default())
    }
    fn exchange(&mut self, setpoint: &Setpoint, feedback: &mut Feedback) -> Result<(), PluginError> {
        let mut script = self.0.lock().unwrap();
        script.told.push(*setpoint);
        let homes = setpoint.homing >> HOMED & 1 == 1;
        let state = if setpoint.enable == 0 { JointState::Disabled } else { JointState::Enabled };
        feedback.state[..JOINTS].fill(state);
        let handed = script.homing_for > 0;
        script.homing_for = if homes { script.homing_for + 1 } else { 0 };
        if homes && !handed {
            script.homed = false;
        }
        let own = homes && !script.homed;
        for joint in 0..JOINTS {
            if joint == HOMED && own {
                script.position[joint] -= 0.05;
                feedback.state[joint] = JointState::Homing;
            } else if setpoint.enable != 0 && !(joint == HOMED && homes) {
                script.position[joint] = setpoint.position[joint];
            }
        }
        if own && script.homing_for > script.takes && !script.never {
            (script.homed, script.position[HOMED]) = (true, script.is_then_mm);
            feedback.state[HOMED] = JointState::Enabled;
        }
        if own && script.fault_after.is_some_and(|after| script.homing_for > after) {
            (feedback.state[HOMED], feedback.fault_code[HOMED]) = (JointState::Fault, 0x8611);
        }
        feedback.homed = u32::from(script.homed || (script.was_homed && !homes)) << HOMED;
        feedback.position = script.position;
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

struct Bench {
    fine: FineLoop,
    rough: RoughEnd,
    host: HostEnd,
    script: Arc<Mutex<Script>>,
    epoch: u32,
    start_s: f64,
}

impl Bench {
    fn new(random: &mut Random) -> Self {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let at = AxisVector::from_slice(&[random.between(-500.0, 500.0), random.between(-500.0, 500.0)]);
        let config = FineConfig {
            period_s: PERIOD_S,
            limits: Limits::new(&[axis; JOINTS]).unwrap(),
            joints: Joints::Axes,
            linear: 0b11,
            speed_difference_mm_per_s: [0.0; MAX_AXES],
            order: 2,
            guard: GuardMode::Stop,
            position: AxisVector::ZERO,
            max_feed_ratio: 1.0,
            max_following_error_mm: AxisVector([0.01; MAX_AXES]),
            missed: MissedLimits::default(),
            kept_outputs: 0,
            pause_at_stops: false,
            dry_run: false,
            unhomed: 1 << HOMED,
            record_drives: true,
            attached: Attached { delay_periods: [2; MAX_AXES], ..Attached::at(at) },
            enable_periods: 100,
            disable_periods: 100,
            reset_drives: false,
            plans_from_rest: true,
            roles: Roles::default(),
        };
        let script = Script {
            takes: 1 + random.below(200),
            is_then_mm: random.between(-900.0, 900.0),
            was_homed: random.below(2) == 1,
            never: false,
            fault_after: None,
            homing_for: 0,
            position: at,
            homed: false,
            told: vec![],
        };
        let script = Arc::new(Mutex::new(script));
        let (rough, end, host) = bridge(Sizes { segments: 64, samples: 1 << 13 });
        let mut fine = FineLoop::new(&config, end, Box::new(Drives(Arc::clone(&script))), None);
        fine.reset();
        let mut bench = Self { fine, rough, host, script, epoch: 0, start_s: 0.0 };
        assert_eq!(bench.rest(20).map(|rest| rest.cause), Some(RestCause::Attached));
        bench
    }

    /// Ticks until a rest is reported, which begins the next epoch.
    fn rest(&mut self, most: u64) -> Option<Rest> {
        for _ in 0..most {
            self.fine.tick();
            if let Ok(rest) = self.rough.rests.pop() {
                (self.epoch, self.start_s) = (rest.epoch + 1, rest.program_time_s);
                self.rough.depth.begin(self.epoch, self.start_s);
                return Some(rest);
            }
        }
        None
    }

    fn hand_over(&mut self, within_s: f64) {
        let event = Event {
            program_time_s: self.start_s,
            epoch: self.epoch,
            ..Event::new(EventKind::HomeByDrive, 0, 0, (HOMED as u32).cast_signed(), within_s)
        };
        self.rough.segments.push(Queued::Event(event)).unwrap();
        self.rough.depth.wall_s.store(f64::INFINITY);
        self.rough.depth.required_s.store(0.0);
        self.rough.depth.stop_deceleration_mm_per_s2.store(500.0);
    }

    fn ticks(&mut self, count: u64) {
        (0..count).for_each(|_| self.fine.tick());
    }

    fn fault(&self) -> Option<FaultKind> {
        self.fine.fault().map(|fault| fault.kind)
    }

    /// No setpoint but that of the joint in its drive's hands ever jumped, and its first one behind is where it is.
    fn assert_bumpless(&self) {
        let script = self.script.lock().unwrap();
        for pair in script.told.windows(2).filter(|pair| pair[1].enable != 0 && pair[0].enable != 0) {
            assert_eq!(pair[0].position[0], pair[1].position[0]);
            if pair[0].homing == 0 && pair[1].homing == 0 {
                assert!((pair[0].position[HOMED] - pair[1].position[HOMED]).abs() <= 0.1, "{pair:?}");
            }
            assert_eq!((pair[1].velocity, pair[1].acceleration), (AxisVector::ZERO, AxisVector::ZERO));
        }
    }
}

#[test]
fn a_joint_is_adopted_where_its_drive_says_that_it_is() {
    for seed in 1..=100 {
        let mut random = Random::new(seed);
        let mut bench = Bench::new(&mut random);
        bench.hand_over(10.0);
        let rest = bench.rest(300).unwrap_or_else(|| panic!("seed {seed}: {:?}", bench.fault()));
        let is_then_mm = bench.script.lock().unwrap().is_then_mm;
        assert_eq!((rest.cause, rest.position[HOMED]), (RestCause::Corrected, is_then_mm), "seed {seed}");
        bench.ticks(20);
        assert_eq!(bench.fault(), None, "seed {seed}");
        let script = bench.script.lock().unwrap();
        assert_eq!((script.told.last().unwrap().homing, script.position[HOMED]), (0, is_then_mm));
        let handed_over = script.told.iter().filter(|told| told.homing != 0).count() as u64;
        assert!((script.takes..=script.takes + 2).contains(&handed_over), "seed {seed}: {handed_over}");
        drop(script);
        bench.assert_bumpless();
    }
}

#[test]
fn it_is_followed_again_from_there() {
    let mut bench = Bench::new(&mut Random::new(9));
    bench.hand_over(10.0);
    let rest = bench.rest(300).unwrap();
    for (speed, acceleration) in [(0.0, 500.0), (50.0, -500.0)] {
        let mut segment = Segment::rest(&rest.position, 0.1);
        let from = if speed == 0.0 { rest.position[HOMED] } else { rest.position[HOMED] + 2.5 };
        segment.coefficients[HOMED] = [from, speed, acceleration / 2.0, 0.0, 0.0, 0.0];
        segment.path = [from, speed, acceleration / 2.0, 0.0, 0.0, 0.0];
        let last = acceleration < 0.0;
        segment.flags = if last { SegmentFlags::ENDS_AT_REST } else { SegmentFlags::default() };
        (segment.epoch, segment.feed_mm_per_s, segment.stop_deceleration_mm_per_s2) = (bench.epoch, 100.0, 500.0);
        bench.rough.segments.push(Queued::Segment { start_s: bench.start_s, segment }).unwrap();
        bench.start_s += 0.1;
    }
    bench.rough.depth.wall_s.store(f64::INFINITY);
    bench.rough.depth.required_s.store(0.0);
    bench.ticks(260);
    // Feedback that answers at once where two periods were told: what is behind by them is 0.1 mm at 50 mm/s.
    let fault = bench.fault();
    assert!(matches!(fault, Some(FaultKind::Following { joint: HOMED, .. })), "it is followed again: {fault:?}");
}

#[test]
fn a_drive_that_finds_nothing_or_fails_is_a_fault_with_its_code() {
    let mut bench = Bench::new(&mut Random::new(3));
    bench.script.lock().unwrap().never = true;
    bench.hand_over(0.3);
    assert_eq!(bench.rest(250), None);
    assert_eq!(bench.fault(), None);
    bench.ticks(200);
    let kind = FaultKind::NotHomed { joint: HOMED, state: JointState::Homing, code: 0, within_s: 0.3 };
    assert_eq!(bench.fault(), Some(kind));
    let last = *bench.script.lock().unwrap().told.last().unwrap();
    assert_eq!((last.homing, last.enable), (0, 0));
    for after in [0, 5, 60] {
        let mut bench = Bench::new(&mut Random::new(4 + after));
        let mut script = bench.script.lock().unwrap();
        (script.never, script.fault_after) = (true, Some(after));
        drop(script);
        bench.hand_over(10.0);
        bench.ticks(200);
        assert_eq!(bench.fault(), Some(FaultKind::Drive { joint: HOMED, code: 0x8611 }));
        bench.assert_bumpless();
        let state = MachineState::from_number(bench.host.status.state.load(Relaxed));
        assert_eq!(state, MachineState::Fault);
    }
}

#[test]
fn an_abort_and_an_emergency_stop_take_the_joint_back_where_it_is() {
    for seed in 1..=20 {
        let mut random = Random::new(seed);
        let mut bench = Bench::new(&mut random);
        bench.script.lock().unwrap().never = true;
        bench.hand_over(10.0);
        bench.ticks(3 + random.below(150));
        let controls = Arc::clone(&bench.host.controls);
        if seed % 3 == 0 {
            controls.emergency_stop.store(true, Relaxed);
            bench.ticks(20);
            assert_eq!(bench.fault(), Some(FaultKind::EmergencyStop));
        } else if seed % 3 == 1 {
            controls.soft_fault.store(true, Relaxed);
            bench.ticks(20);
            assert_eq!(bench.fault(), Some(FaultKind::Soft));
        } else {
            controls.abort.store(true, Relaxed);
            let rest = bench.rest(20).expect("a rest");
            let at_mm = bench.script.lock().unwrap().position[HOMED];
            assert_eq!((rest.cause, rest.position[HOMED], bench.fault()), (RestCause::Abort, at_mm, None));
        }
        bench.ticks(10);
        assert_eq!(bench.script.lock().unwrap().told.last().unwrap().homing, 0);
        bench.assert_bumpless();
    }
}

#[test]
fn a_hold_interrupts_the_drive_and_a_resume_begins_anew() {
    let mut bench = Bench::new(&mut Random::new(11));
    bench.script.lock().unwrap().takes = 100;
    bench.hand_over(10.0);
    bench.ticks(50);
    bench.host.controls.hold.store(true, Relaxed);
    bench.ticks(3);
    assert_eq!(bench.script.lock().unwrap().told.last().unwrap().homing, 0);
    let at = bench.script.lock().unwrap().position;
    bench.ticks(500);
    assert_eq!((bench.fault(), bench.script.lock().unwrap().position), (None, at));
    bench.host.controls.hold.store(false, Relaxed);
    let rest = bench.rest(200).expect("homed");
    assert_eq!(rest.position[HOMED], bench.script.lock().unwrap().is_then_mm);
    bench.assert_bumpless();
}
