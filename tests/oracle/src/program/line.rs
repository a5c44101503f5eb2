//! One line of a program, split into words.

/// The words of a line. Whoever understands a word takes it out; what is left at the end was not understood.
#[derive(Debug, Default)]
pub struct Line {
    /// G codes in tenths: G92.1 is 921.
    pub g: Vec<i32>,
    /// M codes.
    pub m: Vec<i32>,
    values: [Option<f64>; 26],
}

impl Line {
    pub fn parse(text: &str) -> Result<Self, String> {
        let text = without_comments(text)?;
        let mut line = Self::default();
        let mut rest = text.as_str();
        while let Some(letter) = rest.chars().next() {
            rest = &rest[letter.len_utf8()..];
            // TA is a word of two letters: a time constant, which moves nothing.
            let time_constant = letter == 'T' && rest.starts_with('A');
            if time_constant {
                rest = &rest[1..];
            }
            let (value, after) = number(letter, rest)?;
            rest = after;
            if !time_constant {
                line.add(letter, value)?;
            }
        }
        Ok(line)
    }

    /// Takes the value of a word out of the line.
    pub fn take(&mut self, letter: char) -> Option<f64> {
        self.values[slot(letter)].take()
    }

    pub fn has(&self, letter: char) -> bool {
        self.values[slot(letter)].is_some()
    }

    /// The first word that nobody took.
    pub fn left_over(&self) -> Option<String> {
        let index = self.values.iter().position(Option::is_some)?;
        Some(format!(
            "{}{}",
            char::from(b'A' + index as u8),
            self.values[index]?
        ))
    }

    fn add(&mut self, letter: char, value: f64) -> Result<(), String> {
        match letter {
            'N' => {}
            'G' => self.g.push(code(letter, value, 10.0)?),
            'M' => self.m.push(code(letter, value, 1.0)?),
            _ if self.has(letter) => return Err(format!("word {letter} twice")),
            _ => self.values[slot(letter)] = Some(value),
        }
        Ok(())
    }
}

fn slot(letter: char) -> usize {
    letter as usize - 'A' as usize
}

fn code(letter: char, value: f64, scale: f64) -> Result<i32, String> {
    let scaled = value * scale;
    let code = scaled.round();
    if (scaled - code).abs() > 1e-6 || !(0.0..10_000.0).contains(&code) {
        return Err(format!("unknown word {letter}{value}"));
    }
    Ok(code as i32)
}

/// Splits the number of a word from what follows it.
fn number(letter: char, rest: &str) -> Result<(f64, &str), String> {
    if !letter.is_ascii_uppercase() {
        return Err(format!("unknown word {letter}{rest}"));
    }
    let signed = usize::from(rest.starts_with(['+', '-']));
    let digits = rest[signed..]
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(rest.len() - signed);
    let (text, after) = rest.split_at(signed + digits);
    let value = text
        .parse()
        .map_err(|_| format!("unknown word {letter}{rest}"))?;
    Ok((value, after))
}

/// The line in capitals, without comments and blanks. Comments may hold others: read so, a word is never lost to a
/// bracket too many, for a comment without an end is an error.
pub fn without_comments(text: &str) -> Result<String, String> {
    let mut words = String::with_capacity(text.len());
    let mut depth = 0_usize;
    for c in text.chars() {
        match c {
            '(' => depth += 1,
            ')' if depth > 0 => depth -= 1,
            _ if depth > 0 => {}
            ';' => break,
            _ if c.is_whitespace() => {}
            _ => words.push(c.to_ascii_uppercase()),
        }
    }
    if depth > 0 {
        Err("comment without an end".into())
    } else {
        Ok(words)
    }
}
