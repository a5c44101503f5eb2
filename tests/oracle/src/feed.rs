//! Path speed against the programmed feed.

use std::ops::RangeInclusive;

use crate::{
    Kind, Machine, Options, Position, Row,
    follow::{Followed, ranges},
    geometry::minus,
    judge::Report,
    limits::speed_rounding,
    path::{Element, Feed, PathPosition},
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
    let mut wide: Option<Vec<(PathPosition, PathPosition)>> = None;
    for sample in 1..=last {
        let moved = minus(&rows[sample].command, &rows[sample - 1].command);
        if moved.iter().all(|&distance| distance == 0.0) {
            continue;
        }
        let place = |sample: usize| followed.places[followed.links[sample]];
        let from = place((sample - 1).saturating_sub(window));
        let to = place((sample + window).min(last));
        let at = &rows[sample].command;
        let mut touched = judge.touched(from, to);
        if !judge.is_kept(&moved, at, &touched) {
            // Where the path comes by again within its tolerance, the nearest place may be one of another block than moves. The
            // one that the record names counts too, where it may be that.
            let wide =
                wide.get_or_insert_with(|| ranges(elements, followed, options).unwrap_or_default());
            if let Some((first, last)) = wide.get(followed.links[sample]) {
                let named = &elements[first.element..=last.element];
                for element in named.iter().filter(|it| it.line == rows[sample].line) {
                    touched.add(element);
                }
            }
        }
        judge.judge(sample, &moved, at, &touched, report);
    }
}

impl Touched {
    fn add(&mut self, element: &Element) {
        match element.feed {
            Feed::Rapid => self.rapids = true,
            Feed::PerSecond(feed) if element.moves_linear => {
                raise(&mut self.linear_mm_per_s, feed);
            }
            Feed::PerSecond(feed) => raise(&mut self.rotary_deg_per_s, feed),
        }
    }

    /// The feed that counts, and whether it is one of rotary axes; none where a rapid does.
    fn feed(&self) -> Option<(f64, bool)> {
        match *self {
            Self { rapids: true, .. } => None,
            Self {
                linear_mm_per_s: Some(feed),
                ..
            } => Some((feed, false)),
            Self {
                rotary_deg_per_s, ..
            } => rotary_deg_per_s.map(|feed| (feed, true)),
        }
    }
}

impl FeedJudge<'_> {
    fn touched(&self, from: PathPosition, to: PathPosition) -> Touched {
        let mut touched = Touched::default();
        for element in &self.elements[self.range(from, to)] {
            touched.add(element);
        }
        touched
    }

    fn range(&self, from: PathPosition, to: PathPosition) -> RangeInclusive<usize> {
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
        if let Some(feed) = touched.feed() {
            return self.judge_path_speed(sample, moved, at, feed, report);
        }
        // Where a rapid and a feed meet, the limits of the axes alone hold.
        if touched.rapids
            && touched
                .linear_mm_per_s
                .or(touched.rotary_deg_per_s)
                .is_none()
        {
            self.judge_rapid(sample, moved, at, report);
        }
    }

    /// Whether a feed that counts is kept.
    fn is_kept(&self, moved: &Position, at: &Position, touched: &Touched) -> bool {
        touched.feed().is_none_or(|feed| {
            let (speed, most) = self.speed(moved, at, feed);
            speed <= most
        })
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
        let (speed, most) = self.speed(moved, at, (feed, rotary));
        let limit = feed * self.options.max_ratio;
        report.maxima.feed_ratio = report.maxima.feed_ratio.max(speed / feed);
        if speed > most {
            report.add(Kind::Feed, sample, None, speed, limit);
        }
    }

    /// How fast the axes move that a feed counts, and the most that is forgiven.
    fn speed(&self, moved: &Position, at: &Position, (feed, rotary): (f64, bool)) -> (f64, f64) {
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
        let rounding = 2.0 * speed_rounding(magnitude_mm, self.machine.fine_period_s);
        let limit = feed * self.options.max_ratio;
        (
            squared.sqrt() / self.machine.fine_period_s,
            limit * (1.0 + self.options.feed_tolerance) + rounding,
        )
    }
}

fn raise(highest: &mut Option<f64>, feed: f64) {
    *highest = Some(highest.map_or(feed, |known| known.max(feed)));
}
