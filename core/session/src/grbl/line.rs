//! Lines of a sender by what they ask for.

/// What a line asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Asks<'a> {
    /// Nothing: an empty line, or a `%`.
    Nothing,
    /// A line of a program.
    Program(&'a str),
    /// `$J=`: a jog, with its words.
    Jog(&'a str),
    /// `$`: help.
    Help,
    /// `$$`: what the machine is.
    Settings,
    /// `$n=value`.
    Set(&'a str, &'a str),
    /// `$#`: offsets and what the last probe found.
    Offsets,
    /// `$G`: modal words.
    Modes,
    /// `$I`: who this is.
    Build,
    /// `$N`: lines that are run at the start, of which there are none.
    StartLines,
    /// `$N0=line`.
    SetStartLine(&'a str),
    /// `$C`: check mode on or off.
    Check,
    /// `$X`: out of the alarm.
    Unlock,
    /// `$H`, `$HX`: home all axes, or one.
    Home(Option<char>),
    /// `$SLP`: the drives let go.
    Sleep,
    /// `$` and what is no command.
    Unknown,
}

/// Reads a line.
pub fn read(text: &str) -> Asks<'_> {
    let text = text.trim();
    let Some(rest) = text.strip_prefix('$') else {
        return match text {
            "" | "%" => Asks::Nothing,
            _ => Asks::Program(text),
        };
    };
    if let Some((name, value)) = rest.split_once('=') {
        let (name, value) = (name.trim(), value.trim());
        let is = |word: &str| name.eq_ignore_ascii_case(word);
        return if is("J") {
            Asks::Jog(value)
        } else if is("N0") || is("N1") {
            Asks::SetStartLine(value)
        } else if !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_digit()) {
            Asks::Set(name, value)
        } else {
            Asks::Unknown
        };
    }
    let word = rest.trim().to_ascii_uppercase();
    match word.as_str() {
        "" => Asks::Help,
        "$" => Asks::Settings,
        "#" => Asks::Offsets,
        "G" => Asks::Modes,
        "I" | "I+" => Asks::Build,
        "N" => Asks::StartLines,
        "C" => Asks::Check,
        "X" => Asks::Unlock,
        "SLP" | "SD" => Asks::Sleep,
        "H" => Asks::Home(None),
        _ => match word
            .strip_prefix('H')
            .map(|axis| axis.chars().collect::<Vec<_>>())
        {
            Some(axis) if axis.len() == 1 => Asks::Home(Some(axis[0])),
            _ => Asks::Unknown,
        },
    }
}

/// Letters of axes.
const AXES: &str = "XYZABCUVW";
/// Numbers of G words that a jog may have.
const OF_JOGS: [u32; 5] = [20, 21, 53, 90, 91];

/// Checks the words of a jog: axes, F, G20, G21, G53, G90 and G91, each a letter and a plain number.
///
/// # Errors
/// What else stands there; `None` where it is the feed that is missing.
pub fn check_jog(words: &str) -> Result<(), Option<String>> {
    let mut rest = words.trim_start();
    let mut feed = false;
    let mut axis = false;
    while let Some(letter) = rest.chars().next() {
        let letter = letter.to_ascii_uppercase();
        let number = rest[letter.len_utf8()..].trim_start();
        let end = number
            .find(|c: char| !c.is_ascii_digit() && !".+-".contains(c))
            .unwrap_or(number.len());
        let (number, behind) = number.split_at(end);
        rest = behind.trim_start();
        let Ok(value) = number.parse::<f64>() else {
            return Err(Some(format!("a jog has no {letter}{number}")));
        };
        match letter {
            'F' => feed = true,
            'G' if OF_JOGS.iter().any(|of| f64::from(*of) == value) => {}
            'N' => {}
            letter if AXES.contains(letter) => axis = true,
            letter => return Err(Some(format!("a jog has no {letter}{number}"))),
        }
    }
    if !axis {
        return Err(Some("a jog names an axis".to_string()));
    }
    if feed { Ok(()) } else { Err(None) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_ask_for_what_they_begin_with() {
        for (text, asks) in [
            ("  ", Asks::Nothing),
            ("%", Asks::Nothing),
            ("G1 X1", Asks::Program("G1 X1")),
            ("$", Asks::Help),
            ("$$", Asks::Settings),
            ("$g", Asks::Modes),
            ("$J=G91X1F100", Asks::Jog("G91X1F100")),
            ("$ j = X1", Asks::Jog("X1")),
            ("$110=500", Asks::Set("110", "500")),
            ("$N0=G20", Asks::SetStartLine("G20")),
            ("$HX", Asks::Home(Some('X'))),
            ("$h", Asks::Home(None)),
            ("$SLP", Asks::Sleep),
            ("$RST=*", Asks::Unknown),
            ("$HXY", Asks::Unknown),
            ("$=1", Asks::Unknown),
        ] {
            assert_eq!(read(text), asks, "{text}");
        }
    }

    #[test]
    fn a_jog_has_few_words() {
        assert_eq!(check_jog("G91 G21 X-1.5Y2 F500"), Ok(()));
        assert_eq!(check_jog("x1f5"), Ok(()));
        assert_eq!(check_jog("X1"), Err(None));
        for wrong in [
            "G2 X1 F1", "X1 F1 M3", "F100", "X F1", "X[1] F1", "X#1 F1", "X1 F1 é",
        ] {
            assert!(matches!(check_jog(wrong), Err(Some(_))), "{wrong}");
        }
    }
}
