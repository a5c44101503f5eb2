//! The text of a line to its words.

use super::expression::{Context, Parameter};
use super::line_words::{Assignment, Code, LineWords, Target};
use super::scan::Scanner;
use crate::line_error::{Checked, LineError, Span};
use crate::state::parameters::{predefined_name, read_only};

/// Largest magnitude of a word: more is a slip, and would lose the precision of positions.
const MAX_VALUE: f64 = 1e9;

/// Reads the words of `text` from byte `from` on.
///
/// # Errors
/// The first thing that is no word; the words before it have been read.
pub(crate) fn parse(
    text: &[u8],
    from: usize,
    context: &Context,
    words: &mut LineWords,
) -> Checked<()> {
    let mut scanner = Scanner::new(text, from);
    loop {
        match scanner.peek() {
            letter @ (b'a'..=b'z' | b'A'..=b'Z') => {
                word(letter.to_ascii_uppercase(), &mut scanner, context, words)?;
            }
            b' ' => scanner.advance(1),
            _ if scanner.at_end() => return Ok(()),
            b'\t' | b'(' | b';' => {
                scanner.skip_ignorable()?;
                words.abort = scanner.abort();
            }
            byte @ (b'@' | b'^') => polar(byte, &mut scanner, context, words)?,
            b'#' => assignment(&mut scanner, context, words)?,
            b'$' => spindle(&mut scanner, context, words)?,
            other => return Err(unexpected(other, scanner.here())),
        }
    }
}

#[inline]
fn word(
    letter: u8,
    scanner: &mut Scanner,
    context: &Context,
    words: &mut LineWords,
) -> Checked<()> {
    let start = scanner.at();
    if letter == b'T' && starts_time_constant(scanner) {
        return time_constant(scanner, context, words);
    }
    scanner.advance(1);
    scanner.skip_blanks();
    let value = match context.value(scanner) {
        Ok(value) => value,
        Err(error) => return Err(in_word(letter, start, error)),
    };
    let span = scanner.since(start);
    if value.abs() > MAX_VALUE || value.is_nan() {
        return Err(too_large(letter, span));
    }
    match letter {
        b'G' => words.g.push(code('G', value, span)?),
        b'M' => words.m.push(code('M', value, span)?),
        b'O' => program_number(scanner, start, value, words),
        _ => words.add(letter, value, span),
    }
}

/// `@` and `^`.
#[cold]
fn polar(byte: u8, scanner: &mut Scanner, context: &Context, words: &mut LineWords) -> Checked<()> {
    let (value, span) = sign(byte, scanner, context)?;
    words.add_polar(byte, value, span)
}

/// `$` with the number of a spindle.
#[cold]
fn spindle(scanner: &mut Scanner, context: &Context, words: &mut LineWords) -> Checked<()> {
    let next = scanner.peek_at(1);
    if next == b'$' || next.is_ascii_alphabetic() && words.is_empty() {
        let message = "a command to grbl ($H, $X, $$) is no part of a program: whoever sends it says it to the controller";
        return Err(LineError::new(scanner.here(), "unexpected", message));
    }
    let (value, span) = sign(b'$', scanner, context)?;
    words.add_spindle(value, span)
}

/// The value and the place of a word that begins with a sign.
fn sign(byte: u8, scanner: &mut Scanner, context: &Context) -> Checked<(f64, Span)> {
    let start = scanner.at();
    scanner.advance(1);
    scanner.skip_blanks();
    let value = context
        .value(scanner)
        .map_err(|error| in_word(byte, start, error))?;
    let span = scanner.since(start);
    if value.abs() > MAX_VALUE || value.is_nan() {
        return Err(too_large(byte, span));
    }
    Ok((value, span))
}

#[cold]
fn too_large(byte: u8, span: Span) -> LineError {
    let message = format!("{} is too large a number", byte as char);
    LineError::new(span, "word-range", message)
}

/// Adds which word lacks its value.
#[cold]
fn in_word(letter: u8, start: usize, error: LineError) -> LineError {
    if letter == b'O' {
        let span = Span::new(start, error.span.end.max(start as u32 + 1) as usize);
        return LineError::new(span, "o-word", O_WORDS);
    }
    if error.code != "value-missing" {
        return error;
    }
    let span = Span::new(start, start + 1);
    LineError::new(
        span,
        error.code,
        format!("{} has no value: {}", letter as char, error.message),
    )
}

#[inline]
fn code(letter: char, value: f64, span: Span) -> Checked<Code> {
    // Nearly all are whole.
    let whole = value as u16;
    if f64::from(whole) == value && whole < 1000 {
        let tenths = whole * 10;
        return Ok(Code { tenths, span });
    }
    broken_code(letter, value, span)
}

/// The code of a word as G61.1.
fn broken_code(letter: char, value: f64, span: Span) -> Checked<Code> {
    let tenths = (value * 10.0).round();
    if (value * 10.0 - tenths).abs() > 1e-3 || !(0.0..=9999.0).contains(&tenths) {
        let message = format!("{letter}{} is not known", crate::line_error::show(value));
        return Err(LineError::new(span, "unknown-code", message));
    }
    Ok(Code {
        tenths: tenths as u16,
        span,
    })
}

pub(crate) const O_WORDS: &str =
    "an O-word stands in a line of its own of a program; manual input only calls subroutines";

/// `O1234` alone is the number of a program and harmless; with a word after it, it is flow control.
fn program_number(
    scanner: &mut Scanner,
    start: usize,
    value: f64,
    words: &mut LineWords,
) -> Checked<()> {
    scanner.skip_ignorable()?;
    if scanner.at_end() {
        return words.add(b'O', value, scanner.since(start));
    }
    scanner.advance(scanner.name().1);
    Err(LineError::new(scanner.since(start), "o-word", O_WORDS))
}

/// `TA` with a value is the time constant; `TABS[…]` and the like are T with a function.
fn starts_time_constant(scanner: &Scanner) -> bool {
    if scanner.peek_at(1) != b'A' {
        return false;
    }
    let blanks = scanner
        .rest()
        .iter()
        .skip(2)
        .take_while(|b| matches!(b, b' ' | b'\t'))
        .count();
    !scanner.peek_at(2 + blanks).is_ascii_alphabetic()
}

fn time_constant(scanner: &mut Scanner, context: &Context, words: &mut LineWords) -> Checked<()> {
    let start = scanner.at();
    scanner.advance(2);
    scanner.skip_blanks();
    let value = context.value(scanner).map_err(|error| {
        if error.code != "value-missing" {
            return error;
        }
        LineError::new(
            Span::new(start, start + 2),
            error.code,
            format!("TA has no value: {}", error.message),
        )
    })?;
    let span = scanner.since(start);
    if words.time_constant.is_some() {
        return Err(LineError::new(
            span,
            "word-twice",
            "TA stands in this line twice",
        ));
    }
    words.time_constant = Some((value, span));
    Ok(())
}

fn assignment(scanner: &mut Scanner, context: &Context, words: &mut LineWords) -> Checked<()> {
    let start = scanner.at();
    let parameter = context.parameter(scanner, 0)?;
    let target = match parameter {
        Parameter::Numbered(number) => Target::Numbered(number),
        Parameter::Named(name, length) => {
            let from = words.names.len();
            words.names.extend_from_slice(&name[..length]);
            Target::Named(from..words.names.len())
        }
    };
    let span = scanner.since(start);
    if let Target::Numbered(number) = target
        && let Some(why) = read_only(number)
    {
        return Err(LineError::new(
            span,
            "read-only",
            format!("parameter #{number} cannot be assigned: {why}"),
        ));
    }
    if let Target::Named(range) = &target
        && predefined_name(&words.names[range.clone()], context.state, context.letters).is_some()
    {
        return Err(LineError::new(
            span,
            "read-only",
            "this parameter cannot be assigned: the interpreter keeps it itself",
        ));
    }
    if !scanner.take(b'=') {
        return Err(LineError::new(
            span,
            "assignment",
            "a parameter stands here for a word; an assignment needs =",
        ));
    }
    scanner.skip_blanks();
    let value = context.value(scanner);
    // Where the value is at error, zero stands in, so that later lines are not blamed for a parameter never set.
    words.assignments.push(Assignment {
        target,
        value: *value.as_ref().unwrap_or(&0.0),
        span,
    });
    value.map(|_| ())
}

#[cold]
fn unexpected(byte: u8, span: Span) -> LineError {
    let why = match byte {
        b'0'..=b'9' | b'.' | b'+' | b'-' => "a number without a letter before it",
        b')' => "a comment ends here that has not begun",
        b'%' => "% stands on a line of its own",
        b'/' => "/ (block delete) stands at the start of a line only",
        b'*' => "checksums (*) are not supported",
        b'[' | b']' => "a bracket without a letter before it",
        0x80.. => "only comments may hold characters outside ASCII",
        _ => "no word begins with this character",
    };
    LineError::new(span, "unexpected", why)
}
