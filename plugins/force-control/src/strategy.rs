//! The strategy: samples of a rough period in, a feed ratio out.

use tandem_sdk::{
    Answer, Axes, FeedStrategy, FineSample, MAX_SIGNALS, PluginError, Request, StrategyContext,
    Window,
};

use crate::axis::AxisLoad;
use crate::conversion::resultant_nm;
use crate::engagement::{Engagement, Tool};
use crate::guard::Guard;
use crate::law::{FeedLaw, RateLimit};
use crate::mean::window;
use crate::options::{Mode, Options};

/// Names of the signals, in the order of [`Answer::signals`].
const SIGNALS: [&str; 6] = [
    "torque_nm",
    "reference_nm",
    "force_n",
    "asked_feed_mm_per_min",
    "asked_ratio",
    "tool",
];

/// The value of the signal `tool` in the rough period in which the guard trips.
const TRIPPED: f64 = 4.0;

/// Share of the feed asked for that counts as driven.
const DRIVEN_SHARE: f64 = 0.95;

/// Rough periods after which the guard counts again though nothing came to rest.
const LONGEST_HOLD: u32 = 50;

/// Holds a cutting torque by the feed.
pub struct ForceControl {
    options: Options,
    axes: Vec<AxisLoad>,
    law: FeedLaw,
    limit: RateLimit,
    guard: Guard,
    engagement: Engagement,
    per_rough: f64,
    fine_period_s: f64,
    max_ratio: f64,
    last_tick: Option<u64>,
    /// Rough periods until a trip of the guard counts again, while its hold is under way.
    holding: u32,
    /// Highest feed from which a cut may begin after the guard has tripped, mm/s.
    entry_cap_mm_per_s: f64,
    /// Feeds asked for and not yet in force, the one in force last.
    asked_mm_per_s: [f64; 3],
    programmed_mm_per_s: f64,
}

/// What a window says beside the torques.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Mean path speed commanded, mm/s.
    feed_mm_per_s: f64,
    spindle_rad_per_s: f64,
    tripped: bool,
}

impl ForceControl {
    /// A strategy at rest. Allocates.
    ///
    /// # Errors
    /// Options that make no sense on this machine, or a loop that is not stable.
    pub fn open(options: &Options, context: &StrategyContext) -> Result<Self, PluginError> {
        options.check(context)?;
        Ok(Self::new(options.clone(), context))
    }

    fn new(options: Options, context: &StrategyContext) -> Self {
        let index = |letter: &str| {
            letter
                .chars()
                .next()
                .and_then(|c| index_of(&context.axes, c))
        };
        let time_constant_s = options.observer_time_constant_ms * 1e-3;
        let axes = options.axes.iter().filter_map(|(letter, axis)| {
            Some(AxisLoad::new(
                index(letter)?,
                axis,
                context.fine_period_s,
                time_constant_s,
            ))
        });
        let bounds = options.bounds();
        let step_mm_per_s = options.feed_change_mm_per_s2 * context.rough_period_s;
        Self {
            axes: axes.collect(),
            law: FeedLaw::new(options.law(), bounds, bounds.min_mm_per_s),
            limit: RateLimit::new(step_mm_per_s, bounds.min_mm_per_s),
            guard: Guard::new(options.guard_torque_nm(), options.guard_samples),
            engagement: Engagement::new(options.air_torque_nm()),
            per_rough: (context.rough_period_s / context.fine_period_s).round(),
            fine_period_s: context.fine_period_s,
            max_ratio: context.max_feed_ratio,
            last_tick: None,
            holding: 0,
            entry_cap_mm_per_s: f64::INFINITY,
            asked_mm_per_s: [0.0; 3],
            programmed_mm_per_s: 0.0,
            options,
        }
    }

    /// Observers and guard, for one fine sample.
    fn sample(&mut self, sample: &FineSample) -> bool {
        let programmed = sample.programmed_feed_mm_per_s;
        if programmed.is_finite() && programmed > 0.0 {
            self.programmed_mm_per_s = programmed;
        }
        // What is old says nothing of this period: the observers go on behind it, as where a sample is missing.
        if !sample.is_new() {
            return false;
        }
        let follows = self
            .last_tick
            .replace(sample.tick)
            .is_some_and(|last| sample.tick == last + 1);
        for axis in &mut self.axes {
            axis.step(sample, follows);
        }
        let now_nm = resultant_nm(
            self.axes
                .iter()
                .map(|axis| (axis.torque_nm, axis.force_per_torque_per_m)),
        );
        self.guard.trips(now_nm)
    }

    fn samples(&mut self, samples: &[FineSample]) -> Motion {
        let mut motion = Motion::default();
        for sample in samples {
            motion.tripped |= self.sample(sample);
            motion.feed_mm_per_s += sample.feed_mm_per_s / samples.len() as f64;
            motion.spindle_rad_per_s = sample.spindle_rad_per_s;
        }
        self.hold(&mut motion);
        motion
    }

    /// One hold for one event: the torque swings while the axes stop.
    fn hold(&mut self, motion: &mut Motion) {
        let bounds = self.options.bounds();
        if motion.feed_mm_per_s == 0.0 {
            // Nothing is left to be held; what moves next is guarded anew.
            (motion.tripped, self.holding) = (false, 0);
            self.guard.restart();
        } else if self.holding > 0 {
            motion.tripped = false;
            self.holding -= 1;
        } else if motion.tripped {
            self.holding = LONGEST_HOLD;
            // Resumed in the same material, the torque is to be the reference.
            self.entry_cap_mm_per_s =
                motion.feed_mm_per_s * bounds.reference_nm / self.options.guard_torque_nm();
        }
    }

    /// Mean torque over whole tooth periods where they are known, N·m.
    fn mean_nm(&self, spindle_rad_per_s: f64) -> f64 {
        let teeth_per_s = self
            .options
            .teeth
            .map(|teeth| f64::from(teeth) * spindle_rad_per_s.abs() / std::f64::consts::TAU);
        let tooth = teeth_per_s
            .filter(|rate| *rate > 0.0)
            .map(|rate| 1.0 / (rate * self.fine_period_s));
        let samples = window(self.per_rough, tooth);
        // Each axis is averaged before the resultant: the size of a vector never averages its noise to zero.
        resultant_nm(
            self.axes
                .iter()
                .map(|axis| (axis.mean_nm(samples), axis.force_per_torque_per_m)),
        )
    }

    /// The feed to ask for, mm/s.
    fn target(&mut self, motion: &Motion, torque_nm: f64) -> f64 {
        let programmed = self.programmed_mm_per_s;
        let in_force = self.asked_mm_per_s[2];
        let moving = motion.feed_mm_per_s > 0.01 * in_force.min(programmed);
        let stated = |feed: Option<f64>| feed.map_or(programmed, |mm_per_min| mm_per_min / 60.0);
        let bounds = self.options.bounds();
        let entry = stated(self.options.entry_feed_mm_per_min).min(self.entry_cap_mm_per_s);
        let entry = entry.clamp(bounds.min_mm_per_s, bounds.max_mm_per_s);
        self.law.set_max(self.max_ratio * programmed);
        if self.engagement.update(moving, torque_nm) {
            let feed = entry.min(motion.feed_mm_per_s);
            self.law.restart(programmed, torque_nm, feed);
            // The law keeps its bounds, also where the axes come from rest or from a faster block.
            self.limit.restart(self.law.feed_mm_per_s());
            return self.law.feed_mm_per_s();
        }
        match self.engagement.tool {
            // The governor sees to a smooth start: there is nothing to be limited from.
            Tool::Standing => {
                self.limit.restart(entry);
                entry
            }
            Tool::Entering => entry,
            Tool::Air => {
                self.entry_cap_mm_per_s = f64::INFINITY;
                stated(self.options.air_feed_mm_per_min)
            }
            Tool::Cutting => {
                let may_rise = motion.feed_mm_per_s >= DRIVEN_SHARE * in_force;
                self.law.next(programmed, torque_nm, may_rise)
            }
        }
    }

    /// The torque as signals, and a ratio of 1: what is asked for is the programmed feed.
    fn observed(&mut self, motion: &Motion, torque_nm: f64) -> Answer {
        self.engagement
            .update(motion.feed_mm_per_s > 0.0, torque_nm);
        Answer::of_ratio(1.0).with_signals(&[
            torque_nm,
            self.options.reference_nm(),
            self.force_n(torque_nm),
            self.programmed_mm_per_s * 60.0,
            1.0,
            self.engagement.tool.number(),
        ])
    }

    /// The cutting force in the direction of the first axis, N.
    fn force_n(&self, torque_nm: f64) -> f64 {
        let first = self.axes.first();
        first.map_or(0.0, |axis| axis.force_per_torque_per_m) * torque_nm
    }

    fn answer(&mut self, motion: &Motion) -> Answer {
        let torque_nm = self.mean_nm(motion.spindle_rad_per_s);
        if self.options.mode == Mode::Observe {
            return self.observed(motion, torque_nm);
        }
        let target = self.target(motion, torque_nm);
        let bounds = self.options.bounds();
        let feed = self
            .limit
            .next(target.clamp(bounds.min_mm_per_s, bounds.max_mm_per_s));
        let programmed = self.programmed_mm_per_s;
        let ratio = if programmed > 0.0 {
            (feed / programmed).min(self.max_ratio)
        } else {
            1.0
        };
        self.asked_mm_per_s = [feed, self.asked_mm_per_s[0], self.asked_mm_per_s[1]];
        let force_n = self.force_n(torque_nm);
        let tool = if motion.tripped {
            TRIPPED
        } else {
            self.engagement.tool.number()
        };
        let mut signals = [0.0; MAX_SIGNALS];
        let values = [
            torque_nm,
            bounds.reference_nm,
            force_n,
            feed * 60.0,
            ratio,
            tool,
        ];
        signals[..values.len()].copy_from_slice(&values);
        Answer {
            ratio,
            request: if motion.tripped {
                Request::Hold
            } else {
                Request::None
            },
            signals,
        }
    }
}

/// The index of an axis, whatever the case of its letter.
fn index_of(axes: &Axes, letter: char) -> Option<usize> {
    axes.index(letter.to_ascii_uppercase())
}

impl FeedStrategy for ForceControl {
    fn signals(&self) -> &'static [&'static str] {
        &SIGNALS
    }

    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        let motion = self.samples(window.samples());
        Ok(self.answer(&motion))
    }
}
