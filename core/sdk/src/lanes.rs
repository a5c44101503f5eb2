//! Joints that are sums of axes, as planners carry them along.

use crate::{AxisVector, MAX_AXES, size_of_contract};

/// Joints that several axes move together (the belts of a `CoreXY`), each a *lane* behind the machine's axes: entry
/// `first() + n` of every vector holds what lane n is of the axes, `Σ weight · axis`.
///
/// The host fills the lanes of what it hands to a planner: start and end of a block, the control points of a curve, the
/// position at reset. `Limits::axes` in the planner's context goes on with the limits of the lanes. Lines and curves carry
/// them by being linear; what is not, an arc for one, fills them with [`JointLanes::fill`]. The host fills the lanes of
/// every segment again, from its axes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct JointLanes {
    size: u32,
    first: u32,
    count: u32,
    weights: [AxisVector; MAX_AXES],
}

impl JointLanes {
    /// Lanes behind `axes` axes, one for each of `weights`.
    ///
    /// # Errors
    /// No lane, or more than the [`MAX_AXES`] entries of a vector hold behind the axes.
    pub fn new(axes: usize, weights: &[AxisVector]) -> Result<Self, String> {
        let count = weights.len();
        if count == 0 || axes + count > MAX_AXES {
            return Err(format!(
                "{count} joints that are sums of axes, on {axes} axes: together there are 1 to {MAX_AXES} of them"
            ));
        }
        let all = std::array::from_fn(|i| weights.get(i).copied().unwrap_or(AxisVector::ZERO));
        Ok(Self { size: size_of_contract::<Self>(), first: axes as u32, count: count as u32, weights: all })
    }

    /// The entry of the first lane: the number of axes.
    #[inline]
    pub fn first(&self) -> usize {
        self.first as usize
    }

    /// The weights of the axes in each lane.
    pub fn weights(&self) -> &[AxisVector] {
        &self.weights[..self.count as usize]
    }

    /// Fills the lanes of `vector` (a position, a direction, a velocity) from its axes. Any loop; does not allocate.
    #[inline]
    pub fn fill(&self, vector: &mut AxisVector) {
        for (lane, weights) in self.weights().iter().enumerate() {
            let mut sum = 0.0;
            for axis in 0..self.first() {
                sum += weights[axis] * vector[axis];
            }
            vector[self.first() + lane] = sum;
        }
    }

    /// The same for polynomials, one an entry. Any loop; does not allocate.
    pub fn fill_polynomials(&self, coefficients: &mut [[f64; 6]; MAX_AXES]) {
        for (lane, weights) in self.weights().iter().enumerate() {
            let mut sum = [0.0; 6];
            for axis in 0..self.first() {
                for (to, from) in sum.iter_mut().zip(&coefficients[axis]) {
                    *to += weights[axis] * from;
                }
            }
            coefficients[self.first() + lane] = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn belts() -> JointLanes {
        let weights = [[1.0, 1.0], [1.0, -1.0]].map(|w| AxisVector::from_slice(&w));
        JointLanes::new(3, &weights).unwrap()
    }

    #[test]
    fn lanes_are_sums_of_the_axes() {
        let mut vector = AxisVector::from_slice(&[5.0, 2.0, 9.0, f64::NAN, -1.0]);
        belts().fill(&mut vector);
        assert_eq!(vector, AxisVector::from_slice(&[5.0, 2.0, 9.0, 7.0, 3.0]));
        let mut polynomials = [[0.0; 6]; MAX_AXES];
        (polynomials[0], polynomials[1]) = ([1.0; 6], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        belts().fill_polynomials(&mut polynomials);
        assert_eq!(polynomials[3], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(polynomials[4], [1.0, 0.0, -1.0, -2.0, -3.0, -4.0]);
    }

    #[test]
    fn a_vector_has_no_more_entries() {
        assert!(JointLanes::new(3, &[]).is_err());
        assert!(JointLanes::new(7, &[AxisVector::ZERO; 2]).unwrap_err().contains('8'));
    }
}
