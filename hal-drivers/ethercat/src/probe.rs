//! A touch probe of a drive: 60B8 arms it, 60B9 says what it caught, 60BA to 60BD where.

use tandem_sdk::Arm;

use crate::options::ProbeOptions;

const ENABLE: u16 = 0x01;
const FUNCTION_RISING: u16 = 0x10;
const FUNCTION_FALLING: u16 = 0x20;
const CAUGHT_RISING: u16 = 0x02;
const CAUGHT_FALLING: u16 = 0x04;
const ANY: u16 = 0x07;

/// Edges as [`Arm`] has them.
const RISING: u32 = 1;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Nothing is awaited, or what was caught before is still shown.
    Off,
    /// An edge is awaited.
    Armed(u32),
    /// It was caught, and the host still asks for it.
    Caught(u32),
}

/// One touch probe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probe {
    input: u32,
    shift: u32,
    phase: Phase,
    /// Whether the drive shows neither an awaited edge nor a caught one.
    clear: bool,
}

impl Probe {
    pub(crate) fn new(options: ProbeOptions) -> Self {
        Self {
            input: options.input,
            shift: if options.latch == 2 { 8 } else { 0 },
            phase: Phase::Off,
            clear: true,
        }
    }

    /// Objects of the positions at the rising and at the falling edge.
    pub(crate) fn objects(latch: u8) -> [u16; 2] {
        if latch == 2 {
            [0x60BC, 0x60BD]
        } else {
            [0x60BA, 0x60BB]
        }
    }

    /// The function that it is told in this period: what it caught before is put away first, so that an edge is never told twice.
    pub(crate) fn function(&mut self, arm: Arm) -> u16 {
        let edge = if arm.input == self.input { arm.edge } else { 0 };
        self.phase = match self.phase {
            Phase::Armed(awaited) | Phase::Caught(awaited) if awaited != edge => Phase::Off,
            Phase::Off if edge != 0 && self.clear => Phase::Armed(edge),
            phase => phase,
        };
        match self.phase {
            Phase::Off => 0,
            Phase::Armed(edge) | Phase::Caught(edge) => {
                (ENABLE
                    | if edge == RISING {
                        FUNCTION_RISING
                    } else {
                        FUNCTION_FALLING
                    })
                    << self.shift
            }
        }
    }

    /// Takes in its status and the positions of both edges; input, edge and position of one that was awaited and has come.
    pub(crate) fn answer(&mut self, status: u16, positions: [i32; 2]) -> Option<(u32, u32, i32)> {
        let status = status >> self.shift & ANY;
        self.clear = status == 0;
        let Phase::Armed(edge) = self.phase else {
            return None;
        };
        let (caught, position) = if edge == RISING {
            (CAUGHT_RISING, positions[0])
        } else {
            (CAUGHT_FALLING, positions[1])
        };
        if status & caught == 0 {
            return None;
        }
        self.phase = Phase::Caught(edge);
        Some((self.input, edge, position))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Arm = Arm { input: 3, edge: 1 };

    #[test]
    fn an_edge_is_told_once_and_what_is_left_of_one_before_is_none() {
        let mut probe = Probe::new(ProbeOptions { input: 3, latch: 2 });
        assert_eq!(probe.function(Arm::default()), 0);
        // The drive still shows an edge that nobody awaits.
        assert_eq!(probe.answer(0x0300, [7, 8]), None);
        assert_eq!(probe.function(UP), 0);
        assert_eq!(probe.answer(0x0000, [7, 8]), None);
        assert_eq!(probe.function(UP), 0x1100);
        assert_eq!(probe.answer(0x0100, [7, 8]), None);
        assert_eq!(probe.answer(0x0300, [9, 8]), Some((3, 1, 9)));
        assert_eq!(
            (probe.function(UP), probe.answer(0x0300, [9, 8])),
            (0x1100, None)
        );
        assert_eq!(probe.function(Arm { input: 2, edge: 1 }), 0);
    }
}
