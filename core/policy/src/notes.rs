//! What a policy does in words, a few a second.

/// Notes that come at once.
const AT_ONCE: u32 = 10;
/// Notes that wait to be taken.
const MOST: usize = 64;

/// Collects notes; beyond the first ones no more than one a second of machine time. What is left out is counted.
#[derive(Debug)]
pub struct Notes {
    waiting: Vec<String>,
    /// Notes that may be made now.
    allowed: u32,
    /// Rough periods until the next.
    until_next: u32,
    periods_per_s: u32,
    left_out: u64,
}

impl Notes {
    /// No notes; rough periods of `rough_period_s`.
    pub fn new(rough_period_s: f64) -> Self {
        let periods_per_s = (1.0 / rough_period_s).round().max(1.0) as u32;
        Self {
            waiting: vec![],
            allowed: AT_ONCE,
            until_next: periods_per_s,
            periods_per_s,
            left_out: 0,
        }
    }

    /// A rough period has passed.
    pub fn period(&mut self) {
        self.until_next -= 1;
        if self.until_next == 0 {
            self.until_next = self.periods_per_s;
            self.allowed = (self.allowed + 1).min(AT_ONCE);
        }
    }

    /// Whether the next note is left out.
    pub fn is_full(&self) -> bool {
        self.allowed == 0 || self.waiting.len() >= MOST
    }

    /// Leaves out `count` notes.
    pub fn leave_out(&mut self, count: u64) {
        self.left_out += count;
    }

    /// Notes what `text` says, if it may.
    pub fn note(&mut self, text: impl FnOnce() -> String) {
        if self.is_full() {
            self.leave_out(1);
            return;
        }
        self.allowed -= 1;
        self.always(text());
    }

    /// Notes what must be said.
    pub fn always(&mut self, text: String) {
        let before = std::mem::take(&mut self.left_out);
        self.waiting.push(if before == 0 {
            text
        } else {
            format!("{text} ({before} notes were left out before)")
        });
    }

    /// What has been noted since the last look.
    pub fn take(&mut self) -> Vec<String> {
        std::mem::take(&mut self.waiting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_cut_and_counted() {
        let mut notes = Notes::new(0.008);
        for _ in 0..100 {
            notes.note(|| "x".to_string());
        }
        assert_eq!(notes.take().len(), 10);
        for _ in 0..125 {
            notes.period();
        }
        notes.note(|| "y".to_string());
        notes.note(|| "z".to_string());
        assert_eq!(notes.take(), ["y (90 notes were left out before)"]);
    }

    #[test]
    fn a_quiet_hour_allows_no_flood_and_notes_that_nobody_takes_are_not_kept_for_ever() {
        let mut notes = Notes::new(0.008);
        (0..125 * 3600).for_each(|_| notes.period());
        (0..100).for_each(|_| notes.note(|| "x".to_string()));
        assert_eq!(notes.take().len(), AT_ONCE as usize);
        for _ in 0..200 {
            (0..125).for_each(|_| notes.period());
            notes.note(|| "y".to_string());
        }
        assert_eq!(notes.take().len(), MOST);
    }
}
