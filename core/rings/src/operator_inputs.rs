//! The operator's commands as one fine period takes them.

use std::sync::atomic::Ordering::Relaxed;

use crate::Controls;

/// What the operator asks for. The fine loop reads it once, at the start of a period, so that the sample of that period
/// says what acted in it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::struct_excessive_bools)] // independent keys and switches of a panel
pub struct OperatorInputs {
    /// Feed override, 1 for the programmed feed.
    pub feed_override: f64,
    /// Rapid override, 1 for the machine's rapid feed.
    pub rapid_override: f64,
    /// Feed hold.
    pub hold: bool,
    /// The program waits for the operator.
    pub program_hold: bool,
    /// Optional stop.
    pub optional_stop: bool,
    /// Single block.
    pub single_block: bool,
    /// Emergency stop.
    pub emergency_stop: bool,
    /// Abort, until the machine rests.
    pub abort: bool,
}

impl OperatorInputs {
    /// What `controls` hold now. Any loop; does not allocate.
    #[inline]
    pub fn of(controls: &Controls) -> Self {
        Self {
            feed_override: controls.feed_override.load(),
            rapid_override: controls.rapid_override.load(),
            hold: controls.hold.load(Relaxed),
            program_hold: controls.program_hold.load(Relaxed),
            optional_stop: controls.optional_stop.load(Relaxed),
            single_block: controls.single_block.load(Relaxed),
            emergency_stop: controls.emergency_stop.load(Relaxed),
            abort: controls.abort.load(Relaxed),
        }
    }
}

impl Default for OperatorInputs {
    /// Nothing is asked for.
    fn default() -> Self {
        Self::of(&Controls::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_input_is_that_of_its_own_key() {
        let nothing = OperatorInputs::default();
        assert_eq!((nothing.feed_override, nothing.rapid_override), (1.0, 1.0));
        let controls = Controls::default();
        controls.feed_override.store(0.5);
        controls.rapid_override.store(0.25);
        let slowed = OperatorInputs {
            feed_override: 0.5,
            rapid_override: 0.25,
            ..nothing
        };
        assert_eq!(OperatorInputs::of(&controls), slowed);
        let keys = [
            &controls.hold,
            &controls.program_hold,
            &controls.optional_stop,
            &controls.single_block,
            &controls.emergency_stop,
            &controls.abort,
        ];
        for (number, key) in keys.iter().enumerate() {
            key.store(true, Relaxed);
            let seen = OperatorInputs::of(&controls);
            let seen = [
                seen.hold,
                seen.program_hold,
                seen.optional_stop,
                seen.single_block,
                seen.emergency_stop,
                seen.abort,
            ];
            assert_eq!(seen, std::array::from_fn(|other| other == number));
            key.store(false, Relaxed);
        }
    }
}
