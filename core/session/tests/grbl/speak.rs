//! Senders in this process, and the machine that they speak to, on the virtual clock.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::{Arc, Mutex};

use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};
use serde_json::Value;
use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Run, Switches};
use tandem_machine::Machine;
use tandem_session::controller::{Controller, NoPersistence, Options, ScriptLine, VirtualSender};

pub fn machine(name: &str, sets: &[(&str, &str)]) -> Machine {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines");
    let sets: Vec<(String, String)> = sets
        .iter()
        .map(|(key, value)| ((*key).to_string(), (*value).to_string()))
        .collect();
    Machine::read(&folder.join(name), &sets).unwrap()
}

pub fn registry() -> Registry {
    let mut registry = Registry::default();
    for plugin in [
        tandem_look_ahead::PLUGIN,
        tandem_smooth::PLUGIN,
        tandem_sim::PLUGIN,
    ] {
        registry.register(plugin).unwrap();
    }
    registry
}

/// Lets senders and a script speak to a machine; what everybody but the senders was told.
pub fn serve(
    machine: &Machine,
    senders: Vec<Box<dyn VirtualSender>>,
    script: Vec<ScriptLine>,
) -> Vec<Value> {
    serve_recorded(machine, senders, script, None)
}

/// The same with the files of every job in a folder.
pub fn serve_recorded(
    machine: &Machine,
    senders: Vec<Box<dyn VirtualSender>>,
    script: Vec<ScriptLine>,
    record: Option<&Path>,
) -> Vec<Value> {
    let registry = registry();
    let mut options = Options::of_script(script);
    options.record = record.map(Path::to_path_buf);
    let mut controller =
        Controller::open(machine, &registry, options, Box::new(NoPersistence)).unwrap();
    for sender in senders {
        controller.add_sender(sender);
    }
    let mut told = vec![];
    controller
        .run(&mut |line| told.extend(serde_json::from_str(line).ok()))
        .unwrap();
    told
}

/// What happens to a sender: what it heard, line by line, with the tick.
pub type Log = Arc<Mutex<Vec<(u64, String)>>>;

/// Says bytes at ticks, and hears.
pub struct Speaker {
    pub says: VecDeque<(u64, Vec<u8>)>,
    /// What is said before it speaks is not for it: the machine is being enabled.
    pub from: u64,
    pub until: u64,
    pub log: Log,
    pub partial: String,
}

impl Speaker {
    pub fn new(says: &[(u64, &[u8])], until: u64) -> (Box<Self>, Log) {
        let log = Log::default();
        let says = says.iter().map(|(tick, bytes)| (*tick, bytes.to_vec()));
        let speaker = Self {
            says: says.clone().collect(),
            from: says.map(|(tick, _)| tick).min().unwrap_or_default(),
            until,
            log: Arc::clone(&log),
            partial: String::new(),
        };
        (Box::new(speaker), log)
    }
}

/// Complete lines of what was heard; the rest stays.
pub fn lines_of(partial: &mut String, heard: &str) -> Vec<String> {
    partial.push_str(heard);
    let mut lines = vec![];
    while let Some(end) = partial.find('\n') {
        let line: String = partial.drain(..=end).collect();
        let line = line.trim();
        if !line.is_empty() {
            lines.push(line.to_string());
        }
    }
    lines
}

/// The same; nothing while the machine is being enabled.
pub fn lines_when_enabled(partial: &mut String, tick: u64, heard: &str) -> Vec<String> {
    let lines = lines_of(partial, heard);
    if tick > ENABLED_BY { lines } else { vec![] }
}

impl VirtualSender for Speaker {
    fn period(&mut self, tick: u64, heard: &str, say: &mut Vec<u8>) -> bool {
        let lines = lines_of(&mut self.partial, heard);
        let mut log = self.log.lock().unwrap();
        if tick > self.from {
            log.extend(lines.into_iter().map(|line| (tick, line)));
        }
        while self.says.front().is_some_and(|(at, _)| *at <= tick) {
            say.extend(self.says.pop_front().unwrap().1);
        }
        tick < self.until
    }
}

/// What a speaker heard, without its ticks.
pub fn words(log: &Log) -> Vec<String> {
    log.lock()
        .unwrap()
        .iter()
        .map(|(_, line)| line.clone())
        .collect()
}

/// What one sender heard, and what everybody else was told.
pub struct Heard {
    /// With the tick of each line.
    pub log: Vec<(u64, String)>,
    pub words: Vec<String>,
    pub told: Vec<Value>,
}

/// Lets one sender say what it says at its ticks, until `until`, beside the script of another client.
pub fn speak(
    machine: &Machine,
    says: &[(u64, &[u8])],
    until: u64,
    script: Vec<ScriptLine>,
) -> Heard {
    let (speaker, log) = Speaker::new(says, until);
    let told = serve(machine, vec![speaker], script);
    let words = words(&log);
    let log = log.lock().unwrap().clone();
    Heard { log, words, told }
}

/// The lines that begin with `start`.
pub fn beginning<'a>(words: &'a [String], start: &str) -> Vec<&'a str> {
    words
        .iter()
        .map(String::as_str)
        .filter(|word| word.starts_with(start))
        .collect()
}

/// The states that the reports told.
pub fn states(words: &[String]) -> Vec<&str> {
    beginning(words, "<").into_iter().map(state).collect()
}

/// When this line was heard.
pub fn ticks_of(log: &[(u64, String)], line: &str) -> Vec<u64> {
    log.iter()
        .filter(|(_, heard)| heard == line)
        .map(|(tick, _)| *tick)
        .collect()
}

/// A field of a status report.
pub fn field<'a>(report: &'a str, name: &str) -> Option<&'a str> {
    let inner = report.strip_prefix('<')?.strip_suffix('>')?;
    inner
        .split('|')
        .find_map(|field| field.strip_prefix(name)?.strip_prefix(':'))
}

pub fn state(report: &str) -> &str {
    report.trim_start_matches('<').split('|').next().unwrap()
}

/// The simulated drives hold by this period.
pub const ENABLED_BY: u64 = 1000;

/// Streams a program by counted characters, as senders do: so many bytes without an answer, a poll now and then.
pub struct Streamer {
    pub lines: VecDeque<String>,
    /// Bytes of each line that is on the way.
    pub on_the_way: VecDeque<usize>,
    pub budget: usize,
    /// Ticks from one look at what may be sent to the next: what a cable and a program in between take.
    pub every: u64,
    /// Ticks for which nothing is sent, once so many lines are.
    pub stall: Option<(usize, u64)>,
    pub stalled_until: u64,
    pub sent: usize,
    pub polls_every: u64,
    pub polled: Option<usize>,
    pub partial: String,
    pub seen: Arc<Mutex<Seen>>,
    pub rng: TestRng,
}

#[derive(Default)]
pub struct Seen {
    pub answers: usize,
    pub errors: Vec<String>,
    pub reports: usize,
    pub last_report: String,
    pub first_motion: Option<u64>,
    pub end: u64,
    pub lies: Vec<String>,
}

impl Streamer {
    pub fn new(
        text: &str,
        budget: usize,
        polls_every: u64,
        seed: u8,
    ) -> (Box<Self>, Arc<Mutex<Seen>>) {
        let seen = Arc::<Mutex<Seen>>::default();
        let streamer = Self {
            lines: text.lines().map(|line| format!("{line}\n")).collect(),
            on_the_way: VecDeque::new(),
            budget,
            every: 1,
            stall: None,
            stalled_until: ENABLED_BY,
            sent: 0,
            polls_every,
            polled: None,
            partial: String::new(),
            seen: Arc::clone(&seen),
            rng: TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]),
        };
        (Box::new(streamer), seen)
    }

    pub fn hear(&mut self, tick: u64, line: &str) -> bool {
        let mut seen = self.seen.lock().unwrap();
        if line == "ok" || line.starts_with("error:") {
            seen.answers += 1;
            if line != "ok" {
                seen.errors.push(line.to_string());
            }
            self.on_the_way.pop_front();
        } else if line.starts_with('<') {
            seen.reports += 1;
            seen.last_report = line.to_string();
            if state(line) == "Run" {
                seen.first_motion.get_or_insert(tick);
            }
            // What is on the way is what is not free, at the moment of the report.
            let free: usize = field(line, "Bf")
                .unwrap()
                .split(',')
                .nth(1)
                .unwrap()
                .parse()
                .unwrap();
            if let Some(on_the_way) = self.polled.take()
                && free + on_the_way != 1024
                && seen.lies.len() < 3
            {
                seen.lies
                    .push(format!("{line} with {on_the_way} bytes on the way"));
            }
            if state(line) == "Idle" && self.lines.is_empty() && self.on_the_way.is_empty() {
                seen.end = tick;
                return false;
            }
        }
        true
    }
}

impl VirtualSender for Streamer {
    fn period(&mut self, tick: u64, heard: &str, say: &mut Vec<u8>) -> bool {
        for line in lines_of(&mut self.partial, heard) {
            if !self.hear(tick, &line) {
                return false;
            }
        }
        while tick >= self.stalled_until
            && tick.is_multiple_of(self.every)
            && let Some(line) = self.lines.front()
            && self.on_the_way.iter().sum::<usize>() + line.len() <= self.budget
        {
            let line = self.lines.pop_front().unwrap();
            self.on_the_way.push_back(line.len());
            self.sent += 1;
            if let Some((at, ticks)) = self.stall
                && self.sent == at
            {
                self.stalled_until = tick + ticks;
            }
            // Bytes that act at once stand anywhere.
            if self.rng.next_u32().is_multiple_of(50) {
                let at = self.rng.next_u32() as usize % line.len();
                say.extend_from_slice(&line.as_bytes()[..at]);
                say.push(0x85);
                say.extend_from_slice(&line.as_bytes()[at..]);
            } else {
                say.extend_from_slice(line.as_bytes());
            }
        }
        if tick.is_multiple_of(self.polls_every) && self.polled.is_none() {
            say.push(b'?');
            self.polled = Some(self.on_the_way.iter().sum());
        }
        true
    }
}

/// Chords of a circle and back, `count` lines.
pub fn chords(count: usize) -> String {
    let mut text = String::from("G21 G90 G94 F3000\n");
    for nth in 1..=count {
        let angle = nth as f64 / count as f64 * std::f64::consts::TAU * 4.0;
        // A string takes whatever is written to it.
        let _ = writeln!(
            text,
            "G1X{:.3}Y{:.3}",
            40.0 * angle.cos() - 40.0,
            40.0 * angle.sin()
        );
    }
    text
}

pub fn alone_s(machine: &Machine, text: &str) -> f64 {
    let program = Program::spool("alone.ngc", text.as_bytes()).unwrap();
    let run = Run::prepare(machine.clone(), &registry(), program, Switches::default()).unwrap();
    run.drive(Clock::Virtual, &[], &mut ())
        .unwrap()
        .summary
        .motion_time_s
}

pub fn jobs(told: &[Value]) -> Vec<&Value> {
    told.iter()
        .filter(|told| told["told"]["event"] == "job")
        .map(|told| &told["told"]["job"])
        .collect()
}

/// How long jobs took together, s.
pub fn took_s(jobs: &[&Value]) -> f64 {
    jobs.iter().map(|job| job["time_s"].as_f64().unwrap()).sum()
}

/// Jobs take no more than a twentieth longer than a run of the same lines, which takes `alone_s`; `how` they came stands in the failure.
pub fn assert_as_long_as_a_run(jobs: &[&Value], alone_s: f64, how: &str) {
    let ratio = took_s(jobs) / alone_s;
    assert!(
        ratio <= 1.05,
        "{how}: {ratio} of the run's time, {alone_s} s"
    );
}
