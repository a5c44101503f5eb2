//! The published cases, against the loop that they were made with.

mod constants;
mod force;
mod friction;
mod inertia;
mod motion;
mod observer;
mod rig;
