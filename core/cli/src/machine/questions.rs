//! A machine of answers: each question has an answer that an empty line takes.

use std::io::{BufRead, Write};

use super::draft::{DraftAxis, number as shown, turns};
use super::new::{letter, positive, travel_of};

/// Where answers come from. The questions go to standard error.
pub struct Answers {
    lines: Box<dyn BufRead>,
    count: u32,
}

impl Answers {
    /// Those that are typed, or a pipe's.
    pub fn of_standard_input() -> Self {
        Self::of(Box::new(std::io::stdin().lock()))
    }

    fn of(lines: Box<dyn BufRead>) -> Self {
        Self { lines, count: 0 }
    }

    /// Asks until the answer is one that `read` takes. An empty line is `usual`.
    fn ask<T>(
        &mut self,
        question: &str,
        usual: &str,
        read: impl Fn(&str) -> Result<T, String>,
    ) -> Result<T, String> {
        loop {
            let mut err = std::io::stderr().lock();
            // A terminal that has gone away ends the command with its signal.
            let _ = write!(err, "{question} [{usual}]: ").and_then(|()| err.flush());
            let mut line = String::new();
            let count = self.lines.read_line(&mut line);
            if !count.is_ok_and(|bytes| bytes > 0) {
                return Err(format!(
                    "answers end before {question:?}: nothing is written"
                ));
            }
            self.count += 1;
            let answer = if line.trim().is_empty() {
                usual
            } else {
                line.trim()
            };
            match read(answer) {
                Ok(value) => return Ok(value),
                Err(why) => {
                    let _ = writeln!(err, "answer {}: {why}", self.count);
                }
            }
        }
    }
}

/// Asks for the axes of a machine.
///
/// # Errors
/// The answers end too early.
pub fn axes(answers: &mut Answers) -> Result<Vec<DraftAxis>, String> {
    let letters = answers.ask("axes, a letter each", "xyz", |text| {
        let letters: Result<Vec<char>, String> = text
            .chars()
            .filter(|c| !c.is_whitespace() && *c != ',')
            .map(|c| letter(&c.to_string()))
            .collect();
        let letters = letters?;
        let twice = (1..letters.len()).find(|at| letters[..*at].contains(&letters[*at]));
        match twice {
            Some(at) => Err(format!("{} is there twice", letters[at])),
            None if letters.is_empty() => Err("a machine has at least one axis".to_string()),
            None if letters.len() > 8 => Err("a machine has at most 8 axes".to_string()),
            None => Ok(letters),
        }
    })?;
    let mut axes: Vec<DraftAxis> = vec![];
    for letter in letters {
        // What an axis of the same kind before it has is likely.
        let last = axes.iter().rev().find(|axis| axis.rotary == turns(letter));
        let usual = last.cloned().unwrap_or_else(|| {
            if turns(letter) {
                DraftAxis::new(letter, [-180.0, 180.0], 7200.0, 1000.0)
            } else {
                DraftAxis::new(letter, [-200.0, 200.0], 5000.0, 500.0)
            }
        });
        axes.push(axis(answers, letter, &usual)?);
    }
    Ok(axes)
}

fn axis(answers: &mut Answers, letter: char, usual: &DraftAxis) -> Result<DraftAxis, String> {
    let unit = if turns(letter) { "deg" } else { "mm" };
    let [low, high] = usual.travel;
    let travel = answers.ask(
        &format!("{letter}: lowest and highest position, {unit}"),
        &format!("{} {}", shown(low), shown(high)),
        |text| {
            let ends: Vec<&str> = text.split_whitespace().collect();
            match ends[..] {
                [low, high] => travel_of(low, high),
                _ => Err("it is two numbers, as in -250 250".to_string()),
            }
        },
    )?;
    let feed = answers.ask(
        &format!("{letter}: highest speed, {unit}/min"),
        &shown(usual.feed),
        positive,
    )?;
    let acceleration = answers.ask(
        &format!("{letter}: highest acceleration, {unit}/s²"),
        &shown(usual.acceleration),
        positive,
    )?;
    let mut axis = DraftAxis::new(letter, travel, feed, acceleration);
    axis.jerk = answers.ask(
        &format!("{letter}: highest jerk, {unit}/s³, or none"),
        &shown(axis.proposed_jerk()),
        |text| {
            if text == "none" {
                Ok(None)
            } else {
                positive(text).map(Some)
            }
        },
    )?;
    Ok(axis)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answered(text: &'static str) -> Result<Vec<DraftAxis>, String> {
        axes(&mut Answers::of(Box::new(text.as_bytes())))
    }

    #[test]
    fn an_empty_line_takes_what_is_proposed_and_a_wrong_answer_is_asked_for_again() {
        let axes = answered("x, a\n0 0\n-10 30\n\nfast\n200\nnone\n\n\n\n\n").unwrap();
        let mut x = DraftAxis::new('x', [-10.0, 30.0], 5000.0, 200.0);
        x.jerk = None;
        let mut a = DraftAxis::new('a', [-180.0, 180.0], 7200.0, 1000.0);
        a.jerk = Some(20000.0);
        assert_eq!(axes, [x, a]);
    }

    #[test]
    fn answers_that_end_write_nothing() {
        let why = answered("xy\n\n").unwrap_err();
        assert!(
            why.contains("x: highest speed") && why.contains("nothing is written"),
            "{why}"
        );
        assert!(answered("xx\n").unwrap_err().contains("axes"));
    }
}
