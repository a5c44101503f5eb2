//! Axis words to blocks.

use tandem_sdk::{AxisVector, Block, BlockKind};

use crate::fault::{Checked, Fault, Span};
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::letters::AXIS_MASK;
use crate::state::Motion;
use crate::table::{Group, written};

/// Moves below this, mm or rad, are the rounding of offsets and no motion.
pub(crate) const NO_MOVE: f64 = 1e-10;

impl Interpreter {
    /// Moves to where the axis words say.
    #[inline]
    pub(crate) fn motion(&mut self, motion: Motion, out: &mut Vec<Item>) -> Checked<()> {
        let (uncertain, start) = (self.state.uncertain, self.state.position);
        self.advance();
        match motion {
            Motion::Rapid => self.straight(BlockKind::Rapid, out),
            Motion::Line => self.straight(BlockKind::Line, out),
            Motion::ArcClockwise => self.arc(true, uncertain, out),
            Motion::ArcCounterclockwise => self.arc(false, uncertain, out),
            Motion::Probe(tenths) => self.probe(tenths, out),
            Motion::Curve(tenths) => self.curve_motion(tenths, (uncertain, start), out),
            Motion::None | Motion::Refused => Ok(()),
        }
    }

    /// G5, G5.1, G5.2 and G06.2.
    #[cold]
    fn curve_motion(&mut self, tenths: u16, before: (u32, AxisVector), out: &mut Vec<Item>) -> Checked<()> {
        match tenths {
            50 => self.cubic(before.0, out),
            51 => self.quadratic(before.0, out),
            52 => self.open_linuxcnc(before.0, before.1),
            _ => self.open_fanuc(before.0, before.1),
        }
    }

    /// Takes the axis words into the programmed position.
    #[inline]
    pub(crate) fn advance(&mut self) {
        let machine = self.orders.get(Group::NonModal) == Some(530);
        let absolute = machine || self.state.absolute;
        for axis in 0..self.letters.count() {
            let Some(value) = self.words.get(self.letters.letter(axis)) else { continue };
            let value = value * self.state.scale(&self.letters, axis);
            let base = match (machine, absolute) {
                (true, _) => 0.0,
                (_, true) => self.state.offsets.total[axis],
                _ => self.state.position[axis],
            };
            self.state.position[axis] = base + value;
            if absolute {
                self.state.uncertain &= !(1 << axis);
            }
            self.assume_target(axis, machine, absolute);
        }
        self.moved = true;
    }

    /// Whether the programmed position of `axis` now follows from what the first pass has assumed.
    #[inline]
    fn assume_target(&mut self, axis: usize, machine: bool, absolute: bool) {
        let (bit, assumed) = (1 << axis, &mut self.state.assumed);
        let base = match (machine, absolute) {
            (true, _) => 0,
            (_, true) => assumed.offsets,
            _ => assumed.position,
        };
        assumed.position &= !bit;
        if self.reads_assumed.get() {
            assumed.position |= bit;
        }
        assumed.position |= base & bit;
    }

    /// Where the next block ends: the programmed position, but for moves that are none.
    #[inline]
    pub(crate) fn block_end(&self) -> AxisVector {
        let (from, to) = (&self.state.last_end, &self.state.position);
        AxisVector(std::array::from_fn(|i| if (to[i] - from[i]).abs() < NO_MOVE { from[i] } else { to[i] }))
    }

    #[inline]
    fn straight(&mut self, kind: BlockKind, out: &mut Vec<Item>) -> Checked<()> {
        let end = self.block_end();
        let displacement = end - self.state.last_end;
        let length_mm = self.config.axes.path_length(&displacement);
        let feed_mm_per_s = match kind {
            BlockKind::Rapid => f64::INFINITY,
            _ => self.feed(length_mm, self.moves_linear(&displacement))?,
        };
        if length_mm == 0.0 {
            return Ok(());
        }
        for axis in 0..self.letters.count() {
            if displacement[axis] != 0.0 {
                self.check_travel(axis, end[axis], end[axis])?;
            }
        }
        let block = Block { kind, end, length_mm, feed_mm_per_s, ..self.state.blank_block() };
        self.push(block, out);
        Ok(())
    }

    #[inline]
    #[allow(clippy::large_types_passed_by_value, reason = "built in place: a reference would copy once more")]
    pub(crate) fn push(&mut self, block: Block, out: &mut Vec<Item>) {
        self.state.last_end = block.end;
        self.state.next_index += 1;
        self.state.at_rest = false;
        out.push(Item::Block(block));
    }

    #[inline]
    pub(crate) fn moves_linear(&self, displacement: &AxisVector) -> bool {
        (0..self.letters.count()).any(|axis| displacement[axis] != 0.0 && !self.letters.is_rotary(axis))
    }

    /// The feed of a path of `length_mm`.
    #[inline]
    pub(crate) fn feed(&self, length_mm: f64, linear: bool) -> Checked<f64> {
        let feed = &self.state.feed;
        if feed.inverse_time {
            return match self.words.get(b'F') {
                Some(inverse) if inverse > 0.0 => Ok(length_mm * inverse / 60.0),
                _ => Err(self.no_inverse_time()),
            };
        }
        let feed = if linear { feed.linear_mm_per_s } else { feed.rotary_rad_per_s };
        if feed > 0.0 { Ok(feed) } else { Err(self.no_feed()) }
    }

    #[cold]
    fn no_inverse_time(&self) -> Fault {
        let why = match self.orders.motion {
            Some(Motion::Curve(_)) => "with G93 every curve needs its F, in its first line",
            _ => "with G93 every line with G1, G2 or G3 needs its F",
        };
        self.motion_fault("feed-missing", why)
    }

    #[cold]
    fn no_feed(&self) -> Fault {
        let why = if self.words.has(b'F') { "the feed is zero" } else { "the feed is missing: no F has been set" };
        let who = match self.orders.motion {
            Some(Motion::Probe(tenths) | Motion::Curve(tenths)) => written('G', tenths) + " needs",
            _ => "G1, G2 and G3 need".into(),
        };
        self.motion_fault("feed-missing", format!("{why}; {who} one"))
    }

    /// A fault at the motion word, or at the first axis word where the motion is modal.
    pub(crate) fn motion_fault(&self, code: &'static str, message: impl Into<String>) -> Fault {
        match self.words.first_of(AXIS_MASK) {
            _ if self.orders.get(Group::Motion).is_some() => self.orders.fault(Group::Motion, code, message),
            Some((_, span)) => Fault::new(span, code, message),
            None => Fault::new(Span::new(0, 1), code, message),
        }
    }

    /// G28 and G30: a rapid to the programmed point, then one of the named axes (or all) to the reference position.
    pub(crate) fn go_to_reference(&mut self, which: usize, out: &mut Vec<Item>) -> Checked<()> {
        let named = self.words.present & AXIS_MASK;
        self.advance();
        self.straight(BlockKind::Rapid, out)?;
        for axis in 0..self.letters.count() {
            if named == 0 || self.words.has(self.letters.letter(axis)) {
                self.state.position[axis] = self.state.reference[which][axis];
                self.state.uncertain &= !(1 << axis);
            }
        }
        self.straight(BlockKind::Rapid, out)
    }
}
