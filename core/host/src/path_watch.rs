//! How far samples are from the programmed path.

use std::collections::VecDeque;

use tandem_motion::Path;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, Block, BlockKind};

/// Blocks looked back over where a planner leaves the path: what its filters can still hold.
const LOOK_BACK: usize = 256;

/// The same where it stays on the path, within its tolerance: the blocks that may move beside the one named.
const LOOK_BACK_ON_PATH: usize = 4;

/// Distances that are rounding of the segments, mm: not worth looking at the neighbours.
const ON_PATH_MM: f64 = 1e-6;

/// Spans of a curve searched around the last foot.
const SPANS_AROUND: usize = 4;

/// The path of a block.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // lines and arcs are by far the most frequent; boxing them would allocate
enum Watched {
    Path(Path),
    /// A curve, and the span of the last foot.
    Curve(Box<Nurbs>, usize),
}

impl Watched {
    fn curve(axes: &Axes, block: &Block) -> Option<Self> {
        // SAFETY: the block is handed over in this call, and its slices with it.
        let data = unsafe { block.nurbs.to_data() };
        let curve = Nurbs::new(&data, axes).ok()?;
        let span = curve.degree();
        Some(Self::Curve(Box::new(curve), span))
    }

    fn distance_mm(&mut self, position: &AxisVector) -> f64 {
        match self {
            Self::Path(path) => path.distance_mm(position),
            Self::Curve(curve, span) => {
                let mut nearest = curve.nearest(position, span.saturating_sub(SPANS_AROUND), *span + SPANS_AROUND);
                if nearest.distance_mm > ON_PATH_MM {
                    nearest = curve.nearest(position, 0, curve.points());
                }
                *span = curve.span(nearest.u);
                nearest.distance_mm
            }
        }
    }
}

/// Keeps the paths of the blocks that move now and measures samples against them.
#[derive(Debug)]
pub struct PathWatch {
    /// Paths with the index of their block.
    paths: VecDeque<(u64, Watched)>,
    /// Blocks looked back over.
    look_back: usize,
    /// Largest distance so far, mm.
    pub max_mm: f64,
}

impl PathWatch {
    /// Nothing seen yet; `leaves_path` as the planner describes itself.
    pub fn new(leaves_path: bool) -> Self {
        let look_back = if leaves_path { LOOK_BACK } else { LOOK_BACK_ON_PATH };
        Self { paths: VecDeque::new(), look_back, max_mm: 0.0 }
    }

    /// A block that will be driven.
    pub fn block(&mut self, axes: &Axes, block: &Block) {
        let watched = match block.kind {
            BlockKind::Nurbs => Watched::curve(axes, block),
            _ => Path::new(block).map(Watched::Path),
        };
        self.paths.extend(watched.map(|watched| (block.index, watched)));
    }

    /// Distance of `position`, sampled while block `block` moved, from the path, mm. Blocks far behind are forgotten.
    pub fn sample(&mut self, block: u64, position: &AxisVector) -> f64 {
        while self.paths.len() > self.look_back && self.paths[self.look_back].0 < block {
            self.paths.pop_front();
        }
        let here = self.paths.partition_point(|(index, _)| *index < block);
        let mut nearest = f64::INFINITY;
        let last = self.paths.len().min(here + 2);
        for place in (here..last).chain((0..here).rev()) {
            nearest = nearest.min(self.paths[place].1.distance_mm(position));
            if nearest < ON_PATH_MM {
                break;
            }
        }
        let distance_mm = if nearest.is_finite() { nearest } else { 0.0 };
        self.max_mm = self.max_mm.max(distance_mm);
        distance_mm
    }
}
