//! Windows of blocks: what the script sees of each.

use tandem_sdk::{Block, BlockKind, Curve, Edge};

use crate::abi::{self, block as at, put_f64, put_u32};
use crate::bounds::InForce;
use crate::facts::Facts;
use crate::geometry::{Geometry, geometry};
use crate::inputs::MAX_PROGRAM_VALUES;
use crate::shape::{Direction, HalfTurn, LinearAxes, Shape, half_turn, turns_rad};

/// One block as it crosses into the script, laid out as [`abi::block`] says.
pub type Record = [u8; at::BYTES];

/// What version 2 appends to it for every script: diameter of the tool, values of the program.
pub type Sight = [u8; at::BYTES_SMALL - at::BYTES];

/// How much of a block a script looks at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Looks {
    /// Version 2 of the ABI.
    pub sight: bool,
    /// Its geometry too.
    pub geometry: bool,
}

impl Looks {
    /// Bytes of a block that are told.
    fn bytes(self) -> usize {
        match (self.sight, self.geometry) {
            (false, _) => at::BYTES,
            (true, false) => at::BYTES_SMALL,
            (true, true) => at::BYTES_V2,
        }
    }
}

/// The blocks of a window as they cross into the script.
#[derive(Debug)]
pub struct BlockWindow {
    facts: Facts,
    axes: LinearAxes,
    looks: Looks,
    records: Vec<Record>,
    /// One a record, where the script looks at it.
    sights: Vec<Sight>,
    geometries: Vec<Geometry>,
    /// What the program has stated last.
    program: [f64; MAX_PROGRAM_VALUES],
    blocks: Vec<InForce>,
    /// The turn into each block, and behind the last.
    half_turns: Vec<HalfTurn>,
    /// The same as angles; scratch.
    turns_rad: Vec<f64>,
    /// Direction at the end of the block before; none after a rest in the stream.
    last: Option<Direction>,
}

impl BlockWindow {
    /// An empty window.
    pub fn new(facts: &Facts) -> Self {
        let most = abi::WINDOW_BLOCKS;
        Self {
            facts: facts.clone(),
            axes: LinearAxes::of(&facts.axes),
            looks: Looks::default(),
            records: Vec::with_capacity(most),
            sights: Vec::with_capacity(most),
            geometries: Vec::with_capacity(most),
            program: [f64::NAN; MAX_PROGRAM_VALUES],
            blocks: Vec::with_capacity(most),
            half_turns: Vec::with_capacity(most + 1),
            turns_rad: Vec::with_capacity(most + 1),
            last: None,
        }
    }

    /// The records, one after the other.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// What a script of version 2 gets of each block beyond its record; none where it looks at less.
    pub fn sights(&self) -> (&[Sight], &[Geometry]) {
        (&self.sights, &self.geometries)
    }

    /// From the next window on the script looks at `looks`.
    pub fn look_at(&mut self, looks: Looks) {
        self.looks = looks;
    }

    /// The program states `value` for input `which`, for all blocks that follow.
    pub fn state(&mut self, which: usize, value: f64) {
        if let Some(slot) = self.program.get_mut(which) {
            *slot = value;
        }
    }

    /// What is in force for each block.
    pub fn blocks(&self) -> &[InForce] {
        &self.blocks
    }

    /// Appends a block. Its turns are known when the window is closed.
    pub fn push(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        let shape = Shape::of(block, curve, &self.facts.axes, &self.axes);
        self.half_turns
            .push(half_turn(self.last.as_ref(), shape.start.as_ref()));
        self.last = shape.end;
        let in_force = in_force(block, &self.facts);
        self.records.push(record(
            block,
            &in_force,
            shape.curvature_per_mm,
            self.looks.bytes(),
        ));
        self.blocks.push(in_force);
        if self.looks.sight {
            self.sights.push(self.sight(block));
        }
        if self.looks.geometry {
            self.geometries
                .push(geometry(block, curve, &self.facts.axes));
        }
    }

    fn sight(&self, block: &Block) -> Sight {
        let tools = &self.facts.tool_diameters_mm;
        let diameter_mm = tools
            .iter()
            .find(|(number, _)| *number == block.tool)
            .map_or(f64::NAN, |(_, diameter_mm)| *diameter_mm);
        let mut sight = [0; size_of::<Sight>()];
        put_f64(&mut sight, at::TOOL_DIAMETER - at::BYTES, diameter_mm);
        for (index, value) in self.program.iter().enumerate() {
            put_f64(&mut sight, at::PROGRAM - at::BYTES + 8 * index, *value);
        }
        sight
    }

    /// The block behind the window, in the same stretch; without one the machine rests there. Sets the turns.
    pub fn close(&mut self, next: Option<(&Block, Option<Curve<'_>>)>) {
        let next = next.map(|(next, curve)| Shape::of(next, curve, &self.facts.axes, &self.axes));
        let start = next.as_ref().and_then(|next| next.start.as_ref());
        self.half_turns.push(half_turn(self.last.as_ref(), start));
        if next.is_none() {
            self.last = None;
        }
        turns_rad(&self.half_turns, &mut self.turns_rad);
        for (record, turns) in self.records.iter_mut().zip(self.turns_rad.windows(2)) {
            put_f64(record, at::TURN_IN, turns[0]);
            put_f64(record, at::TURN_OUT, turns[1]);
        }
    }

    /// Forgets the blocks.
    pub fn clear(&mut self) {
        self.records.clear();
        self.sights.clear();
        self.geometries.clear();
        self.blocks.clear();
        self.half_turns.clear();
    }
}

fn in_force(block: &Block, facts: &Facts) -> InForce {
    let or = |value: f64, default: f64| if value.is_nan() { default } else { value };
    InForce {
        line: block.line,
        // What an input ends has the feed that the probe or switch can take.
        kind: if block.stop_on.edge == Edge::None {
            block.kind
        } else {
            BlockKind::Dwell
        },
        time_constant_s: or(block.time_constant_s, facts.time_constant_s),
        path_tolerance_mm: or(block.path_tolerance_mm, facts.path_tolerance_mm),
        programmed_feed_mm_per_s: block.feed_mm_per_s,
        feed_cap_mm_per_s: block.feed_cap_mm_per_s,
    }
}

/// The record of a block of which `bytes` are told.
fn record(block: &Block, in_force: &InForce, curvature_per_mm: f64, bytes: usize) -> Record {
    let starts = if block.starts_at_rest() {
        at::STARTS_AT_REST
    } else {
        0
    };
    let ends = if block.ends_at_rest() {
        at::ENDS_AT_REST
    } else {
        0
    };
    let mut record = [0; at::BYTES];
    put_u32(&mut record, at::SIZE, bytes as u32);
    put_u32(&mut record, at::LINE, block.line);
    put_u32(&mut record, at::KIND, block.kind as u32);
    put_u32(&mut record, at::TOOL, block.tool);
    put_u32(&mut record, at::FLAGS, starts | ends);
    put_f64(&mut record, at::LENGTH, block.length_mm);
    let feed_mm_per_s = if block.kind == BlockKind::Dwell {
        0.0
    } else {
        block.command_feed_mm_per_s()
    };
    put_f64(&mut record, at::FEED, feed_mm_per_s);
    put_f64(&mut record, at::CURVATURE, curvature_per_mm);
    put_f64(&mut record, at::SPINDLE, block.spindle_rad_per_s);
    put_f64(&mut record, at::TIME_CONSTANT, in_force.time_constant_s);
    put_f64(&mut record, at::TOLERANCE, in_force.path_tolerance_mm);
    put_f64(&mut record, at::FEED_CAP, in_force.feed_cap_mm_per_s);
    for ask in [at::ASK_TIME_CONSTANT, at::ASK_TOLERANCE, at::ASK_FEED_CAP] {
        put_f64(&mut record, ask, f64::NAN);
    }
    record
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::abi::get_f64;
    use std::f64::consts::{FRAC_PI_2, PI};
    use tandem_sdk::{ArcGeometry, Axes, AxisVector};

    fn facts() -> Facts {
        Facts {
            axes: Axes::new(&[('X', false), ('Y', false), ('A', true)]).unwrap(),
            ..Facts::default()
        }
    }

    fn line(start: [f64; 2], end: [f64; 2]) -> Block {
        let (start, end) = (AxisVector::from_slice(&start), AxisVector::from_slice(&end));
        Block {
            kind: BlockKind::Line,
            start,
            end,
            feed_mm_per_s: 50.0,
            length_mm: 1.0,
            ..Block::at(start)
        }
    }

    fn field(window: &BlockWindow, index: usize, field: usize) -> f64 {
        get_f64(&window.records()[index], field).unwrap()
    }

    #[test]
    fn turns_are_known_at_both_ends_and_across_windows() {
        let mut window = BlockWindow::new(&facts());
        window.push(&line([0.0, 0.0], [1.0, 0.0]), None);
        window.push(&line([1.0, 0.0], [1.0, 1.0]), None);
        window.close(Some((&line([1.0, 1.0], [1.0, 0.0]), None)));
        let turns = [
            (0, at::TURN_IN),
            (0, at::TURN_OUT),
            (1, at::TURN_IN),
            (1, at::TURN_OUT),
        ];
        let turns = turns.map(|(index, place)| field(&window, index, place));
        for (turn, expected) in turns.into_iter().zip([0.0, FRAC_PI_2, FRAC_PI_2, PI]) {
            assert!((turn - expected).abs() < 1e-12, "{turns:?}");
        }
        window.clear();
        window.push(&line([1.0, 1.0], [1.0, 0.0]), None);
        window.close(None);
        assert!((field(&window, 0, at::TURN_IN) - PI).abs() < 1e-12);
        assert_eq!(
            field(&window, 0, at::TURN_OUT),
            0.0,
            "a stretch ends at rest"
        );
        window.clear();
        window.push(&line([1.0, 0.0], [0.0, 0.0]), None);
        window.close(None);
        assert_eq!(
            field(&window, 0, at::TURN_IN),
            0.0,
            "a stretch begins at rest"
        );
    }

    #[test]
    fn an_arc_has_the_curvature_of_its_circle_and_turns_by_its_tangents() {
        let mut window = BlockWindow::new(&facts());
        window.push(&line([0.0, -2.0], [2.0, -2.0]), None);
        let arc = ArcGeometry {
            plane: [0, 1],
            center_mm: [2.0, 0.0],
            radius_mm: 2.0,
            start_angle_rad: -FRAC_PI_2,
            sweep_rad: PI,
        };
        let ends = line([2.0, -2.0], [2.0, 2.0]);
        window.push(
            &Block {
                kind: BlockKind::Arc,
                arc,
                length_mm: 2.0 * PI,
                ..ends
            },
            None,
        );
        window.close(None);
        assert!(field(&window, 1, at::TURN_IN) < 1e-9);
        assert!((field(&window, 1, at::CURVATURE) - 0.5).abs() < 1e-9);
        assert_eq!(field(&window, 1, at::TIME_CONSTANT), 0.05);
    }
}
