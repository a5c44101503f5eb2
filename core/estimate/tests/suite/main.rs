//! The reference cases, and the tie between the published model and the planners.

mod calibration;
mod common;
mod paper;
mod planned;
mod tie;
