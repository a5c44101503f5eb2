//! How late a thread woke, drawn: a page of its own, without a script.

pub(crate) mod scale;
mod svg;

use std::io::{self, Write};

use crate::template;
use crate::text::{count, escape, number};

const TEMPLATE: &str = include_str!("../assets/latency.html");

/// A measurement of wake-ups to be drawn, alone or beside another.
#[derive(Clone, Debug, Default)]
pub struct LatencyReport {
    /// Heading of the page and of the browser's tab.
    pub title: String,
    /// What was measured, in this order: name and value, both as they shall be read.
    pub facts: Vec<(String, String)>,
    /// Sentences that a reader must know.
    pub notes: Vec<String>,
    /// One or two measurements; bins at the same places are drawn beside each other.
    pub series: Vec<LatencySeries>,
}

/// One measurement.
#[derive(Clone, Debug, Default)]
pub struct LatencySeries {
    /// Who measured.
    pub name: String,
    /// The counts, in order, each from where the one before ends.
    pub bins: Vec<LatencyBin>,
    /// Lateness that half, 99 % and 99.9 % of the wake-ups kept, and the latest, µs.
    pub percentiles_us: [f64; 4],
}

/// Wake-ups by so much late.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LatencyBin {
    /// From so much, µs.
    pub from_us: f64,
    /// To less than so much, µs.
    pub below_us: f64,
    /// Wake-ups.
    pub count: u64,
}

impl LatencySeries {
    /// Wake-ups counted.
    pub fn count(&self) -> u64 {
        self.bins.iter().map(|bin| bin.count).sum()
    }
}

impl LatencyReport {
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
        let of_each = |text: &dyn Fn(usize, &LatencySeries) -> String| -> String {
            self.series
                .iter()
                .enumerate()
                .map(|(index, series)| text(index, series))
                .collect()
        };
        match gap {
            "notes" => joined(&self.notes, |note| format!("<p>{}</p>\n", escape(note))),
            "legend" => of_each(&|index, series| {
                format!("<span class=\"s{index}\">{}</span>", escape(&series.name))
            }),
            "histogram" => svg::histogram(&self.series),
            "later" => svg::later(&self.series),
            "figures" => of_each(&figures),
            unknown => unreachable!("the template has an unknown gap {unknown}"),
        }
    }
}

fn joined<T>(items: &[T], text: impl Fn(&T) -> String) -> String {
    items.iter().map(text).collect()
}

fn figures(index: usize, series: &LatencySeries) -> String {
    let cells = joined(&series.percentiles_us, |us| format!("<td>{}", number(*us)));
    let wake_ups = count(usize::try_from(series.count()).unwrap_or(usize::MAX));
    format!(
        "<tr class=\"s{index}\"><th>{}<td>{wake_ups}{cells}",
        escape(&series.name)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(super) fn series(name: &str, counts: &[u64]) -> LatencySeries {
        let edge = |index: usize| 2.0 * (1_u64 << index) as f64;
        let bin = |(index, count): (usize, &u64)| LatencyBin {
            from_us: edge(index),
            below_us: edge(index + 1),
            count: *count,
        };
        let bins = counts.iter().enumerate().map(bin).collect();
        LatencySeries {
            name: name.into(),
            bins,
            percentiles_us: [1.0, 2.0, 3.0, 1234.5],
        }
    }

    fn page(report: &LatencyReport) -> String {
        let mut page = vec![];
        report.write(&mut page).unwrap();
        String::from_utf8(page).unwrap()
    }

    #[test]
    fn the_page_holds_everything_and_fetches_nothing() {
        let series = vec![
            series("tandem", &[5, 0, 1]),
            series("<other>", &[3, 90_000]),
        ];
        let facts = vec![("period".into(), "1 ms".into())];
        let html = page(&LatencyReport {
            title: "a & b".into(),
            facts,
            notes: vec!["no <b>".into()],
            series,
        });
        for text in [
            "a &amp; b",
            "period <b>1 ms",
            "no &lt;b&gt;",
            "&lt;other&gt;",
            "<td>1234",
            "90\u{202f}003",
        ] {
            assert!(html.contains(text), "{text} is not in {html}");
        }
        assert!(
            !html.contains("<other>")
                && !html.contains("http:")
                && !html.contains("https:")
                && !html.contains("<script")
        );
        assert!(html.contains("default-src 'none'"));
    }

    #[test]
    fn nothing_measured_is_a_page() {
        let empty = LatencySeries {
            name: "tandem".into(),
            ..LatencySeries::default()
        };
        for series in [vec![], vec![empty], vec![series("tandem", &[0, 0])]] {
            let html = page(&LatencyReport {
                series,
                ..LatencyReport::default()
            });
            assert!(
                html.contains("</svg>") && !html.contains("NaN") && !html.contains("inf"),
                "{html}"
            );
        }
    }
}
