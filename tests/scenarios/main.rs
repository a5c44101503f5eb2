//! Scenarios end to end: a program goes in, and what comes out is judged by the oracle.
//!
//! What fails prints the command that replays it. `TANDEM_SEEDS=n` asks for more random programs than usual.

mod bad_input;
mod bench;
mod clocks;
mod defective;
mod disturbances;
mod estimate;
mod every_tick;
mod examples;
mod faults;
mod following;
mod force;
mod harness;
mod hold;
mod homing;
mod jog;
mod keys;
mod kinematics;
mod latency;
mod mdi;
mod nurbs;
mod operator;
mod optimal_stop;
mod overlap;
mod overrides;
mod plan;
mod plugins;
mod policy;
mod probing;
mod program_flow;
mod random;
mod random_curves;
mod replay;
mod report;
mod script;
mod signals;
mod single_block;
mod smooth;
mod smooth_peers;
mod starvation;
mod stopping_time;
mod stops;
mod system_calls;
mod trace;
