//! Path speed against the programmed feed.

use std::ops::RangeInclusive;

use crate::{
    Kind, Machine, Options, Position, Row,
    follow::Followed,
    geometry::minus,
    judge::Report,
    limits::speed_rounding,
    path::{Element, Feed, Place},
    vertices::{length_to_mm, lengths_mm},
};

/// Samples this close to a vertex may belong to either block.
const AT_VERTEX_MM: f64 = 1e-9;

/// The blocks that a stretch of the path touches.
#[derive(Default)]
struct Touched {
    rapids: bool,
    linear_mm_per_s: Option<f64>,
    rotary_deg_per_s: Option<f64>,
}

struct FeedJudge<'a> {
    elements: &'a [Element],
    machine: &'a Machine,
    options: &'a Options,
    lengths_mm: Vec<f64>,
    slack_mm: f64,
}

/// Judges the speed of every chord between samples that belong to the path.
pub fn judge_feed(
    elements: &[Element],
    rows: &[Row],
    followed: &Followed,
    machine: &Machine,
    options: &Options,
    report: &mut Report,
) {
    let lengths_mm = lengths_mm(elements);
    let slack_mm = 2.0 * followed.deviation_mm + AT_VERTEX_MM;
    let judge = FeedJudge {
        elements,
        machine,
        options,
        lengths_mm,
        slack_mm,
    };
    let window = options.feed_window_samples(machine);
    let last = followed.links.len() - 1;
    for sample in 1..=last {
        let moved = minus(&rows[sample].command, &rows[sample - 1].command);
        if moved.iter().all(|&distance| distance == 0.0) {
            continue;
        }
        let place = |sample: usize| followed.places[followed.links[sample]];
        let from = place((sample - 1).saturating_sub(window));
        let to = place((sample + window).min(last));
        judge.judge(
            sample,
            &moved,
            &rows[sample].command,
            &judge.touched(from, to),
            report,
        );
    }
}

impl FeedJudge<'_> {
    fn touched(&self, from: Place, to: Place) -> Touched {
        let mut touched = Touched::default();
        for element in &self.elements[self.range(from, to)] {
            match element.feed {
                Feed::Rapid => touched.rapids = true,
                Feed::PerSecond(feed) if element.moves_linear => {
                    raise(&mut touched.linear_mm_per_s, feed);
                }
                Feed::PerSecond(feed) => raise(&mut touched.rotary_deg_per_s, feed),
            }
        }
        touched
    }

    fn range(&self, from: Place, to: Place) -> RangeInclusive<usize> {
        let (mut first, mut last) = (from.element, to.element);
        let from_mm = length_to_mm(&self.lengths_mm, from) - self.slack_mm;
        let to_mm = length_to_mm(&self.lengths_mm, to) + self.slack_mm;
        while first > 0 && self.lengths_mm[first] >= from_mm {
            first -= 1;
        }
        while last + 1 < self.elements.len() && self.lengths_mm[last + 1] <= to_mm {
            last += 1;
        }
        first..=last
    }

    fn judge(
        &self,
        sample: usize,
        moved: &Position,
        at: &Position,
        touched: &Touched,
        report: &mut Report,
    ) {
        let feed = match *touched {
            // Where a rapid and a feed meet, the limits of the axes alone hold.
            Touched {
                rapids: true,
                linear_mm_per_s: None,
                rotary_deg_per_s: None,
            } => {
                return self.judge_rapid(sample, moved, at, report);
            }
            Touched { rapids: true, .. } => return,
            Touched {
                linear_mm_per_s: Some(feed),
                ..
            } => (feed, false),
            Touched {
                rotary_deg_per_s: Some(feed),
                ..
            } => (feed, true),
            Touched { .. } => return,
        };
        self.judge_path_speed(sample, moved, at, feed, report);
    }

    /// Axis by axis, for rapids have no path speed of their own.
    fn judge_rapid(&self, sample: usize, moved: &Position, at: &Position, report: &mut Report) {
        for axis in &self.machine.axes {
            let speed = moved[axis.index].abs() / self.machine.fine_period_s;
            let limit = axis.max_rapid_mm_per_s;
            let rounding = speed_rounding(at[axis.index].abs(), self.machine.fine_period_s);
            if speed > limit * (1.0 + self.options.feed_tolerance) + rounding {
                report.add(Kind::Feed, sample, Some(axis.index), speed, limit);
            }
        }
    }

    fn judge_path_speed(
        &self,
        sample: usize,
        moved: &Position,
        at: &Position,
        (feed, rotary): (f64, bool),
        report: &mut Report,
    ) {
        let counted = self
            .machine
            .axes
            .iter()
            .filter(|axis| axis.rotary == rotary)
            .map(|axis| axis.index);
        let (mut squared, mut magnitude_mm) = (0.0, 0.0_f64);
        for axis in counted {
            squared += moved[axis].powi(2);
            magnitude_mm = magnitude_mm.max(at[axis].abs());
        }
        let speed = squared.sqrt() / self.machine.fine_period_s;
        let limit = feed * self.options.max_ratio;
        report.maxima.feed_ratio = report.maxima.feed_ratio.max(speed / feed);
        let rounding = 2.0 * speed_rounding(magnitude_mm, self.machine.fine_period_s);
        if speed > limit * (1.0 + self.options.feed_tolerance) + rounding {
            report.add(Kind::Feed, sample, None, speed, limit);
        }
    }
}

fn raise(highest: &mut Option<f64>, feed: f64) {
    *highest = Some(highest.map_or(feed, |known| known.max(feed)));
}
