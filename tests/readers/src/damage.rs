//! Sound examples, damaged at random.

use std::path::PathBuf;

use tandem_rig::Random;

use crate::Reader;

/// Of a longer example the beginning is taken: a reader meets every kind of word in it.
const MAX_EXAMPLE_BYTES: usize = 4096;
/// Bytes of an input that begins from no example.
const MAX_NOISE_BYTES: u64 = 600;
/// Changes of one input: few enough for what comes after them to be read still.
const MAX_CHANGES: u64 = 6;
/// Bytes that one change takes out, doubles or moves.
const MAX_PIECE_BYTES: u64 = 40;

/// Gives inputs that are nearly what a reader expects.
pub struct Damage {
    examples: Vec<Vec<u8>>,
    words: Vec<Vec<u8>>,
    random: Random,
}

impl Damage {
    /// From the examples and words of `reader`, as many inputs as are asked for and always the same ones for a seed.
    pub fn new(reader: &Reader, seed: u64) -> Self {
        let mut files: Vec<PathBuf> = reader
            .examples
            .iter()
            .flat_map(|folder| std::fs::read_dir(folder).into_iter().flatten().flatten())
            .map(|entry| entry.path())
            .filter(|path| path.is_file())
            .collect();
        files.sort();
        let read = |path: &PathBuf| {
            let mut bytes = std::fs::read(path).unwrap_or_default();
            bytes.truncate(MAX_EXAMPLE_BYTES);
            bytes
        };
        let words = std::fs::read_to_string(&reader.words).unwrap_or_default();
        Self {
            examples: files.iter().map(read).collect(),
            words: words.lines().filter_map(quoted).collect(),
            random: Random::new(seed),
        }
    }

    /// Sound examples there are.
    pub fn examples(&self) -> &[Vec<u8>] {
        &self.examples
    }

    /// The next input.
    pub fn input(&mut self) -> Vec<u8> {
        if self.examples.is_empty() || self.random.below(20) == 0 {
            let count = self.random.below(MAX_NOISE_BYTES);
            return self.random.bytes(count as usize);
        }
        let mut input = self.example();
        for _ in 0..=self.random.below(MAX_CHANGES) {
            self.change(&mut input);
        }
        input
    }

    fn example(&mut self) -> Vec<u8> {
        let index = self.random.below(self.examples.len() as u64);
        self.examples[index as usize].clone()
    }

    fn change(&mut self, input: &mut Vec<u8>) {
        let at = self.random.below(input.len() as u64 + 1) as usize;
        let end = (at + self.random.below(MAX_PIECE_BYTES) as usize).min(input.len());
        match self.random.below(6) {
            0 if at < input.len() => input[at] = self.random.below(256) as u8,
            1 => drop(input.drain(at..end)),
            2 => {
                let twice = input[at..end].to_vec();
                input.splice(at..at, twice);
            }
            3 if !self.words.is_empty() => {
                let word = self.random.below(self.words.len() as u64) as usize;
                input.splice(at..end, self.words[word].clone());
            }
            4 => {
                let other = self.example();
                let from = self.random.below(other.len() as u64 + 1) as usize;
                let to = (from + MAX_PIECE_BYTES as usize).min(other.len());
                input.splice(at..at, other[from..to].iter().copied());
            }
            _ => {
                let count = self.random.below(4);
                input.splice(at..end.min(at + 1), self.random.bytes(count as usize));
            }
        }
    }
}

/// The bytes between the quotes of a line of a dictionary, in which `\x0a` stands for a byte.
fn quoted(line: &str) -> Option<Vec<u8>> {
    let (_, rest) = line.split_once('"')?;
    let (word, _) = rest.rsplit_once('"')?;
    let mut pieces = word.split("\\x");
    let mut bytes = pieces.next()?.as_bytes().to_vec();
    for piece in pieces {
        let (code, plain) = piece.split_at_checked(2)?;
        bytes.push(u8::from_str_radix(code, 16).ok()?);
        bytes.extend_from_slice(plain.as_bytes());
    }
    Some(bytes)
}
