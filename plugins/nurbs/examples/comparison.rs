//! The forms on the curves of the literature: a table on standard output and, with a file name, a picture of their feeds.
//! `cargo run -p tandem-nurbs --example comparison -- docs/pictures/nurbs.svg`.

#[path = "../tests/common/mod.rs"]
mod common;

use std::fmt::Write;

use common::measure::{BEST_S, Figures, figures};
use common::{Collected, canonical, context, curve_block, run};

const FORMS: [(&str, &str); 3] = [
    ("adaptive", "#999999"),
    ("windowed", "#d97706"),
    ("scan", "#1d4ed8"),
];
const PERIOD_S: f64 = 0.002;

/// A panel of the picture: its place, and the ends of its scales.
struct Panel {
    top: f64,
    height: f64,
    time_s: f64,
    most: f64,
    least: f64,
}

const LEFT: f64 = 70.0;
const WIDTH: f64 = 900.0;
/// Points of a line at most.
const POINTS: usize = 900;

impl Panel {
    fn point(&self, (t, value): (f64, f64)) -> (f64, f64) {
        let share = ((value - self.least) / (self.most - self.least)).clamp(-0.02, 1.02);
        (
            LEFT + WIDTH * t / self.time_s,
            self.top + self.height * (1.0 - share),
        )
    }

    fn frame(&self, title: &str) -> String {
        let Self { top, height, .. } = *self;
        let mut text = format!(
            "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{WIDTH}\" height=\"{height}\" fill=\"none\" stroke=\"#ccc\"/>\n\
             <text x=\"{LEFT}\" y=\"{}\">{title}</text>\n",
            top - 6.0
        );
        for (value, y) in [(self.most, top + 10.0), (self.least, top + height)] {
            writeln!(
                text,
                "<text x=\"{}\" y=\"{y}\" text-anchor=\"end\">{value}</text>",
                LEFT - 6.0
            )
            .unwrap();
        }
        let end = format!("{:.2} s", self.time_s);
        writeln!(
            text,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{end}</text>",
            LEFT + WIDTH,
            top + height + 14.0
        )
        .unwrap();
        text
    }

    fn line(&self, values: &[f64], colour: &str) -> String {
        let points = values
            .iter()
            .enumerate()
            .step_by(values.len().div_ceil(POINTS))
            .map(|(n, value)| self.point((n as f64 * PERIOD_S, *value)));
        let text: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\"/>\n",
            text.join(" ")
        )
    }
}

fn difference(values: &[f64]) -> Vec<f64> {
    values
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / PERIOD_S)
        .collect()
}

fn row(form: &str, name: &str, figures: &Figures, (along_s, axes_s): (f64, f64)) {
    let Figures {
        time_s,
        path,
        axis,
        chord_um,
        fluctuation,
        ..
    } = figures;
    println!(
        "| {name} | `{form}` | {time_s:.4} | {:.4} | {:.4} | {:.0} | {:.2e} | {:.0} | {:.2e} | {chord_um:.3} | {:.5} |",
        time_s / along_s,
        time_s / axes_s,
        path[1],
        path[2],
        axis[1],
        axis[2],
        100.0 * fluctuation,
    );
}

/// Feeds of one curve in all forms; of the first curve the jerk of X too.
fn draw(name: &str, driven: &[Collected], top: f64, jerk_too: bool) -> String {
    let time_s = driven.iter().map(Collected::duration_s).fold(0.0, f64::max);
    let feeds = Panel {
        top,
        height: 130.0,
        time_s,
        most: 250.0,
        least: 0.0,
    };
    let jerks = Panel {
        top: top + 175.0,
        height: 130.0,
        time_s,
        most: 4e5,
        least: -4e5,
    };
    let mut text = feeds.frame(&format!("{name}: feed, mm/s"));
    if jerk_too {
        text += &jerks.frame(&format!(
            "{name}: jerk of X, mm/s³; adaptive lies up to a hundred times outside"
        ));
    }
    for (collected, (form, colour)) in driven.iter().zip(FORMS) {
        let samples = collected.path_samples(PERIOD_S);
        text += &feeds.line(
            &difference(&samples.iter().map(|s| s.1).collect::<Vec<_>>()),
            colour,
        );
        if jerk_too && form != "adaptive" {
            let x: Vec<f64> = samples.iter().map(|s| s.0[0]).collect();
            text += &jerks.line(&difference(&difference(&difference(&x))), colour);
        }
    }
    text
}

fn main() {
    println!(
        "| curve | form | time s | of T_ref, path | of T_ref, axes | path mm/s² | path mm/s³ | axis mm/s² | axis mm/s³ | \
         chord µm | fluctuation % |\n|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let (mut picture, mut top) = (String::new(), 60.0);
    for (name, along_s, axes_s) in BEST_S {
        let (data, length_mm) = canonical(name);
        let block = curve_block(data.clone(), length_mm, 250.0);
        let context = context(block.0.start);
        let blocks = [block];
        let driven = FORMS.map(|(form, _)| run(&format!("form = \"{form}\""), &context, &blocks));
        for (collected, (form, _)) in driven.iter().zip(FORMS) {
            row(
                form,
                name,
                &figures(collected, &data, &context),
                (along_s, axes_s),
            );
        }
        let first = name == "butterfly";
        picture += &draw(name, &driven, top, first);
        top += if first { 350.0 } else { 175.0 };
    }
    let Some(file) = std::env::args().nth(1) else {
        return;
    };
    let mut names = String::new();
    for (n, (form, colour)) in FORMS.iter().enumerate() {
        writeln!(
            names,
            "<text x=\"{}\" y=\"24\" fill=\"{colour}\">{form}</text>",
            LEFT + 100.0 * n as f64
        )
        .unwrap();
    }
    let head = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1000\" height=\"{top}\" font-family=\"sans-serif\""
    );
    let text = format!(
        "{head} font-size=\"13\">\n<rect width=\"1000\" height=\"{top}\" fill=\"white\"/>\n{names}{picture}</svg>\n"
    );
    std::fs::write(file, text).expect("the picture is written");
}
