//! A jerk-limited plan, the fine loop that drives it, and the limits as differences of what was sent.

use std::sync::atomic::Ordering::Relaxed;

use tandem_fine::{FineConfig, FineLoop};
use tandem_rig::Echo;
use tandem_rings::{HostEnd, Queued, Ratio, RoughEnd, Sizes, bridge};
use tandem_sdk::{AxisLimits, AxisVector, Limits, Segment, SegmentFlags};

pub const PERIOD_S: f64 = 1e-3;

/// The machine's limits, the same for each axis: mm/s, mm/s², mm/s³.
pub struct Kept {
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

pub const LIMITS: Kept = Kept {
    speed: 250.0,
    acceleration: 1000.0,
    jerk: 20_000.0,
};

/// Pieces of constant path jerk: jerk and duration.
type Pieces = Vec<(f64, f64)>;

/// From rest to `feed` and back over `length`: seven pieces of constant jerk.
pub fn profile(length: f64, feed: f64, acceleration: f64, jerk: f64) -> Pieces {
    let ramp_s = (feed / jerk).sqrt().min(acceleration / jerk);
    let held_s = feed / (ramp_s * jerk) - ramp_s;
    let cruise_s = length / feed - (2.0 * ramp_s + held_s);
    assert!(cruise_s >= 0.0, "too short");
    [
        (jerk, ramp_s),
        (0.0, held_s),
        (-jerk, ramp_s),
        (0.0, cruise_s),
        (-jerk, ramp_s),
        (0.0, held_s),
        (jerk, ramp_s),
    ]
    .to_vec()
}

/// A path and the motion along it.
pub struct Plan {
    pieces: Pieces,
    feed: f64,
    /// From this time on the second line is driven, whose feed is this share of that of the first.
    next_line: (f64, f64),
    path: Box<dyn Fn(f64) -> [f64; 2]>,
}

impl Plan {
    pub fn new(pieces: Pieces, feed: f64, path: impl Fn(f64) -> [f64; 2] + 'static) -> Self {
        Self {
            pieces,
            feed,
            next_line: (f64::INFINITY, 1.0),
            path: Box::new(path),
        }
    }

    /// The same motion, which from `from_s` on is that of a second line, with `share` of the feed.
    pub fn with_next_line(self, from_s: f64, share: f64) -> Self {
        Self {
            next_line: (from_s, share),
            ..self
        }
    }

    pub fn feed(&self) -> f64 {
        self.feed
    }

    pub fn duration_s(&self) -> f64 {
        self.pieces.iter().map(|(_, duration)| duration).sum()
    }

    /// Path coordinate, speed and acceleration at `t`.
    fn along(&self, t: f64) -> [f64; 3] {
        let (mut s, mut v, mut a, mut left) = (0.0, 0.0, 0.0, t);
        for &(jerk, duration) in &self.pieces {
            let h = left.min(duration).max(0.0);
            s += h * (v + h * (a / 2.0 + h * jerk / 6.0));
            v += h * (a + h * jerk / 2.0);
            a += h * jerk;
            left -= h;
        }
        [s, v, a]
    }

    /// Position, velocity and acceleration at `t` per axis.
    fn state(&self, t: f64) -> [[f64; 3]; 2] {
        let [s, v, a] = self.along(t);
        let h = 1e-4;
        let [before, here, after] = [s - h, s, s + h].map(|s| (self.path)(s));
        std::array::from_fn(|axis| {
            let direction = (after[axis] - before[axis]) / (2.0 * h);
            let curvature = (after[axis] - 2.0 * here[axis] + before[axis]) / (h * h);
            [here[axis], direction * v, direction * a + curvature * v * v]
        })
    }

    /// Times at which segments end: every 4 ms, and where the jerk changes.
    fn cuts(&self) -> Vec<f64> {
        let mut at = 0.0;
        let ends: Vec<f64> = self
            .pieces
            .iter()
            .map(|(_, duration)| {
                at += duration;
                at
            })
            .collect();
        let mut cuts: Vec<f64> = (1..(at / 4e-3) as u32)
            .map(|n| f64::from(n) * 4e-3)
            .chain(ends)
            .collect();
        cuts.sort_by(f64::total_cmp);
        cuts.dedup_by(|a, b| *a - *b < 1e-7);
        cuts
    }

    fn segment(&self, from: f64, to: f64) -> Segment {
        let duration = to - from;
        let mut segment = Segment::rest(&AxisVector::ZERO, duration);
        let (start, end) = (self.state(from), self.state(to));
        for axis in 0..2 {
            segment.coefficients[axis] = hermite(start[axis], end[axis], duration);
        }
        segment.path = hermite(self.along(from), self.along(to), duration);
        segment.flags = SegmentFlags::default();
        (segment.order, segment.line) = (3, 1);
        segment.feed_mm_per_s = self.feed;
        if from + 1e-9 >= self.next_line.0 {
            segment.line = 2;
            segment.feed_mm_per_s *= self.next_line.1;
        }
        segment.stop_deceleration_mm_per_s2 = 500.0;
        segment
    }
}

fn hermite(from: [f64; 3], to: [f64; 3], h: f64) -> [f64; 6] {
    let (c1, c2) = (from[1], from[2] / 2.0);
    let p = to[0] - from[0] - h * (c1 + h * c2);
    let v = (to[1] - c1 - 2.0 * c2 * h) * h;
    let a = (to[2] - from[2]) * h * h;
    let (c3, c4, c5) = (
        10.0 * p - 4.0 * v + a / 2.0,
        -15.0 * p + 7.0 * v - a,
        6.0 * p - 3.0 * v + a / 2.0,
    );
    [
        from[0],
        c1,
        c2,
        c3 / h.powi(3),
        c4 / h.powi(4),
        c5 / h.powi(5),
    ]
}

/// The fine loop with the whole plan queued.
pub struct Machine {
    pub fine: FineLoop,
    pub host: HostEnd,
    _rough: RoughEnd,
    sent: Vec<[f64; 2]>,
    end_mm: [f64; 2],
}

/// What a run left.
pub struct Done {
    pub sent: Vec<[f64; 2]>,
    pub governed: u64,
    pub relaxed: u64,
    end_mm: [f64; 2],
}

impl Machine {
    pub fn new(plan: &Plan) -> Self {
        Self::planned_at(plan, 1.0)
    }

    /// The plan is made at `max_feed_ratio` times the programmed feed.
    pub fn planned_at(plan: &Plan, max_feed_ratio: f64) -> Self {
        let mut config = Self::config();
        config.max_feed_ratio = max_feed_ratio;
        Self::of(plan, &config)
    }

    /// Two axes with [`LIMITS`].
    pub fn config() -> FineConfig {
        let axis = AxisLimits {
            min_mm: -1000.0,
            max_mm: 1000.0,
            feed_mm_per_s: LIMITS.speed,
            rapid_mm_per_s: LIMITS.speed,
            acceleration_mm_per_s2: LIMITS.acceleration,
            jerk_mm_per_s3: LIMITS.jerk,
            speed_difference_mm_per_s: 0.0,
        };
        FineConfig {
            order: 3,
            ..FineConfig::new(PERIOD_S, Limits::new(&[axis; 2]).unwrap())
        }
    }

    pub fn of(plan: &Plan, config: &FineConfig) -> Self {
        let (mut rough, end, host) = bridge(Sizes {
            segments: 4096,
            samples: 4096,
        });
        let mut from = 0.0;
        let cuts = plan.cuts();
        for &to in &cuts {
            let mut segment = plan.segment(from, to);
            segment.feed_mm_per_s /= config.max_feed_ratio;
            segment.order = config.order;
            rough
                .segments
                .push(Queued::Segment {
                    start_s: from,
                    segment,
                })
                .unwrap();
            from = to;
        }
        let end_mm = (plan.path)(plan.along(from)[0]);
        let mut rest = Segment::rest(&AxisVector::from_slice(&end_mm), 0.0);
        rest.order = 3;
        rest.path[0] = plan.along(from)[0];
        rough
            .segments
            .push(Queued::Segment {
                start_s: from,
                segment: rest,
            })
            .unwrap();
        rough.depth.stop_deceleration_mm_per_s2.store(500.0);
        rough.depth.wall_s.store(f64::INFINITY);
        rough.depth.required_s.store(0.0);
        let mut fine = FineLoop::new(config, end, Box::new(Echo::default()), None);
        fine.reset();
        let mut this = Self {
            fine,
            host,
            _rough: rough,
            sent: vec![],
            end_mm,
        };
        while this.sent.is_empty() {
            this.run(1);
        }
        this
    }

    pub fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.fine.tick();
            self.take_samples();
        }
        assert_eq!(self.fine.fault(), None);
    }

    pub fn hold(&self, hold: bool) {
        self.host.controls.hold.store(hold, Relaxed);
    }

    /// Feed override.
    pub fn ratio(&self, ratio: f64) {
        self.host.controls.feed_override.store(ratio);
    }

    /// What strategy and policy ask for from `tick` on.
    pub fn ask_for(&mut self, tick: u64, ratio: f64) {
        self.host.ratios.push(Ratio { tick, ratio }).unwrap();
    }

    /// Position of X in each sample so far, mm.
    pub fn x_mm(&self) -> Vec<f64> {
        self.sent.iter().map(|position| position[0]).collect()
    }

    pub fn is_at_end(&self) -> bool {
        self.sent.last() == Some(&self.end_mm)
    }

    /// Path speed of each sample, mm/s.
    pub fn speeds(&self) -> Vec<f64> {
        speeds(&self.sent)
    }

    /// Periods until nothing moves.
    pub fn run_to_standstill(&mut self) -> u64 {
        let mut periods = 0;
        while self.moves() {
            self.run(1);
            periods += 1;
            assert!(periods < 10_000, "it does not stop");
        }
        periods
    }

    /// Ramps out.
    pub fn emergency_stop(mut self) -> Done {
        self.host.controls.emergency_stop.store(true, Relaxed);
        while !self.fine.is_over() {
            self.fine.tick();
        }
        self.take_samples();
        let rest = self.sent.last().copied().unwrap_or_default();
        // What rests for good goes on resting.
        self.sent.extend([rest; 4]);
        self.done()
    }

    fn take_samples(&mut self) {
        while let Ok(sample) = self.host.samples.pop() {
            self.sent.push([sample.command[0], sample.command[1]]);
        }
    }

    fn done(self) -> Done {
        let counters = self.fine.counters();
        Done {
            sent: self.sent,
            governed: counters.governed_samples,
            relaxed: counters.jerk_relaxed_samples,
            end_mm: self.end_mm,
        }
    }

    fn moves(&self) -> bool {
        let [.., before, last] = self.sent.as_slice() else {
            return true;
        };
        before != last
    }

    pub fn run_to_end(mut self) -> Done {
        let mut patience = 0;
        while self.sent.last() != Some(&self.end_mm) {
            self.run(1);
            patience += 1;
            assert!(
                patience < 100_000,
                "it does not arrive: {:?}",
                self.sent.last()
            );
        }
        self.run(4);
        self.done()
    }
}

impl Done {
    /// Path speed of each sample, mm/s.
    pub fn speeds(&self) -> Vec<f64> {
        speeds(&self.sent)
    }

    /// Speed, acceleration and jerk as differences are within the limits, and the end is reached.
    pub fn assert_kept(&self, what: &str) {
        assert_eq!(self.sent.last(), Some(&self.end_mm));
        self.assert_limits(what);
    }

    /// Speed, acceleration and jerk as differences are within the limits.
    pub fn assert_limits(&self, what: &str) {
        let [speed, acceleration, jerk] = self.worst();
        assert!(
            speed.0 < 1.0 + 1e-6 && acceleration.0 < 1.0 + 1e-6 && jerk.0 < 1.01,
            "{what}: {:?}",
            self.worst()
        );
    }

    /// The largest share of each limit that was used, and where.
    pub fn worst(&self) -> [(f64, usize); 3] {
        let mut worst = [(0.0f64, 0); 3];
        for axis in 0..2 {
            let at: Vec<f64> = self.sent.iter().map(|s| s[axis]).collect();
            let v = differences(&at);
            let a = differences(&v);
            let j = differences(&a);
            for (worst, (values, limit)) in worst.iter_mut().zip([
                (v, LIMITS.speed),
                (a, LIMITS.acceleration),
                (j, LIMITS.jerk),
            ]) {
                for (tick, value) in values.iter().enumerate() {
                    if value.abs() / limit > worst.0 {
                        *worst = (value.abs() / limit, tick);
                    }
                }
            }
        }
        worst
    }
}

fn speeds(sent: &[[f64; 2]]) -> Vec<f64> {
    sent.windows(2)
        .map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]) / PERIOD_S)
        .collect()
}

fn differences(values: &[f64]) -> Vec<f64> {
    values
        .windows(2)
        .map(|w| (w[1] - w[0]) / PERIOD_S)
        .collect()
}
