//! The clocks that drive the loops: lockstep, and real time with what the computer grants.

pub mod exchange_time;
pub mod latency;
pub mod periods;
pub mod phase;
pub mod realtime;
pub mod virtual_clock;
pub mod wall_clock;
