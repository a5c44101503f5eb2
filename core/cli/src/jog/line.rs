//! The lines of a pipe: `x+ 600`, `x-0.1 600`, `stop`, `wait 0.5`, `where`, `quit`, and the operator's commands.

use tandem_host::Command;
use tandem_session::jog::{JogMessage, ReachMessage};

use crate::mdi::conversation::is_farewell;

/// What a line asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Line {
    /// A jog, or its keep-alive.
    Jog(JogMessage),
    /// Lets go of what moves; the next line waits for the rest.
    Stop,
    /// The next line waits so long, s.
    Wait(f64),
    /// Tells the position.
    Where,
    /// Takes back a fault.
    Reset,
    /// Ends the session, as the end of the input does.
    Quit,
    /// A command as sockets and command files know it.
    Command(Command),
    /// An empty line.
    Nothing,
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrong {
    /// Column of the word, from 1.
    pub column: usize,
    /// Why.
    pub why: String,
}

/// Longest wait, s: an hour.
const MAX_WAIT_S: f64 = 3600.0;

/// Understands a line.
///
/// # Errors
/// The word that is wrong, and why.
pub fn parse(text: &str) -> Result<Line, Wrong> {
    let column = |word: &str| word.as_ptr() as usize - text.as_ptr() as usize + 1;
    let wrong = |column: usize, why: String| Wrong { column, why };
    let mut words = text.split_whitespace();
    let Some(first) = words.next() else {
        return Ok(Line::Nothing);
    };
    let second = words.next();
    if let Some(more) = words.next() {
        return Err(wrong(
            column(more),
            format!("{more:?} is one word too many"),
        ));
    }
    let at = column(second.unwrap_or(first));
    let lone = |line: Line| {
        second.map_or(Ok(line), |more| {
            Err(format!("{first} takes no value, not {more:?}"))
        })
    };
    let line = match first {
        "stop" => lone(Line::Stop),
        "where" => lone(Line::Where),
        super::RESET => lone(Line::Reset),
        word if is_farewell(word) => lone(Line::Quit),
        "wait" => wait(second),
        _ => match motion(first) {
            None => Command::parse(first, second)
                .map(Line::Command)
                .map_err(|why| unknown(first, why)),
            Some(Err(why)) => return Err(wrong(column(first), why)),
            Some(Ok((axis, reach))) => feed(second).map(|feed_per_min| {
                Line::Jog(JogMessage {
                    axis,
                    reach,
                    feed_per_min,
                    degrees: None,
                })
            }),
        },
    };
    line.map_err(|why| wrong(at, why))
}

fn unknown(word: &str, why: String) -> String {
    if why.starts_with("no command") {
        return format!(
            "{word:?} is no jog (x+ 600 or x-0.1 600), not stop, wait, where, quit or {}, and {why}",
            super::RESET
        );
    }
    why
}

/// `x+` or `x-0.1`; `None` where it does not look like one.
fn motion(word: &str) -> Option<Result<(char, ReachMessage), String>> {
    let mut chars = word.chars();
    let axis = chars.next().filter(char::is_ascii_alphabetic)?;
    let positive = match chars.next()? {
        '+' => true,
        '-' => false,
        _ => return None,
    };
    let distance = chars.as_str();
    if distance.is_empty() {
        return Some(Ok((axis, ReachMessage::On { positive })));
    }
    let number = number(distance).map(|distance| if positive { distance } else { -distance });
    Some(number.map(|distance| (axis, ReachMessage::By(distance))))
}

fn feed(word: Option<&str>) -> Result<f64, String> {
    number(word.ok_or("a jog needs a feed, mm/min or deg/min, behind it")?)
}

fn wait(word: Option<&str>) -> Result<Line, String> {
    let seconds = number(word.ok_or("wait needs a time in s")?)?;
    if seconds > MAX_WAIT_S {
        return Err(format!("{seconds} s is longer than {MAX_WAIT_S} s"));
    }
    Ok(Line::Wait(seconds))
}

/// A number without sign.
fn number(word: &str) -> Result<f64, String> {
    let digits = word
        .bytes()
        .all(|byte| byte.is_ascii_digit() || byte == b'.');
    word.parse()
        .ok()
        .filter(|_| digits)
        .ok_or_else(|| format!("{word:?} is not a number without sign"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jog(axis: char, reach: ReachMessage, feed_per_min: f64) -> Line {
        Line::Jog(JogMessage {
            axis,
            reach,
            feed_per_min,
            degrees: None,
        })
    }

    #[test]
    fn every_line() {
        for (text, line) in [
            (
                "x+ 600",
                jog('x', ReachMessage::On { positive: true }, 600.0),
            ),
            (
                " Y-  0.5 ",
                jog('Y', ReachMessage::On { positive: false }, 0.5),
            ),
            ("x+0.1 600", jog('x', ReachMessage::By(0.1), 600.0)),
            ("a-90 1800", jog('a', ReachMessage::By(-90.0), 1800.0)),
            ("stop", Line::Stop),
            ("wait 0.5", Line::Wait(0.5)),
            ("where", Line::Where),
            ("!reset", Line::Reset),
            ("quit", Line::Quit),
            (" EXIT ", Line::Quit),
            ("hold", Line::Command(Command::Hold)),
            (
                "feed-override 0.5",
                Line::Command(Command::FeedOverride(0.5)),
            ),
            ("", Line::Nothing),
            ("   ", Line::Nothing),
        ] {
            assert_eq!(parse(text), Ok(line), "{text}");
        }
    }

    #[test]
    fn wrong_lines_say_where_and_why() {
        for (text, column, why) in [
            ("x+", 1, "needs a feed"),
            ("x+ fast", 4, "\"fast\" is not a number"),
            ("x+ -5", 4, "without sign"),
            ("x+inf 5", 1, "\"inf\" is not a number"),
            ("x+1e3 5", 1, "\"1e3\" is not a number"),
            ("x+0..1 5", 1, "not a number"),
            ("x+1 5 7", 7, "too many"),
            ("wait", 1, "a time in s"),
            ("wait 1e9", 6, "not a number"),
            ("wait 4000", 6, "longer than 3600"),
            ("stop now", 6, "takes no value"),
            ("hold 1", 6, "takes no value"),
            ("x 600", 3, "is no jog"),
            ("ü+ 600", 5, "is no jog"),
        ] {
            let wrong = parse(text).expect_err(text);
            assert!(
                wrong.column == column && wrong.why.contains(why),
                "{text}: {wrong:?}"
            );
        }
    }
}
