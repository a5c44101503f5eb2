//! Values: numbers, parameters, `[expressions]` and functions. They are evaluated while they are read.

use std::cell::Cell;

use super::function::{self, Operator};
use super::number;
use super::scan::Scanner;
use crate::line_error::{Checked, LineError, Span, show};
use crate::state::State;
use crate::state::letters::Letters;
use crate::state::parameters::{LAST, Parameters, Value};

/// Most brackets, signs and `#` within each other.
const MAX_DEPTH: usize = 32;
/// Longest name of a parameter.
pub(crate) const MAX_NAME: usize = 64;

/// What values are made of.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub parameters: &'a Parameters,
    pub state: &'a State,
    pub letters: &'a Letters,
    /// Set where a value follows from what the first pass has assumed.
    pub reads_assumed: &'a Cell<bool>,
}

/// Which parameter a `#…` names.
pub(crate) enum Parameter {
    Numbered(usize),
    Named([u8; MAX_NAME], usize),
}

impl Context<'_> {
    /// The value at the cursor.
    ///
    /// # Errors
    /// Anything that is not a value, or has none.
    #[inline]
    pub fn value(&self, scanner: &mut Scanner) -> Checked<f64> {
        if number::starts_here(scanner) {
            number::read(scanner)
        } else {
            self.deep_value(scanner, 0)
        }
    }

    /// The value at the cursor, and whether it follows from what the first pass has assumed.
    pub fn assumed_value(&self, scanner: &mut Scanner) -> Checked<Value> {
        self.reads_assumed.set(false);
        let number = self.value(scanner)?;
        Ok(Value {
            number,
            assumed: self.reads_assumed.get(),
        })
    }

    /// The `[values]` from byte `at` of `text` to its end, at most `max` of them.
    pub fn bracketed(
        &self,
        text: &[u8],
        at: usize,
        max: usize,
        values: &mut Vec<Value>,
    ) -> Checked<()> {
        values.clear();
        let mut scanner = Scanner::new(text, at);
        loop {
            scanner.skip_ignorable()?;
            if scanner.at_end() {
                return Ok(());
            }
            if scanner.peek() != b'[' || values.len() == max {
                let more = if max == 0 {
                    "nothing may"
                } else {
                    "only values in brackets may"
                };
                return Err(LineError::new(
                    scanner.here(),
                    "o-word",
                    format!("{more} follow here"),
                ));
            }
            values.push(self.assumed_value(&mut scanner)?);
        }
    }

    /// The text of a comment with the values of the parameters that it names.
    pub fn expanded(&self, text: &[u8]) -> String {
        let mut shown = String::new();
        let mut rest = text;
        while let Some(at) = rest.iter().position(|byte| *byte == b'#') {
            shown.push_str(&String::from_utf8_lossy(&rest[..at]));
            let mut scanner = Scanner::new(rest, at);
            let Ok(value) = self.value(&mut scanner) else {
                shown.push('#');
                rest = &rest[at + 1..];
                continue;
            };
            shown.push_str(&show(value));
            rest = scanner.rest();
        }
        shown.push_str(&String::from_utf8_lossy(rest));
        shown
    }

    fn deep_value(&self, scanner: &mut Scanner, depth: usize) -> Checked<f64> {
        scanner.skip_blanks();
        if depth > MAX_DEPTH {
            return Err(LineError::new(
                scanner.here(),
                "nesting",
                "the expression is nested too deeply (32 levels)",
            ));
        }
        if number::starts_here(scanner) {
            return number::read(scanner);
        }
        match scanner.peek() {
            b'[' => self.bracket(scanner, depth),
            b'#' => self.parameter_value(scanner, depth),
            sign @ (b'+' | b'-') => {
                scanner.advance(1);
                let value = self.deep_value(scanner, depth + 1)?;
                Ok(if sign == b'-' { -value } else { value })
            }
            b'a'..=b'z' | b'A'..=b'Z' => self.call(scanner, depth),
            _ => Err(missing(scanner.here())),
        }
    }

    fn bracket(&self, scanner: &mut Scanner, depth: usize) -> Checked<f64> {
        let start = scanner.at();
        if !scanner.take(b'[') {
            return Err(LineError::new(scanner.here(), "bracket", "[ is missing"));
        }
        let value = self.operation(scanner, depth + 1, 1)?;
        if !scanner.take(b']') {
            let what = if scanner.at_end() {
                "the [ is not closed: ] is missing"
            } else {
                "an operator or ] is missing"
            };
            let span = if scanner.at_end() {
                scanner.since(start)
            } else {
                scanner.here()
            };
            return Err(LineError::new(span, "bracket", what));
        }
        Ok(value)
    }

    /// Operators that bind at least as strongly as `strength`, from the left.
    fn operation(&self, scanner: &mut Scanner, depth: usize, strength: u8) -> Checked<f64> {
        let start = scanner.at();
        let mut left = self.deep_value(scanner, depth)?;
        while let Some((operator, length)) = next_operator(scanner) {
            if operator.strength() < strength {
                break;
            }
            scanner.advance(length);
            let right = self.operation(scanner, depth, operator.strength() + 1)?;
            left = operator
                .apply(left, right)
                .map_err(|why| LineError::new(scanner.since(start), "arithmetic", why))?;
        }
        Ok(left)
    }

    fn call(&self, scanner: &mut Scanner, depth: usize) -> Checked<f64> {
        let start = scanner.at();
        let (name, length) = scanner.name();
        let name = &name[..length];
        let function = function::called(name);
        if function.is_none() && !matches!(name, b"ATAN" | b"EXISTS") {
            return Err(no_function(Span::new(start, start + length), name));
        }
        scanner.advance(length);
        let Some(function) = function else {
            return if name == b"ATAN" {
                self.arc_tangent(scanner, depth)
            } else {
                self.exists(scanner, depth)
            };
        };
        let argument = self.bracket(scanner, depth)?;
        function(argument).map_err(|why| LineError::new(scanner.since(start), "arithmetic", why))
    }

    fn arc_tangent(&self, scanner: &mut Scanner, depth: usize) -> Checked<f64> {
        let y = self.bracket(scanner, depth)?;
        if !scanner.take(b'/') {
            return Err(LineError::new(
                scanner.here(),
                "bracket",
                "ATAN has two arguments: ATAN[y]/[x]",
            ));
        }
        scanner.skip_blanks();
        let x = self.bracket(scanner, depth)?;
        Ok(y.atan2(x).to_degrees())
    }

    fn exists(&self, scanner: &mut Scanner, depth: usize) -> Checked<f64> {
        scanner.skip_blanks();
        let opened = scanner.take(b'[');
        scanner.skip_blanks();
        if !opened || scanner.peek() != b'#' {
            return Err(LineError::new(
                scanner.here(),
                "bracket",
                "EXISTS takes a parameter: EXISTS[#<name>]",
            ));
        }
        let known = match self.parameter(scanner, depth) {
            Ok(Parameter::Numbered(_)) => true,
            Ok(Parameter::Named(name, length)) => self
                .parameters
                .named(&name[..length], self.state, self.letters)
                .is_some(),
            Err(error) if error.code == "parameter-number" => false,
            Err(error) => return Err(error),
        };
        if !scanner.take(b']') {
            return Err(LineError::new(scanner.here(), "bracket", "] is missing"));
        }
        Ok(f64::from(u8::from(known)))
    }

    fn parameter_value(&self, scanner: &mut Scanner, depth: usize) -> Checked<f64> {
        let start = scanner.at();
        let value = match self.parameter(scanner, depth)? {
            Parameter::Numbered(number) => {
                Ok(self.parameters.numbered(number, self.state, self.letters))
            }
            Parameter::Named(name, length) => {
                let name = &name[..length];
                self.parameters
                    .named(name, self.state, self.letters)
                    .ok_or_else(|| {
                        let message = unset(name);
                        LineError::new(scanner.since(start), "parameter-unset", message)
                    })
            }
        }?;
        if value.assumed {
            self.reads_assumed.set(true);
        }
        Ok(value.number)
    }

    /// Reads `#number`, `#[expression]` or `#<name>`; the cursor is at the `#`.
    pub fn parameter(&self, scanner: &mut Scanner, depth: usize) -> Checked<Parameter> {
        let start = scanner.at();
        scanner.advance(1);
        scanner.skip_blanks();
        if scanner.peek() == b'<' {
            return name(scanner);
        }
        let number = self.deep_value(scanner, depth + 1)?;
        let rounded = number.round();
        if (number - rounded).abs() > 1e-4 || !(1.0..=LAST as f64).contains(&rounded) {
            let message = format!(
                "there is no parameter #{}: the numbers go from 1 to {LAST}",
                show(number)
            );
            return Err(LineError::new(
                scanner.since(start),
                "parameter-number",
                message,
            ));
        }
        Ok(Parameter::Numbered(rounded as usize))
    }
}

/// Why a name has no value.
#[cold]
fn unset(name: &[u8]) -> String {
    let shown = String::from_utf8_lossy(name);
    match name {
        [b'_', b'i', b'n', b'i', b'[', ..] => {
            format!(
                "parameter #<{shown}> would read LinuxCNC's INI file, and there is none: assign the value itself"
            )
        }
        [b'_', b'h', b'a', b'l', b'[', ..] => {
            format!(
                "parameter #<{shown}> would read a HAL pin, and there is no HAL: M66 reads inputs"
            )
        }
        _ => format!("parameter #<{shown}> has never been set"),
    }
}

/// The operator after blanks, with its length; the cursor is then before it.
fn next_operator(scanner: &mut Scanner) -> Option<(Operator, usize)> {
    scanner.skip_blanks();
    match scanner.peek() {
        b'*' if scanner.peek_at(1) == b'*' => Some((Operator::Power, 2)),
        b'*' => Some((Operator::Times, 1)),
        b'/' => Some((Operator::Over, 1)),
        b'+' => Some((Operator::Plus, 1)),
        b'-' => Some((Operator::Minus, 1)),
        _ => named_operator(scanner),
    }
}

/// The longest operator at the cursor: a function may follow it without a blank.
fn named_operator(scanner: &Scanner) -> Option<(Operator, usize)> {
    let (name, length) = scanner.name();
    (2..=length.min(3))
        .rev()
        .find_map(|length| Some((Operator::called(&name[..length])?, length)))
}

/// Reads `<name>`: blanks and case do not count.
fn name(scanner: &mut Scanner) -> Checked<Parameter> {
    let start = scanner.at();
    let text = scanner.rest();
    let end = text.iter().position(|b| *b == b'>').unwrap_or(text.len());
    let characters = || text[1..end].iter().filter(|b| !matches!(b, b' ' | b'\t'));
    let length = characters().count();
    scanner.advance(end + 1);
    if end == text.len() || length == 0 || length > MAX_NAME {
        let message = format!("a parameter name is 1 to {MAX_NAME} characters between < and >");
        return Err(LineError::new(
            scanner.since(start),
            "parameter-name",
            message,
        ));
    }
    let mut name = [0; MAX_NAME];
    for (to, from) in name.iter_mut().zip(characters()) {
        *to = from.to_ascii_lowercase();
    }
    Ok(Parameter::Named(name, length))
}

#[cold]
fn missing(span: Span) -> LineError {
    LineError::new(
        span,
        "value-missing",
        "a number, [expression], #parameter or function must follow",
    )
}

#[cold]
fn no_function(span: Span, name: &[u8]) -> LineError {
    let name = String::from_utf8_lossy(name);
    match &*name {
        "NAN" | "INF" | "INFINITY" => LineError::new(
            span,
            "not-finite",
            format!("{name} is not a number that can be driven"),
        ),
        _ if name.len() < 2 => missing(span),
        _ => LineError::new(
            span,
            "function",
            format!(
                "no function is called {name}; there are {}",
                function::NAMES
            ),
        ),
    }
}
