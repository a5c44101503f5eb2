//! Straight motion, arcs, chords and probes.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::Program;

impl Program<'_> {
    /// A line or a rapid of one to all axes; a shorter one where time is short.
    pub(super) fn straight(&mut self, word: &str) {
        let mut reach = self.scale_mm;
        for _ in 0..12 {
            let mut to = vec![];
            for axis in 0..self.at.len() {
                if self.random.below(2) == 0 {
                    let turns = if self.machine.axes[axis].rotary {
                        self.random.pick(&[1.0, 1.0, 30.0])
                    } else {
                        1.0
                    };
                    to.push((axis, self.place(axis, reach * turns)));
                }
            }
            if self.straight_to(word, &to) {
                return;
            }
            reach *= 0.3;
        }
    }

    /// A full circle or helix in X and Y; often one that touches an end of the travel.
    pub(super) fn circle(&mut self) {
        let (Some(x), Some(y)) = (self.axis('X'), self.axis('Y')) else {
            return;
        };
        let room = |axis: usize, at: f64, up: bool| {
            let of = self.machine.axes[axis];
            if up { of.high - at } else { at - of.low }
        };
        let (right, up) = (self.random.below(2) == 0, self.random.below(2) == 0);
        let rooms = [
            room(x, self.at[x], right),
            room(y, self.at[y], up),
            room(y, self.at[y], !up),
        ];
        let along_x = rooms[0].min(2.0 * rooms[1]).min(2.0 * rooms[2]) / 2.0;
        let touching = self.random.below(3) == 0;
        let most = if touching {
            along_x
        } else {
            along_x.min(self.scale_mm * self.random.between(0.2, 2.0))
        };
        let i = self.written(if touching { most } else { 0.99 * most });
        let radius_mm = i.abs();
        // Rounding may leave the travel.
        if radius_mm < 2e-4 || radius_mm > along_x || !self.spend_bent(TAU * radius_mm, radius_mm) {
            return;
        }
        let word = self.random.pick(&["G2", "G3"]);
        let i = if right { i } else { -i };
        let mut text = format!("{word} I{i:.*} J0", self.digits);
        if let Some(z) = self.axis('Z').filter(|_| self.random.below(3) == 0) {
            let to = self.place(z, self.scale_mm);
            if self.spend(&[(z, to - self.at[z])], false) {
                write!(text, " Z{to:.*}", self.digits).expect("a text takes what is written");
                self.at[z] = to;
            }
        }
        self.line(&text);
    }

    /// A part of a circle, by its radius.
    pub(super) fn arc(&mut self) {
        let (Some(x), Some(y)) = (self.axis('X'), self.axis('Y')) else {
            return;
        };
        let to = [x, y].map(|axis| self.place(axis, self.scale_mm));
        let from = [self.at[x], self.at[y]];
        let chord_mm = (to[0] - from[0]).hypot(to[1] - from[1]);
        let bent = self.random.length(0.5001, 50.0);
        let radius_mm = self.written(chord_mm * bent + 1e-4);
        let sagitta_mm = radius_mm
            - (radius_mm * radius_mm - chord_mm * chord_mm / 4.0)
                .max(0.0)
                .sqrt();
        let inside = [x, y].into_iter().enumerate().all(|(n, axis)| {
            let of = self.machine.axes[axis];
            from[n].min(to[n]) - sagitta_mm >= of.low && from[n].max(to[n]) + sagitta_mm <= of.high
        });
        if chord_mm < 3e-4 || !inside || !self.spend_bent(1.6 * chord_mm, radius_mm) {
            return;
        }
        let word = self.random.pick(&["G2", "G3"]);
        let digits = self.digits;
        self.line(&format!(
            "{word} X{:.digits$} Y{:.digits$} R{radius_mm:.digits$}",
            to[0], to[1]
        ));
        (self.at[x], self.at[y]) = (to[0], to[1]);
    }

    /// The two axes that chords and marks are drawn in: any two, mostly X and Y.
    fn two_axes(&mut self) -> Option<(usize, usize)> {
        let count = self.at.len() as u64;
        if count < 2 {
            return None;
        }
        let first = if self.random.below(3) > 0 {
            0
        } else {
            self.random.below(count - 1) as usize
        };
        Some((first, first + 1))
    }

    /// A number of repetitions: sometimes so many that buffers fill.
    fn many(&mut self, most: u64) -> u64 {
        let most = if self.random.below(12) == 0 {
            16 * most
        } else {
            most
        };
        self.random.below(most) + 3
    }

    /// A stretch of short chords along a bending path, as CAM writes it, with noise of the last digit.
    pub(super) fn chords(&mut self) {
        let Some((a, b)) = self.two_axes() else {
            return;
        };
        let mut angle = self.random.between(0.0, TAU);
        let bend = self.random.pick(&[0.0, 0.001, 0.02, 0.2, 1.0]) * self.random.between(-1.0, 1.0);
        let step = self.scale_mm.min(5.0) * self.random.length(0.01, 1.0);
        for _ in 0..self.many(120) {
            angle += bend;
            let place = |this: &Self, axis: usize, by: f64| {
                let of = this.machine.axes[axis];
                this.written(this.at[axis] + by).clamp(of.low, of.high)
            };
            let to = [
                (a, place(self, a, step * angle.cos())),
                (b, place(self, b, step * angle.sin())),
            ];
            if !self.straight_to("G1", &to) {
                return;
            }
        }
    }

    /// To and fro between two rails: corners of any angle at constant distances.
    pub(super) fn zigzag(&mut self) {
        let Some((a, b)) = self.two_axes() else {
            return;
        };
        let (from, reach) = (self.at[b], self.scale_mm.min(20.0));
        let other = self.place(b, reach);
        let step = self.random.pick(&[0.0, 0.01, 0.3, 2.0]) * reach;
        for n in 0..self.many(60) {
            let of = self.machine.axes[a];
            let ahead = self.written(self.at[a] + step).clamp(of.low, of.high);
            let across = if n % 2 == 0 { other } else { from };
            if !self.straight_to("G1", &[(a, ahead), (b, across)]) {
                return;
            }
        }
    }

    /// Small figures with rapids between them.
    pub(super) fn marks(&mut self) {
        let Some((a, b)) = self.two_axes() else {
            return;
        };
        let size = self.scale_mm.min(1.0) * self.random.length(0.03, 1.0);
        for _ in 0..self.many(30) {
            let [x, y] = [a, b].map(|axis| self.at[axis]);
            let corner = |this: &Self, axis: usize, by: f64| {
                let of = this.machine.axes[axis];
                this.written(this.at[axis] + by).clamp(of.low, of.high)
            };
            let [right, up] = [corner(self, a, size), corner(self, b, size)];
            for to in [[right, y], [right, up], [x, y]] {
                if !self.straight_to("G1", &[(a, to[0]), (b, to[1])]) {
                    return;
                }
            }
            let to = [a, b].map(|axis| self.place(axis, 4.0 * size));
            if self.random.below(2) == 0 && !self.straight_to("G0", &[(a, to[0]), (b, to[1])]) {
                return;
            }
        }
    }

    /// A probe, whether it touches or not, and the way back.
    pub(super) fn probe(&mut self) {
        let Some(surface) = self.machine.probe else {
            return;
        };
        let (axis, letter) = (surface.axis, self.machine.axes[surface.axis].letter);
        let to = self.place(axis, self.scale_mm);
        let by = to - self.at[axis];
        if by == 0.0 || !self.spend(&[(axis, by)], false) {
            return;
        }
        // A probe that touches already when it begins is a fault.
        let touching = if surface.touches(self.at[axis]) {
            ["G38.5"; 2]
        } else {
            ["G38.3", "G31"]
        };
        let word = self.random.pick(&touching);
        self.line(&format!("{word} {letter}{to:.*}", self.digits));
        // Back to where it began, at most as far as to where the probe may have come.
        self.spend(&[(axis, by)], false);
        self.line(&format!("G1 {letter}{:.*}", self.digits, self.at[axis]));
    }
}
