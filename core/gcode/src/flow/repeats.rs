//! The `repeat` loops that are executed, innermost last.

/// One of them.
struct Repeat {
    /// Its O-word, as an entry of the file.
    open: usize,
    left: u64,
}

/// All of them, over all calls.
#[derive(Default)]
pub(super) struct Repeats(Vec<Repeat>);

impl Repeats {
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Keeps the first `count`: those of a caller.
    pub fn truncate(&mut self, count: usize) {
        self.0.truncate(count);
    }

    /// Forgets those that begin at the entry `from` or behind it, but the first `kept`, which are a caller's.
    pub fn leave(&mut self, from: usize, kept: usize) {
        while self.0.len() > kept && self.0.last().is_some_and(|repeat| repeat.open >= from) {
            self.0.pop();
        }
    }

    pub fn begin(&mut self, open: usize, count: u64) {
        self.0.push(Repeat { open, left: count });
    }

    /// A turn of the loop at entry `open` ends; whether another begins.
    pub fn turn(&mut self, open: usize) -> bool {
        let Some(repeat) = self.0.last_mut().filter(|repeat| repeat.open == open) else {
            return false;
        };
        repeat.left -= 1;
        if repeat.left == 0 {
            self.0.pop();
            return false;
        }
        true
    }
}
