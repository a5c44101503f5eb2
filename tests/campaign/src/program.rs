//! Random programs for a machine.

mod curves;
mod lines;

use std::fmt::Write;

use tandem_rig::Random;

use crate::bound::rest_to_rest_s;
use crate::machine::{Drawn, Planner};
use crate::run;

/// Samples that a program is meant to take at most, were it driven with a rest at each block.
const MAX_SAMPLES: f64 = 20_000.0;
/// Share of the samples that a run may have in which filters settle.
const SETTLING_SHARE: f64 = 0.5;
/// Elements at most.
const MAX_ELEMENTS: u64 = 400;

/// A program in the making.
pub struct Program<'a> {
    random: &'a mut Random,
    machine: &'a Drawn,
    /// Where the machine stands, mm or deg.
    at: Vec<f64>,
    /// Programmed feed, mm/min.
    feed: f64,
    /// Length that elements are about as long as, mm.
    scale_mm: f64,
    /// Digits behind the point.
    digits: usize,
    /// Machine time that may still be used, s.
    left_s: f64,
    text: String,
}

/// A program and the time that it takes about, s.
pub fn draw(random: &mut Random, machine: &Drawn) -> (String, f64) {
    let budget_s = MAX_SAMPLES * random.length(0.02, 1.0) * machine.fine_ms / 1000.0;
    let widest = machine
        .axes
        .iter()
        .map(|axis| axis.high - axis.low)
        .fold(0.0, f64::max);
    let feed = 0.0;
    let mut program = Program {
        at: machine.axes.iter().map(|axis| axis.start).collect(),
        machine,
        feed,
        scale_mm: random.length(1e-4, widest.clamp(1e-3, 2000.0)),
        digits: 4 + random.below(3) as usize,
        left_s: budget_s,
        text: String::new(),
        random,
    };
    program.head();
    for _ in 0..program.random.length(2.0, MAX_ELEMENTS as f64) as u64 {
        program.element();
        if program.left_s <= 0.0 {
            break;
        }
    }
    let mut text = settling_in_time(&program.text, machine);
    text.push_str("M2\n");
    (text, budget_s - program.left_s)
}

/// The lines of `text` up to where the rests between them would take longer to settle than a run may be, or the time constants of
/// blocks that keep theirs: one to get faster, and one to slow down.
fn settling_in_time(text: &str, machine: &Drawn) -> String {
    let mut left_ms = SETTLING_SHARE * run::MAX_SAMPLES as f64 * machine.fine_ms;
    let (mut exact, mut constant_ms) = (false, machine.constant_ms);
    let settles = |line: &&str| {
        if let Some(stated) = line.strip_prefix("TA") {
            constant_ms = stated.parse().unwrap_or(constant_ms);
        } else if machine.keeps_constant && line.contains(char::is_whitespace) {
            left_ms -= 2.0 * constant_ms;
        }
        exact = line.starts_with("G61") || (exact && !line.starts_with("G64"));
        let rests = ["G0", "G4", "G38", "M"]
            .iter()
            .any(|word| line.starts_with(word));
        if exact || rests {
            left_ms -= machine.settling_ms;
        }
        left_ms > 0.0
    };
    text.lines()
        .take_while(settles)
        .flat_map(|line| [line, "\n"])
        .collect()
}

impl Program<'_> {
    fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    fn head(&mut self) {
        self.line("G21 G90 G94 G17");
        if self.random.below(3) > 0 {
            self.tolerance();
        }
        self.new_feed();
    }

    fn element(&mut self) {
        let curves = self.machine.planner.keeps_jerk() && self.has_plane();
        match self.random.below(32) {
            0 | 1 => self.new_feed(),
            2 => self.mode(),
            3 => self.dwell(),
            4 => self.word(),
            5 => self.time_constant(),
            6 | 7 => self.straight("G0"),
            8 => self.probe(),
            9 | 10 => self.circle(),
            11 | 12 => self.arc(),
            13 | 14 => self.chords(),
            15 => self.zigzag(),
            16 => self.marks(),
            17 => self.other_words(),
            18 => self.scale_mm = self.random.length(1e-4, 100.0),
            19..=24 if curves => self.curve(),
            _ => self.straight("G1"),
        }
    }

    /// Whether there are linear axes X and Y, as arcs and curves ask for.
    fn has_plane(&self) -> bool {
        self.axis('X').is_some() && self.axis('Y').is_some()
    }

    fn axis(&self, letter: char) -> Option<usize> {
        self.machine
            .axes
            .iter()
            .position(|axis| axis.letter == letter && !axis.rotary)
    }

    /// A number as it is written.
    fn written(&self, value: f64) -> f64 {
        format!("{value:.*}", self.digits)
            .parse()
            .expect("what is written is a number")
    }

    fn new_feed(&mut self) {
        let fastest = self
            .machine
            .axes
            .iter()
            .map(|axis| axis.feed)
            .fold(0.0, f64::max);
        let low = if self.random.below(4) == 0 {
            1.0
        } else {
            (fastest / 300.0).max(1.0)
        };
        self.feed = crate::machine::rounded(self.random.length(low, (2.0 * fastest).max(2.0)));
        let feed = self.feed;
        self.line(&format!("F{feed}"));
    }

    fn tolerance(&mut self) {
        let min_mm = if self.machine.planner == Planner::Smooth {
            2e-4
        } else {
            1e-4
        };
        let mm = self.random.length(min_mm, 1.0);
        let text = if self.random.below(3) == 0 {
            "G64".to_string()
        } else {
            format!("G64 P{:.4}", mm + 5e-5)
        };
        self.line(&text);
    }

    fn mode(&mut self) {
        match self.random.below(4) {
            0 => self.line("G61"),
            1 => self.line("G61.1"),
            _ => self.tolerance(),
        }
    }

    fn dwell(&mut self) {
        let max_s = self.left_s.min(0.5);
        let dwell_s = if self.random.below(6) == 0 {
            0.0
        } else {
            self.random.length(1e-4, max_s.max(2e-4))
        };
        let text = format!("{dwell_s:.4}");
        self.left_s -= dwell_s;
        self.line(&format!("G4 P{text}"));
    }

    fn word(&mut self) {
        let words = [
            "M3 S100", "M4 S50", "M5", "M7", "M8", "M9", "M62 P1", "M63 P1", "M64 P2", "M65 P2",
            "M1", "M0",
        ];
        let word = self.random.pick(&words);
        self.line(word);
    }

    fn time_constant(&mut self) {
        let ms = self.random.length(self.machine.fine_ms.max(1.0), 300.0);
        self.line(&format!("TA{ms:.2}"));
    }

    /// Words that say the same in another way, and leave things as they were.
    fn other_words(&mut self) {
        match self.random.below(3) {
            0 => {
                self.line("G91");
                let axis = self.random.below(self.at.len() as u64) as usize;
                let (from, to) = (self.at[axis], self.place(axis, self.scale_mm));
                let by = self.written(to - from);
                let inside = (self.machine.axes[axis].low..=self.machine.axes[axis].high)
                    .contains(&(from + by));
                if inside && by != 0.0 && self.spend(&[(axis, by)], false) {
                    let letter = self.machine.axes[axis].letter;
                    self.line(&format!("G1 {letter}{by:.*}", self.digits));
                    // Sums of what is written have more digits than that: the next place is absolute.
                    self.at[axis] = from + by;
                }
                self.line("G90");
            }
            1 if self.axis('X').is_some() => {
                let x = self.axis('X').unwrap_or_default();
                let to = self.place(x, self.scale_mm);
                let by = (to - self.at[x]).abs();
                // A line of less than 60 ns has no F that G-code can say.
                let per_minute = (self.feed / by).min(1e9);
                if by > 0.0 && self.spend(&[(x, by)], false) {
                    self.line(&format!("G93 G1 X{to:.*} F{per_minute:.5}", self.digits));
                    self.line(&format!("G94 F{}", self.feed));
                    self.at[x] = to;
                }
            }
            _ => self.line("(nothing)"),
        }
    }

    /// A place of an axis up to `reach` from where it stands, within the travel; sometimes at its very end.
    fn place(&mut self, axis: usize, reach: f64) -> f64 {
        let of = self.machine.axes[axis];
        if self.random.below(16) == 0 {
            return if self.random.below(2) == 0 {
                of.low
            } else {
                of.high
            };
        }
        let reach = reach * self.random.pick(&[0.1, 1.0, 1.0, 1.0, 3.0]);
        let to = self.at[axis] + self.random.between(-reach, reach);
        let to = self.written(to);
        if to < of.low {
            of.low
        } else if to > of.high {
            of.high
        } else {
            to
        }
    }

    /// Takes the time of a straight motion by so much; whether there is enough left.
    fn spend(&mut self, moved: &[(usize, f64)], rapid: bool) -> bool {
        let linear = moved
            .iter()
            .any(|(axis, by)| !self.machine.axes[*axis].rotary && *by != 0.0);
        let counted = moved
            .iter()
            .filter(|(axis, _)| self.machine.axes[*axis].rotary != linear);
        let length = counted.map(|(_, by)| by * by).sum::<f64>().sqrt();
        if length == 0.0 {
            return false;
        }
        let mut limits = [
            if rapid {
                f64::INFINITY
            } else {
                self.feed / 60.0
            },
            f64::INFINITY,
            f64::INFINITY,
        ];
        for (axis, by) in moved.iter().filter(|(_, by)| *by != 0.0) {
            let (of, share) = (&self.machine.axes[*axis], by.abs() / length);
            let speed = if rapid { of.rapid } else { of.feed } / 60.0;
            for (limit, lane) in limits.iter_mut().zip([speed, of.acceleration, of.jerk]) {
                *limit = limit.min(lane / share);
            }
        }
        self.take(rest_to_rest_s(length, limits[0], limits[1], limits[2]))
    }

    /// The same of a bent path of a length in X and Y.
    fn spend_bent(&mut self, length_mm: f64, radius_mm: f64) -> bool {
        let mut limits = [self.feed / 60.0, f64::INFINITY, f64::INFINITY];
        for axis in self.machine.axes.iter().filter(|axis| !axis.rotary) {
            let lanes = [axis.feed / 60.0, axis.acceleration / 2.0, axis.jerk / 4.0];
            limits
                .iter_mut()
                .zip(lanes)
                .for_each(|(limit, lane)| *limit = limit.min(lane));
        }
        let turning = (limits[1] * radius_mm)
            .sqrt()
            .min((limits[2] * radius_mm * radius_mm).cbrt());
        self.take(rest_to_rest_s(
            length_mm,
            limits[0].min(turning),
            limits[1],
            limits[2],
        ))
    }

    fn take(&mut self, time_s: f64) -> bool {
        let enough = time_s <= self.left_s;
        if enough {
            self.left_s -= time_s + self.machine.fine_ms / 1000.0;
        }
        enough
    }

    /// Writes a straight motion to `to`, if there is time for it.
    fn straight_to(&mut self, word: &str, to: &[(usize, f64)]) -> bool {
        let moved: Vec<(usize, f64)> = to
            .iter()
            .map(|(axis, place)| (*axis, place - self.at[*axis]))
            .collect();
        if !self.spend(&moved, word == "G0") {
            return false;
        }
        let mut text = word.to_string();
        for (axis, place) in to {
            let letter = self.machine.axes[*axis].letter;
            write!(text, " {letter}{place:.*}", self.digits).expect("a text takes what is written");
            self.at[*axis] = *place;
        }
        self.line(&text);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_ends_before_its_rests_take_longer_to_settle_than_a_run_may() {
        let mut machine = crate::machine::draw(&mut Random::new(1), None);
        machine.keeps_constant = false;
        machine.fine_ms = 1.0;
        machine.settling_ms = SETTLING_SHARE * run::MAX_SAMPLES as f64 / 3.5;
        let text = "G1 X1\nG61\nG1 X2\nG64\nG1 X3\nG0 X4\nG1 X5\nM8\nG1 X6\n";
        let kept = "G1 X1\nG61\nG1 X2\nG64\nG1 X3\nG0 X4\nG1 X5\n";
        assert_eq!(settling_in_time(text, &machine), kept);
        machine.settling_ms = 0.0;
        machine.keeps_constant = false;
        assert_eq!(settling_in_time(text, &machine), text);
        machine.keeps_constant = true;
        machine.constant_ms = 1e-3;
        assert_eq!(settling_in_time(text, &machine), text);
        let longer = format!(
            "G1 X1\nTA{}\n{text}",
            SETTLING_SHARE * run::MAX_SAMPLES as f64 / 5.0
        );
        let kept = longer.find("G1 X3").unwrap();
        assert_eq!(settling_in_time(&longer, &machine), longer[..kept]);
    }
}
