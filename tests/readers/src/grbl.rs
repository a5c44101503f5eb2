//! Any bytes from a sender of grbl's protocol, in any pieces, at a machine that moves: each line has one answer at most, and behind
//! a soft reset the machine stands and answers.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, LazyLock};

use tandem_host::{Clock, Registry};
use tandem_machine::Machine;
use tandem_session::controller::{Controller, NoPersistence, Options, VirtualSender};
use tandem_session::operator::Listen;

/// The simulated drives hold by this period.
const ENABLED_BY: u64 = 1000;
/// Periods in which the machine has come to rest from any motion, and says so.
const PATIENCE: u64 = 20_000;

static MACHINE: LazyLock<Machine> = LazyLock::new(|| {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-probe.toml");
    Machine::read(&file, &[]).expect("the example")
});

static REGISTRY: LazyLock<Registry> = LazyLock::new(|| {
    let mut registry = Registry::default();
    for plugin in [tandem_look_ahead::PLUGIN, tandem_sim::PLUGIN] {
        registry.register(plugin).expect("a plugin");
    }
    registry
});

/// Says the bytes: the first of each piece is the number of periods before it, the second how long it is.
struct Sender {
    bytes: Vec<u8>,
    at: usize,
    next: u64,
    /// Ends of lines that were said, and answers that were heard.
    ends: usize,
    answers: usize,
    /// The period of the reset at the end, and whether it was greeted.
    reset: Option<u64>,
    greeted: bool,
    heard: String,
    stands: Arc<AtomicBool>,
}

impl Sender {
    fn hear(&mut self, heard: &str) {
        self.heard.push_str(heard);
        while let Some(end) = self.heard.find('\n') {
            let line: String = self.heard.drain(..=end).collect();
            let line = line.trim();
            if line == "ok" || line.starts_with("error:") {
                self.answers += 1;
            } else if line.starts_with("Grbl 1.1h") && self.reset.is_some() {
                self.greeted = true;
            } else if line.starts_with('<') && self.greeted {
                // Spindle and coolant may still be switched off.
                let stands = !line.starts_with("<Run") && !line.starts_with("<Jog");
                self.stands.store(stands, Relaxed);
            }
        }
        assert!(
            self.answers <= self.ends,
            "{} answers to {} lines",
            self.answers,
            self.ends
        );
    }
}

impl VirtualSender for Sender {
    fn period(&mut self, tick: u64, heard: &str, say: &mut Vec<u8>) -> bool {
        self.hear(heard);
        if let Some(reset) = self.reset {
            assert!(tick < reset + PATIENCE, "no answer behind a reset");
            if self.greeted {
                say.push(b'?');
            }
            return !self.stands.load(Relaxed);
        }
        if tick < self.next {
            return true;
        }
        let Some(&[wait, length]) = self.bytes.get(self.at..self.at + 2) else {
            say.push(0x18);
            self.reset = Some(tick);
            return true;
        };
        let from = self.at + 2;
        let to = (from + usize::from(length) % 200).min(self.bytes.len());
        let piece = &self.bytes[from..to];
        self.ends += piece.iter().filter(|byte| b"\r\n".contains(byte)).count();
        say.extend_from_slice(piece);
        (self.at, self.next) = (to, tick + u64::from(wait));
        true
    }
}

/// Judges one input.
///
/// # Panics
/// The reader broke what it promises.
pub fn judge(bytes: &[u8]) {
    let options = Options {
        clock: Clock::Virtual,
        listen: Listen::default(),
        programs: None,
        record: None,
        arrivals: None,
        enable: true,
        script: vec![],
        uptime_periods: 0,
        persistent: None,
    };
    let mut controller = Controller::open(&MACHINE, &REGISTRY, options, Box::new(NoPersistence))
        .expect("a controller");
    let stands = Arc::<AtomicBool>::default();
    controller.add_sender(Box::new(Sender {
        bytes: bytes.to_vec(),
        at: 0,
        next: ENABLED_BY,
        ends: 0,
        answers: 0,
        reset: None,
        greeted: false,
        heard: String::new(),
        stands: Arc::clone(&stands),
    }));
    controller.run(&mut |_| ()).expect("it goes on");
    assert!(stands.load(Relaxed), "it has not come to rest");
}
