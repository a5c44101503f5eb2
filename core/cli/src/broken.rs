//! Files of a run that could not be written to their end.

use tandem_recorder::RecordError;

use crate::operator::tell;

/// Collects what could not be written and says it as it comes.
#[derive(Default)]
pub struct Broken {
    errors: Vec<RecordError>,
    /// How many of them have been said.
    told: usize,
}

impl Broken {
    /// Takes in how a write went.
    pub fn note(&mut self, went: Result<(), RecordError>) {
        self.errors.extend(went.err());
    }

    /// Says what is new, and gives it in words.
    pub fn tell(&mut self) -> Option<String> {
        let new = &self.errors[self.told..];
        if new.is_empty() {
            return None;
        }
        let words: Vec<String> = new.iter().map(ToString::to_string).collect();
        for words in &words {
            tell(&format!("error: {words}"));
        }
        self.told = self.errors.len();
        Some(words.join("; "))
    }

    /// Whether there is any.
    pub fn is_any(&self) -> bool {
        !self.errors.is_empty()
    }

    /// All of them, in order.
    pub fn errors(&self) -> &[RecordError] {
        &self.errors
    }
}
