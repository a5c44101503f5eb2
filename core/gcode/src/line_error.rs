//! What went wrong in a line, before it is known which line of which file that is.

/// Bytes `start..end` of a line, from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span {
    pub start: u32,
    pub end: u32,
}

impl Span {
    pub fn new(start: usize, end: usize) -> Self {
        Self {
            start: start as u32,
            end: end as u32,
        }
    }
}

/// An error with its place in the line. Results that hold one are returned for each word of each line, and hardly ever are
/// errors: so it is one pointer.
#[derive(Debug)]
pub(crate) struct LineError(Box<Details>);

/// What an error says.
#[derive(Debug)]
pub(crate) struct Details {
    pub span: Span,
    pub code: &'static str,
    pub message: String,
    /// The line, where it is not the one that is read.
    pub line: Option<Box<SourceLine>>,
    /// The place in the path, where it is worth to be drawn.
    pub sketch: Option<Box<Sketch>>,
}

/// A line that was read before.
#[derive(Debug)]
pub(crate) struct SourceLine {
    pub number: u32,
    pub text: Vec<u8>,
}

/// A place in the path where the tool does not fit, in the plane of the path, machine coordinates in mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// The axes of the plane, the one to the right first.
    pub axes: [char; 2],
    /// The programmed moves around the place: the line of each, and points of its path.
    pub moves: Vec<(u32, Vec<[f64; 2]>)>,
    /// Where the tool stands beside the corner.
    pub tool_at_mm: [f64; 2],
    /// Its radius.
    pub tool_radius_mm: f64,
}

impl LineError {
    #[cold]
    pub fn new(span: Span, code: &'static str, message: impl Into<String>) -> Self {
        Self(Box::new(Details {
            span,
            code,
            message: message.into(),
            line: None,
            sketch: None,
        }))
    }

    pub fn into_details(self) -> Details {
        *self.0
    }
}

impl std::ops::Deref for LineError {
    type Target = Details;

    fn deref(&self) -> &Details {
        &self.0
    }
}

impl std::ops::DerefMut for LineError {
    fn deref_mut(&mut self) -> &mut Details {
        &mut self.0
    }
}

/// The result of anything that reads a line.
pub(crate) type Checked<T> = Result<T, LineError>;

/// A number as messages show it: at most four decimals, no trailing zeros.
pub(crate) fn show(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".into()
    } else {
        text.into()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_shown_short() {
        assert_eq!(super::show(250.0), "250");
        assert_eq!(super::show(-0.000_01), "0");
        assert_eq!(super::show(-1.250_04), "-1.25");
    }
}
