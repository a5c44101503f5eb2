//! Keys that jog.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use tandem_session::jog::{JogController, JogMessage, ReachMessage};

use super::shared::Shared;
use crate::operator::press;

/// What is said at the start.
const HELP: &str =
    "keys: a letter jogs its axis towards plus, the capital towards minus; arrows x and y, page up and down z
      0 as long as the key is held, 1 to 5 steps of 0.001 0.01 0.1 1 10; < > feed; other keys stop
      space hold/resume, + - feed override, e emergency stop, r reset after a fault, q ends";
/// Distances of the keys 1 to 5, mm or deg.
const STEPS: [f64; 5] = [0.001, 0.01, 0.1, 1.0, 10.0];
/// Feeds, mm/min or deg/min.
const FEEDS: [f64; 12] = [
    10.0, 30.0, 60.0, 100.0, 300.0, 600.0, 1000.0, 1500.0, 3000.0, 6000.0, 10000.0, 15000.0,
];
/// The feed at the start, by its place.
const FIRST_FEED: usize = 5;
const ESCAPE: u8 = 27;
const CTRL_C: u8 = 3;

/// A key, or what a terminal sends for one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Plain(u8),
    /// An arrow or a page key, as the jog that it stands for.
    Jog(char, bool),
    /// Another key that has no letter.
    Other,
}

/// What the keys move: axes of this process, or those of a controller.
pub trait JogPanel: Send {
    /// Whether there is an axis of this letter, upper or lower case.
    fn has_axis(&self, letter: char) -> bool;

    /// Asks for a jog.
    ///
    /// # Errors
    /// Why it is refused, in words.
    fn jog(&self, jog: JogMessage) -> Result<(), String>;

    /// Lets go of what moves.
    fn let_go(&self);

    /// Does what a key of any run does; what is said of it.
    fn command(&self, key: u8) -> Option<String>;

    /// Takes back a fault.
    fn reset(&self);

    /// Ends the session.
    fn quit(&self);

    /// Words for the operator.
    fn say(&self, words: &str);
}

/// Axes of this process.
pub struct OwnAxes {
    pub shared: Arc<Shared>,
    pub jogs: Arc<JogController>,
}

impl JogPanel for OwnAxes {
    fn has_axis(&self, letter: char) -> bool {
        let axes = &self.jogs.machine().axes;
        axes.index(letter.to_ascii_uppercase()).is_some()
    }

    fn jog(&self, jog: JogMessage) -> Result<(), String> {
        self.jogs.ask(jog.on(&self.jogs.machine().axes)?)
    }

    fn let_go(&self) {
        self.jogs.let_go();
    }

    fn command(&self, key: u8) -> Option<String> {
        let (hub, stops) = self.shared.hub()?;
        press(key, &*hub, &stops)
    }

    fn reset(&self) {
        self.shared.reset.store(true, Relaxed);
    }

    fn quit(&self) {
        self.shared.quit.store(true, Relaxed);
    }

    fn say(&self, words: &str) {
        self.shared.say(words);
    }
}

/// The keys of a session.
pub struct JogKeys {
    panel: Box<dyn JogPanel>,
    feed: usize,
    /// None: as long as the key is held.
    step: Option<f64>,
}

impl JogKeys {
    /// Continuous, at a moderate feed.
    pub fn new(panel: Box<dyn JogPanel>) -> Self {
        Self {
            panel,
            feed: FIRST_FEED,
            step: None,
        }
    }

    /// Says what the keys do.
    pub fn explain(&self) {
        say!("{HELP}");
        say!("{}", self.chosen());
    }

    /// Does what the keys say.
    pub fn take(&mut self, bytes: &[u8]) {
        for key in keys(bytes) {
            match key {
                Key::Plain(byte) => self.plain(byte),
                Key::Jog(axis, positive) => self.jog(axis, positive),
                Key::Other => self.panel.let_go(),
            }
        }
    }

    fn plain(&mut self, byte: u8) {
        let letter = byte as char;
        match byte {
            b'0' => self.choose(None),
            b'1'..=b'5' => self.choose(Some(STEPS[usize::from(byte - b'1')])),
            b'>' | b'.' => self.faster(1),
            b'<' | b',' => self.faster(-1),
            b'r' => self.panel.reset(),
            b'q' => self.panel.quit(),
            b' ' | b'+' | b'=' | b'-' | b'e' | b'\r' | b'\n' | CTRL_C => self.command(byte),
            _ if self.panel.has_axis(letter) => {
                self.jog(letter.to_ascii_lowercase(), letter.is_ascii_lowercase());
            }
            _ => self.panel.let_go(),
        }
    }

    fn command(&self, key: u8) {
        if let Some(words) = self.panel.command(key) {
            self.panel.say(&words);
        }
    }

    fn jog(&self, axis: char, positive: bool) {
        let reach = match self.step {
            None => ReachMessage::On { positive },
            Some(step) => ReachMessage::By(if positive { step } else { -step }),
        };
        let words = JogMessage {
            axis,
            reach,
            feed_per_min: FEEDS[self.feed],
            degrees: None,
        };
        if let Err(why) = self.panel.jog(words) {
            self.panel.say(&why);
        }
    }

    fn choose(&mut self, step: Option<f64>) {
        self.step = step;
        self.panel.say(&self.chosen());
    }

    fn faster(&mut self, by: isize) {
        self.feed = self.feed.saturating_add_signed(by).min(FEEDS.len() - 1);
        self.panel.say(&self.chosen());
    }

    fn chosen(&self) -> String {
        let step = self
            .step
            .map_or("as long as the key is held".to_string(), |step| {
                format!("steps of {step} mm or deg")
            });
        format!("{step}, feed {} mm/min or deg/min", FEEDS[self.feed])
    }
}

/// What was pressed: a terminal sends arrows and the like as several bytes, and may send several keys at once.
fn keys(bytes: &[u8]) -> Vec<Key> {
    let mut keys = vec![];
    let mut rest = bytes;
    while let Some((first, behind)) = rest.split_first() {
        let sequence = behind
            .split_first()
            .filter(|(next, _)| *first == ESCAPE && matches!(**next, b'[' | b'O'));
        let Some((_, body)) = sequence else {
            keys.push(if *first == ESCAPE {
                Key::Other
            } else {
                Key::Plain(*first)
            });
            rest = behind;
            continue;
        };
        // A sequence ends with a letter or a tilde.
        let end = body
            .iter()
            .position(|byte| byte.is_ascii_alphabetic() || *byte == b'~');
        let (name, behind) = body.split_at(end.map_or(body.len(), |end| end + 1));
        keys.push(named(name));
        rest = behind;
    }
    keys
}

fn named(sequence: &[u8]) -> Key {
    match sequence {
        b"C" => Key::Jog('x', true),
        b"D" => Key::Jog('x', false),
        b"A" => Key::Jog('y', true),
        b"B" => Key::Jog('y', false),
        b"5~" => Key::Jog('z', true),
        b"6~" => Key::Jog('z', false),
        _ => Key::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_as_terminals_send_them() {
        assert_eq!(keys(b"xX"), [Key::Plain(b'x'), Key::Plain(b'X')]);
        assert_eq!(
            keys(b"\x1b[C\x1b[D\x1bOA"),
            [
                Key::Jog('x', true),
                Key::Jog('x', false),
                Key::Jog('y', true)
            ]
        );
        assert_eq!(
            keys(b"\x1b[5~q\x1b[6~"),
            [Key::Jog('z', true), Key::Plain(b'q'), Key::Jog('z', false)]
        );
        assert_eq!(keys(b"\x1b"), [Key::Other]);
        assert_eq!(keys(b"\x1b[15~x"), [Key::Other, Key::Plain(b'x')]);
        assert_eq!(keys(b"\x1b[1;2"), [Key::Other]);
    }
}
