//! G5 and G5.1: Bezier curves in the plane XY, one a line.

use tandem_sdk::{AxisVector, NurbsData};

use crate::curve_places::Origin;
use crate::fault::Checked;
use crate::interpreter::Interpreter;
use crate::item::Item;
use crate::state::Plane;
use crate::table::Group;

/// The end of the last cubic curve: the block that follows it, and its P and Q, mm.
pub(crate) type Tail = (u64, [f64; 2]);

impl Interpreter {
    /// G5: a cubic curve to X Y; I J is its second control point from the start, P Q its third from the end. A G5 that
    /// follows another without I J goes on in its direction.
    pub(crate) fn cubic(&mut self, uncertain: u32, out: &mut Vec<Item>) -> Checked<()> {
        let [x, y] = self.bezier_axes()?;
        let p = self.offset(b'P').zip(self.offset(b'Q'));
        let Some((p, q)) = p else {
            return Err(self.motion_fault("nurbs", "G5 needs P and Q, the third control point from the end"));
        };
        let before = self.bezier_tail.take().filter(|(index, _)| *index == self.state.next_index);
        let [i, j] = match (self.offset(b'I'), self.offset(b'J'), before) {
            (Some(i), Some(j), _) => [i, j],
            (None, None, Some((_, [p, q]))) => [-p, -q],
            (None, None, None) => {
                let why =
                    "G5 needs I and J, the second control point from the start: only a G5 behind another may lack them";
                return Err(self.motion_fault("nurbs", why));
            }
            _ => return Err(self.motion_fault("nurbs", "G5 takes I and J both or neither")),
        };
        let (start, end) = (self.state.last_end, self.block_end());
        let (mut second, mut third) = (start, end);
        second[x] += i;
        second[y] += j;
        third[x] += p;
        third[y] += q;
        self.bezier(&[start, second, third, end], uncertain, out)?;
        self.bezier_tail = Some((self.state.next_index, [p, q]));
        Ok(())
    }

    /// G5.1: a quadratic curve to X Y; I J is its middle control point from the start.
    pub(crate) fn quadratic(&mut self, uncertain: u32, out: &mut Vec<Item>) -> Checked<()> {
        let [x, y] = self.bezier_axes()?;
        let (i, j) = (self.offset(b'I'), self.offset(b'J'));
        if i.is_none() && j.is_none() {
            return Err(self.motion_fault("nurbs", "G5.1 needs I or J, the middle control point from the start"));
        }
        let (start, end) = (self.state.last_end, self.block_end());
        let mut middle = start;
        middle[x] += i.unwrap_or(0.0);
        middle[y] += j.unwrap_or(0.0);
        self.bezier(&[start, middle, end], uncertain, out)
    }

    fn offset(&self, letter: u8) -> Option<f64> {
        self.words.get(letter).map(|value| value * self.state.unit_mm)
    }

    fn bezier_axes(&self) -> Checked<[usize; 2]> {
        if self.orders.get(Group::NonModal) == Some(530) {
            return Err(self.orders.fault(Group::NonModal, "conflict", "G53 goes with G0 and G1 only"));
        }
        match (self.letters.axis(b'X'), self.letters.axis(b'Y')) {
            _ if self.state.plane != Plane::Xy => {
                Err(self.motion_fault("nurbs", "G5 and G5.1 need the plane XY (G17)"))
            }
            (Some(x), Some(y)) => Ok([x, y]),
            _ => Err(self.motion_fault("axis", "G5 and G5.1 need the axes X and Y")),
        }
    }

    fn bezier(&mut self, points: &[AxisVector], uncertain: u32, out: &mut Vec<Item>) -> Checked<()> {
        if uncertain != 0 {
            self.state.last_end = self.state.position;
            return Ok(());
        }
        let degree = points.len() - 1;
        let knots = (0..2 * points.len()).map(|index| if index > degree { 1.0 } else { 0.0 }).collect();
        let weights = vec![1.0; points.len()];
        let data = NurbsData { degree, control_points: points.to_vec(), weights, knots };
        self.push_curve(&Origin::line(self.state.line), data, out)
    }
}
