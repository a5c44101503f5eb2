//! The wall clock of drives that move metal: they are exchanged with once in a fine period, and never sooner.

use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::machine::FINE_PERIOD_S;

/// When the next exchange may begin.
pub struct Pace {
    next: Instant,
}

impl Pace {
    /// At once.
    pub fn new() -> Self {
        Self {
            next: Instant::now(),
        }
    }

    /// Sleeps until a fine period after the last exchange has begun. What was late is not made up for: a setpoint that comes
    /// early asks for more speed than it says.
    pub fn wait(&mut self) {
        sleep(self.next.saturating_duration_since(Instant::now()));
        self.next = Instant::now() + Duration::from_secs_f64(FINE_PERIOD_S);
    }
}
