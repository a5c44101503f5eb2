//! The text of a line with an O-word: `o100 while [#1 LT 5]`.

use crate::line_error::{Checked, LineError, Span};
use crate::syntax::scan::Scanner;

/// Longest name of a subroutine.
const MAX_NAME: usize = 64;

/// What an O-word does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keyword {
    Sub,
    EndSub,
    Return,
    Call,
    If,
    ElseIf,
    Else,
    EndIf,
    While,
    EndWhile,
    Do,
    Repeat,
    EndRepeat,
    Break,
    Continue,
}

impl Keyword {
    const ALL: [(&str, Self); 15] = [
        ("sub", Self::Sub),
        ("endsub", Self::EndSub),
        ("return", Self::Return),
        ("call", Self::Call),
        ("if", Self::If),
        ("elseif", Self::ElseIf),
        ("else", Self::Else),
        ("endif", Self::EndIf),
        ("while", Self::While),
        ("endwhile", Self::EndWhile),
        ("do", Self::Do),
        ("repeat", Self::Repeat),
        ("endrepeat", Self::EndRepeat),
        ("break", Self::Break),
        ("continue", Self::Continue),
    ];

    pub fn name(self) -> &'static str {
        Self::ALL
            .iter()
            .find(|(_, keyword)| *keyword == self)
            .map_or("", |(name, _)| name)
    }

    /// The fewest and the most `[values]` behind it.
    pub fn values(self) -> (usize, usize) {
        match self {
            Self::Call => (0, 30),
            Self::If | Self::ElseIf | Self::While | Self::Repeat => (1, 1),
            Self::Return | Self::EndSub => (0, 1),
            _ => (0, 0),
        }
    }
}

/// What names a subroutine, a loop or a branch.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Label {
    /// A name without blanks in lower case, or a number.
    Fixed(Box<str>),
    /// A value that only a call can have: `o[#1 + 5] call`. It begins at this byte.
    Computed(u16),
}

/// A line with an O-word.
#[derive(Clone, Debug)]
pub(crate) struct OWord {
    pub label: Label,
    pub keyword: Keyword,
    /// Where the `[values]` behind the keyword begin.
    pub values_at: u16,
}

/// Where the label of an O-word begins, in a line whose first word is one. Line numbers, and `/` where block delete is
/// off, may stand before it.
#[inline]
pub(crate) fn find(text: &[u8], block_delete: bool) -> Option<usize> {
    // Nearly every line begins with a word of another letter.
    let may_be = matches!(
        text.first(),
        Some(b' ' | b'\t' | b'/' | b'n' | b'N' | b'o' | b'O')
    );
    if may_be {
        find_any(text, block_delete)
    } else {
        None
    }
}

fn find_any(text: &[u8], block_delete: bool) -> Option<usize> {
    let first = text.iter().position(|b| !matches!(b, b' ' | b'\t'))?;
    match text[first] {
        b'o' | b'O' => Some(first + 1),
        b'/' if !block_delete => find_any(&text[first + 1..], true).map(|at| at + first + 1),
        b'n' | b'N' => {
            let number = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b' ' | b'\t');
            let after = first + 1 + text[first + 1..].iter().position(|b| !number(b))?;
            matches!(text[after], b'o' | b'O').then_some(after + 1)
        }
        _ => None,
    }
}

/// What a line says that begins with O.
#[derive(Clone, Debug)]
pub(crate) enum Title {
    Word(OWord),
    /// A number alone: that of the program or of a subprogram.
    Number(Box<str>),
    /// A `<name>` alone: that of the program.
    Name,
}

impl OWord {
    /// Reads a line whose label begins at `at`.
    pub fn read(text: &[u8], at: usize) -> Checked<Title> {
        let mut scanner = Scanner::new(text, at);
        scanner.skip_blanks();
        let numbered = scanner.peek().is_ascii_digit();
        let label = label(&mut scanner)?;
        scanner.skip_ignorable()?;
        match label {
            Label::Fixed(label) if numbered && scanner.at_end() => return Ok(Title::Number(label)),
            Label::Fixed(_) if scanner.at_end() => return Ok(Title::Name),
            _ => {}
        }
        let start = scanner.at();
        let word = keyword(&mut scanner);
        let keyword = Keyword::ALL
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(&word));
        let Some((_, keyword)) = keyword else {
            let span = if word.is_empty() {
                scanner.here()
            } else {
                scanner.since(start)
            };
            return Err(without_keyword(span));
        };
        if matches!(label, Label::Computed(_)) && *keyword != Keyword::Call {
            return Err(LineError::new(
                scanner.since(at),
                "o-word",
                "only a call may have a computed number",
            ));
        }
        Ok(Title::Word(Self {
            label,
            keyword: *keyword,
            values_at: scanner.at() as u16,
        }))
    }
}

/// The letters that come next. Blanks among them do not count: `else if` is `elseif`.
fn keyword(scanner: &mut Scanner) -> String {
    let mut word = String::new();
    let mut end = 0;
    for (at, byte) in scanner.rest().iter().enumerate() {
        match byte {
            b' ' | b'\t' => {}
            letter if letter.is_ascii_alphabetic() => {
                word.push(*letter as char);
                end = at + 1;
            }
            _ => break,
        }
    }
    scanner.advance(end);
    word
}

/// A label without a keyword.
pub(crate) fn without_keyword(span: Span) -> LineError {
    let names: Vec<_> = Keyword::ALL.iter().map(|(name, _)| *name).collect();
    let message = format!(
        "what the O-word does is missing here: one of {}",
        names.join(", ")
    );
    LineError::new(span, "o-word", message)
}

fn label(scanner: &mut Scanner) -> Checked<Label> {
    let start = scanner.at();
    match scanner.peek() {
        b'0'..=b'9' => {
            let digits = scanner
                .rest()
                .iter()
                .take_while(|b| b.is_ascii_digit())
                .count();
            let number: String = scanner.rest()[..digits]
                .iter()
                .map(|b| *b as char)
                .collect();
            scanner.advance(digits);
            let number = number.trim_start_matches('0');
            Ok(Label::Fixed(if number.is_empty() {
                "0".into()
            } else {
                number.into()
            }))
        }
        b'<' => {
            let length = scanner
                .rest()
                .iter()
                .position(|b| *b == b'>')
                .unwrap_or(scanner.rest().len());
            let name: String = String::from_utf8_lossy(&scanner.rest()[1..length.max(1)])
                .chars()
                .filter(|c| !c.is_whitespace())
                .flat_map(char::to_lowercase)
                .collect();
            scanner.advance(length + 1);
            let forbidden = |c: char| matches!(c, '/' | '\\' | '\0') || c.is_control();
            if name.is_empty()
                || name.len() > MAX_NAME
                || name.contains(forbidden)
                || name.starts_with('.')
            {
                let message = format!(
                    "the name of a subroutine is 1 to {MAX_NAME} characters between < and >, without /"
                );
                return Err(LineError::new(scanner.since(start), "o-word", message));
            }
            Ok(Label::Fixed(name.into()))
        }
        b'[' | b'#' => {
            skip_value(scanner);
            Ok(Label::Computed(start as u16))
        }
        _ => Err(LineError::new(
            scanner.here(),
            "o-word",
            "an O-word needs a number or a <name>",
        )),
    }
}

/// Skips `[…]`, `#…` or `##…`; whether it is a value shows when it is evaluated.
fn skip_value(scanner: &mut Scanner) {
    let mut depth = 0;
    while !scanner.at_end() {
        match scanner.peek() {
            b'[' | b'<' => depth += 1,
            b']' | b'>' => depth -= 1,
            letter if depth == 0 && letter.is_ascii_alphabetic() => return,
            _ => {}
        }
        scanner.advance(1);
        if depth == 0 && matches!(scanner.peek(), b' ' | b'\t') {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn o_words_are_found_and_read() {
        let read = |text: &str| {
            let at = find(text.as_bytes(), false)?;
            match OWord::read(text.as_bytes(), at).unwrap() {
                Title::Word(word) => Some((word.label, word.keyword, word.values_at)),
                Title::Number(_) | Title::Name => None,
            }
        };
        let fixed = |label: &str| Label::Fixed(label.into());
        assert_eq!(read("o100 sub"), Some((fixed("100"), Keyword::Sub, 8)));
        assert_eq!(read("N5 / O1"), None, "a number is no O-word with a label");
        assert_eq!(
            read(" N5 O < My Sub > CALL [1]"),
            Some((fixed("mysub"), Keyword::Call, 21))
        );
        assert_eq!(
            read("/o01endwhile (x)"),
            Some((fixed("1"), Keyword::EndWhile, 12))
        );
        assert_eq!(
            read("o[#1 + 5] call [2]"),
            Some((Label::Computed(1), Keyword::Call, 14))
        );
        assert_eq!(
            read("o#<n> call"),
            Some((Label::Computed(1), Keyword::Call, 10))
        );
        assert_eq!(
            read("o5 ELSE If [1]"),
            Some((fixed("5"), Keyword::ElseIf, 10))
        );
        assert_eq!(
            read("o5\tend\tif ;x"),
            Some((fixed("5"), Keyword::EndIf, 9))
        );
        assert_eq!(read("O1234 (program)"), None);
        assert!(find(b"G1 O5", false).is_none() && find(b"/o1 if [1]", true).is_none());
        for wrong in ["o<> sub", "o<../x> call", "o5 jump", "o sub", "o[5] sub"] {
            assert!(OWord::read(wrong.as_bytes(), 1).is_err(), "{wrong}");
        }
    }
}
