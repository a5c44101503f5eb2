//! How far samples are from the programmed path.

use std::collections::VecDeque;

use tandem_motion::Path;
use tandem_motion::nurbs::Nurbs;
use tandem_sdk::{Axes, AxisVector, Block, Curve};

/// Blocks looked back over where a planner leaves the path: what its filters can still hold.
const LOOK_BACK: usize = 256;

/// The same where it stays on the path, within its tolerance: so many blocks are shorter than the way searched at most.
const LOOK_BACK_ON_PATH: usize = 512;

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
    fn curve(axes: &Axes, curve: Curve<'_>) -> Option<Self> {
        let curve = Nurbs::new(&curve.to_data(), axes).ok()?;
        let span = curve.degree();
        Some(Self::Curve(Box::new(curve), span))
    }

    fn distance_mm(&mut self, position: &AxisVector) -> f64 {
        match self {
            Self::Path(path) => path.distance_mm(position),
            Self::Curve(curve, span) => {
                let mut nearest = curve.nearest(
                    position,
                    span.saturating_sub(SPANS_AROUND),
                    *span + SPANS_AROUND,
                );
                if nearest.distance_mm > ON_PATH_MM {
                    nearest = curve.nearer(position, nearest);
                }
                *span = curve.span(nearest.u);
                nearest.distance_mm
            }
        }
    }
}

/// A block that will move, moves, or has moved.
#[derive(Debug)]
struct Entry {
    /// Index of the block.
    index: u64,
    length_mm: f64,
    /// Path tolerance in force.
    tolerance_mm: f64,
    path: Watched,
}

/// Keeps the paths of the blocks that move now and measures samples against them.
#[derive(Debug)]
pub struct PathWatch {
    entries: VecDeque<Entry>,
    /// The entry of the block that moves.
    here: usize,
    leaves_path: bool,
    /// Path tolerance of blocks that state none, mm.
    tolerance_mm: f64,
    /// The last sample.
    position: AxisVector,
    /// There was a curve: where it is looked at next follows from where it was looked at last.
    has_curves: bool,
    /// Largest distance so far, mm.
    pub max_mm: f64,
}

impl PathWatch {
    /// Nothing seen yet, at rest at `position`; `leaves_path` as the planner describes itself, `tolerance_mm` the machine's.
    pub fn new(leaves_path: bool, tolerance_mm: f64, position: &AxisVector) -> Self {
        Self {
            entries: VecDeque::new(),
            here: 0,
            leaves_path,
            tolerance_mm,
            position: *position,
            has_curves: false,
            max_mm: 0.0,
        }
    }

    /// A block that will be driven.
    pub fn block(&mut self, axes: &Axes, block: &Block, curve: Option<Curve<'_>>) {
        self.has_curves |= curve.is_some();
        let path = match curve {
            Some(curve) => Watched::curve(axes, curve),
            None => Path::new(block).map(Watched::Path),
        };
        // A block that states none says NaN.
        let tolerance_mm = self.tolerance_mm.max(block.path_tolerance_mm);
        if let Some(path) = path {
            self.entries.push_back(Entry {
                index: block.index,
                length_mm: block.length_mm,
                tolerance_mm,
                path,
            });
        }
    }

    /// Distance of `position`, sampled while block `block` moved, from the path, mm. Blocks far behind are forgotten. Where nobody
    /// needs `each` distance, it is that from the block that moves as long as that is less than the largest so far: other blocks are
    /// not looked at for nothing.
    pub fn sample(&mut self, block: u64, position: &AxisVector, each: bool) -> f64 {
        self.find(block);
        let distance_mm = self.distance_mm(position, each);
        self.position = *position;
        distance_mm
    }

    /// The same, behind `self.position`, where the block has been found.
    fn distance_mm(&mut self, position: &AxisVector, each: bool) -> f64 {
        if !each
            && !self.has_curves
            && let Some(own) = self.entries.get_mut(self.here)
        {
            let own_mm = own.path.distance_mm(position);
            if own_mm < self.max_mm {
                return own_mm;
            }
        }
        let moved_mm = (*position - self.position)
            .0
            .iter()
            .map(|d| d * d)
            .sum::<f64>()
            .sqrt();
        let nearest = if self.leaves_path {
            self.nearest_of_all(position)
        } else {
            self.nearest(position, moved_mm)
        };
        let distance_mm = if nearest.is_finite() { nearest } else { 0.0 };
        self.max_mm = self.max_mm.max(distance_mm);
        distance_mm
    }

    /// Finds the entry of `block`, and forgets those too far behind it.
    fn find(&mut self, block: u64) {
        let look_back = if self.leaves_path {
            LOOK_BACK
        } else {
            LOOK_BACK_ON_PATH
        };
        while self.here > 0 && self.entries[self.here - 1].index >= block {
            self.here -= 1;
        }
        while self
            .entries
            .get(self.here)
            .is_some_and(|entry| entry.index < block)
        {
            self.here += 1;
            if self.here > look_back {
                self.entries.pop_front();
                self.here -= 1;
            }
        }
    }

    fn nearest_of_all(&mut self, position: &AxisVector) -> f64 {
        let mut nearest = f64::INFINITY;
        let last = self.entries.len().min(self.here + 2);
        for place in (self.here..last).chain((0..self.here).rev()) {
            nearest = nearest.min(self.entries[place].path.distance_mm(position));
            if nearest < ON_PATH_MM {
                break;
            }
        }
        nearest
    }

    /// Goes on from the block that moves, and back from it, as far as the blocks come nearer, and then by as much path as
    /// the sample moved and the tolerance may have cut off: blocks shorter than a period are named by the last of them.
    fn nearest(&mut self, position: &AxisVector, moved_mm: f64) -> f64 {
        let neighbours = self.here.saturating_sub(1)..self.entries.len().min(self.here + 2);
        let tolerance_mm = self
            .entries
            .range(neighbours)
            .fold(0.0, |most: f64, entry| most.max(entry.tolerance_mm));
        let patience_mm = moved_mm + 2.0 * tolerance_mm;
        let on = self.here..self.entries.len().min(self.here + LOOK_BACK_ON_PATH);
        let mut nearest = f64::INFINITY;
        self.search(on, position, patience_mm, &mut nearest);
        self.search((0..self.here).rev(), position, patience_mm, &mut nearest);
        nearest
    }

    fn search(
        &mut self,
        places: impl Iterator<Item = usize>,
        position: &AxisVector,
        patience_mm: f64,
        nearest: &mut f64,
    ) {
        let mut passed_mm = 0.0;
        for place in places {
            if *nearest < ON_PATH_MM || passed_mm > patience_mm {
                return;
            }
            let entry = &mut self.entries[place];
            let distance_mm = entry.path.distance_mm(position);
            passed_mm = if distance_mm < *nearest {
                0.0
            } else {
                passed_mm + entry.length_mm
            };
            *nearest = nearest.min(distance_mm);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_sdk::BlockKind;

    /// The largest distance of a motion that swings about a line of short blocks, lagging behind them, and all of its distances.
    fn watched(each: bool) -> (f64, Vec<f64>) {
        let axes = Axes::new(&[('X', false), ('Y', false)]).unwrap();
        let mut watch = PathWatch::new(false, 0.05, &AxisVector::ZERO);
        let at = |n: u64| AxisVector::from_slice(&[0.1 * n as f64, 0.02 * (n % 3) as f64]);
        for index in 0..100 {
            let mut block = Block::at(at(index));
            block.kind = BlockKind::Line;
            block.index = index;
            block.end = at(index + 1);
            block.length_mm = axes.path_length(&(block.end - block.start));
            watch.block(&axes, &block, None);
        }
        let distances = (0..900).map(|n| {
            let x = 0.011 * f64::from(n);
            let position = AxisVector::from_slice(&[x, 0.02 + 0.03 * (5.0 * x).sin()]);
            watch.sample((x / 0.1) as u64, &position, each)
        });
        let distances = distances.collect();
        (watch.max_mm, distances)
    }

    #[test]
    fn the_largest_distance_is_the_same_where_nobody_needs_each() {
        let (exact, each) = watched(true);
        let (quick, some) = watched(false);
        assert_eq!(exact.to_bits(), quick.to_bits());
        let mut most = 0.0;
        for (exact, quick) in each.iter().zip(&some) {
            assert!(exact == quick || exact < quick && *quick < most);
            most = exact.max(most);
        }
        assert_ne!(each, some, "nothing was left out");
    }
}
