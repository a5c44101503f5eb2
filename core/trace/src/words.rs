//! A sample as a row of 64-bit words, and back.

use tandem_rings::{MachineState, Sample};
use tandem_sdk::{AxisVector, MAX_AXES, MAX_SIGNALS};

/// Tick, block, line, state; two positions; feed, sigma, ratio; signals.
pub const MAX_WORDS: usize = 4 + 2 * MAX_AXES + 3 + MAX_SIGNALS;

/// A sample's words; the first [`Shape::words`] count, the rest is zero.
pub type Words = [u64; MAX_WORDS];

/// How many axes and signals a trace has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    pub axes: usize,
    pub signals: usize,
}

impl Shape {
    /// Words of one sample.
    pub fn words(self) -> usize {
        4 + 2 * self.axes + 3 + self.signals
    }

    /// The word of the command to which the feedback in word `index` belongs; `None` for other words.
    pub fn command_of(self, index: usize) -> Option<usize> {
        let feedback = 4 + self.axes..4 + 2 * self.axes;
        feedback.contains(&index).then(|| index - self.axes)
    }

    /// The words of a sample.
    pub fn to_words(self, sample: &Sample, signals: &[f64]) -> Words {
        let numbers = [sample.tick, sample.block, u64::from(sample.line), sample.state as u64];
        let positions = sample.command.0[..self.axes].iter().chain(&sample.feedback.0[..self.axes]);
        let rates = [sample.feed_mm_per_s, sample.sigma, sample.ratio];
        let floats = positions.chain(&rates).chain(signals).map(|value| value.to_bits());
        let mut words = [0; MAX_WORDS];
        for (to, from) in words.iter_mut().zip(numbers.into_iter().chain(floats)) {
            *to = from;
        }
        words
    }

    /// The sample and the signals of a row of words; `None` where they are those of no sample.
    pub fn to_sample(self, words: &Words) -> Option<(Sample, [f64; MAX_SIGNALS])> {
        let state = u32::try_from(words[3]).ok()?;
        let mut floats = words[4..].iter().map(|word| f64::from_bits(*word));
        let mut take = |count: usize| {
            let mut values = [0.0; MAX_AXES];
            values.iter_mut().take(count).for_each(|value| *value = floats.next().unwrap_or_default());
            values
        };
        let (command, feedback) = (take(self.axes), take(self.axes));
        let [feed_mm_per_s, sigma, ratio, ..] = take(3);
        let sample = Sample {
            tick: words[0],
            block: words[1],
            line: u32::try_from(words[2]).ok()?,
            state: MachineState::from_number(state),
            command: AxisVector(command),
            feedback: AxisVector(feedback),
            feed_mm_per_s,
            sigma,
            ratio,
            ..Sample::default()
        };
        // A number that is no state's would have become another state.
        (sample.state as u32 == state).then(|| (sample, take(self.signals)))
    }
}

// `take` hands out both positions and signals.
const _: () = assert!(MAX_AXES == MAX_SIGNALS);
