//! What limits the speed inside one block, one row per axis, in the square of the speed.
//!
//! With w = v², a row says `a·h + w·k ≤ A`: the path acceleration a costs `h` per unit, turning at speed costs `k`.
//! Between the ends of a block of length L, w changes by at most 2aL, and the faster end pays for the turning. So from
//! one end to the other `w' ≤ (h·w + 2·L·A)/(h + 2·L·k)`: rising in w, which keeps the two-pass update optimal.

use tandem_sdk::MAX_AXES;

/// One axis' share: `a·h + w·k ≤ A`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Axis acceleration per path acceleration.
    pub h: f64,
    /// Axis acceleration per square of the speed, 1/mm.
    pub k: f64,
    /// Acceleration left for both, mm/s².
    pub a: f64,
}

/// Share of an axis' acceleration that turning may take. The rest is left to brake with, everywhere: on a circle it is
/// `min (1 − 0.8·cos φ)/sin φ = 0.6` of the acceleration along the path.
pub const TURNING_SHARE: f64 = 0.8;

/// The rows of a block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rows {
    rows: [Row; MAX_AXES],
    count: usize,
}

impl Rows {
    /// Adds a row; one that limits nothing is left out.
    pub fn push(&mut self, row: Row) {
        if row.h > 0.0 || row.k > 0.0 {
            self.rows[self.count] = row;
            self.count += 1;
        }
    }

    fn iter(&self) -> impl Iterator<Item = &Row> {
        self.rows[..self.count].iter()
    }

    /// Square of the highest speed at which turning takes no more than its share.
    pub fn turning_cap(&self) -> f64 {
        self.iter().filter(|r| r.k > 0.0).map(|r| TURNING_SHARE * r.a / r.k).fold(f64::INFINITY, f64::min)
    }

    /// Path acceleration that is left when the square of the speed is `w`, mm/s².
    pub fn acceleration(&self, w: f64) -> f64 {
        self.iter().filter(|r| r.h > 0.0).map(|r| (r.a - w * r.k) / r.h).fold(f64::INFINITY, f64::min)
    }

    /// Square of the highest speed inside a block of `length_mm` whose ends have the mean square `mean`.
    pub fn peak(&self, mean: f64, length_mm: f64) -> f64 {
        let each = self.iter().map(|r| (r.h * mean + length_mm * r.a) / (r.h + length_mm * r.k));
        each.fold(f64::INFINITY, f64::min)
    }

    /// The map from one end of the block to the other.
    pub fn transfer(&self, length_mm: f64) -> Transfer {
        let mut transfer = Transfer::BLANK;
        for row in self.iter() {
            let scale = 1.0 / (row.h + 2.0 * length_mm * row.k);
            transfer.push(row.h * scale, 2.0 * length_mm * row.a * scale);
        }
        transfer
    }
}

/// `w ↦ min over lines of (p·w + q)`: the highest square of the speed at the other end of a block.
#[derive(Clone, Copy, Debug)]
pub struct Transfer {
    lines: [(f64, f64); MAX_AXES],
    count: usize,
}

impl Transfer {
    /// Everything comes to rest.
    pub const BLANK: Self = Self { lines: [(0.0, 0.0); MAX_AXES], count: 0 };

    /// Adds a line unless one that is there lies below it for every w ≥ 0; drops those that lie above it.
    fn push(&mut self, p: f64, q: f64) {
        let mut kept = 0;
        for index in 0..self.count {
            let (other_p, other_q) = self.lines[index];
            if other_p <= p && other_q <= q {
                return;
            }
            if !(p <= other_p && q <= other_q) {
                self.lines[kept] = (other_p, other_q);
                kept += 1;
            }
        }
        self.lines[kept] = (p, q);
        self.count = kept + 1;
    }

    /// The highest square of the speed at one end when it is `w` at the other.
    #[inline]
    pub fn apply(&self, w: f64) -> f64 {
        let (p, q) = self.lines[0];
        let mut least = p * w + q;
        for (p, q) in &self.lines[1..self.count.max(1)] {
            least = least.min(p * w + q);
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows() -> impl Strategy<Value = Rows> {
        proptest::collection::vec((0.01..1.5f64, 0.0..2.0f64, 10.0..2000.0f64), 1..5).prop_map(|rows| {
            let mut all = Rows::default();
            rows.into_iter().for_each(|(h, k, a)| all.push(Row { h, k, a }));
            all
        })
    }

    proptest! {
        #[test]
        fn dropped_lines_never_matter(rows in rows(), length in 0.001..50.0f64, w in 0.0..1e4f64) {
            let every = rows.iter().map(|r| (r.h * w + 2.0 * length * r.a) / (r.h + 2.0 * length * r.k));
            let expect = every.fold(f64::INFINITY, f64::min);
            prop_assert!((rows.transfer(length).apply(w) - expect).abs() <= 1e-12 * expect);
        }

        #[test]
        fn the_faster_end_keeps_every_row(rows in rows(), length in 0.001..50.0f64, slow in 0.0..1.0f64) {
            let w = slow * rows.turning_cap().min(1e4);
            let fast = rows.transfer(length).apply(w).max(w);
            let a = (fast - w) / (2.0 * length);
            prop_assert!(a <= rows.acceleration(fast) * (1.0 + 1e-9) + 1e-9);
        }

        #[test]
        fn the_peak_is_reached_exactly(rows in rows(), length in 0.001..50.0f64, mean in 0.0..1e3f64) {
            let mean = mean.min(rows.turning_cap());
            let peak = rows.peak(mean, length);
            prop_assert!((peak - (mean + rows.acceleration(peak) * length)).abs() <= 1e-9 * peak);
        }
    }
}
