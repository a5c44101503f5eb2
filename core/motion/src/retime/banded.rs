//! Symmetric positive definite systems of half bandwidth 2.

/// A pentadiagonal matrix: for each row its diagonal and the two entries right of it.
#[derive(Debug, Default)]
pub struct Pentadiagonal {
    /// `[a(i,i), a(i,i+1), a(i,i+2)]`.
    pub rows: Vec<[f64; 3]>,
}

impl Pentadiagonal {
    /// All zero, of size `size`. Allocates where it grows.
    pub fn clear(&mut self, size: usize) {
        self.rows.clear();
        self.rows.resize(size, [0.0; 3]);
    }

    /// Replaces the matrix by its factors `L·D·Lᵀ`, and `right` by the solution. Does not allocate.
    pub fn solve(&mut self, right: &mut [f64]) {
        let size = self.rows.len();
        for i in 0..size {
            let [d, e, f] = self.rows[i];
            let l1 = e / d;
            let l2 = f / d;
            if i + 1 < size {
                self.rows[i + 1][0] -= l1 * e;
                self.rows[i + 1][1] -= l1 * f;
                right[i + 1] -= l1 * right[i];
            }
            if i + 2 < size {
                self.rows[i + 2][0] -= l2 * f;
                right[i + 2] -= l2 * right[i];
            }
            self.rows[i] = [d, l1, l2];
        }
        for i in (0..size).rev() {
            let [d, l1, l2] = self.rows[i];
            let mut value = right[i] / d;
            if i + 1 < size {
                value -= l1 * right[i + 1];
            }
            if i + 2 < size {
                value -= l2 * right[i + 2];
            }
            right[i] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_solution_solves(
            entries in proptest::collection::vec((0.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 1..40),
            seed in 0.0..10.0f64,
        ) {
            let rows: Vec<[f64; 3]> = entries.iter().map(|(d, e, f)| [d + 4.5, *e, *f]).collect();
            let right: Vec<f64> = (0..rows.len()).map(|i| (seed * i as f64).sin()).collect();
            let mut solution = right.clone();
            Pentadiagonal { rows: rows.clone() }.solve(&mut solution);
            for i in 0..rows.len() {
                let mut sum = rows[i][0] * solution[i];
                for (offset, entry) in [(1, 1), (2, 2)] {
                    if i + offset < rows.len() { sum += rows[i][entry] * solution[i + offset]; }
                    if i >= offset { sum += rows[i - offset][entry] * solution[i - offset]; }
                }
                prop_assert!((sum - right[i]).abs() < 1e-9);
            }
        }
    }
}
