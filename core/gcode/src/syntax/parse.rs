//! The text of a line to its words.

use super::expression::{Context, Parameter};
use super::line_words::{Assignment, Code, LineWords, Target};
use super::number;
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
    while !scanner.at_end() {
        read_one(&mut scanner, context, words)?;
        let behind = plain_words(text, scanner.at(), words);
        scanner.advance(behind - scanner.at());
    }
    Ok(())
}

/// Reads the words at byte `at` of `text` that are a letter with a short number behind it, which nearly all are. Where the first
/// one that is not begins, or what is wrong: [`read_one`] reads that, and would have read these alike. No short number is too
/// large a value.
#[inline]
pub(crate) fn plain_words(text: &[u8], mut at: usize, words: &mut LineWords) -> usize {
    while let Some(byte) = text.get(at) {
        let letter = byte.to_ascii_uppercase();
        if *byte == b' ' {
            at += 1;
            continue;
        }
        if !letter.is_ascii_uppercase() || letter == b'O' || words.has(letter) {
            break;
        }
        let Some((value, end)) = number::short(text, at + 1) else {
            break;
        };
        let span = Span::new(at, end);
        let taken = match letter {
            b'G' => whole_code(value, span).is_some_and(|code| words.g.take(code)),
            b'M' => whole_code(value, span).is_some_and(|code| words.m.take(code)),
            _ => {
                words.set(letter, value, span);
                true
            }
        };
        if !taken {
            break;
        }
        at = end;
    }
    at
}

/// Reads the next word, or what else may stand there.
fn read_one(scanner: &mut Scanner, context: &Context, words: &mut LineWords) -> Checked<()> {
    match scanner.peek() {
        letter @ (b'a'..=b'z' | b'A'..=b'Z') => {
            word(letter.to_ascii_uppercase(), scanner, context, words)?;
        }
        b' ' => scanner.advance(1),
        b'\t' | b'(' | b';' => {
            scanner.skip_ignorable()?;
            words.abort = scanner.abort();
        }
        byte @ (b'@' | b'^') => polar(byte, scanner, context, words)?,
        b'#' => assignment(scanner, context, words)?,
        b'$' => spindle(scanner, context, words)?,
        other => return Err(unexpected(other, scanner.here())),
    }
    Ok(())
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
    whole_code(value, span).map_or_else(|| broken_code(letter, value, span), Ok)
}

/// The code of a word as G1.
#[inline]
fn whole_code(value: f64, span: Span) -> Option<Code> {
    let whole = value as u16;
    (f64::from(whole) == value && whole < 1000).then(|| Code {
        tenths: whole * 10,
        span,
    })
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::interpreter::Interpreter;
    use crate::testing::mill;
    use proptest::prelude::*;

    /// Lines of words as programs have them, and of what else may stand between them.
    pub fn any_line() -> impl Strategy<Value = String> {
        let words = "G0 G1 g1 G01 G2 G53 G61.1 G80 G92 G1000 M3 M199 X#1 X[1+2] Y5 z-.5 F100 N7 T2 TA5 TABS[1] O5 @1 ^2 $0 #1=2 #<a>=3 (c) (abort,c) ; / % E5 X- Y. \u{e9}";
        let words = prop::sample::select(words.split(' ').collect::<Vec<_>>());
        let number = r"[A-Za-z][ \t]?[+-]?[0-9]{0,9}(\.[0-9]{0,9})?";
        let axis = r"[XYZ][+-]?[0-9]{1,3}(\.[0-9]{0,5})?";
        let part = prop_oneof![
            2 => words.prop_map(str::to_owned),
            1 => number,
            4 => axis,
            1 => r"[ \t]{1,2}",
        ];
        prop::collection::vec(part, 0..7).prop_map(|parts| parts.concat())
    }

    proptest! {
        /// Words that are read the short way are read as one by one, and what is wrong is found at the same place.
        #[test]
        fn plain_words_are_read_as_any_word_is(line in any_line()) {
            let interpreter = Interpreter::new(mill());
            let context = interpreter.context();
            let (mut words, mut one_by_one) = (LineWords::default(), LineWords::default());
            let behind = plain_words(line.as_bytes(), 0, &mut words);
            let read = parse(line.as_bytes(), behind, &context, &mut words);
            let mut scanner = Scanner::new(line.as_bytes(), 0);
            let mut expected = Ok(());
            while !scanner.at_end() && expected.is_ok() {
                expected = read_one(&mut scanner, &context, &mut one_by_one);
            }
            prop_assert_eq!(format!("{read:?}"), format!("{expected:?}"));
            prop_assert_eq!(format!("{words:?}"), format!("{one_by_one:?}"));
        }
    }
}
