//! The frame of a drawing with two scales: grid, numbers at its marks, and what the scales are called.

use std::fmt::Write as _;

use crate::text::{escape, number};

/// Where a drawing of `width` by `height` has its area.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chart {
    pub width: f64,
    pub height: f64,
    /// Left, right, top, bottom.
    pub area: [f64; 4],
}

/// A value of a scale, and the place where it stands.
pub(crate) type Mark = (f64, f64);

impl Chart {
    /// The start of the drawing; the caller ends it with `</svg>`.
    pub fn begin(&self, label: &str) -> String {
        begin(self.width, self.height, label)
    }

    /// Lines across the area at the marks, and the values beside them.
    pub fn grid(
        &self,
        x: impl IntoIterator<Item = Mark>,
        y: impl IntoIterator<Item = Mark>,
        text: &mut String,
    ) {
        let [left, right, top, bottom] = self.area;
        for (value, at) in x {
            let _ = write!(
                text,
                "<path class=\"grid\" d=\"M{at:.1} {top} V{bottom}\"/>\
                 <text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                bottom + 15.0,
                number(value)
            );
        }
        for (value, at) in y {
            let _ = write!(
                text,
                "<path class=\"grid\" d=\"M{left} {at:.1} H{right}\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 6.0,
                at + 4.0,
                number(value)
            );
        }
    }

    /// What the scale below and the one on the left are called, `lift` above the lower edge.
    pub fn names(&self, below: &str, left: &str, lift: f64, text: &mut String) {
        let bottom = self.height - lift;
        let _ = write!(
            text,
            "<text x=\"{}\" y=\"{bottom}\" text-anchor=\"end\">{}</text>\
             <text x=\"6\" y=\"{bottom}\">{}</text>",
            self.area[1],
            escape(below),
            escape(left)
        );
    }
}

/// The start of any drawing.
pub(crate) fn begin(width: f64, height: f64, label: &str) -> String {
    format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{label}\">")
}
