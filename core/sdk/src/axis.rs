//! Axes and vectors over them.

use crate::abi::layout::{Layout, START, fold, fold_text, layout};
use std::ops::{Add, AddAssign, Index, IndexMut, Mul, Sub};

/// Most axes (and joints) that one machine has.
pub const MAX_AXES: usize = 8;

/// One number per axis: a position (mm or rad), a velocity (mm/s or rad/s) or the like. One cache line.
///
/// The index is the order of the axes in `machine.toml`; entries past the machine's last axis are zero, or joint lanes
/// ([`crate::JointLanes`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct AxisVector(pub [f64; MAX_AXES]);

impl Layout for AxisVector {
    const HASH: u64 = fold(fold_text(START, "AxisVector"), <[f64; MAX_AXES]>::HASH);
}

impl AxisVector {
    /// All entries zero.
    pub const ZERO: Self = Self([0.0; MAX_AXES]);

    /// Builds a vector from the first entries; the rest is zero, what is beyond [`MAX_AXES`] is ignored.
    #[inline]
    pub fn from_slice(values: &[f64]) -> Self {
        let mut vector = Self::ZERO;
        for (to, from) in vector.0.iter_mut().zip(values) {
            *to = *from;
        }
        vector
    }

    /// Applies `f` to every entry.
    #[inline]
    #[must_use]
    pub fn map(self, f: impl FnMut(f64) -> f64) -> Self {
        Self(self.0.map(f))
    }

    /// Whether every entry is finite, without a branch for each.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.0.iter().fold(true, |all, v| all & v.is_finite())
    }
}

impl Index<usize> for AxisVector {
    type Output = f64;
    #[inline]
    fn index(&self, axis: usize) -> &f64 {
        &self.0[axis]
    }
}

impl IndexMut<usize> for AxisVector {
    #[inline]
    fn index_mut(&mut self, axis: usize) -> &mut f64 {
        &mut self.0[axis]
    }
}

impl Add for AxisVector {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        let mut sum = self;
        sum += other;
        sum
    }
}

impl AddAssign for AxisVector {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        for (to, by) in self.0.iter_mut().zip(&other.0) {
            *to += by;
        }
    }
}

impl Sub for AxisVector {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        let mut difference = self;
        for (to, by) in difference.0.iter_mut().zip(&other.0) {
            *to -= by;
        }
        difference
    }
}

impl Mul<f64> for AxisVector {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        let mut product = self;
        for to in &mut product.0 {
            *to *= factor;
        }
        product
    }
}

/// The axes that a machine has: letters and kinds, in the order of `machine.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Axes {
    count: u32,
    letters: [u8; MAX_AXES],
    rotary: [bool; MAX_AXES],
}

layout!(Axes {
    count,
    letters,
    rotary
});

impl Axes {
    /// Axes from `(letter, rotary)` pairs; letters are upper case, one of `XYZABCUVW`.
    ///
    /// # Errors
    /// More than [`MAX_AXES`] axes, none, an unknown letter or a letter used twice.
    pub fn new(axes: &[(char, bool)]) -> Result<Self, String> {
        if axes.is_empty() || axes.len() > MAX_AXES {
            return Err(format!(
                "a machine has 1 to {MAX_AXES} axes, not {}",
                axes.len()
            ));
        }
        let mut this = Self {
            count: axes.len() as u32,
            letters: [0; MAX_AXES],
            rotary: [false; MAX_AXES],
        };
        for (index, (letter, rotary)) in axes.iter().enumerate() {
            if !"XYZABCUVW".contains(*letter) {
                return Err(format!(
                    "no axis is called {letter}: the letters are X Y Z A B C U V W"
                ));
            }
            if this.index(*letter).is_some() {
                return Err(format!("axis {letter} appears twice"));
            }
            this.letters[index] = *letter as u8;
            this.rotary[index] = *rotary;
        }
        Ok(this)
    }

    /// How many axes there are.
    #[inline]
    pub fn count(&self) -> usize {
        self.count as usize
    }

    /// The index of the axis called `letter` (upper case).
    pub fn index(&self, letter: char) -> Option<usize> {
        self.letters
            .iter()
            .position(|l| *l != 0 && *l as char == letter)
    }

    /// The letter of axis `index`, upper case.
    pub fn letter(&self, index: usize) -> char {
        self.letters[index] as char
    }

    /// Whether axis `index` turns (rad) rather than slides (mm).
    #[inline]
    pub fn is_rotary(&self, index: usize) -> bool {
        self.rotary[index]
    }

    /// The length of a displacement as path speed counts it: over the linear axes where any of them moves (mm), else
    /// over the rotary ones (rad).
    #[inline]
    pub fn path_length(&self, displacement: &AxisVector) -> f64 {
        let sum = |rotary: bool| -> f64 {
            let squares = (0..self.count())
                .filter(|i| self.rotary[*i] == rotary)
                .map(|i| displacement[i].powi(2));
            squares.sum::<f64>().sqrt()
        };
        let linear = sum(false);
        if linear > 0.0 { linear } else { sum(true) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_length_counts_linear_axes_first() {
        let axes = Axes::new(&[('X', false), ('Y', false), ('A', true)]).unwrap();
        assert_eq!(
            axes.path_length(&AxisVector::from_slice(&[3.0, 4.0, 9.0])),
            5.0
        );
        assert_eq!(
            axes.path_length(&AxisVector::from_slice(&[0.0, 0.0, -9.0])),
            9.0
        );
    }

    #[test]
    fn axes_are_checked() {
        assert!(Axes::new(&[]).is_err());
        assert!(
            Axes::new(&[('X', false), ('X', false)])
                .unwrap_err()
                .contains("twice")
        );
        assert!(Axes::new(&[('Q', false)]).unwrap_err().contains('Q'));
    }
}
