//! A sample as a row of 64-bit words, and back.

use tandem_rings::{MachineState, Sample, Switched};
use tandem_sdk::{AxisVector, MAX_AXES, MAX_SIGNALS};

/// Tick, block, line, state with the age of feedback; two positions; feed, sigma, ratio; what is switched, and the phase; signals.
pub const MAX_WORDS: usize = 4 + 2 * MAX_AXES + 3 + SWITCHED_WORDS + MAX_SIGNALS;

/// Outputs, spindle, phase.
const SWITCHED_WORDS: usize = 3;

/// Above so many bits of the state's word stands the age of feedback, in periods.
const AGE_BITS: u32 = 32;

/// The word of a phase that nobody tells: no phase is so long.
const NO_PHASE: u64 = i64::MIN.cast_unsigned();

/// A sample's words; the first [`Shape::words`] count, the rest is zero.
pub type Words = [u64; MAX_WORDS];

/// How many axes and signals a trace has, and whether it has what is switched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    pub axes: usize,
    pub signals: usize,
    /// From format 3 on.
    pub switched: bool,
    /// Whether the word of the state says how old the oldest feedback was. From format 4 on.
    pub aged: bool,
}

impl Shape {
    /// Words of one sample.
    pub fn words(self) -> usize {
        4 + 2 * self.axes + 3 + if self.switched { SWITCHED_WORDS } else { 0 } + self.signals
    }

    /// The word of the command to which the feedback in word `index` belongs; `None` for other words.
    pub fn command_of(self, index: usize) -> Option<usize> {
        let feedback = 4 + self.axes..4 + 2 * self.axes;
        feedback.contains(&index).then(|| index - self.axes)
    }

    /// The words of a sample.
    pub fn to_words(self, sample: &Sample, signals: &[f64]) -> Words {
        let ages = sample.age_periods[..self.axes].iter();
        let age = u64::from(ages.max().copied().unwrap_or(0)) * u64::from(self.aged);
        let numbers = [
            sample.tick,
            sample.block,
            u64::from(sample.line),
            sample.state as u64 | age << AGE_BITS,
        ];
        let positions = sample.command.0[..self.axes]
            .iter()
            .chain(&sample.feedback.0[..self.axes]);
        let rates = [sample.feed_mm_per_s, sample.sigma, sample.ratio];
        let switched = [
            sample.switched.outputs,
            sample.switched.spindle_rad_per_s.to_bits(),
            sample.phase_ns.map_or(NO_PHASE, i64::cast_unsigned),
        ];
        let switched = switched
            .into_iter()
            .take(if self.switched { SWITCHED_WORDS } else { 0 });
        let bits = |value: &f64| value.to_bits();
        let all = numbers.into_iter().chain(positions.chain(&rates).map(bits));
        let all = all.chain(switched).chain(signals.iter().map(bits));
        let mut words = [0; MAX_WORDS];
        for (to, from) in words.iter_mut().zip(all) {
            *to = from;
        }
        words
    }

    /// The sample and the signals of a row of words; `None` where they are those of no sample.
    pub fn to_sample(self, words: &Words) -> Option<(Sample, [f64; MAX_SIGNALS])> {
        let age = (words[3] >> AGE_BITS) as u32;
        if age > 0 && !self.aged {
            return None;
        }
        let state = words[3] as u32;
        let mut words_left = words[4..].iter().copied();
        let mut take = |count: usize| {
            let mut values = [0; MAX_AXES];
            values
                .iter_mut()
                .take(count)
                .for_each(|value| *value = words_left.next().unwrap_or_default());
            values
        };
        let command = take(self.axes).map(f64::from_bits);
        let feedback = take(self.axes).map(f64::from_bits);
        let [feed_mm_per_s, sigma, ratio, ..] = take(3).map(f64::from_bits);
        let [outputs, spindle, phase, ..] = if self.switched {
            take(SWITCHED_WORDS)
        } else {
            [0, 0, NO_PHASE, 0, 0, 0, 0, 0]
        };
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
            switched: Switched {
                outputs,
                spindle_rad_per_s: f64::from_bits(spindle),
                ..Switched::default()
            },
            age_periods: std::array::from_fn(|axis| if axis < self.axes { age } else { 0 }),
            phase_ns: (phase != NO_PHASE).then_some(phase.cast_signed()),
            ..Sample::default()
        };
        // A number that is no state's would have become another state.
        (sample.state as u32 == state).then(|| (sample, take(self.signals).map(f64::from_bits)))
    }
}

// `take` hands out both positions and signals.
const _: () = assert!(MAX_AXES == MAX_SIGNALS);

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(axes: usize) -> Shape {
        Shape {
            axes,
            signals: 0,
            switched: true,
            aged: true,
        }
    }

    /// What is nearly equal is stored as the difference, which is short: the feedback of an axis beside its own command.
    #[test]
    fn a_feedback_is_stored_beside_the_command_of_its_axis() {
        for axes in 1..=MAX_AXES {
            let words = 0..shape(axes).words();
            let found: Vec<_> = words
                .filter_map(|word| shape(axes).command_of(word).map(|command| (word, command)))
                .collect();
            let expected: Vec<_> = (0..axes).map(|axis| (4 + axes + axis, 4 + axis)).collect();
            assert_eq!(found, expected, "{axes} axes");
        }
    }

    /// The age is that of the oldest, and belongs to the axes that there are.
    #[test]
    fn the_age_of_the_oldest_feedback_comes_back_for_every_axis_there_is() {
        for axes in 1..MAX_AXES {
            let mut sample = Sample::default();
            sample.age_periods[axes - 1] = 3;
            sample.age_periods[axes] = 9;
            let (read, _) = shape(axes)
                .to_sample(&shape(axes).to_words(&sample, &[]))
                .unwrap();
            let expected: [u32; MAX_AXES] =
                std::array::from_fn(|axis| if axis < axes { 3 } else { 0 });
            assert_eq!(read.age_periods, expected, "{axes} axes");
        }
    }
}
