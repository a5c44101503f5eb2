//! The page as a whole: a template whose gaps are filled while it is written.

use std::io::{self, Write};

use serde::Serialize;

use crate::binding;
use crate::columns::Derived;
use crate::model::{Report, Unit};
use crate::sections;
use crate::tables;
use crate::template;
use crate::text::escape;

/// Samples that a browser still draws fluently; more are thinned.
const MAX_SAMPLES: usize = 2_000_000;

const TEMPLATE: &str = include_str!("../assets/page.html");
const STYLE: &str = include_str!("../assets/style.css");
/// What the operator's page draws with too, in the order in which they build on each other.
const SHARED: [&str; 7] = [
    "uPlot.iife.min.js",
    "theme.js",
    "format.js",
    "camera.js",
    "lines.js",
    "scene.js",
    "plot.js",
];
/// In the order in which they build on each other, and on those.
const SCRIPTS: [&str; 10] = [
    include_str!("../assets/data.js"),
    include_str!("../assets/colour.js"),
    include_str!("../assets/state.js"),
    include_str!("../assets/curve.js"),
    include_str!("../assets/plot.js"),
    include_str!("../assets/band.js"),
    include_str!("../assets/timeline.js"),
    include_str!("../assets/path.js"),
    include_str!("../assets/plots.js"),
    include_str!("../assets/main.js"),
];

impl Report {
    /// Writes the page: a complete HTML document in UTF-8.
    ///
    /// Above two million samples every curve is thinned to the extremes of equal time slices, and the page says so;
    /// limits are judged on all samples before that.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::InvalidInput`] where a column's length differs from that of `t_s`, or the fine period is not
    /// positive; otherwise what `out` answers.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write(self, out, MAX_SAMPLES)
    }
}

/// Writes the page with at most about `cap` points in each curve.
fn write(report: &Report, out: &mut dyn Write, cap: usize) -> io::Result<()> {
    let derived = Derived::of(report, cap)?;
    template::write(TEMPLATE, out, |gap, out| fill(gap, report, &derived, out))
}

fn fill(gap: &str, report: &Report, derived: &Derived, out: &mut dyn Write) -> io::Result<()> {
    let text = match gap {
        "title" => escape(&report.title),
        "subtitle" => sections::subtitle(report),
        "verdict" => sections::verdict(report, derived),
        "notes" => sections::notes(report, derived),
        "facts" => tables::facts(report, derived),
        "peaks-head" => tables::peaks_head(report),
        "peaks" => tables::peaks(report, derived),
        "findings" => tables::findings(derived),
        "style" => {
            ["colours.css", "uPlot.min.css"]
                .map(tandem_view::text)
                .concat()
                + STYLE
        }
        "script" => SHARED.map(tandem_view::text).join("\n") + &SCRIPTS.concat(),
        "about" => about(report, derived)?,
        "columns" => {
            return derived
                .columns(report)
                .try_for_each(|column| column.write(out));
        }
        unknown => unreachable!("the template has an unknown gap {unknown}"),
    };
    out.write_all(text.as_bytes())
}

/// What the script must know besides the columns.
#[derive(Serialize)]
struct About<'a> {
    axes: Vec<AboutAxis>,
    signals: Vec<AboutSignal<'a>>,
    path_tolerance_mm: Option<f64>,
    jerk_is_judged: bool,
    binding: [&'static str; binding::LIMITS],
}

#[derive(Serialize)]
struct AboutAxis {
    letter: String,
    unit: &'static str,
    linear: bool,
    centre: f64,
    max_velocity: f64,
    max_acceleration: f64,
    max_jerk: Option<f64>,
    speed_difference: f64,
}

#[derive(Serialize)]
struct AboutSignal<'a> {
    name: &'a str,
    unit: &'a str,
}

/// The JSON of [`About`], with `<` written so that it cannot end the element it stands in.
fn about(report: &Report, derived: &Derived) -> io::Result<String> {
    let axes = report
        .axes
        .iter()
        .zip(&derived.centres)
        .map(|(axis, &centre)| AboutAxis {
            letter: axis.letter.into(),
            unit: axis.unit.as_str(),
            linear: axis.unit == Unit::Mm,
            centre,
            max_velocity: axis.max_velocity,
            max_acceleration: axis.max_acceleration,
            max_jerk: axis.max_jerk,
            speed_difference: axis.speed_difference,
        });
    let signals = report.signals.iter().map(|signal| AboutSignal {
        name: &signal.name,
        unit: &signal.unit,
    });
    let about = About {
        axes: axes.collect(),
        signals: signals.collect(),
        // A line in the plot stands for one tolerance only.
        path_tolerance_mm: report
            .path_tolerance_mm
            .filter(|_| report.samples.tolerance_mm.is_none()),
        jerk_is_judged: report.jerk_is_judged,
        binding: binding::NAMES,
    };
    Ok(serde_json::to_string(&about)?.replace('<', "\\u003c"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Axis, Samples, Signal};

    fn report(n: usize) -> Report {
        Report {
            title: "<b>title</b>".into(),
            program: "a<script>alert(1)</script>.ngc".into(),
            facts: vec![("a<b".into(), "c&d".into())],
            axes: vec![Axis {
                letter: 'X',
                max_velocity: 1.0,
                max_acceleration: 1.0,
                ..Axis::default()
            }],
            fine_period_s: 0.001,
            signals: vec![Signal {
                name: "</script>".into(),
                unit: "%".into(),
                values: vec![0.0; n],
            }],
            samples: Samples {
                t_s: (0..n).map(|i| i as f64 * 0.001).collect(),
                line: vec![0; n],
                command: vec![vec![0.0; n]],
                feed_mm_s: vec![0.0; n],
                ..Samples::default()
            },
            ..Report::default()
        }
    }

    fn html(report: &Report, cap: usize) -> String {
        let mut page = Vec::new();
        write(report, &mut page, cap).unwrap();
        String::from_utf8(page).unwrap()
    }

    #[test]
    fn text_is_escaped_everywhere() {
        let html = html(&report(3), MAX_SAMPLES);
        assert!(
            html.contains("&lt;b&gt;title")
                && html.contains("a&lt;script&gt;alert(1)&lt;/script&gt;.ngc")
        );
        assert!(!html.contains("<b>title") && !html.contains("<script>alert"));
        assert!(html.contains(r#""name":"\u003c/script>""#));
        assert!(html.contains("<th>a&lt;b<td>c&amp;d"));
    }

    #[test]
    fn nothing_is_fetched() {
        // The page has uPlot's notice, and with it an address in a comment.
        let notice = |line: &&str| !line.starts_with("/*! https://github.com/leeoniya/uPlot");
        let html = html(&report(3), MAX_SAMPLES);
        let html = html.lines().filter(notice).collect::<String>();
        assert!(html.contains("default-src 'none'"));
        assert!(!html.contains("http:") && !html.contains("https:") && !html.contains("src="));
    }

    #[test]
    fn long_runs_are_thinned_and_say_so() {
        assert!(!html(&report(1000), 1000).contains("too many for a page"));
        assert!(html(&report(1001), 1000).contains("1001 samples are too many for a page"));
    }

    #[test]
    fn a_run_without_samples_is_a_page() {
        assert!(html(&report(0), MAX_SAMPLES).contains("0 samples"));
    }

    #[test]
    fn columns_of_other_lengths_are_refused() {
        let mut odd = report(3);
        odd.samples.sigma = vec![1.0; 2];
        let error = odd.write(&mut Vec::new()).unwrap_err();
        assert_eq!(error.to_string(), "a column has 2 samples, t_s has 3");
        let still = Report {
            fine_period_s: 0.0,
            ..report(3)
        };
        assert_eq!(
            still.write(&mut Vec::new()).unwrap_err().kind(),
            io::ErrorKind::InvalidInput
        );
    }

    /// The scripts of a report share one space of names: of two that are the same the later one is everybody's.
    #[test]
    fn no_two_parts_of_the_page_have_a_name_in_common() {
        let shared = SHARED.map(tandem_view::text);
        let parts = shared.iter().map(String::as_str).chain(SCRIPTS);
        let mut known = std::collections::BTreeSet::new();
        for line in parts.flat_map(str::lines) {
            let line = line.strip_prefix("async ").unwrap_or(line);
            let Some((kind, rest)) = line.split_once(' ') else {
                continue;
            };
            if !["function", "const", "let", "class"].contains(&kind) {
                continue;
            }
            let is_in_name = |c: char| c.is_alphanumeric() || c == '_';
            let name = rest
                .split(|c: char| !is_in_name(c))
                .next()
                .unwrap_or_default();
            assert!(
                name.is_empty() || known.insert(name),
                "{name} is there twice"
            );
        }
        assert!(known.contains("Camera") && known.contains("Curve"));
    }
}
