//! Simulated drives: the driver `sim`.
//!
//! The same contract as real hardware ([`tandem_sdk::Driver`]), so that a simulation is the same host with another driver.
//! Three models, chosen by the option `model`:
//!
//! - `"ideal"` (default): the feedback of an exchange is the setpoint of that exchange.
//! - `"second-order"`: every joint is a position servo of second order with a following error.
//! - `"servo"`: every joint is a motor with its loops, inertia, friction, encoder and current, loaded by a cutting process;
//!   [`servo`] has its parts. Analog input 0 is the true cutting torque, input 1 the depth of cut.
//!
//! ```toml
//! [driver]
//! plugin = "sim"
//! [driver.options]
//! model = "second-order"
//! natural_frequency_hz = 30
//! damping_ratio = 0.7
//! spindle_time_constant_s = 0.3
//! quick_stop_deceleration_mm_per_s2 = 5000
//! watchdog_periods = 5             # silent fine periods after which the drives stop by themselves; 0: never
//!
//! [[driver.options.switches]]      # input 0 is 1 while joint 0 stands above 12.5 mm: a touch plane to probe
//! input = 0
//! joint = 0
//! above_mm = 12.5
//! ```
//!
//! Beyond that it can be as demanding as real drives are, each of it off unless asked for: joints that stand anywhere, known or
//! not (`encoder`), drives that take their time (`enable_s`, `brake_s`), gravity, faults, noise, and a bus that loses frames
//! (`lost_frames`), is late or has a clock of its own. `docs/simulation.md` has all of it.
//!
//! Everything is computed from the setpoints and the fine period, and what is random comes from a seed, so a run repeats bit for
//! bit. Only `bus_start_s`, in real time, and `bus_clock` look at a clock, and no command depends on them.

mod bus_clock;
mod driver;
mod encoder;
mod faults;
mod hard_stop;
mod joint;
mod mechanics;
mod options;
mod power;
pub mod servo;
mod shape;
mod spindle;
mod switches;
mod times;
mod watchdog;
mod wire;

pub use bus_clock::BusClockOptions;
pub use driver::{SimulatedDrives, WATCHDOG_FAULT};
pub use encoder::Encoder;
pub use faults::DriveFault;
pub use hard_stop::{HardStop, TORQUE_FAULT};
pub use joint::CURRENT_A_PER_MM_PER_S2;
pub use options::{Model, Options, Switch};
pub use shape::Bore;
pub use wire::Frames;

use tandem_sdk::PluginError;

tandem_sdk::plugin!(driver "sim" = open);

fn open(options: &Options) -> Result<SimulatedDrives, PluginError> {
    options.check()?;
    Ok(SimulatedDrives::new(options.clone()))
}
