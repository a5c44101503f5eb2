//! The words of one line.

use crate::line_error::{Checked, LineError, Span};
use crate::state::letters::{AXIS_MASK, SPINDLE_BIT, index, mask};

/// Most G words, and most M words, of a line.
const MAX_CODES: usize = 16;

/// A G or M word: its number in tenths (G61.1 is 611) and its place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Code {
    pub tenths: u16,
    pub span: Span,
}

/// The G or the M words of a line in their order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Codes {
    codes: [Code; MAX_CODES],
    count: usize,
}

impl Codes {
    pub fn push(&mut self, code: Code) -> Checked<()> {
        if self.take(code) {
            return Ok(());
        }
        Err(LineError::new(
            code.span,
            "too-many",
            format!("a line holds at most {MAX_CODES} G and M words each"),
        ))
    }

    /// Adds a word; false where there is no place for it.
    #[inline]
    pub fn take(&mut self, code: Code) -> bool {
        let Some(place) = self.codes.get_mut(self.count) else {
            return false;
        };
        *place = code;
        self.count += 1;
        true
    }

    pub fn as_slice(&self) -> &[Code] {
        &self.codes[..self.count]
    }
}

/// What a `#…=` assigns to: a number, or a range of [`LineWords::names`].
#[derive(Clone, Debug)]
pub(crate) enum Target {
    Numbered(usize),
    Named(std::ops::Range<usize>),
}

/// An assignment; it takes effect when the whole line has been read.
#[derive(Clone, Debug)]
pub(crate) struct Assignment {
    pub target: Target,
    pub value: f64,
    pub span: Span,
}

/// `@` and `^`: a place of the plane XY by its distance from the origin and its direction from X to Y, in program units and
/// degrees.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Polar {
    pub radius: Option<f64>,
    pub angle_deg: Option<f64>,
    pub span: Span,
}

impl Polar {
    /// X and Y of the place, where the line begins at `at`.
    pub fn place(&self, at: [f64; 2], absolute: bool) -> [f64; 2] {
        let (radius, angle) = (at[0].hypot(at[1]), at[1].atan2(at[0]));
        let given = self.angle_deg.map(f64::to_radians);
        let (radius, angle) = if absolute {
            (self.radius.unwrap_or(radius), given.unwrap_or(angle))
        } else {
            (
                radius + self.radius.unwrap_or(0.0),
                angle + given.unwrap_or(0.0),
            )
        };
        [radius * angle.cos(), radius * angle.sin()]
    }
}

/// The words of one line. Kept from line to line so that nothing is allocated.
#[derive(Clone, Debug, Default)]
pub(crate) struct LineWords {
    /// Bit per letter that the line has, G and M apart, and `SPINDLE_BIT`.
    pub present: u32,
    values: [f64; 26],
    spans: [Span; 26],
    /// `$`.
    spindle: Span,
    pub g: Codes,
    pub m: Codes,
    /// `@` and `^`.
    pub polar: Option<Polar>,
    /// TA in ms.
    pub time_constant: Option<(f64, Span)>,
    pub assignments: Vec<Assignment>,
    pub names: Vec<u8>,
    /// The comment `(ABORT, …)`, which ends the program.
    pub abort: Option<Span>,
}

impl LineWords {
    pub fn clear(&mut self) {
        self.present = 0;
        self.g.count = 0;
        self.m.count = 0;
        self.polar = None;
        self.time_constant = None;
        self.abort = None;
        self.assignments.clear();
        self.names.clear();
    }

    /// The letters of the axes that the line names; `@` and `^` name X and Y.
    #[inline]
    pub fn named(&self) -> u32 {
        let polar = if self.polar.is_some() { mask("XY") } else { 0 };
        self.present & AXIS_MASK | polar
    }

    /// Adds `@` or `^`.
    #[cold]
    pub fn add_polar(&mut self, byte: u8, value: f64, span: Span) -> Checked<()> {
        let polar = self.polar.get_or_insert(Polar {
            span,
            ..Polar::default()
        });
        let place = if byte == b'@' {
            &mut polar.radius
        } else {
            &mut polar.angle_deg
        };
        match place.replace(value) {
            None => Ok(()),
            Some(_) => Err(twice(byte, span)),
        }
    }

    /// Adds `$`, which names the spindle that a word means. There is one: $0, and $-1 are all of them.
    #[cold]
    pub fn add_spindle(&mut self, value: f64, span: Span) -> Checked<()> {
        if self.present & SPINDLE_BIT != 0 {
            return Err(twice(b'$', span));
        }
        if value != 0.0 && value != -1.0 {
            let message = "$ names a spindle, and this control has one: $0 ($-1 are all of them)";
            return Err(LineError::new(span, "word-range", message));
        }
        self.present |= SPINDLE_BIT;
        self.spindle = span;
        Ok(())
    }

    /// Whether the line holds no word.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.present == 0 && self.polar.is_none() && self.g.count == 0 && self.m.count == 0
    }

    /// Whether a number O is all that the line says.
    pub fn is_number_of_program(&self) -> bool {
        self.present & !mask("NO") == 0
            && self.polar.is_none()
            && self.time_constant.is_none()
            && self.assignments.is_empty()
            && self.g.count == 0
            && self.m.count == 0
    }

    /// Adds a word other than G and M.
    #[inline]
    pub fn add(&mut self, letter: u8, value: f64, span: Span) -> Checked<()> {
        if self.has(letter) {
            return Err(twice(letter, span));
        }
        self.set(letter, value, span);
        Ok(())
    }

    /// Sets a word other than G and M.
    #[inline]
    pub fn set(&mut self, letter: u8, value: f64, span: Span) {
        self.present |= 1 << index(letter);
        self.values[index(letter)] = value;
        self.spans[index(letter)] = span;
    }

    #[inline]
    pub fn has(&self, letter: u8) -> bool {
        self.present >> index(letter) & 1 != 0
    }

    #[inline]
    pub fn get(&self, letter: u8) -> Option<f64> {
        self.has(letter).then(|| self.values[index(letter)])
    }

    pub fn span(&self, letter: u8) -> Span {
        self.spans[index(letter)]
    }

    /// An error at the word `letter`.
    pub fn error(&self, letter: u8, code: &'static str, message: impl Into<String>) -> LineError {
        LineError::new(self.span(letter), code, message)
    }

    /// What is to be said of a word `letter` out of place where it is E right behind a number: X1e-5.
    #[cold]
    pub fn exponent(&self, letter: u8) -> &'static str {
        let behind = |other: u8| self.has(other) && self.span(other).end == self.span(letter).start;
        if letter == b'E' && (b'A'..=b'Z').any(behind) {
            "; numbers have no exponent"
        } else {
            ""
        }
    }

    /// The place of the first (leftmost) letter of `mask`.
    pub fn first_of(&self, mask: u32) -> Option<(u8, Span)> {
        let present = self.present & mask;
        if present == 0 {
            return None;
        }
        let letters = (b'A'..=b'Z').filter(|l| present >> index(*l) & 1 != 0);
        let spindle = (present & SPINDLE_BIT != 0).then_some((b'$', self.spindle));
        letters
            .map(|l| (l, self.span(l)))
            .chain(spindle)
            .min_by_key(|(_, span)| span.start)
    }

    /// The word `letter` as a whole number of `range`; `None` where the line lacks it.
    pub fn integer(
        &self,
        letter: u8,
        range: std::ops::RangeInclusive<u32>,
    ) -> Checked<Option<u32>> {
        let Some(value) = self.get(letter) else {
            return Ok(None);
        };
        let rounded = value.round();
        if (value - rounded).abs() > 1e-4
            || !(f64::from(*range.start())..=f64::from(*range.end())).contains(&rounded)
        {
            let name = letter as char;
            let message = format!(
                "{name} must be a whole number from {} to {}",
                range.start(),
                range.end()
            );
            return Err(self.error(letter, "word-range", message));
        }
        Ok(Some(rounded as u32))
    }

    /// The word `letter` where it must not be negative; `None` where the line lacks it.
    pub fn not_negative(&self, letter: u8) -> Checked<Option<f64>> {
        match self.get(letter) {
            Some(value) if value < 0.0 => Err(self.error(
                letter,
                "word-range",
                format!("{} must not be negative", letter as char),
            )),
            other => Ok(other),
        }
    }
}

#[cold]
fn twice(byte: u8, span: Span) -> LineError {
    let message = format!("{} stands in this line twice", byte as char);
    LineError::new(span, "word-twice", message)
}
