//! What ramps may use along the path, and where turning leaves less of the jerk.

use super::ramp::{Ramp, Tangential};

/// A ramp that had too much jerk.
#[derive(Clone, Copy, Debug)]
struct Eased {
    /// Path coordinates of its ends, mm.
    ends_mm: [f64; 2],
    /// It went up.
    rises: bool,
    /// Share of the jerk that is left.
    jerk: f64,
}

/// The limits of ramps; keeps its memory.
#[derive(Clone, Debug)]
pub struct Grade {
    pub least: Tangential,
    eased: Vec<Eased>,
}

impl Grade {
    /// The same everywhere.
    pub fn even(least: Tangential) -> Self {
        Self {
            least,
            eased: Vec::new(),
        }
    }

    /// Forgets where there is less.
    pub fn level(&mut self) {
        self.eased.clear();
    }

    /// Leaves ramps that go the same way where `ramp` did a share of the jerk.
    pub fn ease(&mut self, ramp: &Ramp, jerk: f64) {
        let [end_mm, end, ..] = ramp.at(ramp.duration_s);
        let rises = end > ramp.speed[0];
        let before = self.share([ramp.start_mm, end_mm], rises);
        self.eased.push(Eased {
            ends_mm: [ramp.start_mm, end_mm],
            rises,
            jerk: before * jerk,
        });
    }

    /// For ramps between two path coordinates: up and down.
    pub fn between(&self, ends_mm: [f64; 2]) -> [Tangential; 2] {
        [true, false].map(|rises| {
            let jerk_mm_per_s3 = self.share(ends_mm, rises) * self.least.jerk_mm_per_s3;
            Tangential {
                jerk_mm_per_s3,
                ..self.least
            }
        })
    }

    fn share(&self, [from_mm, to_mm]: [f64; 2], rises: bool) -> f64 {
        // Ramps that only touch are neighbours.
        let touch_mm = 1e-3 * (to_mm - from_mm);
        let here = |eased: &&Eased| {
            let overlap_mm = to_mm.min(eased.ends_mm[1]) - from_mm.max(eased.ends_mm[0]);
            eased.rises == rises
                && overlap_mm > touch_mm.min(1e-3 * (eased.ends_mm[1] - eased.ends_mm[0]))
        };
        self.eased
            .iter()
            .filter(here)
            .fold(1.0, |least, eased| least.min(eased.jerk))
    }
}
