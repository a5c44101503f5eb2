//! The M words.

use crate::table::Group::{CoolantOff, Flood, InputOutput, Mist, Override, Spindle, Stop, ToolChange, User};
use crate::table::{Row, refused, works};

const SUBPROGRAMS: &str = "subprograms are not supported: let the CAM system write the program out flat";
const ANALOG: &str = "analogue outputs are not supported";
const MODAL: &str = "saving and restoring the modal state is not supported";

/// All M words, by number.
pub(crate) static M_ROWS: &[Row] = &[
    works(0, Stop, "", "stop until the operator resumes"),
    works(10, Stop, "", "stop where the optional stop is on"),
    works(20, Stop, "", "end of the program"),
    works(30, Spindle, "", "spindle clockwise"),
    works(40, Spindle, "", "spindle counter-clockwise"),
    works(50, Spindle, "", "spindle stop"),
    works(60, ToolChange, "", "change to the tool selected by T"),
    works(70, Mist, "", "mist coolant on"),
    works(80, Flood, "", "flood coolant on"),
    works(90, CoolantOff, "", "coolant off"),
    refused(190, Spindle, "oriented spindle stop", "orienting the spindle is not supported"),
    refused(290, Spindle, "rigid tapping mode", "motion synchronous with the spindle is not supported"),
    works(300, Stop, "", "end of the program"),
    works(480, Override, "", "feed and spindle overrides on"),
    works(490, Override, "", "feed and spindle overrides off"),
    works(500, Override, "P", "feed override on (P1) or off (P0)"),
    works(510, Override, "P", "spindle override on (P1) or off (P0)"),
    works(520, Override, "P", "adaptive feed on (P1) or off (P0)"),
    works(530, Override, "P", "feed hold permitted (P1) or not (P0)"),
    refused(600, Stop, "pallet change", "pallets are not supported"),
    refused(610, ToolChange, "set the number of the tool", "not supported: the configuration says which tool is in"),
    works(620, InputOutput, "P", "digital output P on, with the motion"),
    works(630, InputOutput, "P", "digital output P off, with the motion"),
    works(640, InputOutput, "P", "digital output P on, at rest"),
    works(650, InputOutput, "P", "digital output P off, at rest"),
    works(660, InputOutput, "PELQ", "wait for digital input P"),
    refused(670, InputOutput, "analogue output with the motion", ANALOG),
    refused(680, InputOutput, "analogue output", ANALOG),
    refused(700, User, "save the modal state", MODAL),
    refused(710, User, "drop the saved modal state", MODAL),
    refused(720, User, "restore the modal state", MODAL),
    refused(730, User, "save and restore the modal state", MODAL),
    refused(980, User, "subprogram call", SUBPROGRAMS),
    refused(990, User, "subprogram return", SUBPROGRAMS),
];
