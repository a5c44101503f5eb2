//! Words that radius compensation does not go with.

use crate::line::Line;
use crate::line_error::Checked;
use crate::state::MotionMode;
use crate::words::modes::Plane;
use crate::words::{Group, Shape};

/// What does not go with compensation that is on.
#[cold]
pub(crate) fn refuse_incompatible(line: &Line) -> Checked<()> {
    let word = line.state.compensation.word();
    let refuse = |group, other: &str, why: &str| {
        Err(line.orders.error(
            group,
            "compensation",
            format!("{other} {why} while {word} is on: G40 must come before"),
        ))
    };
    for group in [
        Group::Units,
        Group::Plane,
        Group::CoordinateSystem,
        Group::ToolLength,
        Group::ToolChange,
        Group::User,
    ] {
        if let Some(other) = line.orders.get(group)
            && !changes_nothing(line, other.tenths, group)
        {
            return refuse(group, other.code, "cannot act");
        }
    }
    if line
        .orders
        .get(Group::InputOutput)
        .is_some_and(|other| other.tenths == 660)
    {
        return refuse(Group::InputOutput, "M66", "cannot wait");
    }
    if let Some(other) = line
        .orders
        .get(Group::NonModal)
        .filter(|other| other.tenths != 40)
    {
        return refuse(Group::NonModal, other.code, "cannot act");
    }
    match line.orders.motion {
        Some(MotionMode::Word(other))
            if !matches!(other.shape(), Some(Shape::Straight | Shape::Arc)) =>
        {
            let message = format!(
                "{} does not go with {word}: G40 must come before",
                other.code
            );
            Err(line.motion_error("compensation", message))
        }
        _ => Ok(()),
    }
}

/// Whether a word says only what is so already.
fn changes_nothing(line: &Line, tenths: u16, group: Group) -> bool {
    let modes = &line.state.modes;
    match group {
        Group::Units => (tenths == 210) == (modes.unit_mm == 1.0),
        Group::Plane => {
            tenths
                == match modes.plane {
                    Plane::Xy => 170,
                    Plane::Zx => 180,
                    Plane::Yz => 190,
                }
        }
        Group::CoordinateSystem => {
            crate::persistent::system_code(line.state.coordinates.active())
                == crate::words::written('G', tenths)
        }
        _ => false,
    }
}
