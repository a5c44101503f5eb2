//! What a search for settings found, drawn: the front, what each parameter does, and the path at a few points. A page without a
//! script.

mod linear;
mod svg;

use std::fmt::Write as _;
use std::io::{self, Write};

use crate::template;
use crate::text::{escape, number};

const TEMPLATE: &str = include_str!("../assets/tune.html");

/// A search to be drawn.
#[derive(Clone, Debug, Default)]
pub struct TuneReport {
    /// Heading of the page and of the browser's tab.
    pub title: String,
    /// Names and values, both as they shall be read.
    pub facts: Vec<(String, String)>,
    /// What came out, as a sentence.
    pub verdict: String,
    /// The two numbers: the objective, and what it is drawn against, with their units.
    pub names: [String; 2],
    /// Every point that gave numbers.
    pub points: Vec<TunePoint>,
    /// The points that none beats, by the second number.
    pub front: Vec<[f64; 2]>,
    /// Points with names: the chosen one, and the machine as it is. Where they are in the legend, by number of its style.
    pub marks: Vec<(String, [f64; 2], usize)>,
    /// Limits of the two numbers.
    pub limits: [Option<f64>; 2],
    /// What each parameter does.
    pub parameters: Vec<TuneParameter>,
    /// The path at a few points.
    pub scene: Option<TuneScene>,
    /// A table: its head, and its rows.
    pub table: Vec<Vec<String>>,
    /// Sentences at the end.
    pub notes: Vec<String>,
}

/// A point.
#[derive(Clone, Debug, Default)]
pub struct TunePoint {
    /// The two numbers.
    pub at: [f64; 2],
    /// It keeps every limit.
    pub kept: bool,
    /// What it is, for whoever points at it.
    pub label: String,
}

/// What a parameter does.
#[derive(Clone, Debug, Default)]
pub struct TuneParameter {
    /// Its name.
    pub name: String,
    /// Its steps, in their order.
    pub steps: Vec<TuneStep>,
    /// What it is worth, as a sentence.
    pub worth: String,
}

/// A value of a parameter.
#[derive(Clone, Debug, Default)]
pub struct TuneStep {
    /// The value.
    pub value: String,
    /// How far through the values of the parameter it is, 0 to 1.
    pub share: f64,
    /// The two numbers; none where the run gave none.
    pub at: Option<[f64; 2]>,
    /// It keeps every limit.
    pub kept: bool,
    /// It is the chosen one.
    pub chosen: bool,
}

/// The way that was driven around a place.
#[derive(Clone, Debug, Default)]
pub struct TuneScene {
    /// Where it is.
    pub place: String,
    /// The two axes.
    pub axes: [String; 2],
    /// The middle of the drawing, and half of its width, mm.
    pub centre_mm: [f64; 2],
    /// See there.
    pub radius_mm: f64,
    /// The programmed path, mm.
    pub programmed: Vec<Vec<[f64; 2]>>,
    /// The ways, with their names.
    pub ways: Vec<(String, Vec<Vec<[f64; 2]>>)>,
}

impl TuneReport {
    /// Writes the page: a complete HTML document in UTF-8 that fetches nothing.
    ///
    /// # Errors
    /// Writing fails.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        template::write_plain((&self.title, &self.facts), TEMPLATE, out, |gap| {
            self.fill(gap)
        })
    }

    fn fill(&self, gap: &str) -> String {
        match gap {
            "verdict" => escape(&self.verdict),
            "front" => svg::front(self),
            "first" => escape(&self.names[0]),
            "second" => escape(&self.names[1]),
            "parameters" => self.parameters.iter().map(parameter).collect(),
            "scene" => self.scene.as_ref().map(scene).unwrap_or_default(),
            "table" => table(&self.table),
            "notes" => self.notes.iter().map(|text| note(text)).collect(),
            unknown => unreachable!("the template has an unknown gap {unknown}"),
        }
    }
}

fn parameter(parameter: &TuneParameter) -> String {
    format!(
        "<figure><figcaption>{}</figcaption>{}<p>{}</p></figure>\n",
        escape(&parameter.name),
        svg::parameter(parameter),
        escape(&parameter.worth)
    )
}

fn scene(scene: &TuneScene) -> String {
    let mut legend = "<span class=\"s3\">programmed</span>".to_string();
    for (index, (name, _)) in scene.ways.iter().enumerate() {
        let _ = write!(
            legend,
            "<span class=\"s{}\">{}</span>",
            svg::WAYS[index % svg::WAYS.len()],
            escape(name)
        );
    }
    format!(
        "<h2>The path at {} points</h2>\n<p>{}; the drawing is {} mm wide.</p>\n<p class=\"legend\">{legend}</p>\n{}\n",
        scene.ways.len(),
        escape(&scene.place),
        number(2.0 * scene.radius_mm),
        svg::scene(scene)
    )
}

fn note(note: &str) -> String {
    format!("<p>{}</p>\n", escape(note))
}

fn table(rows: &[Vec<String>]) -> String {
    let mut text = String::new();
    for (index, row) in rows.iter().enumerate() {
        let cell = if index == 0 { "th" } else { "td" };
        text += "<tr>";
        for (column, value) in row.iter().enumerate() {
            let cell = if column == 0 { "th" } else { cell };
            let _ = write!(text, "<{cell}>{}", escape(value));
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(report: &TuneReport) -> String {
        let mut page = vec![];
        report.write(&mut page).unwrap();
        String::from_utf8(page).unwrap()
    }

    fn report() -> TuneReport {
        let point = |time: f64, deviation: f64, kept| TunePoint {
            at: [time, deviation],
            kept,
            label: format!("point <{time}>"),
        };
        let step = |share: f64, at, chosen| TuneStep {
            value: format!("{share}"),
            share,
            at,
            kept: true,
            chosen,
        };
        TuneReport {
            title: "a & b".into(),
            facts: vec![("points".into(), "3".into())],
            verdict: "10 s <instead of> 12 s".into(),
            names: ["time, s".into(), "path deviation, µm".into()],
            points: vec![
                point(10.0, 20.0, true),
                point(12.0, 10.0, true),
                point(9.0, 40.0, false),
            ],
            front: vec![[12.0, 10.0], [10.0, 20.0], [9.0, 40.0]],
            marks: vec![("chosen".into(), [10.0, 20.0], 1)],
            limits: [None, Some(20.0)],
            parameters: vec![TuneParameter {
                name: "planner.options.rounds".into(),
                steps: vec![
                    step(0.0, Some([12.0, 10.0]), false),
                    step(0.5, None, false),
                    step(1.0, Some([10.0, 20.0]), true),
                ],
                worth: "2 s".into(),
            }],
            scene: Some(TuneScene {
                place: "line 7".into(),
                axes: ["X".into(), "Y".into()],
                centre_mm: [1.0, 2.0],
                radius_mm: 0.5,
                programmed: vec![vec![[1.0, 2.0], [1.5, 2.0]]],
                ways: vec![("chosen".into(), vec![vec![[1.0, 2.1], [1.4, 2.1]]])],
            }),
            table: vec![
                vec![String::new(), "chosen".into()],
                vec!["rounds".into(), "2".into()],
            ],
            notes: vec!["one note".into()],
        }
    }

    #[test]
    fn the_page_holds_everything_and_fetches_nothing() {
        let html = page(&report());
        for text in [
            "a &amp; b",
            "10 s &lt;instead of&gt; 12 s",
            "point &lt;9&gt;",
            "time, s",
            "path deviation, µm",
            "limit 20",
            "planner.options.rounds",
            "The path at 1 points",
            "line 7",
            "<th>rounds<td>2",
            "one note",
        ] {
            assert!(html.contains(text), "{text} is not in {html}");
        }
        assert_eq!(html.matches("<svg").count(), 3);
        assert!(!html.contains("<script") && !html.contains("://") && !html.contains("NaN"));
    }

    #[test]
    fn a_search_that_found_nothing_is_a_page() {
        let empty = TuneReport::default();
        let html = page(&empty);
        assert!(
            html.contains("</html>") && !html.contains("NaN") && !html.contains("inf"),
            "{html}"
        );
        let mut same = report();
        same.points = vec![same.points[0].clone(); 3];
        same.front = vec![[10.0, 20.0]];
        assert!(!page(&same).contains("NaN"));
    }
}
