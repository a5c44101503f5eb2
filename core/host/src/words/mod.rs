//! What a machine is and waits for, in words.

pub mod fault_text;
pub mod joint_words;
pub mod roles;
pub mod spindle;
