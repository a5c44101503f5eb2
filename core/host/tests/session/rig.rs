//! Both loops in lockstep, with a stream that the test feeds as it goes along.

use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use tandem_fine::{FineConfig, FineLoop};
use tandem_gcode::Item;
use tandem_look_ahead::{LookAhead, Options};
use tandem_rings::{HostEnd, MachineState, Rest, Sample, Sizes, bridge};
use tandem_rough::{RoughConfig, RoughError, RoughLoop, Source};
use tandem_sdk::{
    Axes, AxisLimits, AxisVector, Block, BlockKind, DriverContext, Event, EventKind, Limits,
    PlannerContext, StopOn,
};

/// Fine period, s.
pub const PERIOD_S: f64 = 0.001;
/// Acceleration limit of every axis, mm/s².
pub const ACCELERATION_MM_PER_S2: f64 = 1000.0;
const FINE_PER_ROUGH: u32 = 8;

/// A stream without an end, filled by the test.
#[derive(Clone, Default)]
struct Feed {
    items: Arc<Mutex<VecDeque<Item>>>,
    rests: Arc<Mutex<Vec<Rest>>>,
}

impl Source for Feed {
    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        items.extend(self.items.lock().unwrap().pop_front());
        Ok(true)
    }

    fn provide_input(&mut self, _value: f64) {}

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        self.items.lock().unwrap().clear();
        self.rests.lock().unwrap().push(*rest);
        true
    }
}

/// A machine with X, Y and Z at rest at zero; input 0 is 1 while X stands above 12.5 mm.
pub struct Rig {
    rough: RoughLoop,
    pub fine: FineLoop,
    pub host: HostEnd,
    feed: Feed,
    position: AxisVector,
    blocks: u64,
    pub samples: Vec<Sample>,
    pub error: Option<RoughError>,
}

impl Rig {
    pub fn new() -> Self {
        Self::with_depth(1.0)
    }

    /// With a queue that holds this share of the worst stop.
    pub fn with_depth(depth_factor: f64) -> Self {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: 250.0,
            rapid_mm_per_s: 250.0,
            acceleration_mm_per_s2: ACCELERATION_MM_PER_S2,
            jerk_mm_per_s3: f64::INFINITY,
            speed_difference_mm_per_s: 0.0,
        };
        let limits = Limits::new(&[axis; 3]).unwrap();
        let (rough_end, fine_end, host) = bridge(Sizes::default());
        let config = FineConfig::new(PERIOD_S, limits);
        let options = "latches = false\nswitches = [{ input = 0, joint = 0, above_mm = 12.5 }]";
        let mut driver = tandem_sim::PLUGIN.driver(options).unwrap();
        driver.open(&DriverContext::new(3, PERIOD_S)).unwrap();
        driver.start().unwrap();
        let mut fine = FineLoop::new(&config, fine_end, driver, None);
        fine.reset();
        let feed = Feed::default();
        let rough_config = RoughConfig {
            depth_factor,
            ..RoughConfig::new(f64::from(FINE_PER_ROUGH) * PERIOD_S, PERIOD_S)
        };
        let rough = RoughLoop::new(
            rough_config,
            Box::new(feed.clone()),
            planner(&limits),
            rough_end,
        );
        let (position, samples) = (AxisVector::ZERO, vec![]);
        Self {
            rough,
            fine,
            host,
            feed,
            position,
            blocks: 0,
            samples,
            error: None,
        }
    }

    /// Queues a line to `end` at `feed_mm_per_s`.
    pub fn line(&mut self, end: [f64; 2], feed_mm_per_s: f64) {
        self.probe(end, feed_mm_per_s, StopOn::default());
    }

    /// Queues a line that an input may end.
    pub fn probe(&mut self, end: [f64; 2], feed_mm_per_s: f64, stop_on: StopOn) {
        let end = AxisVector::from_slice(&end);
        let way = end - self.position;
        let block = Block {
            kind: BlockKind::Line,
            line: self.blocks as u32 + 1,
            index: self.blocks,
            end,
            length_mm: way.0.iter().map(|v| v * v).sum::<f64>().sqrt(),
            feed_mm_per_s,
            stop_on,
            ..Block::at(self.position)
        };
        self.give(Item::Block(block, None));
        (self.position, self.blocks) = (end, self.blocks + 1);
    }

    /// Queues an event.
    pub fn event(&mut self, kind: EventKind, index: i32, value: f64) {
        self.give(Item::Event(Event::new(kind, 0, self.blocks, index, value)));
    }

    fn give(&mut self, item: Item) {
        self.feed.items.lock().unwrap().push_back(item);
    }

    /// Lets so many rough periods pass.
    pub fn rough_periods(&mut self, count: usize) {
        for _ in 0..count {
            if self.error.is_none() {
                self.error = self.rough.step(&mut ()).err();
            }
            self.fine_periods();
        }
    }

    /// Lets so many rough periods pass in which the rough loop does nothing.
    pub fn stall(&mut self, count: usize) {
        (0..count).for_each(|_| self.fine_periods());
    }

    fn fine_periods(&mut self) {
        (0..FINE_PER_ROUGH).for_each(|_| self.fine.tick());
        while let Ok(sample) = self.host.samples.pop() {
            self.samples.push(sample);
        }
    }

    /// Runs until `condition`, or gives up.
    pub fn until(&mut self, mut condition: impl FnMut(&Self) -> bool) {
        for _ in 0..10_000 {
            if condition(self) {
                return;
            }
            self.rough_periods(1);
        }
        panic!("never: {:?}, {:?}", self.samples.last(), self.error);
    }

    /// Runs until another rest is reported, then goes on planning from it.
    pub fn until_rest(&mut self) -> Rest {
        let before = self.rests().len();
        self.until(|rig| rig.rests().len() > before);
        let rest = self.rests()[before];
        self.position = rest.position;
        rest
    }

    /// Runs until everything given is driven.
    pub fn until_driven(&mut self) {
        let end = self.position;
        self.until(|rig| rig.host.status.idle.load(Relaxed) && rig.last().command == end);
    }

    pub fn rests(&self) -> Vec<Rest> {
        self.feed.rests.lock().unwrap().clone()
    }

    pub fn last(&self) -> Sample {
        *self.samples.last().expect("a sample")
    }

    pub fn state(&self) -> MachineState {
        MachineState::from_number(self.host.status.state.load(Relaxed))
    }

    pub fn abort(&self) {
        self.host.controls.abort.store(true, Relaxed);
    }

    /// No period is missing, and over the whole session no axis accelerates more than it may: nowhere a jump.
    pub fn assert_smooth(&self) {
        let velocity: Vec<AxisVector> = self
            .samples
            .windows(2)
            .map(|pair| (pair[1].command - pair[0].command) * (1.0 / PERIOD_S))
            .collect();
        assert!(
            self.samples
                .windows(2)
                .all(|pair| pair[1].tick == pair[0].tick + 1)
        );
        for (index, pair) in velocity.windows(2).enumerate() {
            let change = (pair[1] - pair[0]) * (1.0 / PERIOD_S);
            let most = change.0.iter().fold(0.0f64, |most, a| most.max(a.abs()));
            assert!(
                most <= ACCELERATION_MM_PER_S2 * (1.0 + 1e-6),
                "{most} mm/s² at sample {index}"
            );
        }
        assert_eq!(self.fine.fault(), None);
    }
}

fn planner(limits: &Limits) -> Box<LookAhead> {
    let context = PlannerContext {
        axes: Axes::new(&[('X', false), ('Y', false), ('Z', false)]).unwrap(),
        limits: *limits,
        fine_period_s: PERIOD_S,
        rough_period_s: f64::from(FINE_PER_ROUGH) * PERIOD_S,
        path_tolerance_mm: 0.01,
        time_constant_s: 0.05,
        max_feed_ratio: 1.0,
        position: AxisVector::ZERO,
        joint_lanes: None,
    };
    Box::new(LookAhead::new(&Options::default(), &context).unwrap())
}
