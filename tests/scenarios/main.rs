//! Scenarios end to end: a program goes in, and what comes out is judged by the oracle.
//!
//! Random ones print their seed; `TANDEM_SEED=n cargo test -p tandem --test scenarios NAME` replays one.

mod bad_input;
mod clocks;
mod defective;
mod examples;
mod faults;
mod harness;
mod hold;
mod latency;
mod overrides;
mod program_flow;
mod random;
mod report;
mod starvation;
mod system_calls;
mod trace;
