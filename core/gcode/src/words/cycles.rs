//! G73, G74, G81 to G86, G88, G89 with G98 and G99: canned cycles, as LinuxCNC drives them.

use tandem_sdk::{AxisVector, BlockKind, EventKind};

use super::modes::FeedMode;
use super::overrides::{self, FEED, SPINDLE};
use super::{Action, Group, Shape, Word, motion, spindle};
use crate::line::Line;
use crate::line_error::{Checked, LineError};
use crate::state::letters::{Letters, mask};

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G73",
        Group::Motion,
        LETTERS_Q,
        "drilling, chip breaking: Q a peck",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::ChipBreaking)),
        "G99 G73 X1 Y2 Z-3 R1 Q1",
    ),
    Word::new(
        "G74",
        Group::Motion,
        LETTERS_P,
        "left-hand tapping with a floating chuck: P dwell",
        Action::Move(Shape::Cycle, |line| {
            cycle(line, Kind::Tapping { direction: -1 })
        }),
        "M4\nG74 X1 Z-3 R1",
    ),
    Word::new(
        "G81",
        Group::Motion,
        LETTERS,
        "drilling to Z from R; L repeats",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::Drilling)),
        "G81 X1 Y2 Z-3 R1",
    ),
    Word::new(
        "G82",
        Group::Motion,
        LETTERS_P,
        "drilling, dwell of P seconds",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::DrillingDwell)),
        "G82 X1 Z-3 R1 P0.5",
    ),
    Word::new(
        "G83",
        Group::Motion,
        LETTERS_Q,
        "drilling, pecks of Q, out of the hole between",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::Pecking)),
        "G83 X1 Z-3 R1 Q1",
    ),
    Word::new(
        "G84",
        Group::Motion,
        LETTERS_P,
        "tapping with a floating chuck: P dwell",
        Action::Move(Shape::Cycle, |line| {
            cycle(line, Kind::Tapping { direction: 1 })
        }),
        "M3\nG84 X1 Z-3 R1",
    ),
    Word::new(
        "G85",
        Group::Motion,
        LETTERS,
        "boring, out at the feed",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::Boring)),
        "G85 X1 Z-3 R1",
    ),
    Word::new(
        "G86",
        Group::Motion,
        LETTERS_P,
        "boring, dwell of P, spindle stop, rapid out",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::BoringStop)),
        "M3\nG86 X1 Z-3 R1 P0.5",
    ),
    Word::new(
        "G88",
        Group::Motion,
        LETTERS_P,
        "boring, dwell of P, spindle and program stop, then rapid out",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::BoringByHand)),
        "M3\nG88 X1 Z-3 R1 P0.5",
    ),
    Word::new(
        "G89",
        Group::Motion,
        LETTERS_P,
        "boring, dwell of P, out at the feed",
        Action::Move(Shape::Cycle, |line| cycle(line, Kind::BoringDwell)),
        "G89 X1 Z-3 R1 P0.5",
    ),
    Word::new(
        "G98",
        Group::CycleReturn,
        "",
        "cycles end where they began, or at R where that is higher",
        Action::Act(|line| retract(line, false)),
        "G98 G81 X1 Z-3 R1",
    ),
    Word::new(
        "G99",
        Group::CycleReturn,
        "",
        "cycles end at R (in force at the start, as in LinuxCNC)",
        Action::Act(|line| retract(line, true)),
        "G99 G81 X1 Z-3 R1",
    ),
];

const LETTERS: &str = "XYZRL";
const LETTERS_P: &str = "XYZRLP";
const LETTERS_Q: &str = "XYZRLQ";
/// How far above the last peck a rapid ends: LinuxCNC's value, 0.01 inch.
const PECK_CLEARANCE_MM: f64 = 0.254;
/// A peck that ends nearer to the bottom is the last: the rounding of inches.
const ROUNDING_MM: f64 = 1e-9;
/// Moves of a peck: down, out to R, and back to just above where it ended.
const MOVES_PER_PECK: f64 = 3.0;
/// Most moves and dwells of a hole without pecks, with the two rapids to it. L of these kinds is bounded by it: a kind that makes more
/// needs a number of its own.
const MAX_MOVES_PER_HOLE: f64 = 8.0;
/// Most moves of a line, so that memory stays bounded.
const MAX_MOVES: f64 = 100_000.0;

/// What happens in the hole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    ChipBreaking,
    Pecking,
    Drilling,
    DrillingDwell,
    Tapping { direction: i8 },
    Boring,
    BoringStop,
    BoringByHand,
    BoringDwell,
}

impl Kind {
    fn pecks(self) -> bool {
        matches!(self, Self::ChipBreaking | Self::Pecking)
    }

    /// Whether P, the time of a dwell, has to be given. It is needed wherever in the hole a kind dwells.
    fn needs_dwell_time(self) -> bool {
        self.dwells_at_bottom()
    }

    /// Whether it dwells for P at the bottom of the hole, before the way out.
    fn dwells_at_bottom(self) -> bool {
        matches!(
            self,
            Self::DrillingDwell | Self::BoringStop | Self::BoringByHand | Self::BoringDwell
        )
    }
}

/// What the lines of a cycle leave to the next ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cycles {
    /// G98: cycles end where they began, not at R (G99).
    to_initial: bool,
    /// The cycle whose words these are, by its number in tenths.
    of: u16,
    sticky: Sticky,
    /// Where the first of these cycles began, along the axis of the hole, program coordinates, mm.
    initial_mm: Option<f64>,
}

/// Words that stay in force from line to line of one cycle, as they were given: mm and s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sticky {
    r_mm: Option<f64>,
    depth_mm: Option<f64>,
    peck_mm: Option<f64>,
    dwell_s: Option<f64>,
}

impl Cycles {
    /// A motion word begins: what another cycle left is forgotten.
    pub fn begin(&mut self, word: &Word) {
        if self.of != word.tenths {
            self.of = word.tenths;
            self.sticky = Sticky::default();
        }
        if word.shape() != Some(Shape::Cycle) {
            self.initial_mm = None;
        }
    }

    /// Whether G98 is in force.
    pub fn return_to_initial(self) -> bool {
        self.to_initial
    }

    pub fn set_to_initial(&mut self, to_initial: bool) {
        self.to_initial = to_initial;
    }

    /// G80.
    pub fn end(&mut self) {
        self.of = 0;
        self.sticky = Sticky::default();
        self.initial_mm = None;
    }
}

/// G98 and G99.
fn retract(line: &mut Line, to_r: bool) -> Checked<()> {
    line.state.cycles.to_initial = !to_r;
    Ok(())
}

/// The holes of a line, in program coordinates, mm.
struct Holes {
    kind: Kind,
    /// The axis of the hole, and the two of the plane.
    normal: usize,
    plane: [usize; 2],
    /// From one hole to the next.
    step: [f64; 2],
    count: u32,
    /// The level where the rapid to the hole ends and the feed begins.
    r_mm: f64,
    /// The level of Z, or of the axis across the plane.
    bottom_mm: f64,
    peck_mm: f64,
    dwell_s: f64,
    /// The level to which the tool leaves the hole: R, or with G98 where the first of the cycles began.
    clear_mm: f64,
}

fn cycle(line: &mut Line, kind: Kind) -> Checked<()> {
    // After an error the reading goes on from where the cycle leaves the tool, not from the words X, Y and Z of the line.
    line.state.path.moved = true;
    line.refuse_machine_coordinates()?;
    if line.words.named() == 0 {
        let message = format!("{} needs at least one of X Y Z", line.orders.motion_code());
        return Err(line.motion_error("axis-missing", message));
    }
    if line.state.modes.feed.mode == FeedMode::InverseTime {
        return Err(line.motion_error("conflict", "canned cycles do not go with G93"));
    }
    let mut at = line.state.coordinates.to_program(&line.state.path.position);
    let holes = holes(line, kind, &at)?;
    let exact_stop = std::mem::replace(&mut line.state.modes.exact_stop, true);
    let done = drill(line, &holes, &mut at);
    line.state.modes.exact_stop = exact_stop;
    // What the answer of a probe has set may be in any of the three from here on.
    if line.reads_assumed.get() {
        line.state.path.assumed |= line.letters.axes_of(mask("XYZ"));
    }
    done
}

fn axes(letters: &Letters, plane: [u8; 2]) -> Option<(usize, [usize; 2])> {
    let normal = b"XYZ".iter().find(|letter| !plane.contains(letter))?;
    let [normal, a, b] = [*normal, plane[0], plane[1]].map(|letter| letters.axis(letter));
    let found = (normal?, [a?, b?]);
    (!b"XYZ"
        .iter()
        .filter_map(|letter| letters.axis(*letter))
        .any(|axis| letters.is_rotary(axis)))
    .then_some(found)
}

/// The word of an axis, mm: X may be a diameter.
fn word_mm(line: &Line, axis: usize) -> Option<f64> {
    let value = line.words.get(line.letters.letter(axis))?;
    Some(value * line.state.modes.word_scale(line.letters, axis))
}

/// What the line says of its holes; `at` is where it begins.
fn holes(line: &mut Line, kind: Kind, at: &AxisVector) -> Checked<Holes> {
    let plane = line.state.modes.plane.letters();
    let missing = || line.motion_error("axis", "a canned cycle needs the linear axes X Y Z");
    let (normal, plane) = axes(line.letters, plane).ok_or_else(missing)?;
    let sticky = sticky(line, kind, normal)?;
    let initial_mm = *line.state.cycles.initial_mm.get_or_insert(at[normal]);
    let r_mm = sticky.r_mm.unwrap_or_default();
    let depth_mm = sticky.depth_mm.unwrap_or_default();
    // With G91 R is measured from where the first of the cycles began, and the bottom from R.
    let absolute = line.state.modes.absolute;
    let r_mm = if absolute { r_mm } else { initial_mm + r_mm };
    let bottom_mm = if absolute { depth_mm } else { r_mm + depth_mm };
    if r_mm < bottom_mm {
        return Err(line.motion_error("cycle", "R lies below the bottom of the hole"));
    }
    let named = plane.map(|axis| word_mm(line, axis).unwrap_or_default());
    let step = if line.state.modes.absolute {
        [0.0; 2]
    } else {
        named
    };
    let count = line.words.integer(b'L', 1..=10_000)?.unwrap_or(1);
    let clear_mm = if line.state.cycles.to_initial {
        initial_mm.max(r_mm)
    } else {
        r_mm
    };
    let peck_mm = sticky.peck_mm.unwrap_or_default();
    let dwell_s = sticky.dwell_s.unwrap_or_default();
    let moves = f64::from(count)
        * if kind.pecks() {
            (r_mm - bottom_mm) / peck_mm * MOVES_PER_PECK
        } else {
            MAX_MOVES_PER_HOLE
        };
    if moves > MAX_MOVES {
        let message = format!("this line would make {moves:.0} moves, {MAX_MOVES:.0} are allowed");
        return Err(line.motion_error("cycle", message));
    }
    Ok(Holes {
        kind,
        normal,
        plane,
        step,
        count,
        r_mm,
        bottom_mm,
        peck_mm,
        dwell_s,
        clear_mm,
    })
}

/// The words of the line, and those that earlier lines of the same cycle have left.
fn sticky(line: &mut Line, kind: Kind, normal: usize) -> Checked<Sticky> {
    let unit_mm = line.state.modes.unit_mm;
    let left = line.state.cycles.sticky;
    let given = |letter| line.words.get(letter).map(|value| value * unit_mm);
    let sticky = Sticky {
        r_mm: given(b'R').or(left.r_mm),
        depth_mm: word_mm(line, normal).or(left.depth_mm),
        peck_mm: given(b'Q').or(left.peck_mm),
        dwell_s: line.words.not_negative(b'P')?.or(left.dwell_s),
    };
    let missing = |what: &str| -> LineError {
        line.motion_error(
            "word-missing",
            format!("{} needs {what}", line.orders.motion_code()),
        )
    };
    let letter = line.letters.letter(normal);
    let bottom = format!("{}, the bottom of the hole", letter as char);
    for (lacks, what) in [
        (
            sticky.r_mm.is_none(),
            "R, the level from which the feed begins",
        ),
        (sticky.depth_mm.is_none(), &bottom),
        (
            kind.needs_dwell_time() && sticky.dwell_s.is_none(),
            "P, the dwell in seconds",
        ),
        (
            kind.pecks() && sticky.peck_mm.is_none(),
            "Q, the depth of a peck",
        ),
    ] {
        if lacks {
            return Err(missing(what));
        }
    }
    if kind.pecks() && sticky.peck_mm.is_some_and(|peck| peck <= 0.0) {
        return Err(line.motion_error(
            "word-range",
            "Q, the depth of a peck, must be greater than zero",
        ));
    }
    line.state.cycles.sticky = sticky;
    Ok(sticky)
}

/// A move to `to`, program coordinates.
fn go(line: &mut Line, kind: BlockKind, to: &AxisVector) -> Checked<()> {
    line.state.path.position = line.state.coordinates.to_machine(to);
    motion::straight(line, kind)
}

/// A move along the hole to `level_mm`.
fn plunge(
    line: &mut Line,
    kind: BlockKind,
    at: &mut AxisVector,
    normal: usize,
    level_mm: f64,
) -> Checked<()> {
    at[normal] = level_mm;
    go(line, kind, at)
}

/// All holes of the line.
fn drill(line: &mut Line, holes: &Holes, at: &mut AxisVector) -> Checked<()> {
    if at[holes.normal] < holes.r_mm {
        plunge(line, BlockKind::Rapid, at, holes.normal, holes.r_mm)?;
    }
    for _ in 0..holes.count {
        for (axis, step) in holes.plane.into_iter().zip(holes.step) {
            let named = word_mm(line, axis).filter(|_| line.state.modes.absolute);
            at[axis] = named.unwrap_or(at[axis] + step);
        }
        if let (Some(polar), Some([x, y])) = (line.words.polar, line.state.coordinates.plane()) {
            let unit_mm = line.state.modes.unit_mm;
            let absolute = line.state.modes.absolute;
            let place = polar.place([at[x] / unit_mm, at[y] / unit_mm], absolute);
            [at[x], at[y]] = place.map(|value| value * unit_mm);
        }
        go(line, BlockKind::Rapid, at)?;
        plunge(line, BlockKind::Rapid, at, holes.normal, holes.r_mm)?;
        hole(line, holes, at)?;
    }
    Ok(())
}

/// One hole, from R to the clearance.
fn hole(line: &mut Line, holes: &Holes, at: &mut AxisVector) -> Checked<()> {
    let normal = holes.normal;
    if holes.kind.pecks() {
        pecks(line, holes, at)?;
    }
    if let Kind::Tapping { direction } = holes.kind {
        return tap(line, holes, at, direction);
    }
    plunge(line, BlockKind::Line, at, normal, holes.bottom_mm)?;
    if holes.kind.dwells_at_bottom() {
        line.dwell(holes.dwell_s);
    }
    match holes.kind {
        Kind::Boring => {
            plunge(line, BlockKind::Line, at, normal, holes.r_mm)?;
            plunge(line, BlockKind::Rapid, at, normal, holes.clear_mm)
        }
        Kind::BoringDwell => plunge(line, BlockKind::Line, at, normal, holes.clear_mm),
        Kind::BoringStop | Kind::BoringByHand => {
            let direction = line.state.spindle.direction;
            if direction == 0 {
                return Err(line.motion_error("cycle", "this cycle needs a spindle that turns"));
            }
            spindle::stop(line);
            if holes.kind == Kind::BoringByHand {
                line.event(EventKind::ProgramStop, 0, 0.0);
            }
            plunge(line, BlockKind::Rapid, at, normal, holes.clear_mm)?;
            spindle::turn(line, direction)
        }
        _ => plunge(line, BlockKind::Rapid, at, normal, holes.clear_mm),
    }
}

/// All pecks but the last, which ends at the bottom.
fn pecks(line: &mut Line, holes: &Holes, at: &mut AxisVector) -> Checked<()> {
    let mut depth = holes.r_mm - holes.peck_mm;
    while depth > holes.bottom_mm + ROUNDING_MM {
        plunge(line, BlockKind::Line, at, holes.normal, depth)?;
        if holes.kind == Kind::Pecking {
            plunge(line, BlockKind::Rapid, at, holes.normal, holes.r_mm)?;
        }
        plunge(
            line,
            BlockKind::Rapid,
            at,
            holes.normal,
            depth + PECK_CLEARANCE_MM,
        )?;
        depth -= holes.peck_mm;
    }
    Ok(())
}

/// In and out at the feed, the spindle turned round at the bottom and again at the end. Nothing follows the spindle: the chuck floats,
/// and the program's feed is the speed times the pitch. The overrides would break the thread: they are off meanwhile.
fn tap(line: &mut Line, holes: &Holes, at: &mut AxisVector, direction: i8) -> Checked<()> {
    if line.state.spindle.direction != direction {
        let way = if direction > 0 {
            "clockwise (M3)"
        } else {
            "counter-clockwise (M4)"
        };
        let message = format!(
            "{} needs the spindle to turn {way}",
            line.orders.motion_code()
        );
        return Err(line.motion_error("cycle", message));
    }
    let permits = line.state.permits;
    overrides::switch(line, FEED, false);
    overrides::switch(line, SPINDLE, false);
    plunge(line, BlockKind::Line, at, holes.normal, holes.bottom_mm)?;
    spindle::turn(line, -direction)?;
    if holes.dwell_s > 0.0 {
        line.dwell(holes.dwell_s);
    }
    plunge(line, BlockKind::Line, at, holes.normal, holes.clear_mm)?;
    spindle::turn(line, direction)?;
    overrides::switch(line, FEED, permits.feed_override());
    overrides::switch(line, SPINDLE, permits.spindle_override());
    Ok(())
}

#[cfg(test)]
mod tests;
