//! Random machines, programs for them and what an operator does meanwhile.

use std::fmt::Write;

use crate::random::Random;

/// Something that is limited: an axis, or a joint as a sum of axes; mm or rad.
#[derive(Clone, Debug)]
pub struct Lane {
    pub name: String,
    /// How much of each axis is in it.
    pub parts: [f64; 4],
    pub velocity: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

/// A run to be made.
pub struct Draw {
    pub machine: String,
    pub program: String,
    pub commands: String,
    pub lanes: Vec<Lane>,
    pub period_s: f64,
}

/// What is drawn for an axis or joint, in its own unit: mm or degrees.
struct Limits {
    feed_per_min: f64,
    acceleration: f64,
    jerk: f64,
}

fn logarithmic(random: &mut Random, low: f64, high: f64) -> f64 {
    random.between(low.ln(), high.ln()).exp()
}

impl Limits {
    /// Over four decades of acceleration and of the time in which it is built up.
    fn draw(random: &mut Random) -> Self {
        let acceleration = logarithmic(random, 3.0, 3e4);
        let jerk = acceleration / logarithmic(random, 5e-4, 0.5);
        let speed = acceleration * logarithmic(random, 5e-3, 1.0);
        Self {
            feed_per_min: 60.0 * speed.clamp(1.0, 2000.0),
            acceleration,
            jerk,
        }
    }

    fn keys(&self, unit: &str) -> String {
        let (feed, acceleration, jerk) = (self.feed_per_min, self.acceleration, self.jerk);
        format!(
            "max_feed_{unit}_per_min = {feed}\nmax_acceleration_{unit}_per_s2 = {acceleration}\nmax_jerk_{unit}_per_s3 = {jerk}\n"
        )
    }

    /// `scale` turns its unit into mm or rad.
    fn lane(&self, name: &str, parts: [f64; 4], scale: f64) -> Lane {
        let name = name.to_string();
        let [velocity, acceleration, jerk] =
            [self.feed_per_min / 60.0, self.acceleration, self.jerk].map(|l| l * scale);
        Lane {
            name,
            parts,
            velocity,
            acceleration,
            jerk,
        }
    }
}

const RAD: f64 = std::f64::consts::PI / 180.0;
const AXES: [(&str, [f64; 4]); 3] = [
    ("x", [1.0, 0.0, 0.0, 0.0]),
    ("y", [0.0, 1.0, 0.0, 0.0]),
    ("z", [0.0, 0.0, 1.0, 0.0]),
];

impl Draw {
    pub fn new(planner: &str, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let random = &mut random;
        let fine_ms = [0.125, 0.25, 0.37, 0.5, 1.0, 1.3, 2.0][random.below(7) as usize];
        let times = [1, 1, 2, 4, 8, 16, 25][random.below(7) as usize];
        let tolerance_mm = logarithmic(random, 1e-4, 1.0);
        let ratio = [1.0, 1.0, 1.2, 1.5, 2.0][random.below(5) as usize];
        let mut machine = format!(
            "format = 1\n[loops]\nrough_period_ms = {}\nfine_period_ms = {fine_ms}\n[motion]\npath_tolerance_mm = \
             {tolerance_mm}\nmax_feed_ratio = {ratio}\nallowable_speed_difference_mm_per_min = 0\njerk = \"limit\"\n",
            fine_ms * f64::from(times)
        );
        let mut lanes = vec![];
        for (name, parts) in AXES {
            let limits = Limits::draw(random);
            writeln!(
                machine,
                "[axes.{name}]\ntravel_mm = [-1000, 1000]\n{}",
                limits.keys("mm")
            )
            .unwrap();
            lanes.push(limits.lane(name, parts, 1.0));
        }
        let kind = random.below(6);
        joints(random, kind, &mut machine, &mut lanes);
        writeln!(
            machine,
            "[planner]\nplugin = \"{planner}\"\n[driver]\nplugin = \"sim\""
        )
        .unwrap();
        let period_s = fine_ms * 1e-3;
        let mut program = Program::new(random, &lanes, kind == 3, planner.contains("nurbs"));
        let nominal_s = program.write(12_000.0 * period_s);
        let text = program.text + "M2\n";
        let commands = commands(
            random,
            (nominal_s / period_s).min(15_000.0),
            period_s,
            ratio,
        );
        Self {
            machine,
            program: text,
            commands,
            lanes,
            period_s,
        }
    }
}

/// Kinematics and joints, or a rotary axis, of one kind.
fn joints(random: &mut Random, kind: u64, machine: &mut String, lanes: &mut Vec<Lane>) {
    match kind {
        0 => corexy(random, machine, lanes),
        1 => wrapped(random, machine, lanes),
        2 => gantry(random, machine, lanes),
        3 => {
            let limits = Limits::draw(random);
            writeln!(
                machine,
                "[axes.a]\nkind = \"rotary\"\ntravel_deg = [-360000, 360000]\n{}",
                limits.keys("deg")
            )
            .unwrap();
            lanes.push(limits.lane("a", [0.0, 0.0, 0.0, 1.0], RAD));
        }
        _ => {}
    }
}

fn corexy(random: &mut Random, machine: &mut String, lanes: &mut Vec<Lane>) {
    machine.push_str("[kinematics]\nplugin = \"corexy\"\n");
    for (name, parts) in [("a", [1.0, 1.0, 0.0, 0.0]), ("b", [1.0, -1.0, 0.0, 0.0])] {
        let limits = Limits::draw(random);
        writeln!(
            machine,
            "[joints.{name}]\ntravel_mm = [-2000, 2000]\n{}",
            limits.keys("mm")
        )
        .unwrap();
        lanes.push(limits.lane(name, parts, 1.0));
    }
    machine.push_str("[joints.z]\naxis = \"z\"\n");
}

fn wrapped(random: &mut Random, machine: &mut String, lanes: &mut Vec<Lane>) {
    let (radius_mm, limits) = (logarithmic(random, 3.0, 100.0), Limits::draw(random));
    writeln!(
        machine,
        "[kinematics]\nplugin = \"wrapped-rotary\"\n[kinematics.options]\naxis = \"y\"\nradius_mm = \
         {radius_mm}\n[joints.x]\naxis = \"x\"\n[joints.a]\nkind = \"rotary\"\ntravel_deg = [-36000, \
         36000]\n{}\n[joints.z]\naxis = \"z\"",
        limits.keys("deg")
    )
    .unwrap();
    lanes.push(limits.lane("a", [0.0, 1.0 / radius_mm, 0.0, 0.0], RAD));
}

fn gantry(random: &mut Random, machine: &mut String, lanes: &mut Vec<Lane>) {
    let share = random.between(0.5, 2.0);
    let acceleration = share * lanes[1].acceleration;
    writeln!(
        machine,
        "[joints.y1]\naxis = \"y\"\n[joints.y2]\naxis = \"y\"\nmax_acceleration_mm_per_s2 = {acceleration}"
    )
    .unwrap();
    let acceleration = acceleration.min(lanes[1].acceleration);
    lanes.push(Lane {
        name: "y2".into(),
        acceleration,
        ..lanes[1].clone()
    });
}

/// A walk of the override every 10 ms, holds, resumes, stalls and single lines; everything is let go in the end.
fn commands(random: &mut Random, ticks: f64, period_s: f64, max_ratio: f64) -> String {
    let mut lines: Vec<(u64, String)> = vec![];
    let last = ticks.max(300.0) as u64;
    let step = (0.01 / period_s).ceil() as u64;
    let form = random.below(4);
    if form != 1 {
        let mut ratio = 1.0f64;
        let reach = [0.05, 0.3, 1.0][random.below(3) as usize];
        for n in 0..last / step {
            ratio = (ratio + random.between(-reach, reach)).clamp(0.0, max_ratio);
            if form != 3 || random.below(20) == 0 {
                lines.push((
                    n * step + random.below(step.max(1)),
                    format!("feed-override,{ratio:.4}"),
                ));
            }
        }
    }
    if form != 0 {
        for _ in 0..random.below(30) {
            let (tick, long) = (random.below(last), [3, 30, 300][random.below(3) as usize]);
            lines.push((tick, "hold".into()));
            lines.push((tick + 1 + random.below(long), "resume".into()));
        }
    }
    for _ in 0..[0, 0, 3][random.below(3) as usize] {
        lines.push((
            random.below(last),
            format!("stall-rough,{}", 1 + random.below(40)),
        ));
        lines.push((
            random.below(last),
            format!("rapid-override,{:.3}", random.between(0.0, 1.0)),
        ));
    }
    if random.below(6) == 0 {
        lines.push((random.below(last), "single-block,1".into()));
        lines.extend((0..last / 40).map(|n| (40 * n, "resume".into())));
    }
    let end = last + last / 4;
    for line in [
        "single-block,0",
        "feed-override,1",
        "rapid-override,1",
        "resume",
    ] {
        lines.push((end, line.into()));
    }
    lines.push((end + 1, "resume".into()));
    lines.sort_by_key(|(tick, _)| *tick);
    lines.iter().fold(String::new(), |text, (tick, line)| {
        text + &format!("{tick},{line}\n")
    })
}

/// A program in the making.
struct Program<'a> {
    random: &'a mut Random,
    text: String,
    at: [f64; 4],
    /// Speed, acceleration and jerk along a line in the direction that is slowest.
    slowest: [f64; 3],
    feed_mm_per_s: f64,
    rotary: Option<Lane>,
    curves: bool,
    /// Length of a typical block, mm.
    length_mm: f64,
}

impl<'a> Program<'a> {
    fn new(random: &'a mut Random, lanes: &[Lane], rotary: bool, curves: bool) -> Self {
        let linear = lanes.iter().filter(|lane| lane.parts[3] == 0.0);
        let slowest = linear.fold([f64::INFINITY; 3], |least, lane| {
            let part = lane
                .parts
                .iter()
                .map(|part| part * part)
                .sum::<f64>()
                .sqrt();
            let limits = [lane.velocity, lane.acceleration, lane.jerk];
            std::array::from_fn(|order| least[order].min(limits[order] / part))
        });
        let feed_mm_per_s = 0.0;
        let length_mm = logarithmic(random, 1e-3, 1.0) * slowest[1] * 0.3;
        let rotary = rotary.then(|| lanes[3].clone());
        let length_mm = length_mm.clamp(1e-3, 60.0);
        Self {
            random,
            text: "G21 G90 G94 G17 G64\n".into(),
            at: [0.0; 4],
            slowest,
            feed_mm_per_s,
            rotary,
            curves,
            length_mm,
        }
    }

    /// Blocks for about `max_s`; gives how long they take at least.
    fn write(&mut self, max_s: f64) -> f64 {
        self.feed();
        let mut nominal_s = 0.0;
        for _ in 0..3 + self.random.below(60) {
            nominal_s += self.element();
            if nominal_s > max_s {
                break;
            }
        }
        nominal_s
    }

    fn feed(&mut self) {
        let top = 3.0 * self.slowest[0];
        self.feed_mm_per_s = logarithmic(self.random, (0.02 * top).max(1.0 / 60.0), top.max(0.1));
        writeln!(self.text, "F{:.3}", 60.0 * self.feed_mm_per_s).unwrap();
    }

    fn step(&mut self) -> f64 {
        let share = logarithmic(self.random, 0.1, 3.0);
        let sign = if self.random.below(2) == 0 { 1.0 } else { -1.0 };
        sign * share * self.length_mm
    }

    fn element(&mut self) -> f64 {
        let before = self.at;
        match self.random.below(14) {
            0 => self.feed(),
            1 => writeln!(
                self.text,
                "{}",
                ["G61", "G64", "G64 P0.02", "G64 P0.5"][self.random.below(4) as usize]
            )
            .unwrap(),
            2 => writeln!(self.text, "G4 P{:.4}", self.random.between(0.0, 0.02)).unwrap(),
            3 => self.line("G0"),
            4 | 5 => self.arc(),
            6 | 7 if self.curves => self.bezier(),
            8 => {
                for _ in 0..12 {
                    self.chord();
                }
            }
            _ => self.line("G1"),
        }
        let length_mm = (0..3)
            .map(|axis| (self.at[axis] - before[axis]).powi(2))
            .sum::<f64>()
            .sqrt();
        let [speed, acceleration, jerk] = self.slowest;
        let turned_s = self.rotary.as_ref().map_or(0.0, |a| {
            let angle = (self.at[3] - before[3]).abs() * RAD;
            angle / a.velocity + (angle / a.acceleration).sqrt() + (angle / a.jerk).cbrt()
        });
        let from_rest_s = 2.0 * ((length_mm / acceleration).sqrt() + (length_mm / jerk).cbrt());
        length_mm / self.feed_mm_per_s.min(speed) + from_rest_s + turned_s
    }

    fn rounded(value: f64) -> f64 {
        format!("{value:.5}").parse().unwrap()
    }

    fn line(&mut self, word: &str) {
        let axes = 1 + self.random.below(7);
        for axis in 0..3 {
            if axes >> axis & 1 == 1 {
                let step = self.step();
                self.move_to(axis, step);
            }
        }
        write!(
            self.text,
            "{word} X{} Y{} Z{}",
            self.at[0], self.at[1], self.at[2]
        )
        .unwrap();
        if let Some(a) = self.rotary.clone()
            && self.random.below(2) == 0
        {
            let turn = logarithmic(self.random, 1e-3, 1.0) * a.acceleration / RAD * 0.2;
            self.at[3] = Self::rounded(self.at[3] + turn * self.random.between(-1.0, 1.0));
            write!(self.text, " A{}", self.at[3]).unwrap();
        }
        self.text.push('\n');
    }

    fn move_to(&mut self, axis: usize, step: f64) {
        let to = self.at[axis] + step;
        self.at[axis] = Self::rounded(if to.abs() > 400.0 {
            self.at[axis] - step
        } else {
            to
        });
    }

    fn chord(&mut self) {
        let (x, y) = (self.step() / 12.0, self.step() / 12.0);
        self.move_to(0, x.abs());
        self.move_to(1, y);
        writeln!(self.text, "G1 X{} Y{}", self.at[0], self.at[1]).unwrap();
    }

    fn arc(&mut self) {
        let (i, j) = (self.step(), self.step());
        let word = if self.random.below(2) == 0 {
            "G2"
        } else {
            "G3"
        };
        if self.random.below(3) == 0 {
            writeln!(self.text, "{word} I{i:.5} J{j:.5}").unwrap();
            return;
        }
        // Half around a centre: the end is as far from it as the start.
        let (i, j) = (Self::rounded(i), Self::rounded(j));
        let from = self.at;
        (self.at[0], self.at[1]) = (
            Self::rounded(from[0] + 2.0 * i),
            Self::rounded(from[1] + 2.0 * j),
        );
        writeln!(
            self.text,
            "{word} X{} Y{} I{i} J{j}",
            self.at[0], self.at[1]
        )
        .unwrap();
    }

    fn bezier(&mut self) {
        let [i, j, p, q] = [0; 4].map(|_| self.step());
        let (x, y) = (self.step(), self.step());
        self.move_to(0, x);
        self.move_to(1, y);
        writeln!(
            self.text,
            "G5 X{} Y{} I{i:.5} J{j:.5} P{p:.5} Q{q:.5}",
            self.at[0], self.at[1]
        )
        .unwrap();
    }
}
