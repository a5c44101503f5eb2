//! Random programs of curves from a printed seed: within the limits, judged, and never slowed by the governor.

use std::fmt::Write;

use crate::harness::{Scenario, UNDISTURBED, root};
use crate::random::{Random, attempted};
use crate::replay::for_each_seed;

/// A program in the making, in a box of 50 mm around the origin.
struct Program {
    random: Random,
    at: [f64; 3],
    text: String,
}

/// `count` elements: curves in both dialects, smooth and hard to drive, between lines, arcs, rapids and dwells.
pub fn program(seed: u64, count: u32) -> String {
    let text = String::from("G21 G90 G94 G17\nG64\nF4000\n");
    let mut program = Program {
        random: Random::new(seed),
        at: [0.0; 3],
        text,
    };
    for _ in 0..count {
        program.element();
    }
    program.text.push_str("M2\n");
    program.text
}

impl Program {
    fn element(&mut self) {
        match self.random.below(24) {
            0 => {
                let feed = self.random.between(200.0, 15_000.0);
                writeln!(self.text, "F{feed:.0}").unwrap();
            }
            1 => {
                let dwell_s = self.random.between(0.0, 0.03);
                writeln!(self.text, "G4 P{dwell_s:.3}").unwrap();
            }
            2 => self.line("G0", 20.0),
            3 | 4 => self.line("G1", 8.0),
            5 => self.arc(),
            6 => self.quadratic(),
            7..=9 => self.bezier(),
            10..=13 => self.smooth_on(),
            14 => self.turning_back(),
            15 => self.pinched(),
            16 => self.weighted(),
            17 => self.knotted(),
            _ => self.free_form(),
        }
    }

    /// A number as it is written.
    fn rounded(value: f64) -> f64 {
        format!("{value:.4}").parse().unwrap()
    }

    /// A place up to `reach` away in the first `axes` axes, within the box.
    fn near(&mut self, from: [f64; 3], reach: f64, axes: usize) -> [f64; 3] {
        let mut place = from;
        for value in &mut place[..axes] {
            // Back from the border of the box: clamped points would lie on a line.
            let step = self.random.between(-reach, reach);
            let to = if (*value + step).abs() > 50.0 {
                *value - step.abs() * value.signum()
            } else {
                *value + step
            };
            *value = Self::rounded(to);
        }
        place
    }

    fn words(place: [f64; 3]) -> String {
        format!("X{:.4} Y{:.4} Z{:.4}", place[0], place[1], place[2])
    }

    fn line(&mut self, word: &str, reach: f64) {
        let to = self.near(self.at, reach, 3);
        self.at = to;
        writeln!(self.text, "{word} {}", Self::words(to)).unwrap();
    }

    fn arc(&mut self) {
        let (i, j) = (
            self.random.between(-6.0, 6.0),
            self.random.between(0.1, 6.0),
        );
        writeln!(self.text, "G2 I{i:.4} J{j:.4}").unwrap();
    }

    fn quadratic(&mut self) {
        let ([from, to], middle) = (
            [self.at, self.near(self.at, 8.0, 2)],
            self.near(self.at, 6.0, 2),
        );
        let [i, j] = [middle[0] - from[0], middle[1] - from[1]];
        writeln!(
            self.text,
            "G5.1 X{:.4} Y{:.4} I{i:.4} J{j:.4}",
            to[0], to[1]
        )
        .unwrap();
        self.at = to;
    }

    fn bezier(&mut self) {
        let to = self.near(self.at, 10.0, 2);
        let [i, j, p, q] = [6.0, 6.0, 6.0, 6.0].map(|reach| self.random.between(-reach, reach));
        writeln!(
            self.text,
            "G5 X{:.4} Y{:.4} I{i:.4} J{j:.4} P{p:.4} Q{q:.4}",
            to[0], to[1]
        )
        .unwrap();
        self.at = to;
    }

    /// A curve of order `order` over `points`, the last of which is where it ends.
    fn curve(&mut self, order: u64, points: &[[f64; 3]], weights: impl Fn(usize) -> f64) {
        writeln!(self.text, "G5.2 P1 L{order}").unwrap();
        for (n, point) in points.iter().enumerate() {
            writeln!(self.text, "{} P{}", Self::words(*point), weights(n)).unwrap();
        }
        self.text.push_str("G5.3\n");
        self.at = points[points.len() - 1];
    }

    /// Points one after the other, each up to `reach` from the one before.
    fn wander(&mut self, count: u64, reach: f64, axes: usize) -> Vec<[f64; 3]> {
        let mut at = self.at;
        let mut points = Vec::new();
        for _ in 0..count {
            at = self.near(at, reach, axes);
            points.push(at);
        }
        points
    }

    fn free_form(&mut self) {
        let order = self.random.below(4) + 3;
        let (count, axes) = (
            order + self.random.below(12),
            2 + self.random.below(2) as usize,
        );
        let reach = [0.3, 3.0, 12.0][self.random.below(3) as usize];
        let points = self.wander(count, reach, axes);
        self.curve(order, &points, |_| 1.0);
    }

    /// A line and a curve that leaves it without corner and without curvature, at another feed or the same.
    fn smooth_on(&mut self) {
        let ([x, y, z], step) = (self.at, self.random.between(0.3, 4.0));
        // Along an axis, so that no rounding of the points makes a corner.
        let along = if self.random.below(2) == 0 {
            [step, 0.0]
        } else {
            [0.0, step]
        };
        let along = [along[0] * -x.signum(), along[1] * -y.signum()].map(Self::rounded);
        let ahead = |n: f64| {
            [
                Self::rounded(x + n * along[0]),
                Self::rounded(y + n * along[1]),
                z,
            ]
        };
        writeln!(self.text, "G1 {}", Self::words(ahead(1.0))).unwrap();
        if self.random.below(3) == 0 {
            let feed = self.random.between(300.0, 12_000.0);
            writeln!(self.text, "F{feed:.0}").unwrap();
        }
        self.at = ahead(3.0);
        let mut points = vec![ahead(2.0), ahead(3.0)];
        let count = self.random.below(6) + 2;
        points.extend(self.wander(count, 3.0 * step, 2));
        self.curve(4, &points, |_| 1.0);
    }

    /// A curve on a line that goes to and fro.
    fn turning_back(&mut self) {
        let ([x, y, z], to) = (self.at, self.near(self.at, 10.0, 2));
        let points: Vec<[f64; 3]> = (0..self.random.below(4) + 4)
            .map(|_| self.random.between(-0.5, 1.5))
            .map(|share| {
                [
                    Self::rounded(x + share * (to[0] - x)),
                    Self::rounded(y + share * (to[1] - y)),
                    z,
                ]
            })
            .collect();
        self.curve(4, &points, |_| 1.0);
    }

    /// Control points that coincide.
    fn pinched(&mut self) {
        let some = self.wander(4, 5.0, 3);
        let mut points = Vec::new();
        for point in some {
            points.extend(std::iter::repeat_n(
                point,
                self.random.below(3) as usize + 1,
            ));
        }
        points.extend(self.wander(1, 5.0, 3));
        let order = 4.min(points.len() as u64);
        self.curve(order, &points, |_| 1.0);
    }

    fn weighted(&mut self) {
        let (points, high) = (
            self.wander(7, 8.0, 2),
            [10.0, 100.0, 1000.0][self.random.below(3) as usize],
        );
        self.curve(4, &points, |n| if n % 3 == 1 { high } else { 1.0 });
    }

    /// With knots of any multiplicity up to the degree: corners inside the curve.
    fn knotted(&mut self) {
        let (count, order) = (10u64, 4u64);
        let mut points = vec![self.at];
        points.extend(self.wander(count - 1, 4.0, 2));
        let mut knots = vec![0.0; order as usize];
        while knots.len() < count as usize {
            let (knot, times) = (knots[knots.len() - 1] + 1.0, self.random.below(3) + 1);
            knots.extend((0..times).map(|_| knot));
        }
        knots.truncate(count as usize);
        knots.extend(vec![knots[knots.len() - 1] + 1.0; order as usize]);
        write!(self.text, "G6.2 P{order} ").unwrap();
        for (point, knot) in points.iter().zip(&knots) {
            writeln!(self.text, "K{knot} {} R1", Self::words(*point)).unwrap();
        }
        for knot in &knots[count as usize..] {
            writeln!(self.text, "K{knot}").unwrap();
        }
        self.at = points[points.len() - 1];
    }
}

fn on_the_demo_machine(text: &str, form: &str) -> Scenario {
    let machine = root().join("examples/machines/nurbs-demo.toml");
    Scenario::text(text)
        .on(&machine)
        .with(&["--set", &format!("planner.options.form={form}")])
}

#[test]
fn random_curves_run_within_limits() {
    for form in ["scan", "windowed"] {
        for_each_seed("random_curves_run_within_limits", 2, |seed| {
            attempted(|| {
                let done = on_the_demo_machine(&program(seed, 80), form).run();
                done.assert_within_limits();
                assert_eq!(done.number("starvations"), 0.0);
            })
        });
    }
}

/// Once program time does not pass at its own rate, samples lie at other places of the plan.
#[test]
fn random_curves_are_held_and_overridden_within_limits() {
    for form in ["scan", "windowed"] {
        for_each_seed(
            "random_curves_are_held_and_overridden_within_limits",
            2,
            |seed| {
                attempted(|| {
                    let mut random = Random::new(seed);
                    let mut commands = String::new();
                    for n in 0..24 {
                        let tick = 750 * n + random.below(500);
                        match random.below(3) {
                            0 => writeln!(commands, "{tick},hold\n{},resume", tick + 150).unwrap(),
                            _ => writeln!(
                                commands,
                                "{tick},feed-override,{:.2}",
                                random.between(0.3, 1.0)
                            )
                            .unwrap(),
                        }
                    }
                    let done = on_the_demo_machine(&program(seed, 80), form)
                        .commands(&commands)
                        .run();
                    done.assert_driven("", &UNDISTURBED);
                    let verdict = done.judge(|options| {
                        options.sample_tolerance_mm = Some(2e-6);
                        options.vertex_tolerance_mm = Some(0.3);
                    });
                    assert!(verdict.passed(), "{verdict}");
                })
            },
        );
    }
}
