//! The drawings of a search for settings.

use std::fmt::Write as _;

use super::linear::Linear;
use super::{TuneParameter, TuneReport, TuneScene};
use crate::chart::{Chart, begin};
use crate::text::{escape, number};

/// Styles of the ways of a scene.
pub const WAYS: [usize; 3] = [2, 1, 0];

const CHART: Chart = Chart {
    width: 920.0,
    height: 420.0,
    area: AREA,
};
/// Where the drawing lies: left, right, top, bottom.
const AREA: [f64; 4] = [70.0, 896.0, 16.0, 372.0];

/// The objective against the other number, of every point.
pub fn front(report: &TuneReport) -> String {
    let named = || {
        report
            .front
            .iter()
            .chain(report.marks.iter().map(|(_, at, _)| at))
    };
    let kept = || {
        report
            .points
            .iter()
            .filter(|point| point.kept)
            .map(|point| &point.at)
    };
    let limits = |index: usize| report.limits[index].into_iter();
    // What broke a limit is drawn where it fits: it shall not make what matters small.
    let x = Linear::around(
        named().chain(kept()).map(|at| at[1]).chain(limits(1)),
        AREA[0],
        AREA[1],
    );
    let y = Linear::around(
        named().chain(kept()).map(|at| at[0]).chain(limits(0)),
        AREA[3],
        AREA[2],
    );
    let mut text = CHART.begin("objective against deviation");
    if let Some(limit) = report.limits[1] {
        let at = x.place(limit);
        let _ = write!(
            text,
            "<rect class=\"beyond\" x=\"{at:.1}\" y=\"{}\" width=\"{:.1}\" height=\"{}\"/>",
            AREA[2],
            AREA[1] - at,
            AREA[3] - AREA[2]
        );
    }
    CHART.grid(x.places(8), y.places(7), &mut text);
    CHART.names(&report.names[1], &report.names[0], 8.0, &mut text);
    if let Some(limit) = report.limits[1] {
        let at = x.place(limit);
        let _ = write!(
            text,
            "<path class=\"s1 dashed\" d=\"M{at:.1} {} V{}\"/>",
            AREA[2], AREA[3]
        );
        let _ = write!(
            text,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"end\">limit {}</text>",
            at - 5.0,
            AREA[2] + 12.0,
            number(limit)
        );
    }
    if let Some(limit) = report.limits[0] {
        let at = y.place(limit);
        let _ = write!(
            text,
            "<path class=\"s1 dashed\" d=\"M{} {at:.1} H{}\"/>",
            AREA[0], AREA[1]
        );
        let _ = write!(
            text,
            "<text x=\"{}\" y=\"{:.1}\">limit {}</text>",
            AREA[0] + 6.0,
            at - 5.0,
            number(limit)
        );
    }
    for point in report
        .points
        .iter()
        .filter(|point| x.has(point.at[1]) && y.has(point.at[0]))
    {
        let _ = write!(
            text,
            "<circle class=\"s{} dot\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\"><title>{}</title></circle>",
            if point.kept { 0 } else { 3 },
            x.place(point.at[1]),
            y.place(point.at[0]),
            escape(&point.label)
        );
    }
    text += &line(&report.front, "s0", |at| (x.place(at[1]), y.place(at[0])));
    for (name, at, style) in &report.marks {
        let (left, top) = (x.place(at[1]), y.place(at[0]));
        let (anchor, beside) = if left > 0.7 * CHART.width {
            ("end", -11.0)
        } else {
            ("start", 11.0)
        };
        let _ = write!(
            text,
            "<circle class=\"s{style} dot\" cx=\"{left:.1}\" cy=\"{top:.1}\" r=\"7\"/>\
             <text class=\"name\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
            left + beside,
            top - 8.0,
            escape(name)
        );
    }
    text + "</svg>"
}

/// A line through points.
fn line(points: &[[f64; 2]], style: &str, place: impl Fn(&[f64; 2]) -> (f64, f64)) -> String {
    let mut path = String::new();
    for (index, point) in points.iter().enumerate() {
        let (x, y) = place(point);
        let _ = write!(path, "{}{x:.1} {y:.1} ", if index == 0 { 'M' } else { 'L' });
    }
    if path.is_empty() {
        path
    } else {
        format!("<path class=\"{style}\" d=\"{}\"/>", path.trim_end())
    }
}

const SMALL: [f64; 2] = [300.0, 170.0];
/// Left, right, top, bottom.
const SMALL_AREA: [f64; 4] = [48.0, 252.0, 12.0, 140.0];

/// Both numbers over one parameter.
pub fn parameter(parameter: &TuneParameter) -> String {
    let mut text = begin(SMALL[0], SMALL[1], "what a parameter does");
    let [left, right, top, bottom] = SMALL_AREA;
    let across = |share: f64| left + share * (right - left);
    for index in [1, 0] {
        let values = || {
            parameter
                .steps
                .iter()
                .filter_map(move |step| Some(step.at?[index]))
        };
        let scale = Linear::around(values(), bottom, top);
        for mark in scale.marks(3) {
            let at = scale.place(mark);
            let (edge, anchor) = if index == 0 {
                (left - 5.0, "end")
            } else {
                (right + 5.0, "start")
            };
            if index == 0 {
                let _ = write!(
                    text,
                    "<path class=\"grid\" d=\"M{left} {at:.1} H{right}\"/>"
                );
            }
            let _ = write!(
                text,
                "<text x=\"{edge}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
                at + 4.0,
                number(mark)
            );
        }
        let points: Vec<[f64; 2]> = parameter
            .steps
            .iter()
            .filter_map(|step| Some([step.share, step.at?[index]]))
            .collect();
        text += &line(&points, &format!("s{index}"), |at| {
            (across(at[0]), scale.place(at[1]))
        });
        for step in &parameter.steps {
            let Some(at) = step.at else { continue };
            let (x, y) = (across(step.share), scale.place(at[index]));
            let style = if step.kept { index } else { 3 };
            let _ = write!(
                text,
                "<circle class=\"s{style} dot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"><title>{}: {}</title></circle>",
                escape(&step.value),
                number(at[index])
            );
            if step.chosen {
                let _ = write!(
                    text,
                    "<circle class=\"s{index}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\"/>"
                );
            }
        }
    }
    let ends = [parameter.steps.first(), parameter.steps.last()];
    for (step, anchor) in ends.into_iter().flatten().zip(["start", "end"]) {
        let x = across(step.share);
        let _ = write!(
            text,
            "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{}</text>",
            SMALL[1] - 10.0,
            escape(&step.value)
        );
    }
    text + "</svg>"
}

const SCENE: f64 = 460.0;

/// The ways around a place.
pub fn scene(scene: &TuneScene) -> String {
    let mut text = begin(2.0 * SCENE, SCENE, "the path at a few points");
    let scale = SCENE / (2.0 * scene.radius_mm);
    let place = |at: &[f64; 2]| {
        (
            SCENE + (at[0] - scene.centre_mm[0]) * scale,
            0.5 * SCENE - (at[1] - scene.centre_mm[1]) * scale,
        )
    };
    for part in &scene.programmed {
        text += &line(part, "s3 dashed", place);
    }
    for (index, (_, parts)) in scene.ways.iter().enumerate() {
        for part in parts {
            text += &line(part, &format!("s{}", WAYS[index % WAYS.len()]), place);
        }
    }
    let _ = write!(
        text,
        "<text x=\"10\" y=\"{}\">{} to the right, {} up</text>",
        SCENE - 10.0,
        escape(&scene.axes[0]),
        escape(&scene.axes[1])
    );
    text + "</svg>"
}
