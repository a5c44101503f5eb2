//! The tool guard.

/// Trips where a torque stays above a level.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    level_nm: f64,
    samples: u32,
    above: u32,
}

impl Guard {
    /// Trips at the `samples`-th sample in a row above `level_nm`.
    pub fn new(level_nm: f64, samples: u32) -> Self {
        Self {
            level_nm,
            samples,
            above: 0,
        }
    }

    /// Takes a sample; whether the guard trips with it. It does so once, and again only after a sample below the level.
    pub fn trips(&mut self, torque_nm: f64) -> bool {
        self.above = if torque_nm > self.level_nm {
            self.above.saturating_add(1)
        } else {
            0
        };
        self.above == self.samples
    }

    /// Counts from zero again.
    pub fn restart(&mut self) {
        self.above = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_trips_once_at_the_nth_sample_in_a_row() {
        let mut guard = Guard::new(0.2, 3);
        let torques = [0.3, 0.3, 0.1, 0.3, 0.3, 0.3, 0.3, 0.3, 0.2, 0.3, 0.3, 0.3];
        let trips: Vec<usize> = (0..torques.len())
            .filter(|i| guard.trips(torques[*i]))
            .collect();
        assert_eq!(trips, [5, 11], "exactly at the level is not above it");
    }
}
