//! The terminal, key by key.

use std::io::{IsTerminal, stderr, stdin};
use std::sync::{Mutex, PoisonError};

use rustix::process::getpgrp;
use rustix::stdio;
use rustix::termios::{
    InputModes, LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp,
    tcsetattr,
};

/// Whether keys can be taken: there is a terminal, and it is ours. To a program in the background it belongs to another.
pub fn is_on_terminal() -> bool {
    stdin().is_terminal()
        && stderr().is_terminal()
        && tcgetpgrp(stdio::stdin()).is_ok_and(|group| group == getpgrp())
}

/// How the terminal was before it was taken, while it is.
static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

/// Remembers how the terminal is: what takes it from here on may not come to give it back.
pub fn keep_terminal() {
    let now = tcgetattr(stdio::stdin()).ok();
    let mut before = BEFORE.lock().unwrap_or_else(PoisonError::into_inner);
    *before = before.take().or(now);
}

/// Gives the terminal back from another thread: the process ends before its time.
pub fn restore_terminal() {
    let before = BEFORE.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(before) = before {
        // A terminal that has gone away needs nothing.
        let _ = tcsetattr(stdio::stdin(), OptionalActions::Now, &before);
    }
}

/// Gives keys at once and unseen while it lives; the terminal is as it was afterwards, after a panic too.
pub struct RawTerminal(());

impl RawTerminal {
    /// Takes the terminal of standard input.
    ///
    /// # Errors
    /// The system's words.
    pub fn take() -> Result<Self, String> {
        let before = tcgetattr(stdio::stdin()).map_err(|e| format!("the terminal: {e}"))?;
        let mut raw = before.clone();
        // Ctrl-C comes as a key; a machine in motion is not suspended with Ctrl-Z, nor its display with Ctrl-S.
        raw.local_modes -=
            LocalModes::ICANON | LocalModes::ECHO | LocalModes::ISIG | LocalModes::IEXTEN;
        raw.input_modes -= InputModes::IXON;
        raw.special_codes[SpecialCodeIndex::VMIN] = 1;
        raw.special_codes[SpecialCodeIndex::VTIME] = 0;
        tcsetattr(stdio::stdin(), OptionalActions::Now, &raw)
            .map_err(|e| format!("the terminal: {e}"))?;
        *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(before);
        Ok(Self(()))
    }
}

impl Drop for RawTerminal {
    fn drop(&mut self) {
        restore_terminal();
    }
}
