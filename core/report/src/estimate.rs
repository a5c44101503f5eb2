//! What programs are estimated to take, drawn: block length against the feed reached. A page without a script.

use std::fmt::Write as _;
use std::io::{self, Write};

use crate::chart::Chart;
use crate::latency::scale::Scale;
use crate::template::{self, facts};
use crate::text::{count, escape, number};

const TEMPLATE: &str = include_str!("../assets/estimate.html");
const CHART: Chart = Chart {
    width: 920.0,
    height: 330.0,
    area: AREA,
};
/// Where the drawing lies: left, right, top, bottom.
const AREA: [f64; 4] = [64.0, 900.0, 14.0, 294.0];

/// Estimates to be drawn.
#[derive(Clone, Debug, Default)]
pub struct EstimateReport {
    /// Heading of the page and of the browser's tab.
    pub title: String,
    /// What holds for all programs: name and value, both as they shall be read.
    pub facts: Vec<(String, String)>,
    /// The programs.
    pub programs: Vec<EstimatedProgram>,
}

/// One program.
#[derive(Clone, Debug, Default)]
pub struct EstimatedProgram {
    /// Its name.
    pub name: String,
    /// Its figures: name and value, both as they shall be read.
    pub facts: Vec<(String, String)>,
    /// Blocks of feed motion by length and feed.
    pub fields: Vec<EstimatedField>,
    /// Programmed feeds, mm/min, to be marked.
    pub programmed_mm_per_min: Vec<f64>,
}

/// The blocks of a range of lengths that reach a range of feeds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EstimatedField {
    /// Length from and below, mm.
    pub length_mm: [f64; 2],
    /// Feed from and below, mm/min.
    pub feed_mm_per_min: [f64; 2],
    /// Blocks.
    pub blocks: u64,
    /// Their time, s.
    pub time_s: f64,
}

impl EstimateReport {
    /// Writes the page: a complete HTML document in UTF-8 that fetches nothing.
    ///
    /// # Errors
    /// Writing fails.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let programs = || self.programs.iter().map(program).collect();
        template::write_plain((&self.title, &self.facts), TEMPLATE, out, |gap| match gap {
            "programs" => programs(),
            unknown => unreachable!("the template has an unknown gap {unknown}"),
        })
    }
}

fn program(program: &EstimatedProgram) -> String {
    let (name, figures) = (escape(&program.name), facts(&program.facts));
    format!(
        "<h2>{name}</h2>\n<p class=\"facts\">{figures}</p>\n{}\n",
        drawing(program)
    )
}

fn drawing(program: &EstimatedProgram) -> String {
    let fields = &program.fields;
    let edges = |of: fn(&EstimatedField) -> [f64; 2]| {
        let ends = fields.iter().map(of);
        ends.fold([f64::INFINITY, 0.0], |[low, high], [from, below]| {
            [low.min(from), f64::max(high, below)]
        })
    };
    let programmed = program
        .programmed_mm_per_min
        .iter()
        .copied()
        .fold(0.0, f64::max);
    let (lengths, feeds) = (edges(|f| f.length_mm), edges(|f| f.feed_mm_per_min));
    let x = Scale::new(lengths[0], lengths[1], AREA[0], AREA[1]);
    let y = Scale::new(feeds[0], feeds[1].max(programmed * 1.2), AREA[3], AREA[2]);
    let mut text = CHART.begin("block length against feed reached");
    CHART.grid(x.places(), y.places(), &mut text);
    CHART.names("block length, mm", "feed reached, mm/min", 5.0, &mut text);
    cells(fields, (&x, &y), &mut text);
    for feed in &program.programmed_mm_per_min {
        let at = y.place(*feed);
        let _ = write!(
            text,
            "<path class=\"s1\" stroke-dasharray=\"5 4\" d=\"M{} {at:.1} H{}\"/>",
            AREA[0], AREA[1]
        );
    }
    text + "</svg>"
}

fn cells(fields: &[EstimatedField], (x, y): (&Scale, &Scale), text: &mut String) {
    let most = fields
        .iter()
        .map(|field| field.time_s)
        .fold(f64::MIN_POSITIVE, f64::max);
    for field in fields {
        let (left, right) = (x.place(field.length_mm[0]), x.place(field.length_mm[1]));
        let bottom = y.place(field.feed_mm_per_min[0]);
        let top = y.place(field.feed_mm_per_min[1]);
        let _ = write!(
            text,
            "<rect class=\"s0\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill-opacity=\"{:.2}\">\
             <title>{} to {} mm at {} to {} mm/min: {} blocks, {} s</title></rect>",
            (right - left - 1.0).max(1.0),
            (bottom - top - 1.0).max(1.0),
            0.1 + 0.9 * (field.time_s / most).clamp(0.0, 1.0),
            number(field.length_mm[0]),
            number(field.length_mm[1]),
            number(field.feed_mm_per_min[0]),
            number(field.feed_mm_per_min[1]),
            count(usize::try_from(field.blocks).unwrap_or(usize::MAX)),
            number(field.time_s)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(report: &EstimateReport) -> String {
        let mut page = vec![];
        report.write(&mut page).unwrap();
        String::from_utf8(page).unwrap()
    }

    #[test]
    fn every_field_is_drawn_and_nothing_is_fetched() {
        let field = |length: f64, blocks| EstimatedField {
            length_mm: [length, 2.0 * length],
            feed_mm_per_min: [500.0, 800.0],
            blocks,
            time_s: 1.5,
        };
        let program = EstimatedProgram {
            name: "a<b>.ngc".into(),
            facts: vec![("estimated".into(), "3 s".into())],
            fields: vec![field(0.1, 70_000), field(3.0, 1)],
            programmed_mm_per_min: vec![2000.0],
        };
        let html = page(&EstimateReport {
            programs: vec![program],
            ..EstimateReport::default()
        });
        assert_eq!(html.matches("<rect").count(), 2);
        for text in [
            "a&lt;b&gt;.ngc",
            "estimated <b>3 s",
            "70\u{202f}000 blocks",
            "0.1 to 0.2 mm at 500 to 800 mm/min",
        ] {
            assert!(html.contains(text), "{text} is not in {html}");
        }
        assert!(!html.contains("http:") && !html.contains("https:") && !html.contains("<script"));
    }

    #[test]
    fn a_program_without_cuts_is_a_page() {
        let empty = EstimatedProgram::default();
        let html = page(&EstimateReport {
            programs: vec![empty],
            ..EstimateReport::default()
        });
        assert!(
            html.contains("</svg>") && !html.contains("NaN") && !html.contains("inf"),
            "{html}"
        );
    }
}
