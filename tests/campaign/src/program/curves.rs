//! Curves in the three dialects, smooth and hard to drive.

use std::fmt::Write;

use super::Program;

/// A control point: X, Y and, on machines that have it, Z.
type Point = Vec<f64>;

impl Program<'_> {
    pub(super) fn curve(&mut self) {
        match self.random.below(10) {
            0 => self.quadratic(),
            1..=3 => self.cubic(),
            4 => self.knotted(),
            5 => self.turning_back(),
            6 => self.weighted(),
            7 => self.pinched(),
            _ => self.free_form(),
        }
    }

    /// The axes of control points.
    fn curve_axes(&self) -> Vec<usize> {
        ['X', 'Y', 'Z']
            .into_iter()
            .filter_map(|letter| self.axis(letter))
            .collect()
    }

    fn here(&self) -> Point {
        self.curve_axes()
            .into_iter()
            .map(|axis| self.at[axis])
            .collect()
    }

    /// A place up to `reach` from another in the first axes, within the travel.
    fn near(&mut self, from: &Point, reach: f64, moving: usize) -> Point {
        let axes = self.curve_axes();
        let mut place = from.clone();
        for (value, axis) in place.iter_mut().zip(axes).take(moving) {
            let of = self.machine.axes[axis];
            let step = self.random.between(-reach, reach);
            let to = if (of.low..=of.high).contains(&(*value + step)) {
                *value + step
            } else {
                *value - step
            };
            *value = self
                .written(to.clamp(of.low, of.high))
                .clamp(of.low, of.high);
        }
        place
    }

    fn wander(&mut self, count: u64, reach: f64, moving: usize) -> Vec<Point> {
        let mut points: Vec<Point> = vec![];
        let mut at = self.here();
        for _ in 0..count {
            at = self.near(&at, reach, moving);
            points.push(at.clone());
        }
        points
    }

    /// A reach that there is time for.
    fn reach(&mut self, points: u64) -> Option<f64> {
        let mut reach = self.scale_mm.min(50.0);
        for _ in 0..8 {
            let length_mm = reach * points as f64;
            let before_s = self.left_s;
            if self.spend_bent(length_mm, reach / 2.0) {
                // A curve may be driven much slower than this: it costs twice that.
                self.left_s -= before_s - self.left_s;
                return (reach > 2e-4).then_some(reach);
            }
            reach *= 0.3;
        }
        None
    }

    fn words(&self, place: &Point) -> String {
        let mut text = String::new();
        for (axis, value) in self.curve_axes().into_iter().zip(place) {
            let letter = self.machine.axes[axis].letter;
            write!(text, "{letter}{value:.*} ", self.digits).expect("a text takes what is written");
        }
        text
    }

    fn arrive(&mut self, place: &Point) {
        for (axis, value) in self.curve_axes().into_iter().zip(place) {
            self.at[axis] = *value;
        }
    }

    fn quadratic(&mut self) {
        let Some(reach) = self.reach(2) else { return };
        let from = self.here();
        let (middle, to) = (self.near(&from, reach, 2), self.near(&from, reach, 2));
        let digits = self.digits;
        let [i, j] = [middle[0] - from[0], middle[1] - from[1]];
        self.line(&format!(
            "G5.1 X{:.digits$} Y{:.digits$} I{i:.digits$} J{j:.digits$}",
            to[0], to[1]
        ));
        self.arrive(&to);
    }

    fn cubic(&mut self) {
        let Some(reach) = self.reach(3) else { return };
        let from = self.here();
        let to = self.near(&from, reach, 2);
        let (second, third) = (self.near(&from, reach, 2), self.near(&to, reach, 2));
        let digits = self.digits;
        let ([i, j], [p, q]) = (
            [second[0] - from[0], second[1] - from[1]],
            [third[0] - to[0], third[1] - to[1]],
        );
        let end = format!("X{:.digits$} Y{:.digits$}", to[0], to[1]);
        self.line(&format!(
            "G5 {end} I{i:.digits$} J{j:.digits$} P{p:.digits$} Q{q:.digits$}"
        ));
        self.arrive(&to);
    }

    /// A curve of order `order` over `points`, the last of which is where it ends.
    fn through(&mut self, order: u64, points: &[Point], weights: impl Fn(usize) -> f64) {
        self.line(&format!("G5.2 P1 L{order}"));
        for (n, point) in points.iter().enumerate() {
            self.line(&format!("{}P{}", self.words(point), weights(n)));
        }
        self.line("G5.3");
        if let Some(last) = points.last() {
            self.arrive(last);
        }
    }

    fn free_form(&mut self) {
        let order = self.random.below(4) + 3;
        let count = order + self.random.below(12);
        let Some(reach) = self.reach(count) else {
            return;
        };
        let moving = 2 + self.random.below(2) as usize;
        let points = self.wander(count, reach, moving);
        self.through(order, &points, |_| 1.0);
    }

    /// A curve on a line that goes to and fro.
    fn turning_back(&mut self) {
        let Some(reach) = self.reach(6) else { return };
        let from = self.here();
        let to = self.near(&from, reach, 2);
        let mut points = vec![];
        for _ in 0..self.random.below(4) + 4 {
            let share = self.random.between(0.0, 1.0);
            let on: Point = from
                .iter()
                .zip(&to)
                .map(|(a, b)| self.written(a + share * (b - a)))
                .collect();
            points.push(on);
        }
        self.through(4, &points, |_| 1.0);
    }

    /// Control points that coincide.
    fn pinched(&mut self) {
        let Some(reach) = self.reach(8) else { return };
        let mut points = vec![];
        for point in self.wander(4, reach, 3) {
            let times = self.random.below(3) as usize + 1;
            points.extend(std::iter::repeat_n(point, times));
        }
        points.extend(self.wander(1, reach, 3));
        let order = 4.min(points.len() as u64);
        self.through(order, &points, |_| 1.0);
    }

    fn weighted(&mut self) {
        let Some(reach) = self.reach(7) else { return };
        let points = self.wander(7, reach, 2);
        let high = self.random.pick(&[0.01, 10.0, 100.0, 1000.0]);
        self.through(4, &points, |n| if n % 3 == 1 { high } else { 1.0 });
    }

    /// With knots of any multiplicity up to the degree: corners inside the curve.
    fn knotted(&mut self) {
        let (count, order) = (10u64, 4u64);
        let Some(reach) = self.reach(count) else {
            return;
        };
        let mut points = vec![self.here()];
        points.extend(self.wander(count - 1, reach, 2));
        let mut knots = vec![0.0; order as usize];
        while knots.len() < count as usize {
            let (knot, times) = (knots[knots.len() - 1] + 1.0, self.random.below(3) + 1);
            knots.extend((0..times).map(|_| knot));
        }
        knots.truncate(count as usize);
        knots.extend(vec![knots[knots.len() - 1] + 1.0; order as usize]);
        let mut text = format!("G6.2 P{order} ");
        for (point, knot) in points.iter().zip(&knots) {
            writeln!(text, "K{knot} {}R1", self.words(point))
                .expect("a text takes what is written");
        }
        for knot in &knots[count as usize..] {
            writeln!(text, "K{knot}").expect("a text takes what is written");
        }
        self.text.push_str(&text);
        if let Some(last) = points.last() {
            self.arrive(last);
        }
    }
}
