//! A fine loop with both other ends in the test's hands, and motion along X to feed it.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex};

use tandem_fine::{FineConfig, FineLoop, GuardMode, Joints};
use tandem_rig::Echo;
use tandem_rings::{HostEnd, MachineState, Queued, Rest, RoughEnd, Sizes, bridge};
use tandem_sdk::{
    AxisLimits, AxisVector, Edge, Event, EventKind, Kinematics, Latch, Limits, PluginError,
    Segment, SegmentFlags, StopOn,
};

/// Fine period, s.
pub const PERIOD_S: f64 = 0.001;
/// Programmed feed, mm/s.
pub const FEED_MM_PER_S: f64 = 20.0;
/// What the plan accelerates with, mm/s².
const PLANNED_MM_PER_S2: f64 = 200.0;

/// The output that a fault leaves on.
pub const KEPT_OUTPUT: u32 = 3;

/// The input that a probe waits for.
const PROBE_INPUT: u32 = 5;

/// What a plan at its limits accelerates with, mm/s²: planners leave a thousandth.
const MAX_MM_PER_S2: f64 = 999.0;

/// The fine loop under test.
pub struct Bench {
    pub fine: FineLoop,
    pub host: HostEnd,
    rough: RoughEnd,
    failing: Arc<AtomicBool>,
    spoiled: Arc<AtomicBool>,
    caught_mm: Arc<Mutex<Option<f64>>>,
    quick_stops: Arc<AtomicU64>,
    queued_s: f64,
    x_mm: f64,
    epoch: u32,
    stop_on: StopOn,
    line: u32,
    /// How long the path coordinate is beside the way of the axis.
    path_share: f64,
}

impl Bench {
    /// At rest at zero, nothing queued.
    pub fn new(guard: GuardMode) -> Self {
        Self::of(guard, Joints::Axes, (3, 1.0), None)
    }

    /// What is queued may be planned at `max_feed_ratio` times the feed.
    pub fn planned_at(max_feed_ratio: f64) -> Self {
        Self::of(GuardMode::Stop, Joints::Axes, (3, max_feed_ratio), None)
    }

    /// Three axes and as many joints behind them, as `kinematics` give them.
    pub fn with_curved(kinematics: Box<dyn Kinematics>) -> Self {
        Self::of(
            GuardMode::Stop,
            Joints::Curved { axes: 3 },
            (6, 1.0),
            Some(kinematics),
        )
    }

    fn of(
        guard: GuardMode,
        joints: Joints,
        (entries, max_feed_ratio): (usize, f64),
        kinematics: Option<Box<dyn Kinematics>>,
    ) -> Self {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 100.0,
            rapid_mm_per_s: 100.0,
            acceleration_mm_per_s2: 1000.0,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let config = FineConfig {
            joints,
            guard,
            max_feed_ratio,
            kept_outputs: 1 << KEPT_OUTPUT,
            pause_at_stops: true,
            ..FineConfig::new(PERIOD_S, Limits::new(&[axis; 6][..entries]).unwrap())
        };
        let (rough, end, host) = bridge(Sizes {
            segments: 64,
            samples: 64,
        });
        let (failing, spoiled): (Arc<AtomicBool>, Arc<AtomicBool>) = Default::default();
        let (fails, spoils) = (Arc::clone(&failing), Arc::clone(&spoiled));
        let caught_mm = Arc::<Mutex<Option<f64>>>::default();
        let catches_mm = Arc::clone(&caught_mm);
        let driver = Echo::new(move |_, feedback| {
            if spoils.load(Relaxed) {
                feedback.position[0] = f64::NAN;
            }
            if let Some(at_mm) = *catches_mm.lock().unwrap() {
                feedback.latches[0] = Latch {
                    input: PROBE_INPUT,
                    edge: Edge::Rising as u32,
                    joints: 1,
                    before_s: 0.0,
                    position: AxisVector::from_slice(&[at_mm]),
                };
            }
            if fails.load(Relaxed) {
                Err(PluginError::fixed("the drives are lost"))
            } else {
                Ok(())
            }
        });
        let quick_stops = driver.quick_stops();
        let mut fine = FineLoop::new(&config, end, Box::new(driver), kinematics);
        fine.reset();
        Self {
            fine,
            host,
            rough,
            failing,
            spoiled,
            caught_mm,
            quick_stops,
            queued_s: 0.0,
            x_mm: 0.0,
            epoch: 0,
            stop_on: StopOn::default(),
            line: 1,
            path_share: 1.0,
        }
    }

    /// The path coordinate of what is queued from here on is this share of the way of the axis.
    pub fn shorten_path(&mut self, share: f64) {
        self.path_share = share;
    }

    /// What the machine is doing.
    pub fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    /// The next exchange fails.
    pub fn fail_drives(&self) {
        self.failing.store(true, Relaxed);
    }

    /// What the first drive reports is no number from the next exchange on.
    pub fn spoil_feedback(&self) {
        self.spoiled.store(true, Relaxed);
    }

    /// The drives have caught the edge of the probe where their first joint was at `at_mm`.
    pub fn catch_edge(&self, at_mm: f64) {
        *self.caught_mm.lock().unwrap() = Some(at_mm);
    }

    /// How often the drives were told to stop by themselves.
    pub fn quick_stops(&self) -> u64 {
        self.quick_stops.load(Relaxed)
    }

    /// Says of what is queued that it ends at rest, whatever it does.
    pub fn say_that_it_ends_at_rest(&self) {
        self.rough.depth.wall_s.store(f64::INFINITY);
        self.rough.depth.required_s.store(0.0);
    }

    /// Queues the way from rest to the feed.
    pub fn accelerate(&mut self) {
        self.piece(
            0.0,
            PLANNED_MM_PER_S2,
            FEED_MM_PER_S / PLANNED_MM_PER_S2,
            false,
        );
    }

    /// Queues motion at the feed.
    pub fn cruise(&mut self, duration_s: f64) {
        self.piece(FEED_MM_PER_S, 0.0, duration_s, false);
    }

    /// Queues motion at eleven times the feed: beyond the limits.
    pub fn leap(&mut self, duration_s: f64) {
        self.piece(11.0 * FEED_MM_PER_S, 0.0, duration_s, false);
    }

    /// Queues the way from rest to a speed and back, with all that the axis has.
    pub fn peak(&mut self, peak_mm_per_s: f64) {
        self.piece(0.0, MAX_MM_PER_S2, peak_mm_per_s / MAX_MM_PER_S2, false);
        self.piece(
            peak_mm_per_s,
            -MAX_MM_PER_S2,
            peak_mm_per_s / MAX_MM_PER_S2,
            true,
        );
    }

    /// Queues the way from the feed to rest.
    pub fn brake(&mut self) {
        self.piece(
            FEED_MM_PER_S,
            -PLANNED_MM_PER_S2,
            FEED_MM_PER_S / PLANNED_MM_PER_S2,
            true,
        );
    }

    /// Takes the report of a rest, which it gives, and queues in the next epoch from there.
    pub fn go_on(&mut self) -> Rest {
        let rest = self.rough.rests.pop().expect("a rest");
        (self.epoch, self.queued_s, self.x_mm) =
            (rest.epoch + 1, rest.program_time_s, rest.position[0]);
        self.rough.depth.begin(self.epoch, self.queued_s);
        rest
    }

    /// Queues a rest.
    pub fn dwell(&mut self, duration_s: f64) {
        self.piece(0.0, 0.0, duration_s, true);
    }

    /// Queues a plan that stands, and is at no rest.
    pub fn stand(&mut self, duration_s: f64) {
        self.piece(0.0, 0.0, duration_s, false);
    }

    /// What is queued from here on waits for the input of the probe, which comes with [`Bench::catch_edge`] or never.
    pub fn probe(&mut self) {
        self.stop_on = StopOn {
            input: PROBE_INPUT,
            edge: Edge::Rising,
            miss_is_fault: 1,
        };
    }

    /// What is queued from here on belongs to the next line; returns where that begins, mm.
    pub fn next_line(&mut self) -> f64 {
        self.line += 1;
        self.x_mm
    }

    /// Queues an event.
    pub fn event(&mut self, kind: EventKind, index: i32, value: f64) {
        let event = Event {
            program_time_s: self.queued_s,
            epoch: self.epoch,
            ..Event::new(kind, 1, 0, index, value)
        };
        self.rough.segments.push(Queued::Event(event)).unwrap();
    }

    fn piece(
        &mut self,
        speed_mm_per_s: f64,
        acceleration_mm_per_s2: f64,
        duration_s: f64,
        last: bool,
    ) {
        let mut segment = Segment::rest(&AxisVector::ZERO, duration_s);
        let motion = [
            self.x_mm,
            speed_mm_per_s,
            acceleration_mm_per_s2 / 2.0,
            0.0,
            0.0,
            0.0,
        ];
        segment.coefficients[0] = motion;
        segment.path = motion.map(|term| self.path_share * term);
        segment.flags = if last {
            SegmentFlags::ENDS_AT_REST
        } else {
            SegmentFlags::default()
        };
        segment.epoch = self.epoch;
        segment.line = self.line;
        segment.stop_on = self.stop_on;
        segment.feed_mm_per_s = FEED_MM_PER_S;
        segment.stop_deceleration_mm_per_s2 = PLANNED_MM_PER_S2;
        self.rough
            .segments
            .push(Queued::Segment {
                start_s: self.queued_s,
                segment,
            })
            .unwrap();
        self.x_mm = segment.position(duration_s)[0];
        self.queued_s += duration_s;
        let depth = &self.rough.depth;
        depth.stop_deceleration_mm_per_s2.store(PLANNED_MM_PER_S2);
        depth
            .wall_s
            .store(if last { f64::INFINITY } else { self.queued_s });
        depth.required_s.store(if last { 0.0 } else { 0.2 });
    }
}
