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
/// `min (1 − 0.8·cos φ)/sin φ = 0.6` of the acceleration along the path. `an_arc_entered_at_speed_keeps_the_limits` does not
/// pass with half of it, nor with 0.95.
pub const TURNING_SHARE: f64 = 0.8;

/// The rows of a block.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rows {
    rows: [Row; MAX_AXES],
    count: usize,
}

impl Rows {
    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a row.
    pub fn push(&mut self, row: Row) {
        self.rows[self.count] = row;
        self.count += 1;
    }

    fn iter(&self) -> impl Iterator<Item = &Row> {
        self.rows[..self.count].iter()
    }

    /// Path acceleration that is left when the square of the speed is `w`, mm/s².
    pub fn acceleration(&self, w: f64) -> f64 {
        min_ratio(f64::INFINITY, self.iter().map(|r| (r.a - w * r.k, r.h)))
    }

    /// Square of the highest speed, up to `most`, inside a block of `length_mm` whose ends have the mean square `mean`.
    pub fn peak(&self, mean: f64, length_mm: f64, most: f64) -> f64 {
        min_ratio(
            most,
            self.iter()
                .map(|r| (r.h * mean + length_mm * r.a, r.h + length_mm * r.k)),
        )
    }
}

impl Row {
    /// Whether it limits anything.
    pub fn limits(&self) -> bool {
        self.h > 0.0 || self.k > 0.0
    }

    /// Square of the highest speed at which turning takes no more than its share, as a ratio.
    pub fn turning_cap(&self) -> (f64, f64) {
        (TURNING_SHARE * self.a, self.k)
    }
}

/// The lesser of two numbers: `f64::min` also minds NaN, which costs several times as much and does not occur here.
#[inline]
pub fn lesser(a: f64, b: f64) -> f64 {
    if b < a { b } else { a }
}

/// The greater of two numbers; see [`lesser`].
#[inline]
pub fn greater(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The least of some ratios `n/d`, with one division: they are compared crosswise. A `d` of zero limits nothing; none is
/// negative.
#[derive(Clone, Copy, Debug)]
pub struct Least {
    n: f64,
    d: f64,
}

impl Least {
    /// At most `most`.
    pub fn new(most: f64) -> Self {
        Self { n: most, d: 1.0 }
    }

    /// And at most `n/d`.
    #[inline]
    pub fn and(&mut self, (n, d): (f64, f64)) {
        if n * self.d < self.n * d {
            self.n = n;
            self.d = d;
        }
    }

    /// The least.
    #[inline]
    pub fn value(&self) -> f64 {
        if self.d == 1.0 {
            self.n
        } else {
            self.n / self.d
        }
    }
}

/// The least of `most` and the ratios `n/d`.
#[inline]
pub fn min_ratio(most: f64, ratios: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut least = Least::new(most);
    ratios.for_each(|ratio| least.and(ratio));
    least.value()
}

/// `w ↦ min over rows of (p·w + q)`: the highest square of the speed at the other end of a block.
#[derive(Clone, Copy, Debug)]
pub struct Transfer {
    lines: [(f64, f64); MAX_AXES],
    count: usize,
}

impl Transfer {
    /// Everything comes to rest.
    pub const BLANK: Self = Self {
        lines: [(0.0, 0.0); MAX_AXES],
        count: 0,
    };

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds the row of one axis for a block of `length_mm`.
    pub fn push(&mut self, row: &Row, length_mm: f64) {
        let scale = 1.0 / (row.h + 2.0 * length_mm * row.k);
        self.lines[self.count] = (row.h * scale, 2.0 * length_mm * row.a * scale);
        self.count += 1;
    }

    /// The highest square of the speed at one end when it is `w` at the other.
    #[inline]
    pub fn apply(&self, w: f64) -> f64 {
        let Some(((p, q), others)) = self.lines[..self.count].split_first() else {
            return 0.0;
        };
        others
            .iter()
            .fold(p * w + q, |least, (p, q)| lesser(least, p * w + q))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows() -> impl Strategy<Value = Rows> {
        proptest::collection::vec((0.01..1.5f64, 0.0..2.0f64, 10.0..2000.0f64), 1..5).prop_map(
            |rows| {
                let mut all = Rows::default();
                for (h, k, a) in rows {
                    all.push(Row { h, k, a });
                }
                all
            },
        )
    }

    fn transfer(rows: &Rows, length_mm: f64) -> Transfer {
        let mut transfer = Transfer::BLANK;
        rows.iter().for_each(|row| transfer.push(row, length_mm));
        transfer
    }

    fn turning_cap(rows: &Rows, most: f64) -> f64 {
        min_ratio(most, rows.iter().map(Row::turning_cap))
    }

    proptest! {
        #[test]
        fn the_transfer_is_the_least_of_the_rows(rows in rows(), length in 0.001..50.0f64, w in 0.0..1e4f64) {
            let every = rows.iter().map(|r| (r.h * w + 2.0 * length * r.a) / (r.h + 2.0 * length * r.k));
            let expect = every.fold(f64::INFINITY, f64::min);
            prop_assert!((transfer(&rows, length).apply(w) - expect).abs() <= 1e-12 * expect);
        }

        #[test]
        fn the_faster_end_keeps_every_row(rows in rows(), length in 0.001..50.0f64, slow in 0.0..1.0f64) {
            let w = slow * turning_cap(&rows, 1e4);
            let fast = transfer(&rows, length).apply(w).max(w);
            let a = (fast - w) / (2.0 * length);
            prop_assert!(a <= rows.acceleration(fast) * (1.0 + 1e-9) + 1e-9);
        }

        #[test]
        fn the_peak_is_reached_exactly(rows in rows(), length in 0.001..50.0f64, mean in 0.0..1e3f64) {
            let mean = turning_cap(&rows, mean);
            let peak = rows.peak(mean, length, f64::INFINITY);
            prop_assert!((peak - (mean + rows.acceleration(peak) * length)).abs() <= 1e-9 * peak);
        }
    }
}
