//! G40 to G42.1: the centre of the tool is driven beside the programmed path, by the tool's radius.
//!
//! A move is kept back until the next one in the plane says what the corner between them is: only then is it known where
//! it ends. What stands between the two in the program is kept back with it.

mod corner;
mod incompatible;
mod sketch;

use std::fmt::Write as _;

use tandem_sdk::{AxisVector, Block, BlockKind};

use super::arc;
use super::circle::{Ends, Parts, Point, extent, tolerance_mm};
use super::modes::Plane;
use super::{Action, Group, Word, spindle, tool};
use crate::item::Item;
use crate::line::Line;
use crate::line_error::{Checked, LineError};
use crate::state::path::NO_MOVE;
use corner::{Corner, Track, along, beside, distance, dot, unit};
pub(crate) use incompatible::refuse_incompatible;
use sketch::{Programmed, drawn, gouge};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G40",
        Group::CutterRadius,
        "",
        "radius compensation off",
        Action::Act(off),
        "G40",
    ),
    Word::new(
        "G41",
        Group::CutterRadius,
        "D",
        "the tool cuts left of the path; D is the tool whose radius counts, else the one in the spindle",
        Action::Act(|line| on_by_table(line, 1.0)),
        "G41 D1 G1 X20\nG40 G0 Y9",
    ),
    Word::new(
        "G41.1",
        Group::CutterRadius,
        "DL",
        "the tool cuts left of the path; D is its diameter",
        Action::Act(|line| on_by_diameter(line, 1.0)),
        "G41.1 D4 G1 X20\nG40 G0 Y9",
    ),
    Word::new(
        "G42",
        Group::CutterRadius,
        "D",
        "the tool cuts right of the path; D is the tool whose radius counts, else the one in the spindle",
        Action::Act(|line| on_by_table(line, -1.0)),
        "G42 D1 G1 X20\nG40 G0 Y9",
    ),
    Word::new(
        "G42.1",
        Group::CutterRadius,
        "DL",
        "the tool cuts right of the path; D is its diameter",
        Action::Act(|line| on_by_diameter(line, -1.0)),
        "G42.1 D4 G1 X20\nG40 G0 Y9",
    ),
];

/// Most moves and events that are kept back, so that memory stays bounded.
const MAX_HELD: usize = 1000;
/// An arc that is to end earlier may be longer by this, mm or rad: LinuxCNC's value.
const LONGER: f64 = 0.0254;

/// The compensation in force.
#[derive(Clone, Debug)]
pub(crate) struct Compensation {
    /// Number of its word, in tenths.
    code: u16,
    /// 1 left of the path, −1 right of it.
    side: f64,
    /// 0 where it is off.
    radius_mm: f64,
    /// No move has been made with it.
    fresh: bool,
    /// Where the programmed path has come to, in the plane.
    programmed: Point,
    /// Direction in which it has come there.
    direction: Point,
    /// The axes of the plane.
    plane: [usize; 2],
    held: Vec<Held>,
    /// The move that is kept back, and the one that makes the corner with it, as they are programmed.
    programmed_moves: [Option<Programmed>; 2],
    /// A line was wrong: nothing is driven until it is off.
    spoiled: bool,
}

impl Default for Compensation {
    fn default() -> Self {
        Self {
            code: 400,
            side: 0.0,
            radius_mm: 0.0,
            fresh: true,
            programmed: [0.0; 2],
            direction: [0.0; 2],
            plane: [0, 1],
            held: Vec::new(),
            programmed_moves: [None; 2],
            spoiled: false,
        }
    }
}

/// What waits for the next corner.
#[derive(Clone, Debug)]
enum Held {
    /// A straight move, and the direction of the programmed one, which it must keep.
    Line(Box<Block>, Option<Point>),
    Arc(Box<Block>, Bend),
    /// A move across the plane, or rest.
    Across(Box<Block>),
    Event(Box<Item>),
}

/// The circle of an arc that is kept back.
#[derive(Clone, Copy, Debug)]
struct Bend {
    center: Point,
    clockwise: bool,
    turns: u32,
    /// Of the programmed arc; the one that is driven has no greater.
    sweep_rad: f64,
}

impl Compensation {
    /// Whether moves are driven beside their path.
    #[inline]
    pub fn is_on(&self) -> bool {
        self.radius_mm > 0.0
    }

    /// Whether what comes must wait behind a move that is kept back.
    #[inline]
    pub fn holds(&self) -> bool {
        !self.held.is_empty()
    }

    /// `#<_ccomp>`.
    pub fn code(&self) -> u16 {
        self.code
    }

    /// The word in force.
    pub fn word(&self) -> &'static str {
        WORDS
            .iter()
            .find(|word| word.tenths == self.code)
            .map_or("G40", |word| word.code)
    }

    /// A line was wrong.
    pub fn spoil(&mut self) {
        self.spoiled |= self.is_on();
        self.held.clear();
    }

    /// Whether nothing can be driven beside the path any more, because it is not known where it goes.
    fn is_lost(&self, uncertain: u32) -> bool {
        self.spoiled || self.plane.iter().any(|axis| uncertain >> axis & 1 != 0)
    }

    /// Where a move in the plane begins as it is programmed; the first one begins where the machine stands.
    pub fn begins(&self, stands: Point) -> Point {
        if self.fresh { stands } else { self.programmed }
    }

    /// Keeps back what stands behind a move that is kept back.
    pub fn hold(&mut self, item: Item) {
        self.held.push(match item {
            Item::Block(block, None) => Held::Across(Box::new(block)),
            other => Held::Event(Box::new(other)),
        });
    }
}

fn on_by_table(line: &mut Line, side: f64) -> Checked<()> {
    // D0 is the tool in the spindle too.
    let number = line
        .words
        .integer(b'D', 0..=tool::MAX_TOOL)?
        .filter(|number| *number != 0);
    let number = number.unwrap_or(line.state.tools.in_spindle);
    let diameter_mm = tool::diameter_of(line, number)?;
    on(line, side, diameter_mm)
}

fn on_by_diameter(line: &mut Line, side: f64) -> Checked<()> {
    let Some(diameter) = line.words.get(b'D') else {
        let message = format!("{} needs D, the diameter of the tool", code(line));
        return Err(line
            .orders
            .error(Group::CutterRadius, "word-missing", message));
    };
    if !matches!(line.words.integer(b'L', 0..=9)?, None | Some(0 | 9)) {
        let message = "L1 to L8 are tools whose tip lies beside their centre: only round tools (L0, L9) are known";
        return Err(line.words.error(b'L', "refused", message));
    }
    let diameter_mm = diameter * line.state.modes.unit_mm;
    on(line, side, diameter_mm)
}

fn code(line: &Line) -> &'static str {
    line.orders
        .get(Group::CutterRadius)
        .map_or("G41", |word| word.code)
}

fn on(line: &mut Line, side: f64, diameter_mm: f64) -> Checked<()> {
    let refuse = |message: String| {
        Err(line
            .orders
            .error(Group::CutterRadius, "compensation", message))
    };
    let before = &line.state.compensation;
    if before.code != 400 {
        return refuse(format!(
            "{} is on already: G40 must come before",
            before.word()
        ));
    }
    if line.state.modes.plane == Plane::Yz {
        return refuse("radius compensation works in the planes XY (G17) and ZX (G18)".into());
    }
    let plane = arc::plane(line)?;
    let programmed = plane.map(|axis| line.state.path.position[axis]);
    // A negative diameter is one on the other side.
    let side = if diameter_mm < 0.0 { -side } else { side };
    let code = line
        .orders
        .get(Group::CutterRadius)
        .map_or(410, |word| word.tenths);
    let radius_mm = diameter_mm.abs() / 2.0;
    line.state.compensation = Compensation {
        code,
        side,
        radius_mm,
        programmed,
        plane,
        ..Compensation::default()
    };
    Ok(())
}

/// G40, and the end of a program: what is kept back ends beside its end.
pub(crate) fn off(line: &mut Line) -> Checked<()> {
    let done = if line.state.compensation.holds() {
        flush_here(line)
    } else {
        Ok(())
    };
    line.state.compensation = Compensation::default();
    done
}

fn flush_here(line: &mut Line) -> Checked<()> {
    let plane = line.state.compensation.plane;
    let end = plane.map(|axis| line.state.path.last_end[axis]);
    flush(line, plane, end)
}

/// A straight move from the programmed position before to the one now.
pub(crate) fn straight(line: &mut Line, kind: BlockKind) -> Checked<()> {
    if line.state.compensation.is_lost(line.state.path.uncertain) {
        return pass(line);
    }
    let plane = line.state.compensation.plane;
    let to = plane.map(|axis| line.state.path.position[axis]);
    let side = line.state.compensation.side;
    let radius_mm = line.state.compensation.radius_mm;
    let from = if line.state.compensation.fresh {
        let at = plane.map(|axis| line.state.path.last_end[axis]);
        if distance(at, to) <= radius_mm {
            let message = "the first move with radius compensation must be longer than the radius of the tool";
            return Err(entry_error(line, message));
        }
        at
    } else {
        line.state.compensation.programmed
    };
    if distance(from, to) < NO_MOVE {
        return across(line, plane, kind);
    }
    line.state.compensation.programmed_moves[1] = Some(Programmed {
        line: line.state.line,
        from,
        to,
        bend: None,
    });
    let direction = unit(from, to);
    let end = along(to, beside(direction, side), radius_mm);
    let track = Track::Line {
        through: end,
        direction,
    };
    let fresh = line.state.compensation.fresh;
    let feed_mm_per_s = feed(line, kind, distance(from, to))?;
    if !fresh {
        turn(line, direction, &track, (kind, feed_mm_per_s))?;
    }
    let block = template(line, end, kind, feed_mm_per_s);
    let keeps = (!fresh).then_some(direction);
    begin(line, Held::Line(Box::new(block), keeps), direction, to);
    Ok(())
}

/// An arc about a centre.
pub(crate) fn bent(line: &mut Line, ends: &Ends, parts: &Parts, plane: [usize; 2]) -> Checked<()> {
    if line.state.compensation.is_lost(line.state.path.uncertain) {
        return pass(line);
    }
    let side = line.state.compensation.side;
    let radius_mm = line.state.compensation.radius_mm;
    let Some(first) = parts.as_slice().first() else {
        return Ok(());
    };
    let sweep_rad: f64 = parts.as_slice().iter().map(|part| part.arc.sweep_rad).sum();
    let length_mm = first.arc.radius_mm * sweep_rad.abs();
    let mut center = first.arc.center_mm;
    let way = if ends.clockwise { -1.0 } else { 1.0 };
    let inside = side * way > 0.0;
    let tangent = |at: Point| beside(unit(center, at), way);
    let [begins, ends_in] = [ends.start, ends.end].map(tangent);
    let end = along(ends.end, beside(ends_in, side), radius_mm);
    let clockwise = ends.clockwise;
    line.state.compensation.programmed_moves[1] = Some(Programmed {
        line: line.state.line,
        from: ends.start,
        to: ends.end,
        bend: Some((center, clockwise)),
    });
    let feed_mm_per_s = feed(line, BlockKind::Arc, length_mm)?;
    if line.state.compensation.fresh {
        let at = plane.map(|axis| line.state.path.last_end[axis]);
        if distance(at, ends.end) <= radius_mm {
            let message =
                "the first arc with radius compensation must be longer than the radius of the tool";
            return Err(entry_error(line, message));
        }
        // The arc that leaves from where the tool stands, and ends beside the end in the same direction.
        let towards = unit(end, center);
        let cosine = dot(unit(end, at), towards);
        let out = distance(end, at) / 2.0 / cosine;
        if !out.is_finite() || cosine.abs() < NO_MOVE {
            return Err(entry_error(
                line,
                "the tool cannot enter by this arc: its radius is too large for it",
            ));
        }
        center = along(end, towards, out);
    } else {
        if inside && first.arc.radius_mm <= radius_mm {
            let message = format!(
                "the radius of the arc, {} mm, is not greater than that of the tool, {} mm: it would cut away the inside",
                crate::line_error::show(first.arc.radius_mm),
                crate::line_error::show(radius_mm)
            );
            return Err(drawn(line, line.motion_error("compensation", message)));
        }
        let offset_mm = if inside {
            first.arc.radius_mm - radius_mm
        } else {
            first.arc.radius_mm + radius_mm
        };
        let track = Track::Circle {
            center,
            radius_mm: offset_mm,
            outside: !inside,
            clockwise,
        };
        turn(line, begins, &track, (BlockKind::Line, feed_mm_per_s))?;
    }
    let block = template(line, end, BlockKind::Arc, feed_mm_per_s);
    let bend = Bend {
        center,
        clockwise,
        turns: ends.turns,
        sweep_rad: sweep_rad.abs(),
    };
    begin(line, Held::Arc(Box::new(block), bend), ends_in, ends.end);
    Ok(())
}

/// A line of the program after a wrong one: nothing is driven.
fn pass(line: &mut Line) -> Checked<()> {
    line.state.path.last_end = line.state.path.position;
    Ok(())
}

fn entry_error(line: &Line, message: &str) -> LineError {
    line.motion_error("compensation", message)
}

/// The feed of a move whose programmed length in the plane is `length_mm`.
fn feed(line: &Line, kind: BlockKind, length_mm: f64) -> Checked<f64> {
    if kind == BlockKind::Rapid {
        return Ok(f64::INFINITY);
    }
    let plane = line.state.compensation.plane;
    let mut across = line.state.path.block_end() - line.state.path.last_end;
    [across[plane[0]], across[plane[1]]] = [0.0; 2];
    let across_mm = if line.moves_linear(&across) {
        line.config.axes.path_length(&across)
    } else {
        0.0
    };
    line.feed(length_mm.hypot(across_mm), true)
}

/// The block of a move that ends beside its programmed end, at `end` in the plane.
fn template(line: &mut Line, end: Point, kind: BlockKind, feed_mm_per_s: f64) -> Block {
    let plane = line.state.compensation.plane;
    let mut to = line.state.path.block_end();
    [to[plane[0]], to[plane[1]]] = end;
    if line.state.spindle.surface.is_some() {
        let radius_mm =
            spindle::radius_mm(line, &line.state.path.last_end).max(spindle::radius_mm(line, &to));
        spindle::follow_radius(line, radius_mm);
    }
    Block {
        kind,
        end: to,
        feed_mm_per_s,
        ..line.state.blank_block()
    }
}

/// A move across the plane, kept back with what it follows.
fn across(line: &mut Line, plane: [usize; 2], kind: BlockKind) -> Checked<()> {
    let at = plane.map(|axis| line.state.path.last_end[axis]);
    let mut to = line.state.path.block_end();
    [to[plane[0]], to[plane[1]]] = at;
    let displacement = to - line.state.path.last_end;
    let length_mm = line.config.axes.path_length(&displacement);
    if length_mm == 0.0 {
        return Ok(());
    }
    let feed_mm_per_s = match kind {
        BlockKind::Rapid => f64::INFINITY,
        _ => line.feed(length_mm, line.moves_linear(&displacement))?,
    };
    let block = Block {
        kind,
        end: to,
        length_mm,
        feed_mm_per_s,
        ..line.state.blank_block()
    };
    line.state.path.last_end = to;
    line.state.path.at_rest = false;
    keep(line, Held::Across(Box::new(block)))
}

/// A move in the plane begins to wait.
fn begin(line: &mut Line, held: Held, direction: Point, programmed: Point) {
    if let Held::Line(block, _) | Held::Arc(block, _) = &held {
        line.state.path.last_end = block.end;
    }
    line.state.path.at_rest = false;
    let compensation = &mut line.state.compensation;
    compensation.held.push(held);
    compensation.programmed_moves = [compensation.programmed_moves[1], None];
    compensation.fresh = false;
    compensation.direction = direction;
    compensation.programmed = programmed;
}

fn keep(line: &mut Line, held: Held) -> Checked<()> {
    if line.state.compensation.held.len() == MAX_HELD {
        let message = format!(
            "more than {MAX_HELD} moves and events stand between two moves in the plane with radius compensation"
        );
        return Err(line.motion_error("compensation", message));
    }
    line.state.compensation.held.push(held);
    Ok(())
}

/// The corner between what is kept back and a move that begins in `direction`.
fn turn(
    line: &mut Line,
    direction: Point,
    track: &Track,
    move_of: (BlockKind, f64),
) -> Checked<()> {
    let compensation = &line.state.compensation;
    let plane = compensation.plane;
    let side = compensation.side;
    let radius_mm = compensation.radius_mm;
    let corner = compensation.programmed;
    let tool = (side, radius_mm);
    let before = compensation.direction;
    let end = along(corner, beside(before, side), radius_mm);
    let joined = match compensation
        .held
        .iter()
        .find(|held| matches!(held, Held::Line(..) | Held::Arc(..)))
    {
        Some(Held::Arc(_, bend)) => {
            let way = if bend.clockwise { -1.0 } else { 1.0 };
            let last = Track::Circle {
                center: bend.center,
                radius_mm: distance(bend.center, end),
                outside: side * way < 0.0,
                clockwise: bend.clockwise,
            };
            corner::join([before, direction], tool, [&last, track], end)
        }
        _ => corner::join(
            [before, direction],
            tool,
            [
                &Track::Line {
                    through: end,
                    direction: before,
                },
                track,
            ],
            end,
        ),
    };
    let Ok(joined) = joined else {
        return Err(gouge(
            line,
            held_line(line),
            "the tool does not fit into the corner between them",
        ));
    };
    match joined {
        Corner::Straight => flush(line, plane, end),
        Corner::Inside(place) => flush(line, plane, place),
        Corner::Round => {
            flush(line, plane, end)?;
            round(
                line,
                [end, along(corner, beside(direction, side), radius_mm)],
                corner,
                move_of,
            )
        }
    }
}

/// The tool rolls around an outside corner; a rapid goes straight.
fn round(
    line: &mut Line,
    [from, to]: [Point; 2],
    corner: Point,
    (kind, feed_mm_per_s): (BlockKind, f64),
) -> Checked<()> {
    let plane = line.state.compensation.plane;
    let mut block = Block {
        feed_mm_per_s,
        ..line.state.blank_block()
    };
    [block.end[plane[0]], block.end[plane[1]]] = to;
    if kind == BlockKind::Rapid {
        block.kind = BlockKind::Rapid;
        block.length_mm = distance(from, to);
        check_end(line, plane, &block)?;
        line.emit(block);
        return Ok(());
    }
    let clockwise = line.state.compensation.side > 0.0;
    let bend = Bend {
        center: corner,
        clockwise,
        turns: 1,
        sweep_rad: f64::INFINITY,
    };
    bend_block(line, plane, &block, &bend)
}

/// The line of the move that is kept back.
fn held_line(line: &Line) -> u32 {
    let first = line
        .state
        .compensation
        .held
        .iter()
        .find_map(|held| match held {
            Held::Line(block, _) | Held::Arc(block, _) | Held::Across(block) => Some(block.line),
            Held::Event(_) => None,
        });
    first.unwrap_or(line.state.line)
}

/// Hands out what is kept back: its last move in the plane ends at `end`.
fn flush(line: &mut Line, plane: [usize; 2], end: Point) -> Checked<()> {
    let held = std::mem::take(&mut line.state.compensation.held);
    let at_rest = line.state.path.at_rest;
    let mut at: Option<AxisVector> = None;
    for held in held {
        match held {
            Held::Line(block, keeps) => {
                let block = place(plane, *block, at, end);
                let way = [0, 1].map(|i| block.end[plane[i]] - block.start[plane[i]]);
                if keeps.is_some_and(|direction| dot(direction, way) < -NO_MOVE) {
                    let why = "the corner lies before the start of the first, and the tool would cut into what stands there";
                    return Err(gouge(line, block.line, why));
                }
                at = Some(emit_straight(line, plane, block)?);
            }
            Held::Arc(block, bend) => {
                let block = place(plane, *block, at, end);
                bend_block(line, plane, &block, &bend)?;
                at = Some(line.state.path.last_end);
            }
            Held::Across(block) => {
                let block = place(plane, *block, at, end);
                at = Some(emit_straight(line, plane, block)?);
            }
            Held::Event(mut item) => {
                if let Item::Event(event) = &mut *item {
                    event.before_block = line.state.path.next_index;
                }
                line.out.push(*item);
            }
        }
    }
    let mut last = line.state.path.last_end;
    [last[plane[0]], last[plane[1]]] = end;
    line.state.path.last_end = last;
    line.state.path.at_rest = at_rest;
    Ok(())
}

/// A block with its true ends in the plane.
fn place(plane: [usize; 2], mut block: Block, start: Option<AxisVector>, end: Point) -> Block {
    if let Some(start) = start {
        block.start = start;
    }
    [block.end[plane[0]], block.end[plane[1]]] = end;
    block
}

fn emit_straight(line: &mut Line, plane: [usize; 2], mut block: Block) -> Checked<AxisVector> {
    if block.kind != BlockKind::Dwell {
        block.length_mm = line.config.axes.path_length(&(block.end - block.start));
        if block.length_mm < NO_MOVE {
            return Ok(block.start);
        }
    }
    check_end(line, plane, &block)?;
    let end = block.end;
    line.emit(block);
    Ok(end)
}

fn check_end(line: &Line, plane: [usize; 2], block: &Block) -> Checked<()> {
    for axis in 0..line.letters.count() {
        if block.end[axis] != block.start[axis] || plane.contains(&axis) {
            line.check_travel(axis, block.end[axis], block.end[axis])
                .map_err(|error| beside_line(error, block.line))?;
        }
    }
    Ok(())
}

/// Says which line an error belongs to that shows only in a later one.
fn beside_line(mut error: LineError, line: u32) -> LineError {
    let _ = write!(
        error.message,
        "; the tool is driven beside the path of line {line}"
    );
    error
}

/// An arc between true ends.
fn bend_block(line: &mut Line, plane: [usize; 2], block: &Block, bend: &Bend) -> Checked<()> {
    let pick = |v: &AxisVector| plane.map(|axis| v[axis]);
    let (start, end) = (pick(&block.start), pick(&block.end));
    if distance(start, end) < NO_MOVE && bend.sweep_rad < std::f64::consts::PI {
        return Ok(());
    }
    let unequal = (distance(start, bend.center) - distance(end, bend.center)).abs();
    let ends = Ends {
        start,
        end,
        clockwise: bend.clockwise,
        turns: bend.turns,
        tolerance_mm: tolerance_mm(line.state.modes.unit_mm),
    };
    let parts = ends
        .about(bend.center)
        .map_err(|(_, why)| gouge(line, block.line, &why))?;
    let swept: f64 = parts
        .as_slice()
        .iter()
        .map(|part| part.arc.sweep_rad.abs())
        .sum();
    if swept > bend.sweep_rad + LONGER.max(unequal) {
        return Err(gouge(
            line,
            block.line,
            "the corner lies before the start of the first, which is an arc",
        ));
    }
    for part in parts.as_slice() {
        for (axis, (low, high)) in plane.into_iter().zip(extent(part)) {
            line.check_travel(axis, low, high)
                .map_err(|error| beside_line(error, block.line))?;
        }
    }
    let mut helix = block.end - block.start;
    [helix[plane[0]], helix[plane[1]]] = [0.0; 2];
    arc::push_parts(line, &parts, plane, block, &helix);
    Ok(())
}

#[cfg(test)]
mod tests;
