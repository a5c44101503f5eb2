//! What comes out of the interpreter.

use std::sync::Arc;

use tandem_sdk::{AxisVector, Block, Edge, Event, NurbsData};

/// One element of the stream, in program order.
#[derive(Clone, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "blocks are by far the most frequent item; boxing them would allocate"
)]
pub enum Item {
    /// A path element, or rest. Behind a probe, whose [`Block::stop_on`] names an edge, nothing is read before
    /// [`crate::Stream::provide_probe`]; what else stands in its line may follow it. A NURBS has the data of its curve beside it.
    Block(Block, Option<Arc<NurbsData>>),
    /// A non-motion word, tied to the block before which it acts.
    Event(Event),
    /// M66: the program goes on when the input has answered.
    Wait(InputWait),
    /// M100 to M199: the machine is at rest, and the program goes on when the command is over. Simulations pass over it.
    Command(UserCommand),
    /// The program states `value` for number `which` of [`crate::Config::watched`], NaN where that is no value: it holds for
    /// the blocks that follow.
    Stated {
        /// Index of the name.
        which: usize,
        /// What it is from here on.
        value: f64,
    },
    /// The program is over (M2, M30, `%` or the end of the file). Nothing follows.
    End,
}

impl Item {
    /// Whether this is a block that an input ends.
    pub fn is_probe(&self) -> bool {
        matches!(self, Self::Block(block, _) if block.stop_on.edge != Edge::None)
    }
}

/// Which input M66 reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Digital input P.
    Digital(u32),
    /// Analogue input E; its value is the answer.
    Analog(u32),
}

/// What M66 waits for (the L word).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputMode {
    /// L0: nothing, the value is read at once.
    Immediate,
    /// L1: a change from low to high.
    Rise,
    /// L2: a change from high to low.
    Fall,
    /// L3: the high state.
    High,
    /// L4: the low state.
    Low,
}

/// M66: wait for an input. The machine is at rest; the answer becomes parameter #5399.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputWait {
    /// Line of the part program, from 1.
    pub line: u32,
    /// The wait lies before the block of this index.
    pub before_block: u64,
    /// The input.
    pub input: Input,
    /// What is waited for.
    pub mode: InputMode,
    /// Longest wait, s; after it the answer is −1. Zero for [`InputMode::Immediate`].
    pub timeout_s: f64,
}

/// A command of the machine's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UserCommand {
    /// Line of the part program, from 1.
    pub line: u32,
    /// The command lies before the block of this index.
    pub before_block: u64,
    /// 100 for M100; one of those that [`crate::Config::user_commands`] lists.
    pub number: u32,
    /// Its argument P.
    pub p: Option<f64>,
    /// Its argument Q.
    pub q: Option<f64>,
}

/// What became of a probe, in machine coordinates of axis space, mm or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeResult {
    /// Where the machine was at the edge; none where the end came without one.
    pub touched: Option<AxisVector>,
    /// Where the machine has come to rest: what follows starts here.
    pub rest: AxisVector,
}
