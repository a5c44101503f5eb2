//! Every G and M word: one row each, beside the function that gives the word its behaviour.
//!
//! A module of this folder holds the words of one subject. Its `WORDS` are the rows, which the reader, the messages and
//! the reference table of the documentation share; its functions are what the words do; its tests show it.
//! `docs/adding-a-word.md` says how to add one.

#![allow(
    clippy::unnecessary_wraps,
    reason = "all functions of words have one signature, and some cannot fail"
)]

pub(crate) mod arc;
pub(crate) mod circle;
pub(crate) mod compensation;
pub(crate) mod coolant;
pub(crate) mod coordinates;
pub(crate) mod curve;
pub(crate) mod cycles;
mod dwell;
pub(crate) mod lathe;
pub(crate) mod modal;
pub(crate) mod modes;
pub(crate) mod motion;
pub(crate) mod orders;
pub(crate) mod outputs;
pub(crate) mod overrides;
pub(crate) mod probe;
mod refused;
pub(crate) mod spindle;
pub(crate) mod stop;
pub(crate) mod subprogram;
pub(crate) mod tool;
mod user;

use std::fmt::Write as _;

use crate::line::Line;
use crate::line_error::Checked;
use crate::state::letters::mask;

/// Words of one group exclude each other in a line. The groups stand in the order in which they take effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Group {
    Units,
    FeedMode,
    LatheDiameter,
    ModalState,
    InputOutput,
    ToolChange,
    SpindleMode,
    Spindle,
    CoolantOff,
    Mist,
    Flood,
    Override,
    User,
    Plane,
    Distance,
    ArcDistance,
    CutterRadius,
    ToolLength,
    CoordinateSystem,
    PathControl,
    CycleReturn,
    Polar,
    Scaling,
    Rotation,
    NonModal,
    CycleCancel,
    Motion,
    Stop,
}

/// Number of groups.
pub(crate) const GROUPS: usize = Group::Stop as usize + 1;

impl Group {
    /// The bit of this group in a set of groups.
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }

    /// The name for messages and documentation.
    pub fn name(self) -> &'static str {
        match self {
            Self::NonModal => "non-modal",
            Self::Motion => "motion",
            Self::CycleCancel => "end of canned cycles",
            Self::Plane => "plane",
            Self::Distance => "distance mode",
            Self::ArcDistance => "arc distance mode",
            Self::FeedMode => "feed mode",
            Self::Units => "units",
            Self::CutterRadius => "cutter radius compensation",
            Self::ToolLength => "tool length offset",
            Self::CoordinateSystem => "coordinate system",
            Self::PathControl => "path control",
            Self::SpindleMode => "spindle mode",
            Self::CycleReturn => "cycle return",
            Self::Polar => "polar coordinates",
            Self::Scaling => "scaling",
            Self::Rotation => "rotation",
            Self::LatheDiameter => "lathe diameter mode",
            Self::Stop => "stopping",
            Self::ModalState => "modal state",
            Self::InputOutput => "input and output",
            Self::ToolChange => "tool change",
            Self::Spindle => "spindle",
            Self::Mist => "mist coolant",
            Self::Flood => "flood coolant",
            Self::CoolantOff => "coolant off",
            Self::Override => "override",
            Self::User => "user-defined",
        }
    }
}

/// What a word does, as a function of the line that holds it.
pub(crate) type Act = fn(&mut Line) -> Checked<()>;

/// The kind of path that a motion word makes: what begins it, and what it depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// Axis words begin it, and say all of where it ends.
    Straight,
    /// Axis words or I J K R begin it.
    Arc,
    /// Its word or axis words begin it.
    Probe,
    /// Its word or axis words begin it.
    Curve,
    /// Its word or axis words begin it: several lines around a hole.
    Cycle,
}

/// When a word acts.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Action {
    /// At the turn of its group.
    Act(Act),
    /// With the axis words of its line, and those of the lines after it until another motion word comes.
    Move(Shape, Act),
    /// With the axis words of its line only.
    MoveOnce(Shape, Act),
    /// Never: the word is refused, for this reason.
    Refuse(&'static str),
}

/// One G or M word.
pub(crate) struct Word {
    /// As it is written: `G61.1`.
    pub code: &'static str,
    /// `G` or `M`.
    pub letter: u8,
    /// The number in tenths: 611 for G61.1.
    pub tenths: u16,
    pub group: Group,
    /// What it does.
    pub meaning: &'static str,
    /// The letters that it takes, besides F S T N, which any line may have.
    pub takes: &'static str,
    /// The same as a set.
    pub mask: u32,
    pub action: Action,
    /// Lines that show its use. They work on a mill with tools and a probe after `F100 S100`.
    pub example: &'static str,
}

impl Word {
    /// The row of the word `code`.
    pub const fn new(
        code: &'static str,
        group: Group,
        takes: &'static str,
        meaning: &'static str,
        action: Action,
        example: &'static str,
    ) -> Self {
        let letter = code.as_bytes()[0];
        let tenths = tenths(code);
        Self {
            code,
            letter,
            tenths,
            group,
            meaning,
            takes,
            mask: mask(takes),
            action,
            example,
        }
    }

    /// The row of a word that is refused.
    pub const fn refused(
        code: &'static str,
        group: Group,
        meaning: &'static str,
        why: &'static str,
    ) -> Self {
        Self::new(code, group, "", meaning, Action::Refuse(why), code)
    }

    /// What a motion word makes; `None` for other words.
    pub fn shape(&self) -> Option<Shape> {
        match self.action {
            Action::Move(shape, _) | Action::MoveOnce(shape, _) => Some(shape),
            Action::Act(_) | Action::Refuse(_) => None,
        }
    }
}

/// The number of `G61.1` in tenths.
const fn tenths(code: &str) -> u16 {
    let code = code.as_bytes();
    let mut tenths = 0;
    let mut at = 1;
    let mut fraction = false;
    while at < code.len() {
        if code[at] == b'.' {
            fraction = true;
        } else {
            tenths = tenths * 10 + (code[at] - b'0') as u16;
        }
        at += 1;
    }
    if fraction { tenths } else { tenths * 10 }
}

/// The words of all subjects.
static SUBJECTS: [&[Word]; 20] = [
    motion::WORDS,
    arc::WORDS,
    curve::WORDS,
    cycles::WORDS,
    probe::WORDS,
    modes::WORDS,
    modal::WORDS,
    compensation::WORDS,
    coordinates::WORDS,
    dwell::WORDS,
    tool::WORDS,
    spindle::WORDS,
    lathe::WORDS,
    coolant::WORDS,
    outputs::WORDS,
    overrides::WORDS,
    user::WORDS,
    stop::WORDS,
    subprogram::WORDS,
    refused::WORDS,
];

const NO_ROW: (u8, u8) = (u8::MAX, u8::MAX);
const SPAN: usize = 2000;
static G_INDEX: [(u8, u8); SPAN] = index(b'G');
static M_INDEX: [(u8, u8); SPAN] = index(b'M');

/// The subject and the row of each number of `letter`.
const fn index(letter: u8) -> [(u8, u8); SPAN] {
    let mut index = [NO_ROW; SPAN];
    let mut subject = 0;
    while subject < SUBJECTS.len() {
        let mut row = 0;
        while row < SUBJECTS[subject].len() {
            let word = &SUBJECTS[subject][row];
            if word.letter == letter {
                assert!(
                    index[word.tenths as usize].0 == NO_ROW.0,
                    "a word has two rows"
                );
                index[word.tenths as usize] = (subject as u8, row as u8);
            }
            row += 1;
        }
        subject += 1;
    }
    index
}

/// The row of the G or M word with this number.
#[inline]
pub(crate) fn find(letter: u8, tenths: u16) -> Option<&'static Word> {
    let index = if letter == b'G' { &G_INDEX } else { &M_INDEX };
    // M100 to M199 share one row.
    let user = letter == b'M' && user::TENTHS.contains(&tenths) && tenths.is_multiple_of(10);
    let (subject, row) = *index.get(if user { 1000 } else { tenths as usize })?;
    SUBJECTS.get(subject as usize)?.get(row as usize)
}

/// All words, by letter and number.
pub(crate) fn all() -> Vec<&'static Word> {
    let mut words: Vec<_> = SUBJECTS.iter().copied().flatten().collect();
    words.sort_by_key(|word| (word.letter, word.tenths));
    words
}

/// How a number is written behind its letter: `61.1` for 611.
pub(crate) fn written(letter: char, tenths: u16) -> String {
    match tenths % 10 {
        0 => format!("{letter}{}", tenths / 10),
        tenth => format!("{letter}{}.{tenth}", tenths / 10),
    }
}

/// The reference of every G and M word, a Markdown table.
pub fn docs() -> String {
    let mut text = String::from(
        "| word | what it does | group | takes | example | |\n|---|---|---|---|---|---|\n",
    );
    for word in all() {
        let support = match word.action {
            Action::Refuse(why) => format!("refused: {why}"),
            _ => "works".to_owned(),
        };
        let takes = word
            .takes
            .chars()
            .map(String::from)
            .collect::<Vec<_>>()
            .join(" ");
        let example = word
            .example
            .lines()
            .map(|line| format!("`{line}`"))
            .collect::<Vec<_>>()
            .join("<br>");
        let _ = writeln!(
            text,
            "| {} | {} | {} | {takes} | {example} | {support} |",
            word.code,
            word.meaning,
            word.group.name()
        );
    }
    text
}

/// A G or M word as an operator is told it.
#[derive(Clone, Copy, Debug)]
pub struct KnownWord {
    /// As it is written: `G61.1`.
    pub code: &'static str,
    /// What it does.
    pub meaning: &'static str,
    /// The letters that it takes, besides F S T N.
    pub takes: &'static str,
    /// A line or lines that show its use.
    pub example: &'static str,
}

/// The words that work, by letter and number. Allocates.
pub fn known_words() -> Vec<KnownWord> {
    let works = |word: &&Word| !matches!(word.action, Action::Refuse(_));
    let told = |word: &Word| KnownWord {
        code: word.code,
        meaning: word.meaning,
        takes: word.takes,
        example: word.example,
    };
    all().into_iter().filter(works).map(told).collect()
}

/// For words that need no action of their own: others look whether they stand in the line.
fn nothing(_line: &mut Line) -> Checked<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::errors_of;

    #[test]
    fn every_row_is_found_by_its_number() {
        for word in all() {
            assert!(
                std::ptr::eq(find(word.letter, word.tenths).unwrap(), word),
                "{}",
                word.code
            );
            assert_eq!(written(word.letter as char, word.tenths), word.code);
        }
        assert!(find(b'G', 9990).is_none() && find(b'G', 9).is_none());
    }

    /// Each word that works works in its example, which cannot do without it; each other is refused by name.
    #[test]
    fn every_example_is_true() {
        for word in all() {
            assert!(word.example.contains(word.code), "{}", word.code);
            let errors = errors_of(&format!("F100 S100\n{}", word.example));
            match word.action {
                Action::Refuse(why) => {
                    let error = errors
                        .first()
                        .unwrap_or_else(|| panic!("{} is not refused", word.code));
                    assert!(
                        error.code == "refused" && error.message.contains(why),
                        "{error}"
                    );
                    assert!(error.message.starts_with(word.code), "{error}");
                }
                _ => assert!(errors.is_empty(), "{}: {}", word.code, errors[0]),
            }
        }
    }

    #[test]
    fn the_reference_says_what_is_refused_and_why() {
        let docs = docs();
        assert!(
            docs.contains("| G61.1 | exact stop | path control |  | `G61.1` | works |"),
            "{docs}"
        );
        assert!(docs.contains("| G41 |") && docs.contains("refused: "));
    }
}
