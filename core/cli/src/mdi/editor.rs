//! Lines typed at a terminal: with history, completion of words, and help.

use std::fs;
use std::path::PathBuf;

use rustyline::completion::{Completer, Pair};
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::Validator;
use rustyline::{CompletionType, Config, Context, Editor, Helper};
use tandem_gcode::known_words;
use tandem_state::default_path;

use super::RESET;

/// Lines of history that are kept.
const HISTORY: usize = 1000;
/// Words of a session that are no G-code.
const OWN: [(&str, &str); 5] = [
    ("help", "says what there is; help G38.2 what one word does"),
    (RESET, "takes back a fault"),
    ("quit", "ends the session"),
    ("exit", "ends the session"),
    ("F S T", "feed, spindle speed, tool; any line may have them"),
];

/// What is typed.
pub struct LineEditor {
    editor: Editor<Words, FileHistory>,
    history: Option<PathBuf>,
}

impl LineEditor {
    /// An editor on the terminal, with the lines of earlier sessions.
    ///
    /// # Errors
    /// The terminal's words.
    pub fn new() -> Result<Self, String> {
        let config = Config::builder()
            .max_history_size(HISTORY)
            .and_then(|config| config.history_ignore_dups(true))
            .map_err(|e| e.to_string())?
            .completion_type(CompletionType::List)
            .auto_add_history(true)
            .build();
        let mut editor = Editor::with_config(config).map_err(|e| e.to_string())?;
        editor.set_helper(Some(Words));
        let history = default_path("mdi")
            .map(|path| path.with_file_name("mdi-history"))
            .ok();
        if let Some(path) = &history {
            // The first session has none.
            let _ = editor.load_history(path);
        }
        Ok(Self { editor, history })
    }

    /// The next line that is no question for help; none where there are no more.
    pub fn line(&mut self) -> Option<String> {
        loop {
            // Ctrl-C at the prompt ends the session, as Ctrl-D does.
            let line = self.editor.readline("> ").ok()?;
            self.keep();
            match help(&line) {
                Some(text) => say!("{text}"),
                None => return Some(line),
            }
        }
    }

    /// Writes the history. Where it cannot be written, this session has it all the same.
    fn keep(&mut self) {
        if let Some(path) = &self.history {
            if let Some(folder) = path.parent() {
                let _ = fs::create_dir_all(folder);
            }
            let _ = self.editor.save_history(path);
        }
    }
}

/// What a line asks help for; none where it does not ask for any.
fn help(line: &str) -> Option<String> {
    let mut words = line.split_whitespace();
    if !words.next()?.eq_ignore_ascii_case("help") {
        return None;
    }
    let Some(asked) = words.next() else {
        return Some(all_words());
    };
    let asked = asked.to_ascii_uppercase();
    let known = known_words();
    let Some(word) = known.iter().find(|word| word.code == asked) else {
        return Some(format!(
            "{asked} is no word of a part program that works here; help lists them"
        ));
    };
    let takes = if word.takes.is_empty() {
        String::new()
    } else {
        let letters: Vec<String> = word.takes.chars().map(String::from).collect();
        format!("; takes {}", letters.join(" "))
    };
    let example = word.example.lines().collect::<Vec<_>>().join("\n  ");
    Some(format!("{asked}: {}{takes}\n  {example}", word.meaning))
}

fn all_words() -> String {
    let words = known_words()
        .into_iter()
        .map(|word| (word.code, word.meaning));
    let all = OWN.into_iter().chain(words);
    all.map(|(word, meaning)| format!("{word:<6} {meaning}"))
        .collect::<Vec<_>>()
        .join("\n")
}

/// Completes the words of lines.
struct Words;

/// Where the word under the cursor begins, and what completes it.
fn completions(line: &str, at: usize) -> (usize, Vec<Pair>) {
    let before = &line[..at];
    let is_first = |start: usize| line[..start].trim().is_empty();
    let start = before
        .rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '.' || c == '!'))
        .map_or(0, |last| {
            last + before[last..].chars().next().map_or(0, char::len_utf8)
        });
    let begun = &before[start..];
    if begun.is_empty() {
        return (start, vec![]);
    }
    let codes = known_words()
        .into_iter()
        .map(|word| (word.code, word.meaning));
    let own = OWN.into_iter().filter(|_| is_first(start)).take(4);
    let fits = |(word, _): &(&str, &str)| {
        let head = word.get(..begun.len());
        head.is_some_and(|head| head.eq_ignore_ascii_case(begun))
    };
    let pair = |(word, meaning): (&str, &str)| Pair {
        display: format!("{word}  {meaning}"),
        replacement: word.to_string(),
    };
    (start, codes.chain(own).filter(fits).map(pair).collect())
}

impl Completer for Words {
    type Candidate = Pair;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _context: &Context<'_>,
    ) -> rustyline::Result<(usize, Vec<Pair>)> {
        Ok(completions(line, at))
    }
}

impl Hinter for Words {
    type Hint = String;
}

impl Highlighter for Words {}
impl Validator for Words {}
impl Helper for Words {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mdi::conversation::is_farewell;

    #[test]
    fn words_are_completed_where_they_stand() {
        let of = |line: &str| {
            let (start, pairs) = completions(line, line.len());
            (
                start,
                pairs
                    .into_iter()
                    .map(|pair| pair.replacement)
                    .collect::<Vec<_>>(),
            )
        };
        assert_eq!(
            of("G90 g38"),
            (
                4,
                ["G38.2", "G38.3", "G38.4", "G38.5"]
                    .map(String::from)
                    .to_vec()
            )
        );
        assert_eq!(of("!r"), (0, vec![RESET.to_string()]));
        assert_eq!(of("qu"), (0, vec!["quit".to_string()]));
        // The words of a session are lines of their own.
        assert_eq!(of("G0 X1 qu").1, Vec::<String>::new());
        assert_eq!(of("G1 ").1, Vec::<String>::new());
        assert_eq!(of("ü").1, Vec::<String>::new());
    }

    #[test]
    fn help_says_what_words_do() {
        assert_eq!(help("G0 X1"), None);
        let probe = help("help g38.2").unwrap();
        assert!(
            probe.starts_with("G38.2: straight line until the probe touches"),
            "{probe}"
        );
        assert!(help("help G33").unwrap().contains("is no word"));
        let all = help(" HELP ").unwrap();
        assert!(
            all.contains("\nG1     straight line at the feed\n"),
            "{all}"
        );
        assert!(OWN.iter().all(|(word, _)| all.contains(word)));
        assert!(is_farewell(OWN[2].0) && is_farewell(OWN[3].0));
    }
}
