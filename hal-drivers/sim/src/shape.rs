//! What trips a simulated switch: a part of the space of the joints.

use serde::{Deserialize, Serialize};
use tandem_sdk::{AxisVector, MAX_AXES};

/// Halvings of a period in search of the edge: far below a nanometre at any speed.
const HALVINGS: usize = 60;

/// A hole along joint 2 in a plate: the wall and the plate around it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bore {
    /// Centre, by joints 0 and 1, mm.
    pub centre_mm: [f64; 2],
    /// Radius, mm.
    pub radius_mm: f64,
    /// Top of the plate, by joint 2, mm; without it the plate has no end.
    pub top_mm: Option<f64>,
}

/// Where a switch is on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// A joint above a position.
    Above { joint: usize, mm: f64 },
    /// A joint below a position.
    Below { joint: usize, mm: f64 },
    /// Within a box of the first joints.
    Box { low_mm: [f64; 3], high_mm: [f64; 3] },
    /// Outside a circle of joints 0 and 1, below the top.
    Bore(Bore),
}

impl Shape {
    /// The greatest number of a joint that it looks at.
    pub fn last_joint(&self) -> usize {
        match self {
            Self::Above { joint, .. } | Self::Below { joint, .. } => *joint,
            Self::Box { .. } => 2,
            Self::Bore(bore) => {
                if bore.top_mm.is_some() {
                    2
                } else {
                    1
                }
            }
        }
    }

    /// How deep the joints stand in it, mm; it is on above zero.
    fn depth_mm(&self, at: &AxisVector) -> f64 {
        match self {
            Self::Above { joint, mm } => at[*joint] - mm,
            Self::Below { joint, mm } => mm - at[*joint],
            Self::Box { low_mm, high_mm } => (0..3)
                .map(|i| (at[i] - low_mm[i]).min(high_mm[i] - at[i]))
                .fold(f64::INFINITY, f64::min),
            Self::Bore(bore) => {
                let wall_mm =
                    (at[0] - bore.centre_mm[0]).hypot(at[1] - bore.centre_mm[1]) - bore.radius_mm;
                bore.top_mm
                    .map_or(wall_mm, |top_mm| wall_mm.min(top_mm - at[2]))
            }
        }
    }
}

/// Whether any of the shapes is on. Fine loop.
pub(crate) fn is_on<'a>(mut shapes: impl Iterator<Item = &'a Shape>, at: &AxisVector) -> bool {
    shapes.any(|shape| shape.depth_mm(at) > 0.0)
}

/// Where on the straight way between two positions `is_on` changes, which differs between their ends, and the share of the way up
/// to there. Fine loop, bounded.
pub(crate) fn edge(
    from: &AxisVector,
    to: &AxisVector,
    is_on: impl Fn(&AxisVector) -> bool,
) -> (AxisVector, f64) {
    let before = is_on(from);
    let at = |share: f64| {
        AxisVector(std::array::from_fn::<_, MAX_AXES, _>(|i| {
            from[i] + (to[i] - from[i]) * share
        }))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if is_on(&at(middle)) == before {
            low = middle;
        } else {
            high = middle;
        }
    }
    (at(high), high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_lie_on_the_surface() {
        let plate = Bore {
            centre_mm: [1.0, 2.0],
            radius_mm: 5.0,
            top_mm: None,
        };
        let bore = Shape::Bore(plate);
        let top = Shape::Bore(Bore {
            top_mm: Some(-3.0),
            ..plate
        });
        let boxed = Shape::Box {
            low_mm: [-1.0; 3],
            high_mm: [1.0; 3],
        };
        let cases = [
            (
                Shape::Above { joint: 1, mm: 0.3 },
                [0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.3, 0.0],
            ),
            (
                Shape::Below { joint: 2, mm: -0.3 },
                [0.0, 0.0, 0.0],
                [0.0, 0.0, -1.0],
                [0.0, 0.0, -0.3],
            ),
            (boxed, [0.0, 0.0, 1.5], [0.5, 0.0, 0.5], [0.25, 0.0, 1.0]),
            (bore, [4.0, 2.0, 0.0], [7.0, 2.0, 0.0], [6.0, 2.0, 0.0]),
            (top, [9.0, 2.0, -2.0], [9.0, 2.0, -4.0], [9.0, 2.0, -3.0]),
        ];
        for (shape, from, to, expected) in cases {
            let (found, share) = edge(
                &AxisVector::from_slice(&from),
                &AxisVector::from_slice(&to),
                |at| shape.depth_mm(at) > 0.0,
            );
            let (back, rest) = edge(
                &AxisVector::from_slice(&to),
                &AxisVector::from_slice(&from),
                |at| shape.depth_mm(at) > 0.0,
            );
            assert!((share + rest - 1.0).abs() < 1e-12, "{share} {rest}");
            for axis in 0..3 {
                assert!(
                    (found[axis] - expected[axis]).abs() < 1e-12
                        && (back[axis] - expected[axis]).abs() < 1e-12
                );
            }
        }
    }
}
