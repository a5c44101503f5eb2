//! The G and M words of a line, sorted by group and checked against each other and against the other words.

use super::{Action, GROUPS, Group, Shape, Word, written};
use crate::line_error::{Checked, LineError, Span};
use crate::state::MotionMode;
use crate::state::letters::{AXIS_MASK, Letters, SPINDLE_BIT, bit, mask};
use crate::syntax::line_words::{Code, LineWords, Polar};

/// Letters that any line may have.
const ALWAYS: u32 = mask("NOFST");
/// With any of these an arc goes on in a line without its word. R alone is that of another word, as M19's.
const ARC_LETTERS: u32 = mask("IJK");
/// Letters that several words of a line may take together.
const SHARED: u32 = AXIS_MASK | SPINDLE_BIT;

/// What a line orders.
#[derive(Clone)]
pub(crate) struct Orders {
    present: u32,
    words: [(&'static Word, Span); GROUPS],
    /// The motion that the line makes with its axis words, where it makes one.
    pub motion: Option<MotionMode>,
    /// A non-modal word (G10, G28, G92, …) takes the axis words.
    pub axes_taken: bool,
}

impl Orders {
    pub fn new() -> Self {
        let filler = (&super::motion::WORDS[0], Span::default());
        Self {
            present: 0,
            words: [filler; GROUPS],
            motion: None,
            axes_taken: false,
        }
    }

    /// Forgets the words of the line before.
    pub fn clear(&mut self) {
        self.present = 0;
        self.motion = None;
        self.axes_taken = false;
    }

    /// The groups that have a word in the line, as a set.
    #[inline]
    pub fn present(&self) -> u32 {
        self.present
    }

    /// The word of the group with number `group`, which is present.
    #[inline]
    pub fn word(&self, group: usize) -> &'static Word {
        self.words[group].0
    }

    #[inline]
    pub fn has(&self, group: Group) -> bool {
        self.present & group.bit() != 0
    }

    /// The word of `group`.
    #[inline]
    pub fn get(&self, group: Group) -> Option<&'static Word> {
        self.has(group).then(|| self.words[group as usize].0)
    }

    /// How the word is written whose path the line makes.
    pub fn motion_code(&self) -> &'static str {
        match self.motion {
            Some(MotionMode::Word(word)) => word.code,
            _ => "the motion",
        }
    }

    /// An error at the word of `group`, which stands in the line.
    pub fn error(&self, group: Group, code: &'static str, message: impl Into<String>) -> LineError {
        debug_assert!(self.has(group), "no word of {group:?} in the line");
        LineError::new(self.words[group as usize].1, code, message)
    }

    /// Sorts the words of a line; `modal` is the motion mode before it. After an error the other words are sorted
    /// all the same, so that reading can go on.
    #[inline]
    pub fn sort(&mut self, words: &LineWords, modal: MotionMode, letters: &Letters) -> Checked<()> {
        self.clear();
        let mut claims = Claims::default();
        let g = self.sort_kind(b'G', words.g.as_slice(), words, &mut claims);
        let m = if words.m.as_slice().is_empty() {
            Ok(())
        } else {
            self.sort_kind(b'M', words.m.as_slice(), words, &mut claims)
        };
        let motion = self.choose_motion(words, modal, &mut claims, letters);
        g.and(m).and(motion)?;
        let foreign = words.present & AXIS_MASK & !letters.mask;
        let unused = words.present & !(ALWAYS | claims.letters);
        if unused | foreign != 0 && !(unused | foreign == SPINDLE_BIT && words.has(b'S')) {
            return Err(super::modes::turning_cycle(self, words)
                .unwrap_or_else(|| misplaced(words, claims.letters, letters)));
        }
        Ok(())
    }

    /// Sorts a line that says no more than where a straight line goes, as nearly all do: axis words, and at most the G word for
    /// them. Whether it is one; [`Self::sort`] would have sorted it alike.
    #[inline]
    pub fn sort_straight(
        &mut self,
        words: &LineWords,
        modal: MotionMode,
        letters: &Letters,
    ) -> bool {
        let (word, span) = match (words.g.as_slice(), modal) {
            ([], MotionMode::Word(word)) => (word, None),
            ([code], _) => match super::find(b'G', code.tenths) {
                Some(word) => (word, Some(code.span)),
                None => return false,
            },
            _ => return false,
        };
        let is_straight = matches!(word.action, Action::Move(Shape::Straight, _));
        let others = words.present & !(word.mask & letters.mask);
        let has_others = others != 0 || !words.m.as_slice().is_empty() || words.polar.is_some();
        if !is_straight || has_others || words.present == 0 {
            return false;
        }
        self.clear();
        if let Some(span) = span {
            self.present = word.group.bit();
            self.words[word.group as usize] = (word, span);
        }
        self.motion = Some(MotionMode::Word(word));
        true
    }

    #[inline]
    fn sort_kind(
        &mut self,
        letter: u8,
        codes: &[Code],
        words: &LineWords,
        claims: &mut Claims,
    ) -> Checked<()> {
        let mut result = Ok(());
        for code in codes {
            let added = self.add(letter, *code, words, claims);
            result = result.and(added);
        }
        result
    }

    fn add(
        &mut self,
        letter: u8,
        code: Code,
        words: &LineWords,
        claims: &mut Claims,
    ) -> Checked<()> {
        let Some(word) = super::find(letter, code.tenths) else {
            return Err(unknown(letter as char, code));
        };
        if let Action::Refuse(why) = word.action {
            self.axes_taken |= word.group == Group::NonModal;
            if word.group == Group::Motion {
                self.motion = Some(MotionMode::Refused);
            }
            let message = format!("{} ({}): {why}", word.code, word.meaning);
            return Err(LineError::new(code.span, "refused", message));
        }
        if let Some(other) = self.get(word.group) {
            return Err(conflict(word, other, code.span));
        }
        self.present |= word.group.bit();
        self.words[word.group as usize] = (word, code.span);
        claims.add(word, words)
    }

    /// Decides who takes the axis words: a non-modal word, else the motion word, else the motion mode.
    #[inline]
    fn choose_motion(
        &mut self,
        words: &LineWords,
        modal: MotionMode,
        claims: &mut Claims,
        letters: &Letters,
    ) -> Checked<()> {
        let takes_axes = |word: &&'static Word| word.mask & AXIS_MASK != 0;
        let taker = self
            .get(Group::NonModal)
            .filter(takes_axes)
            .or(self.get(Group::ToolLength).filter(takes_axes));
        let has_axes = words.named() != 0;
        self.axes_taken |= taker.is_some_and(|word| word.group == Group::NonModal || has_axes);
        let refused = self
            .motion
            .filter(|motion| matches!(motion, MotionMode::Refused));
        let word = self.get(Group::Motion);
        if word.is_some_and(|word| word.shape().is_none()) {
            return Err(self.error(Group::Motion, "nurbs", super::curve::NONE_OPEN));
        }
        if self.axes_taken {
            words
                .polar
                .map_or(Ok(()), |polar| Err(polar_misplaced(&polar)))?;
            return self.check_taken(word, taker, words);
        }
        if word.is_none() && has_axes && self.has(Group::CycleCancel) {
            let message = "G80 ends the motion mode: axis words need a motion word beside it";
            return Err(self.error(Group::CycleCancel, "motion-missing", message));
        }
        let motion = word.map(MotionMode::Word).or(refused).unwrap_or(modal);
        if !begins(motion, words, word.is_some()) {
            return Ok(());
        }
        self.motion = Some(motion);
        if let Some(polar) = &words.polar {
            if self
                .get(Group::NonModal)
                .is_some_and(|word| word.code == "G53")
            {
                return Err(polar_misplaced(polar));
            }
            check_polar(polar, motion, words, letters)?;
        }
        match motion {
            MotionMode::None => Err(no_motion(words)),
            MotionMode::Refused => {
                claims.letters = u32::MAX;
                Ok(())
            }
            MotionMode::Word(_) if word.is_some() => Ok(()),
            MotionMode::Word(modal) => claims.add(modal, words),
        }
    }

    /// G28 and G30 go well with a motion word, which then only sets the mode; the others do not.
    fn check_taken(
        &self,
        motion: Option<&'static Word>,
        taker: Option<&'static Word>,
        words: &LineWords,
    ) -> Checked<()> {
        let Some((motion, taker)) = motion.zip(taker) else {
            return Ok(());
        };
        let probes = motion.shape() == Some(Shape::Probe);
        let has_axes = words.present & AXIS_MASK != 0;
        let only_sets_mode = matches!(taker.tenths, 280 | 300);
        if probes || has_axes && !only_sets_mode {
            let message = format!(
                "the axis words belong to {}, not to a motion: split the line",
                taker.code
            );
            return Err(self.error(Group::Motion, "conflict", message));
        }
        Ok(())
    }
}

/// Whether the words of a line begin a motion; `stands` says whether its word is in the line.
#[inline]
fn begins(motion: MotionMode, words: &LineWords, stands: bool) -> bool {
    if words.named() != 0 {
        return true;
    }
    let MotionMode::Word(word) = motion else {
        return false;
    };
    match word.shape() {
        Some(Shape::Arc) => stands || words.present & ARC_LETTERS != 0,
        Some(Shape::Probe | Shape::Curve | Shape::Cycle) => stands,
        Some(Shape::Straight) | None => false,
    }
}

/// `@` and `^` stand for X and Y of a motion.
#[cold]
fn check_polar(
    polar: &Polar,
    motion: MotionMode,
    words: &LineWords,
    letters: &Letters,
) -> Checked<()> {
    let bends = matches!(motion, MotionMode::Word(word) if word.shape() == Some(Shape::Curve));
    if bends || words.present & mask("XY") != 0 {
        return Err(polar_misplaced(polar));
    }
    let linear = |letter: u8| {
        letters
            .axis(letter)
            .is_some_and(|axis| !letters.is_rotary(axis))
    };
    if linear(b'X') && linear(b'Y') {
        return Ok(());
    }
    Err(LineError::new(
        polar.span,
        "axis",
        "polar coordinates (@ and ^) need the linear axes X and Y",
    ))
}

#[cold]
pub(crate) fn polar_misplaced(polar: &Polar) -> LineError {
    let message = "polar coordinates (@ and ^) stand for X and Y of a line, an arc, a probe or a cycle: neither go they \
                   with X and Y, nor with G53 and words that take axis words for something else";
    LineError::new(polar.span, "conflict", message)
}

#[cold]
fn conflict(word: &Word, other: &Word, span: Span) -> LineError {
    let message = if word.group == Group::User {
        "a line holds one of the commands M100 to M199".to_owned()
    } else if word.tenths == other.tenths {
        format!("{} stands in this line twice", word.code)
    } else {
        format!(
            "{} and {} exclude each other in a line (group: {})",
            word.code,
            other.code,
            word.group.name()
        )
    };
    LineError::new(span, "conflict", message)
}

/// The letters that the words of the line take.
#[derive(Default)]
struct Claims {
    letters: u32,
}

impl Claims {
    /// A letter that two words of the line could take belongs to neither: the author must split the line.
    #[inline]
    fn add(&mut self, word: &Word, words: &LineWords) -> Checked<()> {
        let both = self.letters & word.mask & words.present & !SHARED;
        self.letters |= word.mask;
        if both == 0 {
            return Ok(());
        }
        Err(ambiguous(word, both, words))
    }
}

#[cold]
fn ambiguous(word: &Word, both: u32, words: &LineWords) -> LineError {
    let (shared, span) = words.first_of(both).unwrap_or_default();
    let word = word.code;
    let message = format!(
        "{word} takes {}, but so does another word of this line: split it",
        shared as char
    );
    LineError::new(span, "ambiguous", message)
}

#[cold]
fn unknown(letter: char, code: Code) -> LineError {
    let word = written(letter, code.tenths);
    LineError::new(code.span, "unknown-code", format!("{word} is not known"))
}

#[cold]
fn no_motion(words: &LineWords) -> LineError {
    let span = words
        .first_of(AXIS_MASK)
        .map(|(_, span)| span)
        .unwrap_or_default();
    LineError::new(
        span,
        "motion-missing",
        "no motion mode is in force: G0, G1, G2 or G3 is missing",
    )
}

/// The first word that the machine or the line has no use for.
#[cold]
fn misplaced(words: &LineWords, claimed: u32, letters: &Letters) -> LineError {
    let foreign = AXIS_MASK & !letters.mask;
    let useless = !(ALWAYS | claimed) | foreign;
    let (letter, span) = words.first_of(useless).unwrap_or_default();
    let name = letter as char;
    if letter.is_ascii_uppercase() && foreign & bit(letter) != 0 {
        return no_axis(letter, span, letters);
    }
    let takers = takers(letter);
    if takers.is_empty() {
        return LineError::new(
            span,
            "unknown-word",
            format!("the word {name} is not known"),
        );
    }
    let exponent = words.exponent(letter);
    LineError::new(
        span,
        "unused-word",
        format!("nothing in this line takes the word {name} ({takers} would){exponent}"),
    )
}

/// An axis that the machine lacks.
#[cold]
pub(crate) fn no_axis(letter: u8, span: Span, letters: &Letters) -> LineError {
    LineError::new(
        span,
        "axis",
        format!(
            "this machine has no axis {}; it has {}",
            letter as char,
            letters.list()
        ),
    )
}

/// The supported words that take `letter`.
fn takers(letter: u8) -> String {
    let takes = |word: &&&Word| word.takes.as_bytes().contains(&letter);
    let words = super::all();
    words
        .iter()
        .filter(takes)
        .map(|word| word.code)
        .chain((letter == b'$').then_some("S"))
        .collect::<Vec<_>>()
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpreter::Interpreter;
    use crate::syntax::parse::{parse, tests::any_line};
    use crate::testing::mill;
    use proptest::prelude::*;

    fn shown(orders: &Orders) -> String {
        let groups = (0..GROUPS).filter(|group| orders.present >> group & 1 != 0);
        let words: Vec<_> = groups
            .map(|group| (group, orders.words[group].0.code, orders.words[group].1))
            .collect();
        let motion = match orders.motion {
            None => "none",
            Some(MotionMode::None) => "no mode",
            Some(MotionMode::Refused) => "refused",
            Some(MotionMode::Word(word)) => word.code,
        };
        format!("{words:?} {motion} {}", orders.axes_taken)
    }

    proptest! {
        /// What is sorted the short way is sorted as any line is, in whatever motion mode.
        #[test]
        fn straight_lines_are_sorted_as_any_line_is(line in any_line(), mode in 0..8usize) {
            let interpreter = Interpreter::new(mill());
            let letters = Letters::new(&mill().axes);
            let modal = match mode {
                0 => MotionMode::None,
                1 => MotionMode::Refused,
                _ => MotionMode::Word(super::super::find(b'G', [0, 10, 20, 382, 810, 50][mode - 2]).unwrap()),
            };
            let mut words = LineWords::default();
            let _ = parse(line.as_bytes(), 0, &interpreter.context(), &mut words);
            let (mut orders, mut expected) = (Orders::new(), Orders::new());
            if orders.sort_straight(&words, modal, &letters) {
                prop_assert!(expected.sort(&words, modal, &letters).is_ok());
                prop_assert_eq!(shown(&orders), shown(&expected));
            }
        }
    }
}
