//! From a machine and a program to everything that a run needs: what is refused is refused here.

pub mod claim;
pub mod commands;
pub mod density;
pub mod dry_run;
pub mod lines;
pub mod parts;
pub mod ready;
pub mod rules;
pub mod stand_in;
