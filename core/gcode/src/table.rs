//! What the interpreter knows of each G and M word: one row each, for the reader, the messages and the documentation.

use std::fmt::Write as _;

use crate::letters::mask;
use crate::table_g::G_ROWS;
use crate::table_m::M_ROWS;

/// Words of one group exclude each other in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Group {
    NonModal,
    Motion,
    CannedCycle,
    Plane,
    Distance,
    ArcDistance,
    FeedMode,
    Units,
    CutterRadius,
    ToolLength,
    CoordinateSystem,
    PathControl,
    SpindleMode,
    CycleReturn,
    Polar,
    Scaling,
    Rotation,
    LatheDiameter,
    Stop,
    InputOutput,
    ToolChange,
    Spindle,
    Mist,
    Flood,
    CoolantOff,
    Override,
    User,
}

/// Number of groups.
pub(crate) const GROUPS: usize = Group::User as usize + 1;

impl Group {
    /// The name for messages and documentation.
    pub fn name(self) -> &'static str {
        match self {
            Self::NonModal => "non-modal",
            Self::Motion => "motion",
            Self::CannedCycle => "canned cycle",
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

/// One G or M word.
pub(crate) struct Row {
    /// The number in tenths: 611 for G61.1.
    pub tenths: u16,
    pub group: Group,
    /// What it does.
    pub name: &'static str,
    /// The letters it takes, beside F S T N, which any line may have.
    pub letters: &'static str,
    /// The same as a mask.
    pub mask: u32,
    /// Why it is refused; `None` where it is supported.
    pub refusal: Option<&'static str>,
}

/// A word that works.
pub(crate) const fn works(tenths: u16, group: Group, letters: &'static str, name: &'static str) -> Row {
    Row { tenths, group, name, letters, mask: mask(letters), refusal: None }
}

/// A word that is refused, and why.
pub(crate) const fn refused(tenths: u16, group: Group, name: &'static str, why: &'static str) -> Row {
    Row { tenths, group, name, letters: "", mask: 0, refusal: Some(why) }
}

const NO_ROW: u8 = u8::MAX;
const SPAN: usize = 2000;
static G_INDEX: [u8; SPAN] = index(G_ROWS);
static M_INDEX: [u8; SPAN] = index(M_ROWS);

const fn index(rows: &[Row]) -> [u8; SPAN] {
    let mut index = [NO_ROW; SPAN];
    let mut at = 0;
    while at < rows.len() {
        index[rows[at].tenths as usize] = at as u8;
        at += 1;
    }
    index
}

/// The row of a G word.
#[inline]
pub(crate) fn g(tenths: u16) -> Option<&'static Row> {
    G_ROWS.get(*G_INDEX.get(tenths as usize)? as usize)
}

/// The row of an M word.
pub(crate) fn m(tenths: u16) -> Option<&'static Row> {
    M_ROWS.get(*M_INDEX.get(tenths as usize)? as usize)
}

/// How a word is written: `G61.1`.
pub(crate) fn written(letter: char, tenths: u16) -> String {
    match tenths % 10 {
        0 => format!("{letter}{}", tenths / 10),
        tenth => format!("{letter}{}.{tenth}", tenths / 10),
    }
}

/// The documentation of every G and M word, a Markdown table.
pub fn docs() -> String {
    let mut text = String::from("| word | what it does | group | takes | |\n|---|---|---|---|---|\n");
    let g = G_ROWS.iter().map(|row| ('G', row));
    for (letter, row) in g.chain(M_ROWS.iter().map(|row| ('M', row))) {
        let word = written(letter, row.tenths);
        let support = row.refusal.map_or("works".to_owned(), |why| format!("refused: {why}"));
        let takes = row.letters.chars().map(String::from).collect::<Vec<_>>().join(" ");
        let _ = writeln!(text, "| {word} | {} | {} | {takes} | {support} |", row.name, row.group.name());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_found_by_its_number() {
        assert!(G_ROWS.len() < NO_ROW as usize && M_ROWS.len() < NO_ROW as usize);
        for row in G_ROWS {
            assert!(std::ptr::eq(g(row.tenths).unwrap(), row), "{} stands twice", written('G', row.tenths));
        }
        for row in M_ROWS {
            assert!(std::ptr::eq(m(row.tenths).unwrap(), row), "{} stands twice", written('M', row.tenths));
        }
        assert!(g(9990).is_none() && g(9).is_none());
    }

    #[test]
    fn the_documentation_says_what_is_refused_and_why() {
        let docs = docs();
        assert!(docs.contains("| G61.1 | exact stop | path control |  | works |"), "{docs}");
        assert!(docs.contains("| G41 |") && docs.contains("refused: "));
    }
}
