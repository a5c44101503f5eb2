//! The strategy: samples of a rough period in, a feed ratio out.

use tandem_sdk::{
    Answer, Axes, FeedStrategy, FineSample, MAX_AXES, MAX_SIGNALS, PluginError, Request,
    StrategyContext, Window, Words,
};

use crate::axis::{AxisLoad, Sampling};
use crate::conversion::resultant_nm;
use crate::engagement::{Engagement, Tool};
use crate::guard::Guard;
use crate::law::{FeedLaw, RateLimit};
use crate::mean::window;
use crate::options::{Mode, Options};

/// Names of the signals, in the order of [`Answer::signals`].
const SIGNALS: [&str; 7] = [
    "torque_nm",
    "reference_nm",
    "force_n",
    "asked_feed_mm_per_min",
    "tool",
    "friction_ratio",
    "inertia_kg_m2",
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
    /// Torque of the last sample, N·m.
    now_nm: f64,
    engagement: Engagement,
    per_rough: f64,
    fine_period_s: f64,
    max_ratio: f64,
    last_tick: Option<u64>,
    /// Rough periods until a trip of the guard counts again, while its hold is under way.
    holding: u32,
    /// Highest feed from which a cut may begin after the guard has tripped, mm/s.
    entry_cap_mm_per_s: f64,
    /// Highest torque of the rough period in which the guard tripped last, N·m.
    tripped_nm: f64,
    /// Feeds asked for and not yet in force, the one in force last.
    asked_mm_per_s: [f64; 3],
    programmed_mm_per_s: f64,
    /// The operator's feed override where it is above 1: it raises the programmed feed that the law begins from.
    raised: f64,
    /// The same as the law heard it last.
    law_raised: f64,
    /// All axes run in air, as far as the rough period before said.
    in_air: bool,
    rapid: bool,
}

/// What a window says beside the torques.
#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Mean path speed commanded, mm/s.
    feed_mm_per_s: f64,
    spindle_rad_per_s: f64,
    tripped: bool,
    /// Highest torque of its samples, N·m.
    max_nm: f64,
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
        let sampling = Sampling {
            period_s: context.fine_period_s,
            time_constant_s: options.observer_time_constant_ms * 1e-3,
            delay_periods: context.delay_periods,
            lag_s: 1.0 / options.stability.position_gain_per_s,
        };
        let axes = options.axes.iter().filter_map(|(letter, axis)| {
            Some(AxisLoad::new(
                index(letter)?,
                axis,
                &options.learning,
                sampling,
            ))
        });
        let bounds = options.bounds();
        let step_mm_per_s = options.feed_change_mm_per_s2 * context.rough_period_s;
        Self {
            axes: axes.collect(),
            law: FeedLaw::new(options.law(), bounds, bounds.min_mm_per_s),
            limit: RateLimit::new(step_mm_per_s, bounds.min_mm_per_s),
            now_nm: 0.0,
            guard: Guard::new(options.guard_torque_nm(), options.guard_samples),
            engagement: Engagement::new(options.air_torque_nm()),
            per_rough: (context.rough_period_s / context.fine_period_s).round(),
            fine_period_s: context.fine_period_s,
            max_ratio: context.max_feed_ratio,
            last_tick: None,
            holding: 0,
            entry_cap_mm_per_s: f64::INFINITY,
            tripped_nm: 0.0,
            asked_mm_per_s: [0.0; 3],
            programmed_mm_per_s: 0.0,
            raised: 1.0,
            law_raised: 1.0,
            in_air: false,
            rapid: false,
            options,
        }
    }

    /// Observers and guard, for one fine sample.
    fn sample(&mut self, sample: &FineSample) -> bool {
        let programmed = sample.programmed_feed_mm_per_s;
        if programmed.is_finite() && programmed > 0.0 {
            self.programmed_mm_per_s = programmed;
        }
        self.rapid = programmed.is_infinite();
        self.raised = sample.feed_override.max(1.0);
        // What is old says nothing of this period: the observers go on behind it, as where a sample is missing.
        if !sample.is_new() {
            return false;
        }
        let follows = self
            .last_tick
            .replace(sample.tick)
            .is_some_and(|last| sample.tick == last + 1);
        for axis in &mut self.axes {
            axis.step(sample, follows, self.in_air);
        }
        let now_nm = resultant_nm(
            self.axes
                .iter()
                .map(|axis| (axis.torque_nm, axis.force_per_torque_per_m)),
        );
        self.now_nm = now_nm;
        self.guard.trips(now_nm)
    }

    fn samples(&mut self, samples: &[FineSample]) -> Motion {
        let mut motion = Motion::default();
        for sample in samples {
            motion.tripped |= self.sample(sample);
            motion.max_nm = motion.max_nm.max(self.now_nm);
            motion.feed_mm_per_s += sample.feed_mm_per_s / samples.len() as f64;
            motion.spindle_rad_per_s = sample.spindle_rad_per_s;
        }
        self.learn(samples.iter().all(FineSample::is_new));
        self.hold(&mut motion);
        motion
    }

    /// What the rough period that ends says of friction and inertia, where it was heard whole.
    fn learn(&mut self, whole: bool) {
        let mut means = [[0.0; 3]; MAX_AXES];
        for (axis, means) in self.axes.iter_mut().zip(&mut means) {
            *means = axis.end_period();
        }
        let rapid = self.rapid;
        self.in_air = whole && self.axes.iter().all(|axis| axis.is_in_air(rapid));
        for (axis, means) in self.axes.iter_mut().zip(means) {
            axis.learn(self.in_air, means);
        }
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
            self.tripped_nm = motion.max_nm;
            // Resumed in the same material, the torque is to be the reference.
            let torque_nm = motion.max_nm.max(self.options.guard_torque_nm());
            self.entry_cap_mm_per_s = motion.feed_mm_per_s * bounds.reference_nm / torque_nm;
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
        let entered = self.programmed_mm_per_s;
        let programmed = self.raised * entered;
        let changed = std::mem::replace(&mut self.law_raised, self.raised) != self.raised;
        let in_force = self.asked_mm_per_s[2];
        let moving = motion.feed_mm_per_s > 0.01 * in_force.min(entered);
        let stated = |feed: Option<f64>, unstated: f64| feed.map_or(unstated, |feed| feed / 60.0);
        let bounds = self.options.bounds();
        // An override does not make a tool enter faster than programmed.
        let entry = stated(self.options.entry_feed_mm_per_min, entered);
        let entry = entry
            .min(self.entry_cap_mm_per_s)
            .clamp(bounds.min_mm_per_s, bounds.max_mm_per_s);
        self.law.set_max(self.max_ratio * entered);
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
                stated(self.options.air_feed_mm_per_min, programmed)
            }
            Tool::Cutting => {
                if changed {
                    // A step of the operator's is none of the cut: the law goes on from what it asks for.
                    let feed_mm_per_s = self.law.feed_mm_per_s();
                    self.law.restart(programmed, torque_nm, feed_mm_per_s);
                }
                let may_rise = motion.feed_mm_per_s >= DRIVEN_SHARE * in_force;
                self.law.next(programmed, torque_nm, may_rise)
            }
        }
    }

    /// The torque as signals, and a ratio of 1: what is asked for is the programmed feed.
    fn observed(&mut self, motion: &Motion, torque_nm: f64) -> Answer {
        self.engagement
            .update(motion.feed_mm_per_s > 0.0, torque_nm);
        let asked = (self.programmed_mm_per_s, self.engagement.tool.number());
        Answer::of_ratio(1.0).with_signals(&self.signals_of(torque_nm, asked))
    }

    /// The signals beside the feed asked for, mm/s, and where the tool is.
    fn signals_of(&self, torque_nm: f64, (feed_mm_per_s, tool): (f64, f64)) -> [f64; MAX_SIGNALS] {
        let learned = self.axes.first().map_or((1.0, 0.0), AxisLoad::learned);
        [
            torque_nm,
            self.options.reference_nm(),
            self.force_n(torque_nm),
            feed_mm_per_s * 60.0,
            tool,
            learned.0,
            learned.1,
            0.0,
        ]
    }

    /// The cutting force in the direction of the first axis, N.
    fn force_n(&self, torque_nm: f64) -> f64 {
        let first = self.axes.first();
        first.map_or(0.0, |axis| axis.force_per_torque_per_m) * torque_nm
    }

    fn answer(&mut self, motion: &Motion) -> Answer {
        let torque_nm = self.mean_nm(motion.spindle_rad_per_s);
        if self.options.mode() == Mode::Observe {
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
        let tool = if motion.tripped {
            TRIPPED
        } else {
            self.engagement.tool.number()
        };
        Answer {
            ratio,
            request: if motion.tripped {
                Request::Hold
            } else {
                Request::None
            },
            signals: self.signals_of(torque_nm, (feed, tool)),
        }
    }
}

/// The index of an axis, whatever the case of its letter.
fn index_of(axes: &Axes, letter: char) -> Option<usize> {
    axes.index(letter.to_ascii_uppercase())
}

impl FeedStrategy for ForceControl {
    fn signals(&self) -> &'static [&'static str] {
        // A trace has room for 8 with those of the driver.
        if self.options.learning.inertia_signal {
            &SIGNALS
        } else {
            &SIGNALS[..6]
        }
    }

    fn explain(&self) -> Words {
        let (max_nm, level_nm) = (self.tripped_nm, self.options.guard_torque_nm());
        Words::new(format!(
            "{max_nm:.4} N·m is above the guard's {level_nm:.4} N·m"
        ))
    }

    fn takes_override(&self) -> bool {
        self.options.mode() == Mode::Control
    }

    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        let motion = self.samples(window.samples());
        Ok(self.answer(&motion))
    }
}
