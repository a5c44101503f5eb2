//! Where the path has come to.

use tandem_sdk::AxisVector;

/// Moves below this, mm or rad, are the rounding of offsets and no motion.
pub(crate) const NO_MOVE: f64 = 1e-10;

/// The end of the path so far, and how much is known of it.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    /// The programmed position, machine coordinates, mm or rad.
    pub position: AxisVector,
    /// Where the last block ended: the programmed position but for moves too short to be blocks.
    pub last_end: AxisVector,
    /// Bit per axis whose position an erroneous line has left unknown.
    pub uncertain: u32,
    /// Bit per axis whose position follows from what the first pass has assumed: the answers of probes and inputs.
    pub assumed: u32,
    /// Number of the next block.
    pub next_index: u64,
    /// The last block was rest, or there was none.
    pub at_rest: bool,
    /// The axis words of the current line have been used up.
    pub moved: bool,
    /// Axes whose position was assumed before the current line.
    pub assumed_start: u32,
}

impl Path {
    pub fn new(start: AxisVector) -> Self {
        Self {
            position: start,
            last_end: start,
            uncertain: 0,
            assumed: 0,
            next_index: 0,
            at_rest: true,
            moved: false,
            assumed_start: 0,
        }
    }

    /// Before a line is read.
    #[inline]
    pub fn begin_line(&mut self) {
        self.moved = false;
        self.assumed_start = self.assumed;
    }

    /// The machine really stands at rest at `position`.
    pub fn set(&mut self, position: AxisVector) {
        self.position = position;
        self.last_end = position;
        self.uncertain = 0;
        self.assumed = 0;
        self.at_rest = true;
    }

    /// A block ends at `end`.
    #[inline]
    pub fn advance_to(&mut self, end: AxisVector) {
        self.last_end = end;
        self.next_index += 1;
        self.at_rest = false;
    }

    /// Where the next block ends: the programmed position, but for moves that are none.
    #[inline]
    pub fn block_end(&self) -> AxisVector {
        let (from, to) = (&self.last_end, &self.position);
        AxisVector(std::array::from_fn(|i| {
            if (to[i] - from[i]).abs() < NO_MOVE {
                from[i]
            } else {
                to[i]
            }
        }))
    }
}
