//! Where the O-words of a file stand, and what belongs together: found once, when the first of them comes.

use std::collections::HashMap;

use super::o_word::{self, Keyword, Label, OWord, Title};
use crate::diagnostic::Diagnostic;
use crate::line_error::{Checked, LineError, Span};
use crate::program::lines::{Lines, Mark, Next};
use crate::program::{Program, ProgramError};

/// Most O-words of a file, so that memory stays bounded.
const MAX_O_WORDS: usize = 20_000;
const TOO_MANY: &str = "a file holds at most 20000 O-words";

/// One O-word.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub number: u32,
    pub word: OWord,
    /// The place before its line, and the one after it.
    pub before: Mark,
    pub after: Mark,
    /// What opens the block that this belongs to, and what closes it.
    pub open: usize,
    pub close: usize,
    /// After `if`, `elseif` and `else`: the next of them, or `endif`.
    pub next: usize,
}

/// The O-words of a file in their order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outline {
    entries: Vec<Entry>,
    /// The subroutines by their labels.
    subs: HashMap<Box<str>, usize>,
    /// Numbers in lines of their own, where subprograms begin: the number, its line and the place after it.
    programs: Vec<(Box<str>, u32, Mark)>,
    /// Blocks that another's end has left unclosed.
    given_up: Vec<usize>,
    /// What is wrong with the O-words of a line. It counts where the line is executed, and not where it never is.
    wrong: HashMap<u32, Diagnostic>,
    /// The first line with an O-word that is one too many: nothing behind it has been read.
    full_from: Option<u32>,
}

impl Outline {
    /// Reads all of `lines`, which then stand at their end.
    pub fn read(
        program: &mut Program,
        lines: &mut Lines,
        block_delete: bool,
    ) -> Result<Self, ProgramError> {
        let mut outline = Self::default();
        let mut open = Vec::new();
        let mut begun = false;
        lines.seek(program, Mark::START)?;
        loop {
            let before = lines.mark();
            let range = match lines.next(program)? {
                Next::Line(range) => range,
                Next::Bad(_) => continue,
                Next::End => break,
            };
            let number = lines.number;
            let text = lines.text(&range);
            match text.iter().find(|b| !matches!(b, b' ' | b'\t')) {
                // What stands behind the end is no part of the program.
                Some(b'%') if begun => break,
                None | Some(b'(' | b';') => {}
                Some(_) => begun = true,
            }
            let Some(at) = o_word::find(text, block_delete) else {
                continue;
            };
            if outline.is_full() {
                let error = LineError::new(Span::new(0, at), "o-word", TOO_MANY);
                let diagnostic = Diagnostic::new(&program.name, number, text, error);
                outline.wrong.insert(number, diagnostic);
                outline.full_from = Some(number);
                break;
            }
            let added = match OWord::read(text, at) {
                Ok(Title::Number(label)) => {
                    outline.programs.push((label, number, lines.mark()));
                    Ok(())
                }
                Ok(Title::Name) => continue,
                Ok(Title::Word(word)) => {
                    let entry = Entry {
                        number,
                        word,
                        before,
                        after: lines.mark(),
                        open: 0,
                        close: 0,
                        next: 0,
                    };
                    outline.add(entry, &mut open)
                }
                Err(error) => Err(error),
            };
            if let Err(error) = added {
                outline
                    .wrong
                    .insert(number, Diagnostic::new(&program.name, number, text, error));
            }
        }
        open.append(&mut outline.given_up);
        for opened in open {
            let error = match outline.full_from {
                Some(_) => LineError::new(Span::new(0, 1), "o-word", TOO_MANY),
                None => outline.error(opened, "it is opened and never closed"),
            };
            let number = outline.entries[opened].number;
            outline
                .wrong
                .entry(number)
                .or_insert_with(|| Diagnostic::new(&program.name, number, b"", error));
        }
        Ok(outline)
    }

    /// What is wrong with the O-word of line `number`.
    pub fn wrong(&self, number: u32) -> Option<&Diagnostic> {
        let beyond = self.full_from.filter(|from| number >= *from);
        self.wrong.get(&beyond.unwrap_or(number))
    }

    /// The O-word of line `number`; none where it is wrong.
    pub fn find(&self, number: u32) -> Option<usize> {
        self.entries
            .binary_search_by_key(&number, |entry| entry.number)
            .ok()
    }

    pub fn entry(&self, index: usize) -> &Entry {
        &self.entries[index]
    }

    pub fn sub(&self, label: &str) -> Option<usize> {
        self.subs.get(label).copied()
    }

    /// How an entry is written: `o100 while`.
    pub fn shown(&self, index: usize) -> String {
        let entry = &self.entries[index];
        match &entry.word.label {
            Label::Fixed(label) if label.bytes().all(|b| b.is_ascii_digit()) => {
                format!("o{label} {}", entry.word.keyword.name())
            }
            Label::Fixed(label) => format!("o<{label}> {}", entry.word.keyword.name()),
            Label::Computed(_) => format!("o[…] {}", entry.word.keyword.name()),
        }
    }

    fn is_full(&self) -> bool {
        self.entries.len() + self.programs.len() + self.wrong.len() >= MAX_O_WORDS
    }

    /// Where the subprogram with this number begins that is called in line `from`: behind it, or else before it.
    pub fn program(&self, label: &str, from: u32) -> Option<Mark> {
        let mut all = self.programs.iter().filter(|(found, ..)| **found == *label);
        let behind = all.clone().find(|(_, line, _)| *line > from);
        behind.or_else(|| all.next()).map(|(.., mark)| *mark)
    }

    /// Adds an entry; `open` are the blocks that are not closed yet.
    fn add(&mut self, entry: Entry, open: &mut Vec<usize>) -> Checked<()> {
        let index = self.entries.len();
        let keyword = entry.word.keyword;
        let label = entry.word.label.clone();
        self.entries.push(Entry {
            open: index,
            close: index,
            next: index,
            ..entry
        });
        match keyword {
            Keyword::Sub => self.open_sub(index, &label, open),
            Keyword::While if self.top(open, &label, &[Keyword::Do]).is_some() => {
                self.close(index, open);
                Ok(())
            }
            Keyword::If | Keyword::While | Keyword::Do | Keyword::Repeat => {
                open.push(index);
                Ok(())
            }
            Keyword::ElseIf | Keyword::Else => self.branch(index, &label, open),
            Keyword::EndIf => self.end(index, &label, &[Keyword::If], open),
            Keyword::EndSub => self.end(index, &label, &[Keyword::Sub], open),
            Keyword::EndWhile => self.end(index, &label, &[Keyword::While], open),
            Keyword::EndRepeat => self.end(index, &label, &[Keyword::Repeat], open),
            Keyword::Break | Keyword::Continue => self.inside(
                index,
                &label,
                &[Keyword::While, Keyword::Do, Keyword::Repeat],
                open,
            ),
            Keyword::Return => self.return_from(index, open),
            Keyword::Call => Ok(()),
        }
    }

    fn open_sub(&mut self, index: usize, label: &Label, open: &mut Vec<usize>) -> Checked<()> {
        let outer = open
            .iter()
            .find(|outer| self.entries[**outer].word.keyword == Keyword::Sub)
            .copied();
        open.push(index);
        if let Some(outer) = outer {
            return Err(self.error(
                index,
                &format!("a subroutine lies within another, {}", self.placed(outer)),
            ));
        }
        let Label::Fixed(label) = label else {
            return Ok(());
        };
        match self.subs.insert(label.clone(), index) {
            Some(before) => Err(self.error(
                index,
                &format!("the subroutine is there already: {}", self.placed(before)),
            )),
            None => Ok(()),
        }
    }

    /// The block that was opened last, if it has this label and one of these keywords.
    fn top(&self, open: &[usize], label: &Label, keywords: &[Keyword]) -> Option<usize> {
        let entry = &self.entries[*open.last()?];
        (keywords.contains(&entry.word.keyword) && entry.word.label == *label)
            .then_some(*open.last()?)
    }

    fn end(
        &mut self,
        index: usize,
        label: &Label,
        keywords: &[Keyword],
        open: &mut Vec<usize>,
    ) -> Checked<()> {
        if self.top(open, label, keywords).is_some() {
            self.close(index, open);
            return Ok(());
        }
        let opener =
            |entry: &Entry| keywords.contains(&entry.word.keyword) && entry.word.label == *label;
        let place = open
            .iter()
            .rposition(|opened| opener(&self.entries[*opened]));
        // A subroutine with a wrong block is told when it comes to that block: a library holds subs that nobody calls.
        if let (Some(place), [Keyword::Sub]) = (place, keywords) {
            self.given_up.extend(open.drain(place + 1..));
            self.close(index, open);
            return Ok(());
        }
        // Gives up what lies within the block that this closes, so that one mistake is one message.
        let error = match open.last() {
            Some(other) => self.error(
                index,
                &format!("it closes nothing here: open is {}", self.placed(*other)),
            ),
            None => self.error(index, "it closes nothing: no block is open"),
        };
        if let Some(place) = place {
            self.given_up.extend(open.drain(place..));
        }
        Err(error)
    }

    /// Entry `index` closes the block that was opened last.
    fn close(&mut self, index: usize, open: &mut Vec<usize>) {
        let Some(opened) = open.pop() else { return };
        self.entries[index].open = opened;
        for inside in opened..index {
            if self.entries[inside].open == opened {
                self.entries[inside].close = index;
            }
        }
        // The last branch of an if goes on at its end.
        let last = (opened..index).rev().find(|inside| {
            self.entries[*inside].open == opened && is_branch(&self.entries[*inside])
        });
        if let Some(last) = last {
            self.entries[last].next = index;
        }
    }

    fn branch(&mut self, index: usize, label: &Label, open: &[usize]) -> Checked<()> {
        let Some(opened) = self.top(open, label, &[Keyword::If]) else {
            return Err(self.error(index, "it belongs to no if that is open here"));
        };
        self.entries[index].open = opened;
        let before = (opened..index)
            .rev()
            .find(|inside| self.entries[*inside].open == opened)
            .unwrap_or(opened);
        if self.entries[before].word.keyword == Keyword::Else {
            return Err(self.error(
                index,
                &format!("nothing but endif may follow else, {}", self.placed(before)),
            ));
        }
        self.entries[before].next = index;
        Ok(())
    }

    /// `break` and `continue` belong to a block around them.
    fn inside(
        &mut self,
        index: usize,
        label: &Label,
        keywords: &[Keyword],
        open: &[usize],
    ) -> Checked<()> {
        let belongs =
            |entry: &Entry| keywords.contains(&entry.word.keyword) && entry.word.label == *label;
        let around = open
            .iter()
            .rev()
            .find(|opened| belongs(&self.entries[**opened]))
            .copied();
        let Some(around) = around else {
            let names: Vec<_> = keywords.iter().map(|keyword| keyword.name()).collect();
            return Err(self.error(
                index,
                &format!("it stands in no {} with this label", names.join(" or ")),
            ));
        };
        self.entries[index].open = around;
        Ok(())
    }

    /// `return` leaves the subroutine around it, whatever its label.
    fn return_from(&mut self, index: usize, open: &[usize]) -> Checked<()> {
        let around = open
            .iter()
            .rev()
            .find(|opened| self.entries[**opened].word.keyword == Keyword::Sub)
            .copied();
        let Some(around) = around else {
            return Err(self.error(index, "it stands in no sub"));
        };
        self.entries[index].open = around;
        Ok(())
    }

    fn error(&self, index: usize, why: &str) -> LineError {
        let end = usize::from(self.entries[index].word.values_at);
        LineError::new(
            Span::new(0, end),
            "o-word",
            format!("{}: {why}", self.shown(index)),
        )
    }

    fn placed(&self, index: usize) -> String {
        format!(
            "{} of line {}",
            self.shown(index),
            self.entries[index].number
        )
    }
}

fn is_branch(entry: &Entry) -> bool {
    matches!(
        entry.word.keyword,
        Keyword::If | Keyword::ElseIf | Keyword::Else
    )
}
