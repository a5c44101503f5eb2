//! Axis words to blocks.

use std::fmt::Write as _;

use tandem_sdk::{AxisVector, Block, BlockKind};

use crate::arc::{Ends, extent};
use crate::fault::{Checked, Fault, Span};
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::letters::AXIS_MASK;
use crate::state::{Motion, Plane};
use crate::table::Group;

/// Moves below this, mm or rad, are the rounding of offsets and no motion.
const NO_MOVE: f64 = 1e-10;
/// Rounding that a travel limit forgives, mm or rad.
const TRAVEL_ROUNDING: f64 = 1e-9;

impl Interpreter {
    /// Moves to where the axis words say.
    #[inline]
    pub(crate) fn motion(&mut self, motion: Motion, out: &mut Vec<Item>) -> Checked<()> {
        let uncertain = self.state.uncertain;
        self.advance();
        match motion {
            Motion::Rapid => self.straight(BlockKind::Rapid, out),
            Motion::Line => self.straight(BlockKind::Line, out),
            Motion::ArcClockwise => self.arc(true, uncertain, out),
            Motion::ArcCounterclockwise => self.arc(false, uncertain, out),
            Motion::None | Motion::Refused => Ok(()),
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
        }
        self.moved = true;
    }

    /// Where the next block ends: the programmed position, but for moves that are none.
    #[inline]
    fn block_end(&self) -> AxisVector {
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
    fn push(&mut self, block: Block, out: &mut Vec<Item>) {
        self.state.last_end = block.end;
        self.state.next_index += 1;
        self.state.at_rest = false;
        out.push(Item::Block(block));
    }

    #[inline]
    fn moves_linear(&self, displacement: &AxisVector) -> bool {
        (0..self.letters.count()).any(|axis| displacement[axis] != 0.0 && !self.letters.is_rotary(axis))
    }

    /// The feed of a path of `length_mm`.
    #[inline]
    fn feed(&self, length_mm: f64, linear: bool) -> Checked<f64> {
        let feed = &self.state.feed;
        if feed.inverse_time {
            return match self.words.get(b'F') {
                Some(inverse) if inverse > 0.0 => Ok(length_mm * inverse / 60.0),
                _ => Err(self.motion_fault("feed-missing", "with G93 every line with G1, G2 or G3 needs its F")),
            };
        }
        let feed = if linear { feed.linear_mm_per_s } else { feed.rotary_rad_per_s };
        if feed > 0.0 { Ok(feed) } else { Err(self.no_feed()) }
    }

    #[cold]
    fn no_feed(&self) -> Fault {
        let why = if self.words.has(b'F') { "the feed is zero" } else { "the feed is missing: no F has been set" };
        self.motion_fault("feed-missing", format!("{why}; G1, G2 and G3 need one"))
    }

    fn arc(&mut self, clockwise: bool, uncertain: u32, out: &mut Vec<Item>) -> Checked<()> {
        if self.orders.get(Group::NonModal) == Some(530) {
            return Err(self.orders.fault(Group::NonModal, "conflict", "G53 goes with G0 and G1 only"));
        }
        let plane = self.plane()?;
        let end = self.block_end();
        let pick = |v: &AxisVector| [v[plane[0]], v[plane[1]]];
        let turns = self.words.integer(b'P', 1..=100_000)?.unwrap_or(1);
        let ends = Ends { start: pick(&self.state.last_end), end: pick(&end), clockwise, turns };
        let circle = self.circle(&ends, plane, uncertain);
        if plane.iter().any(|axis| uncertain >> axis & 1 != 0) {
            self.state.last_end = self.state.position;
            return Ok(());
        }
        let mut arc = circle?;
        arc.plane = plane.map(|axis| axis as u32);
        let mut displacement = end - self.state.last_end;
        self.check_arc_travel(plane, extent(&arc, [ends.start, ends.end]), &displacement)?;
        for axis in plane {
            displacement[axis] = 0.0;
        }
        let along = if self.moves_linear(&displacement) { self.config.axes.path_length(&displacement) } else { 0.0 };
        let length_mm = (arc.radius_mm * arc.sweep_rad).hypot(along);
        let feed_mm_per_s = self.feed(length_mm, true)?;
        let block = Block { kind: BlockKind::Arc, end, arc, length_mm, feed_mm_per_s, ..self.state.blank_block() };
        self.push(block, out);
        Ok(())
    }

    /// The axes of the plane in force.
    fn plane(&self) -> Checked<[usize; 2]> {
        let letters = self.plane_letters();
        let axes = letters.map(|letter| self.letters.axis(letter));
        match axes {
            [Some(a), Some(b)] if !self.letters.is_rotary(a) && !self.letters.is_rotary(b) => Ok([a, b]),
            _ => {
                let [a, b] = letters.map(char::from);
                let message = format!(
                    "an arc in the plane {a}{b} needs two linear axes; this machine has {}",
                    self.letters.list()
                );
                Err(self.motion_fault("axis", message))
            }
        }
    }

    fn plane_letters(&self) -> [u8; 2] {
        match self.state.plane {
            Plane::Xy => *b"XY",
            Plane::Zx => *b"ZX",
            Plane::Yz => *b"YZ",
        }
    }

    fn circle(&self, ends: &Ends, plane: [usize; 2], uncertain: u32) -> Checked<tandem_sdk::ArcGeometry> {
        let letters = self.plane_letters().map(|letter| letter - b'X' + b'I');
        if let Some(foreign) = (b'I'..=b'K').find(|l| self.words.has(*l) && !letters.contains(l)) {
            let [a, b] = letters.map(char::from);
            let message =
                format!("{} is no centre in this plane: {a} and {b} are (G17, G18, G19 choose)", foreign as char);
            return Err(self.words.fault(foreign, "arc-centre", message));
        }
        let given = letters.map(|letter| self.words.get(letter));
        let arc = match (self.words.get(b'R'), given) {
            (Some(_), [None, None]) if plane.iter().any(|axis| uncertain >> axis & 1 != 0) => return Ok(<_>::default()),
            (Some(radius), [None, None]) => ends.of_radius(radius * self.state.unit_mm),
            (Some(_), _) => return Err(self.words.fault(b'R', "arc-centre", "an arc has either R or I J K, not both")),
            (None, [None, None]) => return Err(self.no_center(letters)),
            (None, given) => ends.about(self.center(ends, plane, given)?),
        };
        arc.map_err(|(code, message)| self.arc_fault(letters, code, message))
    }

    fn center(&self, ends: &Ends, plane: [usize; 2], given: [Option<f64>; 2]) -> Checked<[f64; 2]> {
        let unit = self.state.unit_mm;
        if !self.state.arc_absolute {
            return Ok(std::array::from_fn(|i| ends.start[i] + given[i].unwrap_or(0.0) * unit));
        }
        let ([Some(a), Some(b)], offset) = (given, &self.state.offsets.total) else {
            return Err(self.motion_fault("arc-centre", "with G90.1 an arc needs both coordinates of its centre"));
        };
        Ok([a * unit + offset[plane[0]], b * unit + offset[plane[1]]])
    }

    fn no_center(&self, letters: [u8; 2]) -> Fault {
        let [a, b] = letters.map(char::from);
        self.motion_fault("arc-centre", format!("the arc has no centre ({a} {b}) and no radius (R)"))
    }

    /// A fault at the words of the circle.
    fn arc_fault(&self, letters: [u8; 2], code: &'static str, message: String) -> Fault {
        let spans =
            [letters[0], letters[1], b'R'].into_iter().filter(|l| self.words.has(*l)).map(|l| self.words.span(l));
        let span = spans.reduce(|a, b| Span { start: a.start.min(b.start), end: a.end.max(b.end) });
        Fault::new(span.unwrap_or_default(), code, message)
    }

    /// A fault at the motion word, or at the first axis word where the motion is modal.
    fn motion_fault(&self, code: &'static str, message: impl Into<String>) -> Fault {
        match self.words.first_of(AXIS_MASK) {
            _ if self.orders.get(Group::Motion).is_some() => self.orders.fault(Group::Motion, code, message),
            Some((_, span)) => Fault::new(span, code, message),
            None => Fault::new(Span::new(0, 1), code, message),
        }
    }

    fn check_arc_travel(&self, plane: [usize; 2], extent: [(f64, f64); 2], displacement: &AxisVector) -> Checked<()> {
        for (axis, (low, high)) in plane.into_iter().zip(extent) {
            self.check_travel(axis, low, high)?;
        }
        for axis in (0..self.letters.count()).filter(|axis| !plane.contains(axis) && displacement[*axis] != 0.0) {
            self.check_travel(axis, self.state.position[axis], self.state.position[axis])?;
        }
        Ok(())
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

    /// Whether `low` to `high`, machine coordinates, lies within the travel of `axis`.
    #[inline]
    fn check_travel(&self, axis: usize, low: f64, high: f64) -> Checked<()> {
        let (min, max) = self.config.travel_mm[axis];
        if low >= min - TRAVEL_ROUNDING && high <= max + TRAVEL_ROUNDING || self.state.uncertain >> axis & 1 != 0 {
            return Ok(());
        }
        Err(self.beyond_travel(axis, if high > max + TRAVEL_ROUNDING { high } else { low }))
    }

    #[cold]
    fn beyond_travel(&self, axis: usize, value: f64) -> Fault {
        let rotary = self.letters.is_rotary(axis);
        let shown = |v: f64| crate::fault::show(if rotary { v.to_degrees() } else { v });
        let (unit, letter) = (if rotary { "deg" } else { "mm" }, self.letters.letter(axis));
        let (min, max) = self.config.travel_mm[axis];
        let name = letter as char;
        let travel = format!("{} to {} {unit}", shown(min), shown(max));
        let mut message =
            format!("{name} would reach {} {unit}, beyond its travel of {travel} (machine coordinates", shown(value));
        let offset = self.state.offsets.total[axis];
        if offset != 0.0 {
            let _ = write!(message, "; the offset in force is {} {unit}", shown(offset));
        }
        message.push(')');
        if self.words.has(letter) {
            self.words.fault(letter, "travel", message)
        } else {
            self.whole_fault("travel", message)
        }
    }

    fn whole_fault(&self, code: &'static str, message: String) -> Fault {
        if self.orders.axes_taken {
            self.orders.fault(Group::NonModal, code, message)
        } else {
            self.motion_fault(code, message)
        }
    }
}
