//! G38.2 to G38.5 and G31: a straight line that the probe ends.

use tandem_sdk::{AxisVector, Block, BlockKind, Edge, StopOn};

use super::modes::FeedMode;
use super::{Action, Group, Shape, Word};
use crate::item::ProbeResult;
use crate::line::Line;
use crate::line_error::Checked;
use crate::state::State;
use crate::state::letters::{AXIS_LETTERS, Letters};
use crate::state::parameters::Parameters;
use crate::state::path::NO_MOVE;

pub(super) const WORDS: &[Word] = &[
    Word::new(
        "G31",
        Group::Motion,
        "XYZABCUVW",
        "skip: straight line that the probe ends; in this line only",
        Action::MoveOnce(Shape::Probe, |line| probe(line, TOWARDS)),
        "G31 Z-5",
    ),
    Word::new(
        "G38.2",
        Group::Motion,
        "XYZABCUVW",
        "straight line until the probe touches; an error where it does not",
        Action::Move(Shape::Probe, |line| {
            probe(
                line,
                Probe {
                    must: true,
                    ..TOWARDS
                },
            )
        }),
        "G38.2 Z-5",
    ),
    Word::new(
        "G38.3",
        Group::Motion,
        "XYZABCUVW",
        "straight line until the probe touches",
        Action::Move(Shape::Probe, |line| probe(line, TOWARDS)),
        "G38.3 Z-5",
    ),
    Word::new(
        "G38.4",
        Group::Motion,
        "XYZABCUVW",
        "straight line until the probe lets go; an error where it does not",
        Action::Move(Shape::Probe, |line| {
            probe(line, Probe { must: true, ..AWAY })
        }),
        "G38.4 Z5",
    ),
    Word::new(
        "G38.5",
        Group::Motion,
        "XYZABCUVW",
        "straight line until the probe lets go",
        Action::Move(Shape::Probe, |line| probe(line, AWAY)),
        "G38.5 Z5",
    ),
];

/// First of the nine parameters of the touched position.
pub(crate) const TOUCHED: usize = 5061;
/// Whether the last probe touched (or let go).
pub(crate) const SUCCESS: usize = 5070;

/// What ends the line.
#[derive(Clone, Copy)]
struct Probe {
    /// The probe lets go, instead of touching.
    away: bool,
    /// It is an error where it does not.
    must: bool,
}

const TOWARDS: Probe = Probe {
    away: false,
    must: false,
};
const AWAY: Probe = Probe {
    away: true,
    must: false,
};

/// Rest, and the block that an edge ends.
fn probe(line: &mut Line, probe: Probe) -> Checked<()> {
    line.advance();
    let word = line.orders.motion_code();
    let stop_on = stop_on(line, probe, word)?;
    refuse_same_line(line, word)?;
    let end = line.state.path.block_end();
    let displacement = end - line.state.path.last_end;
    let length_mm = line.config.axes.path_length(&displacement);
    if length_mm <= NO_MOVE {
        let message = format!("{word} would not move: the probe stands where it is to end");
        return Err(line.motion_error("probe-distance", message));
    }
    let feed_mm_per_s = line.feed(length_mm, line.moves_linear(&displacement))?;
    for axis in (0..line.letters.count()).filter(|axis| displacement[*axis] != 0.0) {
        line.check_travel(axis, end[axis], end[axis])?;
    }
    line.rest();
    let blank = line.state.blank_block();
    line.push(Block {
        kind: BlockKind::Line,
        end,
        length_mm,
        feed_mm_per_s,
        stop_on,
        ..blank
    });
    line.state.path.at_rest = true;
    Ok(())
}

fn stop_on(line: &Line, probe: Probe, word: &str) -> Checked<StopOn> {
    let Some(wired) = line.config.probe else {
        let message = format!("{word}: this machine has no probe: its file has no [probe]");
        return Err(line.motion_error("refused", message));
    };
    let edge = if probe.away == wired.inverted {
        Edge::Rising
    } else {
        Edge::Falling
    };
    Ok(StopOn {
        input: wired.input,
        edge,
        miss_is_fault: u32::from(probe.must),
    })
}

/// What a probe does not go with.
fn refuse_same_line(line: &Line, word: &str) -> Checked<()> {
    line.refuse_machine_coordinates()?;
    if line
        .orders
        .get(Group::InputOutput)
        .is_some_and(|other| other.tenths == 660)
    {
        let message = format!("{word} and M66 each wait for an input: split the line");
        return Err(line.motion_error("conflict", message));
    }
    if line.words.named() == 0 {
        return Err(line.motion_error(
            "axis-missing",
            format!("{word} needs at least one axis word"),
        ));
    }
    if line.state.modes.feed.mode == FeedMode::InverseTime {
        let message = format!(
            "{word} does not go with G93: where it ends is not known, so its time is not either"
        );
        return Err(line.motion_error("conflict", message));
    }
    Ok(())
}

/// What became of the probe. #5061 to #5069 get the touched position in program coordinates and units, the programmed end
/// where nothing touched; #5070 says which. The program goes on from where the machine rests.
pub(crate) fn provide(
    state: &mut State,
    parameters: &mut Parameters,
    letters: &Letters,
    result: &ProbeResult,
) {
    let touched: AxisVector = result.touched.unwrap_or(state.path.position);
    let touched = state.coordinates.to_program(&touched);
    for (nth, letter) in AXIS_LETTERS.bytes().enumerate() {
        let value = letters
            .axis(letter)
            .map_or(0.0, |axis| touched[axis] / state.modes.scale(letters, axis));
        parameters.set_numbered(TOUCHED + nth, value, false);
    }
    parameters.set_numbered(
        SUCCESS,
        f64::from(u8::from(result.touched.is_some())),
        false,
    );
    state.path.set(result.rest);
}

/// The first pass: the probe is taken to touch at its end, and what follows from that to be unknown. `named` are the axes
/// of its line.
pub(crate) fn assume(
    state: &mut State,
    parameters: &mut Parameters,
    letters: &Letters,
    named: u32,
) {
    let end = state.path.position;
    let assumed = state.path.assumed | named;
    provide(
        state,
        parameters,
        letters,
        &ProbeResult {
            touched: Some(end),
            rest: end,
        },
    );
    (TOUCHED..=SUCCESS).for_each(|number| parameters.assume(number));
    state.path.assumed = assumed;
}
