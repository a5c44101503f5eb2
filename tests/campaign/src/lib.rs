//! Random machines, programs and operators: each run is driven through the host as the command drives it, and judged.
//!
//! A seed draws a machine, a program for it and what the operator does. [`run::run`] drives it on the virtual clock and
//! judges it: the oracle, the counts of the summary, and a bound of its own on how long it may take. Runs are driven in
//! worker processes ([`worker`]), so that one that aborts, never ends or takes all memory is one failed run. What fails is
//! made smaller ([`minimise`]) and written as files that `tandem run` reads.
//!
//! `docs/campaign.md` says how to use it.

pub mod bound;
pub mod campaign;
pub mod case;
pub mod commands;
pub mod draw;
pub mod machine;
pub mod minimise;
pub mod program;
pub mod run;
pub mod verdict;
pub mod worker;
