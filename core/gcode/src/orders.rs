//! The G and M words of a line, sorted by group and checked against each other and against the other words.

use crate::fault::{Checked, Fault, Span};
use crate::letters::{AXIS_MASK, Letters, index, mask};
use crate::state::Motion;
use crate::table::{self, GROUPS, Group, Row, written};
use crate::words::{Code, Words};

/// Letters that any line may have.
const ALWAYS: u32 = mask("NOFST");
const ARC_LETTERS: u32 = mask("IJKR");

/// What a line orders.
#[derive(Clone)]
pub(crate) struct Orders {
    present: u32,
    codes: [Code; GROUPS],
    /// The motion the line makes with its axis words, where it makes one.
    pub motion: Option<Motion>,
    /// A non-modal word (G10, G28, G92, …) takes the axis words.
    pub axes_taken: bool,
}

impl Orders {
    pub fn new() -> Self {
        Self { present: 0, codes: [Code::default(); GROUPS], motion: None, axes_taken: false }
    }

    /// Forgets the words of the line before.
    pub fn clear(&mut self) {
        self.present = 0;
        self.motion = None;
        self.axes_taken = false;
    }

    /// The word of `group`, in tenths.
    #[inline]
    pub fn get(&self, group: Group) -> Option<u16> {
        (self.present >> group as u8 & 1 != 0).then(|| self.codes[group as usize].tenths)
    }

    /// A fault at the word of `group`.
    pub fn fault(&self, group: Group, code: &'static str, message: impl Into<String>) -> Fault {
        Fault::new(self.codes[group as usize].span, code, message)
    }

    /// Sorts the words of a line; `modal` is the motion mode before it. After a fault what is not at fault is sorted
    /// all the same, so that reading can go on.
    #[inline]
    pub fn sort(&mut self, words: &Words, modal: Motion, letters: &Letters) -> Checked<()> {
        self.clear();
        let mut claims = Claims::default();
        let g = self.sort_kind('G', words.g.as_slice(), words, &mut claims);
        let m = self.sort_kind('M', words.m.as_slice(), words, &mut claims);
        let motion = self.settle_motion(words, modal, &mut claims);
        g.and(m).and(motion)?;
        if words.present & (ALWAYS | claims.letters) != words.present || words.present & AXIS_MASK & !letters.mask != 0
        {
            return Err(misplaced(words, claims.letters, letters));
        }
        Ok(())
    }

    #[inline]
    fn sort_kind(&mut self, letter: char, codes: &[Code], words: &Words, claims: &mut Claims) -> Checked<()> {
        let mut result = Ok(());
        for code in codes {
            let added = self.add(letter, *code, words, claims);
            result = result.and(added);
        }
        result
    }

    fn add(&mut self, letter: char, code: Code, words: &Words, claims: &mut Claims) -> Checked<()> {
        let row = if letter == 'G' { table::g(code.tenths) } else { table::m(code.tenths) };
        let Some(row) = row else { return Err(unknown(letter, code)) };
        if let Some(why) = row.refusal {
            self.axes_taken |= row.group == Group::NonModal;
            if matches!(row.group, Group::Motion | Group::CannedCycle) {
                self.motion = Some(Motion::Refused);
            }
            let message = format!("{} ({}): {why}", written(letter, code.tenths), row.name);
            return Err(Fault::new(code.span, "refused", message));
        }
        if self.get(row.group).is_some() {
            return Err(self.conflict(letter, code, row.group));
        }
        self.present |= 1 << row.group as u8;
        self.codes[row.group as usize] = code;
        claims.add(letter, row, words)
    }

    #[cold]
    fn conflict(&self, letter: char, code: Code, group: Group) -> Fault {
        let (this, other) = (written(letter, code.tenths), written(letter, self.codes[group as usize].tenths));
        let message = if this == other {
            format!("{this} stands in this line twice")
        } else {
            format!("{this} and {other} exclude each other in a line (group: {})", group.name())
        };
        Fault::new(code.span, "conflict", message)
    }

    /// Decides who takes the axis words: a non-modal word, else the motion word, else the motion mode.
    #[inline]
    fn settle_motion(&mut self, words: &Words, modal: Motion, claims: &mut Claims) -> Checked<()> {
        let non_modal = self.get(Group::NonModal);
        self.axes_taken |= matches!(non_modal, Some(100 | 280 | 300 | 920));
        // The lines of an open curve do not come here.
        if self.get(Group::Motion) == Some(53) {
            let message = "G5.3 ends a curve, and none is open: G5.2 opens one".to_string();
            return Err(self.fault(Group::Motion, "nurbs", message));
        }
        let word = self.get(Group::Motion).map(motion_of).or(self.motion.filter(|m| *m == Motion::Refused));
        let axes = words.present & AXIS_MASK != 0;
        let arc_words = words.present & ARC_LETTERS != 0;
        if self.axes_taken {
            return self.check_taken(word, non_modal, words);
        }
        let motion = word.unwrap_or(modal);
        let moves_without_axes = match motion {
            Motion::ArcClockwise | Motion::ArcCounterclockwise => arc_words || word.is_some(),
            Motion::Probe(_) | Motion::Curve(_) => word.is_some(),
            _ => false,
        };
        if !(axes || moves_without_axes) {
            return Ok(());
        }
        self.motion = Some(motion);
        match motion {
            Motion::None => Err(no_motion(words)),
            Motion::Refused => {
                claims.letters = u32::MAX;
                Ok(())
            }
            _ if word.is_some() => Ok(()),
            _ => claims.add('G', implied(motion), words),
        }
    }

    /// G28 and G30 go well with a motion word, which then only sets the mode; the others do not.
    fn check_taken(&self, word: Option<Motion>, non_modal: Option<u16>, words: &Words) -> Checked<()> {
        let probes = matches!(word, Some(Motion::Probe(_)));
        if word.is_some_and(|m| m != Motion::Refused)
            && (words.present & AXIS_MASK != 0 || probes)
            && let Some(tenths) = non_modal.filter(|tenths| matches!(tenths, 100 | 920) || probes)
        {
            let message = format!("the axis words belong to {}, not to a motion: split the line", written('G', tenths));
            return Err(self.fault(Group::Motion, "conflict", message));
        }
        Ok(())
    }
}

/// The motion of a G word of the motion group.
pub(crate) fn motion_of(tenths: u16) -> Motion {
    match tenths {
        0 => Motion::Rapid,
        10 => Motion::Line,
        20 => Motion::ArcClockwise,
        50..=52 | 62 => Motion::Curve(tenths),
        53 => Motion::None,
        310 | 382..=385 => Motion::Probe(tenths),
        _ => Motion::ArcCounterclockwise,
    }
}

/// The row of the motion mode in force.
fn implied(motion: Motion) -> &'static Row {
    let tenths = match motion {
        Motion::Line => 10,
        Motion::ArcClockwise => 20,
        Motion::ArcCounterclockwise => 30,
        Motion::Probe(tenths) | Motion::Curve(tenths) => tenths,
        _ => 0,
    };
    table::g(tenths).unwrap_or(&crate::table_g::G_ROWS[0])
}

/// The letters that the words of the line take.
#[derive(Default)]
struct Claims {
    letters: u32,
}

impl Claims {
    /// A letter that two words of the line could take belongs to neither: the author must split the line.
    #[inline]
    fn add(&mut self, letter: char, row: &Row, words: &Words) -> Checked<()> {
        let both = self.letters & row.mask & words.present & !AXIS_MASK;
        self.letters |= row.mask;
        let Some((shared, span)) = words.first_of(both) else { return Ok(()) };
        let word = written(letter, row.tenths);
        let message = format!("{word} takes {}, but so does another word of this line: split it", shared as char);
        Err(Fault::new(span, "ambiguous", message))
    }
}

#[cold]
fn unknown(letter: char, code: Code) -> Fault {
    let word = written(letter, code.tenths);
    let message = match code.tenths {
        1000..=1999 if letter == 'M' => format!("{word}: user-defined commands are not supported"),
        _ => format!("{word} is not known"),
    };
    Fault::new(code.span, "unknown-code", message)
}

#[cold]
fn no_motion(words: &Words) -> Fault {
    let span = words.first_of(AXIS_MASK).map(|(_, span)| span).unwrap_or_default();
    Fault::new(span, "motion-missing", "no motion mode is in force: G0, G1, G2 or G3 is missing")
}

/// The first word that the machine or the line has no use for.
#[cold]
fn misplaced(words: &Words, claimed: u32, letters: &Letters) -> Fault {
    let foreign = AXIS_MASK & !letters.mask;
    let useless = !(ALWAYS | claimed) | foreign;
    let (letter, span) = words.first_of(useless).unwrap_or_default();
    let name = letter as char;
    if letter.is_ascii_uppercase() && foreign >> index(letter) & 1 != 0 {
        return no_axis(letter, span, letters);
    }
    let takers = takers(letter);
    if takers.is_empty() {
        return Fault::new(span, "unknown-word", format!("the word {name} is not known"));
    }
    let exponent = words.exponent(letter);
    Fault::new(span, "unused-word", format!("nothing in this line takes the word {name} ({takers} would){exponent}"))
}

/// An axis that the machine lacks.
#[cold]
pub(crate) fn no_axis(letter: u8, span: Span, letters: &Letters) -> Fault {
    Fault::new(span, "axis", format!("this machine has no axis {}; it has {}", letter as char, letters.list()))
}

/// The supported words that take `letter`.
fn takers(letter: u8) -> String {
    let takes = |row: &&Row| row.letters.as_bytes().contains(&letter);
    let g = crate::table_g::G_ROWS.iter().filter(takes).map(|row| written('G', row.tenths));
    let m = crate::table_m::M_ROWS.iter().filter(takes).map(|row| written('M', row.tenths));
    g.chain(m).collect::<Vec<_>>().join(", ")
}
