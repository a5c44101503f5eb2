//! Where the control points and knots of a curve stand: what is wrong with a whole curve shows only when it is complete.

use tandem_motion::nurbs::{Nurbs, NurbsError};
use tandem_sdk::NurbsData;

use crate::line_error::{LineError, SourceLine, Span};

/// The lines of a curve, one for each control point; those of knots that stand alone follow.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// Number of the line, and where its text ends.
    lines: Vec<(u32, usize)>,
    text: Vec<u8>,
}

impl Places {
    /// `text` is the line of what has been read last, up to `count` control points or knots.
    pub fn note(&mut self, number: u32, text: &[u8], count: usize) {
        while self.lines.len() < count {
            self.text.extend_from_slice(text);
            self.lines.push((number, self.text.len()));
        }
    }

    /// Moves `line_error` to the word `letter` of the line `index`, or to the first word of that line. A line that is still
    /// being read keeps it.
    fn point_out(&self, mut line_error: LineError, index: usize, letter: u8) -> LineError {
        let Some((number, to)) = self.lines.get(index).copied() else {
            return line_error;
        };
        let from = index
            .checked_sub(1)
            .map_or(0, |before| self.lines[before].1);
        let text = &self.text[from..to];
        let words = words(text);
        let word = words
            .iter()
            .find(|span| text[span.start as usize].eq_ignore_ascii_case(&letter));
        line_error.span = word.or(words.first()).copied().unwrap_or_default();
        line_error.line = Some(Box::new(SourceLine {
            number,
            text: text.to_vec(),
        }));
        line_error
    }
}

/// Where the words of a line stand that could be read: not what is in comments and brackets, nor names of functions.
fn words(text: &[u8]) -> Vec<Span> {
    let mut words = Vec::new();
    let mut depth = 0_i32;
    let mut in_name = false;
    for (at, byte) in text
        .iter()
        .enumerate()
        .filter(|(_, byte)| !byte.is_ascii_whitespace())
    {
        match byte {
            b'(' | b'[' | b'<' => depth += 1,
            b')' | b']' | b'>' => depth -= 1,
            b';' if depth == 0 => break,
            letter if depth == 0 && letter.is_ascii_alphabetic() && !in_name => {
                words.push(Span::new(at, at));
            }
            _ => {}
        }
        in_name = byte.is_ascii_alphabetic();
        if let Some(word) = words.last_mut().filter(|_| depth == 0 && *byte != b')') {
            word.end = at as u32 + 1;
        }
    }
    words
}

/// Where a curve comes from.
pub(crate) struct Origin {
    /// The line that opens it.
    pub line: u32,
    /// F of that line under G93, 1/min.
    pub inverse_time: Option<f64>,
    pub places: Places,
    /// The letter of weights.
    pub weight: u8,
}

impl Origin {
    /// A curve that stands in one line.
    pub fn line(line: u32) -> Self {
        Self {
            line,
            inverse_time: None,
            places: Places::default(),
            weight: b'P',
        }
    }

    /// Moves `line_error` to the word that `error` is about, where it is about one.
    pub fn blame(&self, line_error: LineError, error: &NurbsError, data: &NurbsData) -> LineError {
        let span = |from: f64| data.knots.partition_point(|knot| *knot <= from) - 1;
        match *error {
            NurbsError::WeightRatio { .. } => {
                let by_size = |a: &usize, b: &usize| data.weights[*a].total_cmp(&data.weights[*b]);
                let all = 0..data.weights.len();
                let later = all.clone().min_by(by_size).max(all.rev().max_by(by_size));
                self.places
                    .point_out(line_error, later.unwrap_or(0), self.weight)
            }
            NurbsError::Close { index, .. } => self.places.point_out(line_error, index + 1, b'K'),
            // Between two knots all control points are alike in what counts: the second is the first that repeats it.
            NurbsError::NotCounted { from, .. } => {
                self.places
                    .point_out(line_error, span(from) - data.degree + 1, 0)
            }
            _ => line_error,
        }
    }

    /// Moves `line_error` to the control point that draws the curve beyond `limit` on `axis`: with its weight it lies
    /// furthest out, `above` or below.
    pub fn blame_travel(
        &self,
        line_error: LineError,
        curve: &Nurbs,
        axis: (usize, u8),
        limit: f64,
        above: bool,
    ) -> LineError {
        let out = |index: usize| {
            let (point, weight) = curve.control_point(index);
            weight * (point[axis.0] - limit) * if above { 1.0 } else { -1.0 }
        };
        let furthest = (0..curve.points())
            .rev()
            .max_by(|a, b| out(*a).total_cmp(&out(*b)));
        let mut line_error = self
            .places
            .point_out(line_error, furthest.unwrap_or(0), axis.1);
        if line_error.line.is_some() {
            line_error
                .message
                .push_str("; this control point draws the curve there");
        }
        line_error
    }
}

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn words_are_found() {
        let found = |text: &str| {
            words(text.as_bytes())
                .iter()
                .map(|s| text[s.start as usize..s.end as usize].to_string())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            found("N7 X-1.5(Y9) y [2 + COS[3]]P 1 ; K4"),
            ["N7", "X-1.5", "y [2 + COS[3]]", "P 1"]
        );
        assert_eq!(
            found("X ABS[-3] Y#<x y> R SIN[1]"),
            ["X ABS[-3]", "Y#<x y>", "R SIN[1]"]
        );
        assert_eq!(found(" (X1) "), Vec::<String>::new());
    }
}
