//! What an operator does at random ticks.

use std::fmt::Write;

use tandem_rig::Random;

use crate::machine::Drawn;

/// Lines of a command file for a program that takes about `time_s`; mostly in the end everything is as it was.
pub fn draw(random: &mut Random, machine: &Drawn, time_s: f64) -> String {
    let ticks = ((time_s / (machine.fine_ms / 1000.0)) as u64).max(10);
    let mut operator = Operator {
        random,
        most: machine.max_feed_ratio,
        fine_ms: machine.fine_ms,
        lines: String::new(),
    };
    match operator.random.below(20) {
        0..=6 => return String::new(),
        7..=13 => operator.steps(ticks),
        14..=16 => operator.walk(ticks),
        17 => operator.single_blocks(ticks),
        18 => return operator.stop(ticks),
        _ => operator.stalls(ticks),
    }
    operator.restore()
}

struct Operator<'a> {
    random: &'a mut Random,
    most: f64,
    fine_ms: f64,
    lines: String,
}

impl Operator<'_> {
    fn give(&mut self, tick: u64, command: &str) {
        writeln!(self.lines, "{tick},{command}").expect("a text takes what is written");
    }

    fn ratio(&mut self) -> f64 {
        let ratio = match self.random.below(6) {
            0 => 0.0,
            1 => self.most,
            2 => self.random.length(1e-4, 1.0),
            _ => self.random.between(0.0, self.most),
        };
        (ratio * 1e4).floor() / 1e4
    }

    /// Overrides and holds in the order of their ticks.
    fn steps(&mut self, ticks: u64) {
        let mut tick = self.random.below(ticks / 4 + 2);
        for _ in 0..=self.random.below(12) {
            match self.random.below(5) {
                0 | 1 => {
                    self.give(tick, "hold");
                    tick += self.random.below(ticks / 3 + 3);
                    self.give(tick, "resume");
                }
                2 => {
                    let ratio = self.ratio().min(1.0);
                    self.give(tick, &format!("rapid-override,{ratio}"));
                }
                _ => {
                    let ratio = self.ratio();
                    self.give(tick, &format!("feed-override,{ratio}"));
                }
            }
            tick += 1 + self.random.below(ticks / 5 + 2);
        }
    }

    /// A random walk of the override, every 10 ms.
    fn walk(&mut self, ticks: u64) {
        let every = ((10.0 / self.fine_ms).round() as u64).max(1);
        let (mut tick, mut ratio) = (self.random.below(ticks), 1.0f64.min(self.most));
        let stride = self.random.pick(&[0.02, 0.2, 0.5]);
        for _ in 0..self.random.below(120) + 10 {
            ratio = (ratio + self.random.between(-stride, stride)).clamp(0.02, self.most);
            let written = (ratio * 1e4).floor() / 1e4;
            self.give(tick, &format!("feed-override,{written}"));
            if self.random.below(6) == 0 {
                let rapid = (self.random.unit() * 1e3).floor() / 1e3;
                self.give(tick, &format!("rapid-override,{rapid}"));
            }
            tick += every;
        }
    }

    fn single_blocks(&mut self, ticks: u64) {
        let mut tick = self.random.below(ticks / 2 + 1);
        self.give(tick, "single-block,1");
        for _ in 0..=self.random.below(25) {
            tick += 1 + self.random.below(ticks / 8 + 20);
            self.give(tick, "resume");
        }
        self.give(tick + 1, "single-block,0");
    }

    /// Abort or emergency stop, with something before it.
    fn stop(mut self, ticks: u64) -> String {
        if self.random.below(2) == 0 {
            let ratio = self.ratio();
            let tick = self.random.below(ticks);
            self.give(tick, &format!("feed-override,{ratio}"));
        }
        let tick = self.last_tick() + 1 + self.random.below(ticks);
        let word = self.random.pick(&["abort", "emergency-stop"]);
        self.give(tick, word);
        self.lines
    }

    fn stalls(&mut self, ticks: u64) {
        let mut tick = self.random.below(ticks);
        for _ in 0..=self.random.below(3) {
            let periods = self.random.below(80) + 1;
            self.give(tick, &format!("stall-rough,{periods}"));
            tick += 1 + self.random.below(ticks / 2 + 1);
            if self.random.below(2) == 0 {
                let ratio = self.ratio();
                self.give(tick, &format!("feed-override,{ratio}"));
            }
            tick += 1 + self.random.below(ticks / 2 + 1);
        }
    }

    fn last_tick(&self) -> u64 {
        let last = self
            .lines
            .lines()
            .last()
            .and_then(|line| line.split(',').next());
        last.and_then(|tick| tick.parse().ok()).unwrap_or_default()
    }

    /// Everything as it was, so that the program must come to its end.
    fn restore(mut self) -> String {
        let tick = self.last_tick() + 1 + self.random.below(50);
        for command in [
            "feed-override,1",
            "rapid-override,1",
            "single-block,0",
            "resume",
        ] {
            self.give(tick, command);
        }
        self.lines
    }
}
