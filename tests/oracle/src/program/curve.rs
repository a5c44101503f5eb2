//! Curves: `LinuxCNC`'s G5, G5.1 and G5.2 to G5.3, and Fanuc's G6.2.

use super::{
    line::Line,
    state::{FeedMode, Motion, State},
};
use crate::{
    Position,
    path::{Nurbs, Shape},
};

/// A curve whose lines are being read.
#[derive(Debug)]
pub struct Open {
    line: usize,
    fanuc: bool,
    order: Option<usize>,
    points: Vec<Position>,
    weights: Vec<f64>,
    knots: Vec<f64>,
}

/// The code of a line that opens a curve or is one.
pub fn code(line: &Line) -> Option<i32> {
    line.g
        .iter()
        .copied()
        .find(|code| matches!(code, 50..=52 | 62))
}

impl State<'_> {
    /// A line with G5, G5.1, G5.2 or G6.2, whose other codes are in force already.
    pub fn curve_code(&mut self, code: i32, line: &mut Line, number: usize) -> Result<(), String> {
        self.motion = None;
        match code {
            50 | 51 => self.bezier(code == 50, line, number),
            _ => self.open(code == 62, line, number),
        }
    }

    fn open(&mut self, fanuc: bool, line: &mut Line, number: usize) -> Result<(), String> {
        let mut open = Open {
            line: number,
            fanuc,
            order: None,
            points: vec![self.position],
            weights: vec![],
            knots: vec![],
        };
        if fanuc {
            open.order = Some(line.take('P').map_or(4, |order| order as usize));
            for (axis, value) in self.take_axes(line)? {
                let value = if self.incremental {
                    self.position[axis] + value
                } else {
                    value + self.offset_mm(axis)
                };
                if (value - self.position[axis]).abs() > 1e-5 {
                    return Err("G6.2 that does not begin where the machine stands".into());
                }
            }
            open.weights.push(line.take('R').unwrap_or(1.0));
            open.knots.push(line.take('K').ok_or("G6.2 without K")?);
        } else {
            let bare = !crate::LETTERS.iter().any(|&letter| line.has(letter));
            open.weights.push(if bare {
                line.take('P').unwrap_or(1.0)
            } else {
                1.0
            });
            open.order = line.take('L').map(|order| order as usize);
            if !bare {
                self.add_point(&mut open, line, 'P')?;
            }
        }
        self.curve = Some(open);
        Ok(())
    }

    /// A further line of a curve.
    pub fn curve_line(&mut self, mut open: Open, mut line: Line) -> Result<(), String> {
        let g = std::mem::take(&mut line.g);
        let ends = g == [53];
        if !line.m.is_empty() || !(g.is_empty() || ends && !open.fanuc) {
            return Err("a curve that is not complete".into());
        }
        let bare = !crate::LETTERS.iter().any(|&letter| line.has(letter));
        if let Some(order) = line.take('L').filter(|_| !open.fanuc) {
            open.order = Some(order as usize);
        }
        let knot = line.take('K').filter(|_| open.fanuc);
        open.knots.extend(knot);
        if !bare {
            let weight = if open.fanuc { 'R' } else { 'P' };
            self.add_point(&mut open, &mut line, weight)?;
        }
        if let Some(word) = line.left_over() {
            return Err(format!("unknown word {word} in a curve"));
        }
        if open.fanuc && !bare && knot.is_none() {
            return Err("a control point without its knot".into());
        }
        if ends || open.fanuc && open.knots.len() == open.points.len() + open.order.unwrap_or(0) {
            return self.close(open);
        }
        self.curve = Some(open);
        Ok(())
    }

    fn add_point(&mut self, open: &mut Open, line: &mut Line, weight: char) -> Result<(), String> {
        for (axis, value) in self.take_axes(line)? {
            self.position[axis] = if self.incremental {
                self.position[axis] + value
            } else {
                value + self.offset_mm(axis)
            };
        }
        open.points.push(self.position);
        open.weights.push(line.take(weight).unwrap_or(1.0));
        Ok(())
    }

    fn close(&mut self, open: Open) -> Result<(), String> {
        let (order, count) = (open.order.unwrap_or(3), open.points.len());
        if !(2..=6).contains(&order) {
            return Err(format!("a curve of order {order}"));
        }
        let knots = if open.fanuc {
            open.knots
        } else {
            uniform(order, count)
        };
        let curve = Nurbs {
            degree: order - 1,
            points: open.points,
            weights: open.weights,
            knots,
        };
        self.add_curve(curve, open.line)
    }

    fn bezier(&mut self, cubic: bool, line: &mut Line, number: usize) -> Result<(), String> {
        if self.plane != [0, 1, 2] {
            return Err("G5 outside the plane XY".into());
        }
        if cubic && !(line.has('I') || line.has('J')) {
            return Err("G5 without I and J".into());
        }
        let start = self.position;
        for (axis, value) in self.take_axes(line)? {
            self.position[axis] = if self.incremental {
                start[axis] + value
            } else {
                value + self.offset_mm(axis)
            };
        }
        let unit_mm = self.unit_mm;
        let mut beside = |from: &Position, letters: [char; 2]| {
            let mut point = *from;
            for (axis, letter) in letters.into_iter().enumerate() {
                point[axis] += unit_mm * line.take(letter).unwrap_or(0.0);
            }
            point
        };
        let mut points = vec![start, beside(&start, ['I', 'J'])];
        if cubic {
            points.push(beside(&self.position, ['P', 'Q']));
        }
        points.push(self.position);
        let (order, weights) = (points.len(), vec![1.0; points.len()]);
        let knots = uniform(order, order);
        self.add_curve(
            Nurbs {
                degree: order - 1,
                points,
                weights,
                knots,
            },
            number,
        )
    }

    fn add_curve(&mut self, curve: Nurbs, number: usize) -> Result<(), String> {
        curve.check()?;
        let shapes = curve.pieces().into_iter().map(Shape::Curve).collect();
        self.append(shapes, Motion::Feed, number)?;
        if self.feed_mode == FeedMode::InverseTime {
            self.feed = None;
        }
        Ok(())
    }
}

/// Clamped knots, one apart inside.
fn uniform(order: usize, points: usize) -> Vec<f64> {
    (0..order + points)
        .map(|index| index.max(order - 1).min(points) as f64)
        .collect()
}
