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
        let size = self.rows.len().min(right.len());
        let (rows, right) = (&mut self.rows[..size], &mut right[..size]);
        let Some((mut here, mut value)) = rows.first().copied().zip(right.first().copied()) else {
            return;
        };
        // A row is written once, as each waits for the one before: what rows before have taken of the next one is carried on.
        let mut next = rows.get(1).map_or(0.0, |row| row[0]);
        let mut next_value = right.get(1).copied().unwrap_or(0.0);
        for i in 0..size {
            let [d, e, f] = here;
            let l1 = e / d;
            let l2 = f / d;
            rows[i] = [d, l1, l2];
            right[i] = value;
            if i + 1 < size {
                let [_, e_below, f_below] = rows[i + 1];
                here = [next - l1 * e, e_below - l1 * f, f_below];
                let below = next_value - l1 * value;
                if i + 2 < size {
                    next = rows[i + 2][0] - l2 * f;
                    next_value = right[i + 2] - l2 * value;
                }
                value = below;
            }
        }
        let [mut after, mut after_next] = [0.0; 2];
        for i in (0..size).rev() {
            let [d, l1, l2] = rows[i];
            let mut value = right[i] / d;
            if i + 1 < size {
                value -= l1 * after;
            }
            if i + 2 < size {
                value -= l2 * after_next;
            }
            (after, after_next) = (value, after);
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
