//! Why a program is refused: each error, and the place in the path where that can be drawn. A page without a script.

use std::fmt::Write as _;
use std::io::{self, Write};

use crate::template;
use crate::text::{escape, number};

const TEMPLATE: &str = include_str!("../assets/refusal.html");
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 420.0;
/// Room around what is drawn.
const MARGIN: f64 = 40.0;

/// A program that is refused.
#[derive(Clone, Debug, Default)]
pub struct RefusalReport {
    /// Heading of the page and of the browser's tab.
    pub title: String,
    /// What holds for all of it: name and value, both as they shall be read.
    pub facts: Vec<(String, String)>,
    /// The errors.
    pub errors: Vec<RefusedPlace>,
}

/// One error.
#[derive(Clone, Debug, Default)]
pub struct RefusedPlace {
    /// What is said of it.
    pub message: String,
    /// Names of the axes to the right and upwards.
    pub axes: [String; 2],
    /// Moves around the place: what each is called, and points of its path, mm. None where nothing is to be drawn.
    pub moves: Vec<(String, Vec<[f64; 2]>)>,
    /// Where the tool stands, and its radius, mm.
    pub tool_at_mm: [f64; 2],
    /// Its radius, mm.
    pub tool_radius_mm: f64,
}

impl RefusalReport {
    /// Writes the page: a complete HTML document in UTF-8 that fetches nothing.
    ///
    /// # Errors
    /// Writing fails.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let errors = || self.errors.iter().map(place).collect();
        template::write_plain((&self.title, &self.facts), TEMPLATE, out, |gap| match gap {
            "errors" => errors(),
            unknown => unreachable!("the template has an unknown gap {unknown}"),
        })
    }
}

fn place(error: &RefusedPlace) -> String {
    let mut text = format!("<pre>{}</pre>\n", escape(&error.message));
    if !error.moves.is_empty() {
        text += &drawing(error);
        text.push('\n');
    }
    text
}

/// The way from mm to the page, the same in both directions.
struct View {
    low: [f64; 2],
    scale: f64,
}

impl View {
    fn of(error: &RefusedPlace) -> Self {
        let [x, y] = error.tool_at_mm;
        let r = error.tool_radius_mm;
        let corners = [[x - r, y - r], [x + r, y + r]];
        let points = error.moves.iter().flat_map(|(_, points)| points);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        // Of long moves only what lies near the tool is seen.
        let near = |axis: usize, value: f64| {
            let reach = 8.0 * r.max(1e-3);
            value.clamp(
                error.tool_at_mm[axis] - reach,
                error.tool_at_mm[axis] + reach,
            )
        };
        for point in points.chain(&corners) {
            for axis in 0..2 {
                low[axis] = low[axis].min(near(axis, point[axis]));
                high[axis] = high[axis].max(near(axis, point[axis]));
            }
        }
        let scale = f64::min(
            (WIDTH - 2.0 * MARGIN) / (high[0] - low[0]).max(1e-6),
            (HEIGHT - 2.0 * MARGIN) / (high[1] - low[1]).max(1e-6),
        );
        Self { low, scale }
    }

    fn place(&self, point: [f64; 2]) -> [f64; 2] {
        [
            MARGIN + (point[0] - self.low[0]) * self.scale,
            HEIGHT - MARGIN - (point[1] - self.low[1]) * self.scale,
        ]
    }
}

fn drawing(error: &RefusedPlace) -> String {
    let view = View::of(error);
    let mut text = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"where the tool does not fit\">"
    );
    for (name, points) in &error.moves {
        let mut path = String::new();
        for (n, point) in points.iter().enumerate() {
            let [x, y] = view.place(*point);
            let _ = write!(path, "{}{x:.1} {y:.1}", if n == 0 { "M" } else { " L" });
        }
        let name = escape(name);
        let _ = write!(
            text,
            "<path class=\"s0\" d=\"{path}\"><title>{name}</title></path>"
        );
        if let Some(middle) = middle(points) {
            let [x, y] = view.place(middle);
            let _ = write!(
                text,
                "<text x=\"{:.1}\" y=\"{:.1}\">{name}</text>",
                x + 6.0,
                y - 6.0
            );
        }
    }
    let [x, y] = view.place(error.tool_at_mm);
    let radius = (error.tool_radius_mm * view.scale).max(2.0);
    let _ = write!(
        text,
        "<circle class=\"s1\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"><title>the tool at {} {}, {} {}: radius {} mm</title></circle>",
        escape(&error.axes[0]),
        number(error.tool_at_mm[0]),
        escape(&error.axes[1]),
        number(error.tool_at_mm[1]),
        number(error.tool_radius_mm)
    );
    let bottom = HEIGHT - 6.0;
    let _ = write!(
        text,
        "<text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{} →, {} ↑, mm</text>",
        WIDTH - 8.0,
        escape(&error.axes[0]),
        escape(&error.axes[1])
    );
    text + "</svg>"
}

/// The point half way along a move.
fn middle(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    match points {
        [from, to] => Some([f64::midpoint(from[0], to[0]), f64::midpoint(from[1], to[1])]),
        _ => points.get(points.len() / 2).copied(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_is_drawn_and_nothing_is_fetched() {
        let place = RefusedPlace {
            message: "a<b".into(),
            axes: ["X".into(), "Y".into()],
            moves: vec![
                ("line 4".into(), vec![[20.0, 0.0], [20.0, 2.0]]),
                ("line 5".into(), vec![[20.0, 2.0], [-4000.0, 2.0]]),
            ],
            tool_at_mm: [17.0, 2.0],
            tool_radius_mm: 3.0,
        };
        let told = RefusedPlace {
            message: "told".into(),
            ..RefusedPlace::default()
        };
        let report = RefusalReport {
            title: "part.ngc".into(),
            errors: vec![place, told],
            ..RefusalReport::default()
        };
        let mut page = vec![];
        report.write(&mut page).unwrap();
        let html = String::from_utf8(page).unwrap();
        assert_eq!(html.matches("<svg").count(), 1);
        assert_eq!(html.matches("<path class=\"s0\"").count(), 2);
        for text in [
            "a&lt;b",
            "<pre>told",
            "line 4",
            "the tool at X 17, Y 2: radius 3 mm",
        ] {
            assert!(html.contains(text), "{text} is not in {html}");
        }
        assert!(!html.contains("http:") && !html.contains("<script") && !html.contains("NaN"));
        // A long move does not make the tool a dot: it is drawn with a tenth of the height at least.
        let radius: f64 = html
            .split(" r=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap()
            .parse()
            .unwrap();
        assert!(radius > HEIGHT / 10.0, "{radius}");
    }
}
