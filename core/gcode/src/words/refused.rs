//! Words that are known and refused, with the reason.

use super::Group::{Motion, NonModal, Plane, Polar, Rotation, Scaling, Spindle, Stop, ToolLength};
use super::Word;

const CYCLES: &str = "this canned cycle is not supported: let the CAM system write it out";
pub(super) const TURNING: &str =
    "turning cycles are not supported: let the CAM system write the passes out";
const SYNCHRONOUS: &str = "motion synchronous with the spindle is not supported";
const FRAMES: &str = "scaling, rotation, mirroring and polar coordinates are not supported";

pub(super) const WORDS: &[Word] = &[
    Word::refused(
        "G6.1",
        Motion,
        "NURBS",
        "write G6.2 (a control point and a knot a line) or G5.2",
    ),
    Word::refused(
        "G9",
        NonModal,
        "exact stop in this line only",
        "not supported: use G61.1 and G64",
    ),
    Word::refused("G16", Polar, "polar coordinates", FRAMES),
    Word::refused(
        "G17.1",
        Plane,
        "arcs in the plane UV",
        "arcs lie in XY, ZX or YZ",
    ),
    Word::refused(
        "G18.1",
        Plane,
        "arcs in the plane WU",
        "arcs lie in XY, ZX or YZ",
    ),
    Word::refused(
        "G19.1",
        Plane,
        "arcs in the plane VW",
        "arcs lie in XY, ZX or YZ",
    ),
    Word::refused("G33", Motion, "synchronous motion", SYNCHRONOUS),
    Word::refused("G33.1", Motion, "rigid tapping", SYNCHRONOUS),
    Word::refused(
        "G44",
        ToolLength,
        "negative tool length offset",
        "not supported: use G43 with the tool table",
    ),
    Word::refused("G51", Scaling, "scaling", FRAMES),
    Word::refused("G65", NonModal, "macro call", "macros are not supported"),
    Word::refused(
        "G66",
        NonModal,
        "modal macro call",
        "macros are not supported",
    ),
    Word::refused("G68", Rotation, "rotation", FRAMES),
    Word::refused("G68.2", Rotation, "tilted plane", FRAMES),
    Word::refused("G71.1", Motion, "roughing of a turned profile", TURNING),
    Word::refused("G71.2", Motion, "roughing of a turned profile", TURNING),
    Word::refused("G72", Motion, "facing of a turned profile", TURNING),
    Word::refused("G72.1", Motion, "facing of a turned profile", TURNING),
    Word::refused("G72.2", Motion, "facing of a turned profile", TURNING),
    Word::refused("G76", Motion, "threading", CYCLES),
    Word::refused("G87", Motion, "back boring", CYCLES),
    Word::refused(
        "M25",
        Stop,
        "Z to its home",
        "controls take it for different things (on some it opens a clamp or pauses): write G53 G0 Z or G28 Z",
    ),
    Word::refused(
        "M29",
        Spindle,
        "rigid tapping mode",
        "motion synchronous with the spindle is not supported",
    ),
];
