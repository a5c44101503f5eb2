//! Many simulations: jobs by the hashes of their inputs, their results, and the search for the best settings of a machine.
//!
//! A [`Job`] is pure: one program on one machine with some keys set gives the same result, bit for bit, wherever the same build
//! computes it. So a result is kept under a name that says all of that, and whatever is interrupted goes on where it was.
//! [`Bench`] simulates jobs on this computer; docs/batch.md says how several share them.

mod folder;
mod hash;
mod inputs;
mod job;
mod local;
mod result;
mod scene;
mod search;
mod simulate;
mod space;
mod table;
mod tune;
mod whole;

pub use folder::{Folder, Listed, files};
pub use hash::{sha256, sha256_of_file};
pub use inputs::{InputError, Inputs};
pub use job::{Build, FORMAT, Job, shown};
pub use local::{Bench, MAX_TRIES, Shard};
pub use result::{Ended, JobResult, Results, numbers_of};
pub use scene::{Lines, Scene};
pub use search::{Ask, Found, Point, Score, search};
pub use simulate::{PROGRAM, Plugins, simulate, simulate_with};
pub use space::{Parameter, Values, grid};
pub use table::Table;
pub use tune::{Keep, Task, Tried, Tuned, WorstDeviation, key_of, set_of, tune};
pub use whole::write_whole;
