//! What a machine is and waits for, in words.

pub mod drive_states;
pub mod fault_text;
pub mod roles;
pub mod spindle;
