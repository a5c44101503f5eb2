//! Symmetric positive definite systems of half bandwidth 3, one a lane.

use crate::lanes::{Lanes, each};

/// A row: its diagonal entry and the three entries right of it, of every lane. It lies on whole cache lines: half of the wide loads
/// would cross from one to the next.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Row<const L: usize>(pub [Lanes<L>; 4]);

impl<const L: usize> Row<L> {
    pub const ZERO: Self = Self([[0.0; L]; 4]);
}

/// Replaces the matrix by its factors `L·D·Lᵀ`, and `right` by the solution. Entries beyond the last column are not read.
/// Does not allocate.
#[inline(always)]
pub fn solve<const L: usize>(rows: &mut [Row<L>], right: &mut [Lanes<L>]) {
    let size = rows.len().min(right.len());
    for i in 0..size {
        let row = rows[i].0;
        let inverse: Lanes<L> = each(|l| 1.0 / row[0][l]);
        let factor = |n: usize| -> Lanes<L> { each(|l| row[n][l] * inverse[l]) };
        let factors = [factor(1), factor(2), factor(3)];
        let value = right[i];
        for below in 1..4.min(size - i) {
            let factor = &factors[below - 1];
            for column in below..4 {
                let entry = &mut rows[i + below].0[column - below];
                *entry = each(|l| entry[l] - factor[l] * row[column][l]);
            }
            let entry = &mut right[i + below];
            *entry = each(|l| entry[l] - factor[l] * value[l]);
        }
        rows[i].0 = [inverse, factors[0], factors[1], factors[2]];
    }
    for i in (0..size).rev() {
        let row = &rows[i].0;
        let mut value: Lanes<L> = each(|l| right[i][l] * row[0][l]);
        for after in 1..4.min(size - i) {
            let known = right[i + after];
            value = each(|l| value[l] - row[after][l] * known[l]);
        }
        right[i] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_solution_solves(
            entries in proptest::collection::vec((0.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 1..40),
            seed in 0.0..10.0f64,
        ) {
            let rows: Vec<Row<2>> =
                entries.iter().map(|(d, e, f, g)| Row([[d + 6.5; 2], [*e, -e], [*f; 2], [*g; 2]])).collect();
            let right: Vec<Lanes<2>> = (0..rows.len()).map(|i| [(seed * i as f64).sin(), 1.0]).collect();
            let mut solution = right.clone();
            solve(&mut rows.clone(), &mut solution);
            for lane in 0..2 {
                for i in 0..rows.len() {
                    let mut sum = rows[i].0[0][lane] * solution[i][lane];
                    for offset in 1..4 {
                        if i + offset < rows.len() { sum += rows[i].0[offset][lane] * solution[i + offset][lane]; }
                        if i >= offset { sum += rows[i - offset].0[offset][lane] * solution[i - offset][lane]; }
                    }
                    prop_assert!((sum - right[i][lane]).abs() < 1e-9);
                }
            }
        }
    }
}
