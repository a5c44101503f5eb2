//! Where the time of a program goes.

use std::collections::BTreeMap;

use crate::element::{Element, Kind};
use crate::histogram::Histogram;
use crate::model::Spent;

/// Most line ranges that are kept apart.
const RANGES: usize = 32;

/// Most programmed feeds that are remembered.
const FEEDS: usize = 8;

/// Time and path of a part of the program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Part {
    /// Time, s.
    pub time_s: f64,
    /// Nominal time, s.
    pub nominal_s: f64,
    /// Blocks.
    pub blocks: u64,
}

impl Part {
    fn add(&mut self, element: &Element, spent: &Spent) {
        self.time_s += spent.time_s;
        self.nominal_s += element.nominal_s;
        self.blocks += 1;
    }

    fn join(&mut self, other: &Self) {
        self.time_s += other.time_s;
        self.nominal_s += other.nominal_s;
        self.blocks += other.blocks;
    }
}

/// Totals of one program. Bounded, whatever its length.
#[derive(Clone, Debug)]
pub struct Tally {
    /// All blocks.
    pub all: Part,
    /// Rapids.
    pub rapid: Part,
    /// Feed motion.
    pub cutting: Part,
    /// Dwells.
    pub dwell: Part,
    /// Path length, mm.
    pub length_mm: f64,
    /// Blocks of feed motion by case, 1 to 4.
    pub cases: [u64; 4],
    /// Programmed feeds, mm/min: the first few that differ.
    pub feeds_mm_per_min: Vec<f64>,
    /// By tool.
    pub tools: BTreeMap<u32, Part>,
    /// Length of each block of feed motion against the feed reached in it.
    pub histogram: Histogram,
    ranges: Vec<Part>,
    lines_per_range: u32,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            all: Part::default(),
            rapid: Part::default(),
            cutting: Part::default(),
            dwell: Part::default(),
            length_mm: 0.0,
            cases: [0; 4],
            feeds_mm_per_min: vec![],
            tools: BTreeMap::new(),
            histogram: Histogram::default(),
            ranges: vec![],
            lines_per_range: 1,
        }
    }
}

impl Tally {
    /// Adds a block.
    pub fn add(&mut self, element: &Element, spent: &Spent) {
        self.all.add(element, spent);
        match element.kind {
            Kind::Rapid => self.rapid.add(element, spent),
            Kind::Dwell => self.dwell.add(element, spent),
            Kind::Cut => {
                self.cutting.add(element, spent);
                self.programmed(element.length_mm / element.nominal_s * 60.0);
                self.histogram
                    .add(element.length_mm, spent.reached_mm_per_s, spent.time_s);
            }
        }
        self.length_mm += element.length_mm;
        if let Some(case) = spent.case {
            self.cases[case as usize - 1] += 1;
        }
        self.tools
            .entry(element.tool)
            .or_default()
            .add(element, spent);
        self.range(element.line).add(element, spent);
    }

    fn programmed(&mut self, feed_mm_per_min: f64) {
        let alike = |other: &f64| (other / feed_mm_per_min - 1.0).abs() < 1e-6;
        if feed_mm_per_min.is_finite()
            && self.feeds_mm_per_min.len() < FEEDS
            && !self.feeds_mm_per_min.iter().any(alike)
        {
            self.feeds_mm_per_min.push(feed_mm_per_min);
        }
    }

    /// Blocks of feed motion that reach their feed, and those that do not: L and S of the paper.
    pub fn long_and_short(&self) -> (u64, u64) {
        (self.cases[0], self.cases[1..].iter().sum())
    }

    /// Ranges of lines, first and last, with what they take; those without any block are left out.
    pub fn lines(&self) -> impl Iterator<Item = (u32, u32, &Part)> {
        let ranges = self
            .ranges
            .iter()
            .enumerate()
            .filter(|(_, part)| part.blocks > 0);
        ranges.map(|(index, part)| {
            let first = index as u32 * self.lines_per_range + 1;
            (first, first + (self.lines_per_range - 1), part)
        })
    }

    /// The range of a line. Where the program goes on beyond the last range, ranges become twice as long.
    fn range(&mut self, line: u32) -> &mut Part {
        let index = |lines_per_range: u32| (line.saturating_sub(1) / lines_per_range) as usize;
        while index(self.lines_per_range) >= RANGES {
            self.lines_per_range *= 2;
            let halves = self.ranges.chunks(2).map(|pair| {
                let mut sum = pair[0];
                pair[1..].iter().for_each(|other| sum.join(other));
                sum
            });
            self.ranges = halves.collect();
        }
        let index = index(self.lines_per_range);
        self.ranges
            .resize(self.ranges.len().max(index + 1), Part::default());
        &mut self.ranges[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_lines_stay_few_and_lose_nothing() {
        let mut tally = Tally::default();
        for line in [1, 2, 31, 33, 500, 70_001, 4_000_000_000] {
            let element = Element {
                line,
                ..Element::line(1.0, 0.0, 10.0)
            };
            tally.add(
                &element,
                &Spent {
                    time_s: f64::from(line),
                    reached_mm_per_s: 10.0,
                    case: None,
                },
            );
        }
        let total: f64 = tally.lines().map(|(_, _, part)| part.time_s).sum();
        assert_eq!(total, tally.all.time_s);
        assert!(tally.lines().count() <= RANGES);
        let (first, last, part) = tally.lines().last().unwrap();
        assert!(first <= 4_000_000_000 && 4_000_000_000 <= last && part.blocks == 1);
    }
}
