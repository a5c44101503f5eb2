//! G2 and G3 to blocks.

use tandem_sdk::{ArcGeometry, AxisVector, Block, BlockKind};

use crate::arc::{Ends, Part, Parts, extent};
use crate::fault::{Checked, Fault, Span};
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::state::Plane;
use crate::table::Group;

/// Most turns of a helix.
const MAX_TURNS: u32 = 100_000;

impl Interpreter {
    /// G2 and G3. `uncertain` are the axes whose position was unknown before the line.
    pub(crate) fn arc(&mut self, clockwise: bool, uncertain: u32, out: &mut Vec<Item>) -> Checked<()> {
        if self.orders.get(Group::NonModal) == Some(530) {
            return Err(self.orders.fault(Group::NonModal, "conflict", "G53 goes with G0 and G1 only"));
        }
        let plane = self.plane()?;
        let (start, end) = (self.state.last_end, self.block_end());
        let turns = self.words.integer(b'P', 1..=MAX_TURNS)?.unwrap_or(1);
        let pick = |v: &AxisVector| plane.map(|axis| v[axis]);
        let ends = Ends { start: pick(&start), end: pick(&end), clockwise, turns };
        if plane.iter().any(|axis| uncertain >> axis & 1 != 0) {
            self.state.last_end = self.state.position;
            return Ok(());
        }
        let parts = self.circle(&ends, plane)?;
        let mut helix = end - start;
        for axis in plane {
            helix[axis] = 0.0;
        }
        self.check_arc_travel(plane, &parts, &helix)?;
        self.push_arcs(&parts, plane, end, &helix, out)
    }

    /// One block a part; the axes outside the plane move in proportion to the swept angle.
    fn push_arcs(
        &mut self,
        parts: &Parts,
        plane: [usize; 2],
        end: AxisVector,
        helix: &AxisVector,
        out: &mut Vec<Item>,
    ) -> Checked<()> {
        let parts = parts.as_slice();
        let along = if self.moves_linear(helix) { self.config.axes.path_length(helix) } else { 0.0 };
        let swept: f64 = parts.iter().map(|part| part.arc.sweep_rad).sum();
        let length = |part: &Part| (part.arc.radius_mm * part.arc.sweep_rad).hypot(along * part.arc.sweep_rad / swept);
        let feed_mm_per_s = self.feed(parts.iter().map(length).sum(), true)?;
        for (n, part) in parts.iter().enumerate() {
            let mut block = self.state.blank_block();
            block.end = end;
            if n + 1 < parts.len() {
                block.end = block.start + *helix * (part.arc.sweep_rad / swept);
                block.end[plane[0]] = part.end[0];
                block.end[plane[1]] = part.end[1];
            }
            let arc = ArcGeometry { plane: plane.map(|axis| axis as u32), ..part.arc };
            let length_mm = length(part);
            self.push(Block { kind: BlockKind::Arc, arc, length_mm, feed_mm_per_s, ..block }, out);
        }
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

    fn circle(&self, ends: &Ends, plane: [usize; 2]) -> Checked<Parts> {
        let letters = self.plane_letters().map(|letter| letter - b'X' + b'I');
        if let Some(foreign) = (b'I'..=b'K').find(|l| self.words.has(*l) && !letters.contains(l)) {
            let [a, b] = letters.map(char::from);
            let message =
                format!("{} is no centre in this plane: {a} and {b} are (G17, G18, G19 choose)", foreign as char);
            return Err(self.words.fault(foreign, "arc-centre", message));
        }
        let given = letters.map(|letter| self.words.get(letter));
        let arc = match (self.words.get(b'R'), given) {
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

    fn check_arc_travel(&self, plane: [usize; 2], parts: &Parts, helix: &AxisVector) -> Checked<()> {
        for part in parts.as_slice() {
            for (axis, (low, high)) in plane.into_iter().zip(extent(part)) {
                self.check_travel(axis, low, high)?;
            }
        }
        for axis in (0..self.letters.count()).filter(|axis| helix[*axis] != 0.0) {
            self.check_travel(axis, self.state.position[axis], self.state.position[axis])?;
        }
        Ok(())
    }
}
