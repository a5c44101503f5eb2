//! Text from a file, made fit to stand in a message.

/// Longest part of a file's text that a message repeats, in characters.
const LONGEST: usize = 64;

/// The beginning of `text`, without line breaks or control characters.
pub fn shorten(text: &str) -> String {
    let mut short: String = text
        .chars()
        .take(LONGEST)
        .flat_map(char::escape_debug)
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}

/// `text` on one line: names of files and values of the command line may hold anything.
pub fn one_line(text: &str) -> String {
    let shown = |c: char| {
        if c.is_control() {
            c.escape_debug().to_string()
        } else {
            c.to_string()
        }
    };
    text.chars().map(shown).collect()
}

/// A dotted path as it would be written in TOML: quoted where a part needs it.
pub fn dotted<S: AsRef<str>>(path: &[S]) -> String {
    let parts: Vec<_> = path.iter().map(|part| quoted(part.as_ref())).collect();
    parts.join(".")
}

fn quoted(part: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !part.is_empty() && part.chars().all(bare) {
        shorten(part)
    } else {
        format!("\"{}\"", shorten(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_quoted_and_shortened() {
        assert_eq!(dotted(&["axes", "x"]), "axes.x");
        assert_eq!(dotted(&["a b", "", "c\n"]), "\"a b\".\"\".\"c\\n\"");
        assert_eq!(one_line("a\nb\"µ"), "a\\nb\"µ");
        assert_eq!(shorten(&"a".repeat(70)), format!("{}…", "a".repeat(64)));
    }
}
