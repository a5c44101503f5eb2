//! The feed-strategy contract: the samples of one rough period in, a feed ratio out.

use crate::abi::layout::layout;

use crate::{
    Axes, AxisLimits, AxisVector, JointDescription, Limits, MAX_ANALOG, MAX_AXES, MAX_DIGITAL,
    Name, PluginError, Slice, Words,
};

/// Most named signals a strategy publishes.
pub const MAX_SIGNALS: usize = 8;

/// One fine period as it happened.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct FineSample {
    /// Number of the fine period since the start of the run.
    pub tick: u64,
    /// Program line that moved.
    pub line: u32,
    /// Position commanded, mm or rad.
    pub command: AxisVector,
    /// Position measured, as the exchange of the period answered it, mm or rad.
    pub position: AxisVector,
    /// Speed measured, of the same answer, mm/s or rad/s.
    pub speed: AxisVector,
    /// Mean motor current over the period that ends with position and speed, A; per joint.
    pub current_a: AxisVector,
    /// Path speed commanded, mm/s.
    pub feed_mm_per_s: f64,
    /// Programmed feed, mm/s.
    pub programmed_feed_mm_per_s: f64,
    /// The operator's feed override, 1 for the programmed feed; 1 too where the program forbids it (M49, M50 P0).
    pub feed_override: f64,
    /// Rate of program time, 0 to 1.
    pub sigma: f64,
    /// Spindle speed measured, rad/s.
    pub spindle_rad_per_s: f64,
    /// Analog inputs, in units that the machine's builder knows.
    pub analog: [f64; MAX_ANALOG],
    /// Digital inputs, bit n is input n.
    pub inputs: u64,
    /// Bit per digital input of which nothing was heard in this period: what [`FineSample::inputs`] says of it is old.
    pub old_inputs: u64,
    /// Age of what was measured of each joint, in fine periods; 0 is new. What is old says nothing of this period.
    pub age_periods: [u32; MAX_AXES],
}

impl FineSample {
    /// Whether something was heard of every joint in this period: observers go on by such samples only. Any loop; does not
    /// allocate.
    pub fn is_new(&self) -> bool {
        self.age_periods == [0; MAX_AXES]
    }
}

layout!(FineSample {
    tick,
    line,
    command,
    position,
    speed,
    current_a,
    feed_mm_per_s,
    programmed_feed_mm_per_s,
    feed_override,
    sigma,
    spindle_rad_per_s,
    analog,
    inputs,
    old_inputs,
    age_periods
});

/// What a strategy is told when it is opened.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct StrategyContext {
    /// Number of axes.
    pub axis_count: u32,
    /// The axes, in the order of all vectors.
    pub axes: Axes,
    /// Fine period, s.
    pub fine_period_s: f64,
    /// Rough period, s.
    pub rough_period_s: f64,
    /// Highest ratio that may be answered.
    pub max_feed_ratio: f64,
    /// 1 where joint i is axis i, so that [`FineSample`]'s speed and current of a joint are those of the axis.
    pub joints_are_axes: u32,
    /// Number of joints: entries of [`FineSample::current_a`] that count.
    pub joint_count: u32,
    /// Limits of the axes, as narrow as the joints make them.
    pub limits: Limits,
    /// The joints, by name and with their limits; the first [`StrategyContext::joint_count`] count.
    pub joints: [JointDescription; MAX_AXES],
    /// Names of the analog inputs, by number; empty where the machine file names none.
    pub analog: [Name; MAX_ANALOG],
    /// Names of the digital inputs, by number; empty where the machine file names none.
    pub inputs: [Name; MAX_DIGITAL],
    /// Fine periods by which [`FineSample::command`] is ahead of what is measured in the same sample, of the joint where they are
    /// most, as the drivers say when their drives are claimed; 0 before.
    pub delay_periods: u32,
}

layout!(StrategyContext {
    axis_count,
    axes,
    fine_period_s,
    rough_period_s,
    max_feed_ratio,
    joints_are_axes,
    joint_count,
    limits,
    joints,
    analog,
    inputs,
    delay_periods
});

impl StrategyContext {
    /// A context for `axes` that are their joints, without limits and named inputs. For tests of strategies; does not allocate.
    pub fn new(axes: Axes, fine_period_s: f64, rough_period_s: f64, max_feed_ratio: f64) -> Self {
        let count = axes.count() as u32;
        let name = |axis: usize| {
            let mut bytes = [0; 4];
            let letter = axes.letter(axis).to_ascii_lowercase();
            Name::new(letter.encode_utf8(&mut bytes))
        };
        let joint = |axis: usize| JointDescription {
            name: if axis < axes.count() {
                name(axis)
            } else {
                Name::new("")
            },
            rotary: u32::from(axis < axes.count() && axes.is_rotary(axis)),
            homing_method: 0,
            homing_torque_percent: f64::INFINITY,
            limits: AxisLimits::unlimited(),
        };
        Self {
            axis_count: count,
            axes,
            fine_period_s,
            rough_period_s,
            max_feed_ratio,
            joints_are_axes: 1,
            joint_count: count,
            limits: Limits {
                count,
                axes: [AxisLimits::unlimited(); MAX_AXES],
            },
            joints: std::array::from_fn(joint),
            analog: [Name::new(""); MAX_ANALOG],
            inputs: [Name::new(""); MAX_DIGITAL],
            delay_periods: 0,
        }
    }

    /// Number of the analog input called `name`, as the machine file names it. Host; does not allocate.
    pub fn analog_input(&self, name: &str) -> Option<usize> {
        place(&self.analog, name)
    }

    /// Number of the digital input called `name`. Host; does not allocate.
    pub fn digital_input(&self, name: &str) -> Option<usize> {
        place(&self.inputs, name)
    }
}

fn place(names: &[Name], name: &str) -> Option<usize> {
    names
        .iter()
        .position(|other| !name.is_empty() && other.as_str() == name)
}

/// One rough period.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Window<'a> {
    /// Number of the rough period since the start of the run.
    pub period: u64,
    samples: Slice<'a, FineSample>,
}

layout!(Window<'a> { period, samples });

impl<'a> Window<'a> {
    /// The window of rough period `period` with all its fine samples.
    pub fn new(period: u64, samples: &'a [FineSample]) -> Self {
        Self {
            period,
            samples: Slice::new(samples),
        }
    }

    /// Every fine sample of the period, in order.
    pub fn samples(&self) -> &'a [FineSample] {
        self.samples.get()
    }
}

/// What a strategy asks for beside the ratio.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub enum Request {
    /// Nothing.
    #[default]
    None,
    /// A feed hold, on the path.
    Hold,
    /// A fault with a code of the strategy's own.
    Fault(u32),
}

/// A strategy's answer for one rough period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Answer {
    /// Feed ratio asked for: at most `ratio × programmed feed` is driven.
    pub ratio: f64,
    /// What else is asked for.
    pub request: Request,
    /// Values of the named signals, in the order of [`FeedStrategy::signals`].
    pub signals: [f64; MAX_SIGNALS],
}

impl Answer {
    /// An answer that asks for `ratio` and nothing else.
    pub fn of_ratio(ratio: f64) -> Self {
        Self {
            ratio,
            request: Request::None,
            signals: [0.0; MAX_SIGNALS],
        }
    }

    /// The same with the values of the named signals; what is beyond [`MAX_SIGNALS`] is left out.
    #[must_use]
    pub fn with_signals(mut self, values: &[f64]) -> Self {
        for (signal, value) in self.signals.iter_mut().zip(values) {
            *signal = *value;
        }
        self
    }
}

/// Adapts the feed to what the machine feels. Called once a rough period, on the rough loop; allocates nothing in a
/// steady state. The ratio made from the samples of rough period k takes effect from the first tick of period k + 2 on,
/// and in full at the end of that period: in between it is led over evenly from the one before.
pub trait FeedStrategy: Send {
    /// Names of the signals, at most [`MAX_SIGNALS`], lower case with underscores and a unit.
    fn signals(&self) -> &'static [&'static str] {
        &[]
    }

    /// How fast the ratio changes at most, 1/s: what the strategy promises of itself, and the conformance kit judges.
    fn max_ratio_change_per_s(&self) -> f64 {
        f64::INFINITY
    }

    /// Whether the ratio that is answered counts an operator's feed override above 1 already, as bounds that are feeds and not
    /// ratios ask for: then [`FineSample::feed_override`] raises the feed by that ratio alone. One below 1 slows down by itself,
    /// in the next fine period, and so does any where the program switches strategies off (M52 P0). Asked once.
    fn takes_override(&self) -> bool {
        false
    }

    /// Why the last answer asks for a hold or a fault, in words; empty where the signals say it all. Asked after such an answer
    /// alone; may allocate.
    fn explain(&self) -> Words {
        Words::default()
    }

    /// The answer for one rough period.
    ///
    /// # Errors
    /// A defect of the strategy: the machine comes to a controlled stop and names it.
    fn update(&mut self, window: &Window) -> Result<Answer, PluginError>;
}
