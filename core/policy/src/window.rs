//! Windows of blocks: what the script sees of each.

use tandem_motion::nurbs::Nurbs;
use tandem_motion::{Path, half_angle_turn_rad};
use tandem_sdk::{AxisVector, Block, BlockKind, Edge};

use crate::abi::{self, block as at, put_f64, put_u32};
use crate::bounds::InForce;
use crate::facts::Facts;

/// Places on a curve at which its curvature is looked at.
const CURVATURE_PLACES: usize = 16;

/// The blocks of a window as they cross into the script.
#[derive(Debug)]
pub struct Window {
    facts: Facts,
    bytes: Vec<u8>,
    blocks: Vec<InForce>,
    /// Direction at the end of the block before, over the linear axes; none after a rest in the stream.
    last: Option<AxisVector>,
}

impl Window {
    /// An empty window.
    pub fn new(facts: &Facts) -> Self {
        let (bytes, blocks) = (abi::WINDOW_BLOCKS * at::BYTES, abi::WINDOW_BLOCKS);
        Self { facts: *facts, bytes: Vec::with_capacity(bytes), blocks: Vec::with_capacity(blocks), last: None }
    }

    /// The records, one after the other.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// What is in force for each block.
    pub fn blocks(&self) -> &[InForce] {
        &self.blocks
    }

    /// Appends a block.
    pub fn push(&mut self, block: &Block) {
        let shape = Shape::of(block, &self.facts);
        let turn_rad = shape.turn_from(self.last.as_ref());
        self.set_turn_out(turn_rad);
        self.last = shape.end;
        let in_force = in_force(block, &self.facts);
        let record = self.bytes.len();
        self.bytes.resize(record + at::BYTES, 0);
        write(&mut self.bytes[record..], block, &in_force, turn_rad, shape.curvature_per_mm);
        self.blocks.push(in_force);
    }

    /// The block behind the window, in the same stretch; without one the machine rests there.
    pub fn close(&mut self, next: Option<&Block>) {
        match next {
            Some(next) => self.set_turn_out(Shape::of(next, &self.facts).turn_from(self.last.as_ref())),
            None => self.last = None,
        }
    }

    /// Forgets the blocks.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.blocks.clear();
    }

    fn set_turn_out(&mut self, turn_rad: f64) {
        if let Some(record) = self.bytes.len().checked_sub(at::BYTES) {
            put_f64(&mut self.bytes, record + at::TURN_OUT, turn_rad);
        }
    }
}

fn in_force(block: &Block, facts: &Facts) -> InForce {
    let or = |value: f64, default: f64| if value.is_nan() { default } else { value };
    InForce {
        line: block.line,
        // What an input ends has the feed that the probe or switch can take.
        kind: if block.stop_on.edge == Edge::None { block.kind } else { BlockKind::Dwell },
        time_constant_s: or(block.time_constant_s, facts.time_constant_s),
        path_tolerance_mm: or(block.path_tolerance_mm, facts.path_tolerance_mm),
        programmed_feed_mm_per_s: block.feed_mm_per_s,
        feed_cap_mm_per_s: block.feed_cap_mm_per_s,
    }
}

fn write(record: &mut [u8], block: &Block, in_force: &InForce, turn_in_rad: f64, curvature_per_mm: f64) {
    let starts = if block.starts_at_rest() { at::STARTS_AT_REST } else { 0 };
    let ends = if block.ends_at_rest() { at::ENDS_AT_REST } else { 0 };
    put_u32(record, at::SIZE, at::BYTES as u32);
    put_u32(record, at::LINE, block.line);
    put_u32(record, at::KIND, block.kind as u32);
    put_u32(record, at::TOOL, block.tool);
    put_u32(record, at::FLAGS, starts | ends);
    put_f64(record, at::LENGTH, block.length_mm);
    let feed_mm_per_s = if block.kind == BlockKind::Dwell { 0.0 } else { block.command_feed_mm_per_s() };
    put_f64(record, at::FEED, feed_mm_per_s);
    put_f64(record, at::TURN_IN, turn_in_rad);
    put_f64(record, at::CURVATURE, curvature_per_mm);
    put_f64(record, at::SPINDLE, block.spindle_rad_per_s);
    put_f64(record, at::TIME_CONSTANT, in_force.time_constant_s);
    put_f64(record, at::TOLERANCE, in_force.path_tolerance_mm);
    put_f64(record, at::FEED_CAP, in_force.feed_cap_mm_per_s);
    for ask in [at::ASK_TIME_CONSTANT, at::ASK_TOLERANCE, at::ASK_FEED_CAP] {
        put_f64(record, ask, f64::NAN);
    }
}

/// Directions at the ends over the linear axes, of unit length, and curvature.
struct Shape {
    start: Option<AxisVector>,
    end: Option<AxisVector>,
    curvature_per_mm: f64,
}

impl Shape {
    fn of(block: &Block, facts: &Facts) -> Self {
        let unit = |direction: AxisVector| unit(direction, facts);
        match block.kind {
            BlockKind::Nurbs => Self::of_curve(block, facts),
            BlockKind::Rapid | BlockKind::Line => {
                let direction = unit(block.end - block.start);
                Self { start: direction, end: direction, curvature_per_mm: 0.0 }
            }
            BlockKind::Arc => match Path::new(block) {
                Some(path) => Self {
                    start: unit(path.direction(0.0)),
                    end: unit(path.direction(path.length_mm())),
                    curvature_per_mm: length(&path.curvature(0.0)),
                },
                None => Self::none(),
            },
            BlockKind::Dwell => Self::none(),
        }
    }

    fn none() -> Self {
        Self { start: None, end: None, curvature_per_mm: 0.0 }
    }

    /// A curve: its curvature is looked at in places of equal distance in its parameter.
    fn of_curve(block: &Block, facts: &Facts) -> Self {
        // SAFETY: the block is handed over for this call, and its curve with it.
        let data = unsafe { block.nurbs.to_data() };
        let Ok(curve) = Nurbs::new(&data, &facts.axes) else { return Self::none() };
        let (from, to) = curve.range();
        let direction = |u: f64| curve.along_path(&curve.derivatives(u)).and_then(|at| unit(at.direction, facts));
        let place = |i: usize| from + (to - from) * i as f64 / CURVATURE_PLACES as f64;
        let curvatures = (0..=CURVATURE_PLACES).filter_map(|i| curve.curvature(&curve.derivatives(place(i))));
        Self { start: direction(from), end: direction(to), curvature_per_mm: curvatures.fold(0.0, f64::max) }
    }

    /// Turn from the direction `before` to the start of this; 0 where either has none.
    fn turn_from(&self, before: Option<&AxisVector>) -> f64 {
        match (before, &self.start) {
            (Some(before), Some(start)) => half_angle_turn_rad(before, start),
            _ => 0.0,
        }
    }
}

/// `direction` over the linear axes, of unit length; none where it has none of them.
fn unit(direction: AxisVector, facts: &Facts) -> Option<AxisVector> {
    let mut linear = AxisVector::ZERO;
    for axis in (0..facts.axes.count()).filter(|axis| !facts.axes.is_rotary(*axis)) {
        linear[axis] = direction[axis];
    }
    let inverse = 1.0 / length(&linear);
    inverse.is_finite().then(|| linear * inverse)
}

fn length(vector: &AxisVector) -> f64 {
    vector.0.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::abi::get_f64;
    use std::f64::consts::{FRAC_PI_2, PI};
    use tandem_sdk::{ArcGeometry, Axes};

    fn facts() -> Facts {
        let axes = Axes::new(&[('X', false), ('Y', false), ('A', true)]).unwrap();
        Facts { axes, time_constant_s: 0.05, path_tolerance_mm: 0.01, rough_period_s: 0.008 }
    }

    fn line(start: [f64; 2], end: [f64; 2]) -> Block {
        let (start, end) = (AxisVector::from_slice(&start), AxisVector::from_slice(&end));
        Block { kind: BlockKind::Line, start, end, feed_mm_per_s: 50.0, length_mm: 1.0, ..Block::at(start) }
    }

    fn field(window: &Window, index: usize, field: usize) -> f64 {
        get_f64(window.bytes(), index * at::BYTES + field).unwrap()
    }

    #[test]
    fn turns_are_known_at_both_ends_and_across_windows() {
        let mut window = Window::new(&facts());
        window.push(&line([0.0, 0.0], [1.0, 0.0]));
        window.push(&line([1.0, 0.0], [1.0, 1.0]));
        window.close(Some(&line([1.0, 1.0], [1.0, 0.0])));
        let turns = [(0, at::TURN_IN), (0, at::TURN_OUT), (1, at::TURN_IN), (1, at::TURN_OUT)];
        let turns = turns.map(|(index, place)| field(&window, index, place));
        for (turn, expected) in turns.into_iter().zip([0.0, FRAC_PI_2, FRAC_PI_2, PI]) {
            assert!((turn - expected).abs() < 1e-12, "{turns:?}");
        }
        window.clear();
        window.push(&line([1.0, 1.0], [1.0, 0.0]));
        assert!((field(&window, 0, at::TURN_IN) - PI).abs() < 1e-12);
        window.close(None);
        window.clear();
        window.push(&line([1.0, 0.0], [0.0, 0.0]));
        assert_eq!(field(&window, 0, at::TURN_IN), 0.0, "a stretch begins at rest");
    }

    #[test]
    fn an_arc_has_the_curvature_of_its_circle_and_turns_by_its_tangents() {
        let mut window = Window::new(&facts());
        window.push(&line([0.0, -2.0], [2.0, -2.0]));
        let arc = ArcGeometry {
            plane: [0, 1],
            center_mm: [2.0, 0.0],
            radius_mm: 2.0,
            start_angle_rad: -FRAC_PI_2,
            sweep_rad: PI,
        };
        let ends = line([2.0, -2.0], [2.0, 2.0]);
        window.push(&Block { kind: BlockKind::Arc, arc, length_mm: 2.0 * PI, ..ends });
        assert!(field(&window, 1, at::TURN_IN) < 1e-9);
        assert!((field(&window, 1, at::CURVATURE) - 0.5).abs() < 1e-9);
        assert_eq!(field(&window, 1, at::TIME_CONSTANT), 0.05);
    }
}
