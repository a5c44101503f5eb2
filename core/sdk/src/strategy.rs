//! The feed-strategy contract: the samples of one rough period in, a feed ratio out.

use crate::abi::layout::layout;

use crate::{Axes, AxisVector, MAX_ANALOG, MAX_AXES, PluginError, Slice};

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
}

layout!(StrategyContext {
    axis_count,
    axes,
    fine_period_s,
    rough_period_s,
    max_feed_ratio,
    joints_are_axes
});

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
/// steady state. The ratio made from the samples of rough period k takes effect at the first tick of period k + 2.
pub trait FeedStrategy: Send {
    /// Names of the signals, at most [`MAX_SIGNALS`], lower case with underscores and a unit.
    fn signals(&self) -> &'static [&'static str] {
        &[]
    }

    /// How fast the ratio changes at most, 1/s: what the strategy promises of itself, and the conformance kit judges.
    fn max_ratio_change_per_s(&self) -> f64 {
        f64::INFINITY
    }

    /// The answer for one rough period.
    ///
    /// # Errors
    /// A defect of the strategy: the machine comes to a controlled stop and names it.
    fn update(&mut self, window: &Window) -> Result<Answer, PluginError>;
}
