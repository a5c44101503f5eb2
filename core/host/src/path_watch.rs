//! How far samples are from the programmed path.

use std::collections::VecDeque;

use tandem_motion::Path;
use tandem_sdk::{AxisVector, Block};

/// Blocks looked back over where a planner leaves the path: what its filters can still hold.
const LOOK_BACK: usize = 256;

/// Distances that are rounding of the segments, mm: not worth looking at the neighbours.
const ON_PATH_MM: f64 = 1e-6;

/// Keeps the paths of the blocks that move now and measures samples against them.
#[derive(Debug, Default)]
pub struct PathWatch {
    /// Paths with the index of their block.
    paths: VecDeque<(u64, Path)>,
    /// Largest distance so far, mm.
    pub max_mm: f64,
}

impl PathWatch {
    /// A block that will be driven.
    pub fn block(&mut self, block: &Block) {
        if let Some(path) = Path::new(block) {
            self.paths.push_back((block.index, path));
        }
    }

    /// Distance of `position`, sampled while block `block` moved, from the path, mm. Blocks far behind are forgotten.
    pub fn sample(&mut self, block: u64, position: &AxisVector) -> f64 {
        while self.paths.len() > LOOK_BACK && self.paths[LOOK_BACK].0 < block {
            self.paths.pop_front();
        }
        let here = self.paths.partition_point(|(index, _)| *index < block);
        let mut nearest = f64::INFINITY;
        let from_here = self.paths.range(here..).take(2).chain(self.paths.range(..here).rev());
        for (_, path) in from_here {
            nearest = nearest.min(path.distance_mm(position));
            if nearest < ON_PATH_MM {
                break;
            }
        }
        let distance_mm = if nearest.is_finite() { nearest } else { 0.0 };
        self.max_mm = self.max_mm.max(distance_mm);
        distance_mm
    }
}
