//! Keys while a program runs.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::stdio;
use tandem_host::Command;

use super::panel::{Panel, PanelSwitches};
use super::signals::Stops;
use super::tell;
use super::terminal::RawTerminal;

/// How often the thread looks whether the run is over, ns.
const LOOK_NS: i64 = 50_000_000;
/// A step of the feed override.
const STEP: f64 = 0.1;
/// What is said when the keys are taken.
const HELP: &str = "keys: space hold/resume, + - feed override, s single block, o optional stop, Enter goes on, \
                    q abort, e emergency stop";
const CTRL_C: u8 = 3;
const ESCAPE: u8 = 27;

/// Takes keys while it lives; dropping it gives the terminal back.
pub struct Keyboard {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _terminal: RawTerminal,
}

impl Keyboard {
    /// Says what the keys do.
    pub fn explain() {
        say!("{HELP}");
    }

    /// Takes the terminal: its keys command the run at `hub`.
    ///
    /// # Errors
    /// The system's words.
    pub fn begin(panel: Arc<dyn Panel>, stops: Stops) -> Result<Self, String> {
        Self::begin_with(move |keys| {
            // An arrow or function key is no letter.
            if keys[0] == ESCAPE && keys.len() > 1 {
                return;
            }
            for words in keys.iter().filter_map(|key| press(*key, &*panel, &stops)) {
                tell(&words);
            }
        })
    }

    /// Takes the terminal: what is typed goes to `take` as it comes, on a thread of its own.
    ///
    /// # Errors
    /// The system's words.
    pub fn begin_with(take: impl FnMut(&[u8]) + Send + 'static) -> Result<Self, String> {
        let terminal = RawTerminal::take()?;
        let over = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&over);
        let thread = thread::spawn(move || listen(take, &seen));
        Ok(Self {
            over,
            thread: Some(thread),
            _terminal: terminal,
        })
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // It has nothing left to do; how it ended does not matter.
            let _ = thread.join();
        }
    }
}

fn listen(mut take: impl FnMut(&[u8]), over: &AtomicBool) {
    let mut keys = [0; 16];
    let timeout = Timespec {
        tv_sec: 0,
        tv_nsec: LOOK_NS,
    };
    while !over.load(Ordering::Acquire) {
        let input = stdio::stdin();
        let ready = poll(&mut [PollFd::new(&input, PollFlags::IN)], Some(&timeout));
        if !ready.is_ok_and(|count| count > 0) {
            continue;
        }
        // No bytes: the terminal is gone, and its signal stops the machine.
        let Ok(count @ 1..) = rustix::io::read(input, &mut keys) else {
            return;
        };
        take(&keys[..count]);
    }
}

/// What a key does, and what is said of it.
pub fn press(key: u8, panel: &dyn Panel, stops: &Stops) -> Option<String> {
    let switches = panel.switches();
    let (command, words) = match key {
        b' ' if switches.hold => (Command::Resume, "resume".to_string()),
        b' ' => (Command::Hold, "feed hold; space resumes".to_string()),
        b'\r' | b'\n' => (Command::Resume, "on".to_string()),
        b'+' | b'=' => step(&switches, STEP),
        b'-' => step(&switches, -STEP),
        b's' => (
            Command::SingleBlock(!switches.single_block),
            switched("single block", switches.single_block),
        ),
        b'o' => (
            Command::OptionalStop(!switches.optional_stop),
            switched("optional stop", switches.optional_stop),
        ),
        b'q' => (Command::Abort, "abort: stopping on the path".to_string()),
        b'e' => (Command::EmergencyStop, "emergency stop".to_string()),
        CTRL_C => return Some(stops.ask(panel)),
        _ => return None,
    };
    Some(
        panel
            .give(command)
            .map_or_else(|refusal| refusal, |()| words),
    )
}

fn switched(what: &str, was_on: bool) -> String {
    format!("{what} {}", if was_on { "off" } else { "on" })
}

/// The feed override a step on, within what the machine allows.
fn step(switches: &PanelSwitches, by: f64) -> (Command, String) {
    let (now, most) = (switches.feed_override, switches.max_feed_ratio);
    // Whole per cents: steps up and down end where they began.
    let asked = ((now + by) * 100.0).round() / 100.0;
    let next = asked.clamp(0.0, most);
    let bound = match next {
        _ if next == asked => "",
        0.0 => ": the least there is",
        _ => ": the most that motion.max_feed_ratio allows",
    };
    (
        Command::FeedOverride(next),
        format!("feed override {:.0} %{bound}", next * 100.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::atomic::Ordering::Relaxed;
    use tandem_machine::Machine;
    use tandem_session::operator::OperatorHub;

    fn hub() -> OperatorHub {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
        let machine = Machine::read(
            &path,
            &[("motion.max_feed_ratio".to_string(), "1.15".to_string())],
        )
        .unwrap();
        OperatorHub::new(&machine, Arc::default(), Arc::default())
    }

    #[test]
    fn every_key() {
        let (hub, stops) = (hub(), Stops::default());
        let type_in = |keys: &str| {
            keys.bytes()
                .filter_map(|key| press(key, &hub, &stops))
                .collect::<Vec<_>>()
        };
        let controls = hub.controls();
        assert_eq!(type_in(" "), ["feed hold; space resumes"]);
        assert!(controls.hold.load(Relaxed));
        assert_eq!(type_in(" "), ["resume"]);
        assert!(!controls.hold.load(Relaxed));
        assert_eq!(type_in("s"), ["single block on"]);
        assert!(controls.single_block.load(Relaxed));
        assert_eq!(type_in("so"), ["single block off", "optional stop on"]);
        hub.begin_wait(7);
        assert!(!hub.answered());
        type_in("\n");
        assert!(hub.answered());
        assert!(type_in("xyz\x1b").is_empty());
        type_in("q");
        assert!(controls.abort.load(Relaxed) && !controls.emergency_stop.load(Relaxed));
        type_in("e");
        assert!(controls.emergency_stop.load(Relaxed));
    }

    #[test]
    fn the_override_stays_within_the_machine_and_says_so() {
        let (hub, stops) = (hub(), Stops::default());
        let said = |key: u8| press(key, &hub, &stops).unwrap();
        assert_eq!(said(b'+'), "feed override 110 %");
        assert_eq!(
            said(b'+'),
            "feed override 115 %: the most that motion.max_feed_ratio allows"
        );
        assert_eq!(hub.controls().feed_override.load(), 1.15);
        assert_eq!(said(b'-'), "feed override 105 %");
        let down: Vec<String> = (0..12).map(|_| said(b'-')).collect();
        assert_eq!(down[11], "feed override 0 %: the least there is");
        assert_eq!(said(b'+'), "feed override 10 %");
    }

    #[test]
    fn ctrl_c_aborts_and_then_stops_at_once() {
        let (hub, stops) = (hub(), Stops::default());
        press(CTRL_C, &hub, &stops);
        assert!(hub.controls().abort.load(Relaxed) && !hub.controls().emergency_stop.load(Relaxed));
        press(CTRL_C, &hub, &stops);
        assert!(hub.controls().emergency_stop.load(Relaxed));
    }
}
