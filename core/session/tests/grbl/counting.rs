//! Senders that count characters, with bytes that come in any pieces: `Bf:` says what is free, at the byte that asks.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use tandem_rig::Random;
use tandem_session::controller::VirtualSender;

use crate::speak::{ENABLED_BY, field, lines_when_enabled, machine, serve};

/// Bytes that may be on the way, as `[OPT:]` says.
const ROOM: usize = 1024;

#[derive(Default)]
struct Seen {
    answers: usize,
    lines: usize,
    reports: usize,
    /// The most that was on the way.
    most: usize,
    lies: Vec<String>,
}

struct Counting {
    random: Random,
    budget: usize,
    /// How its lines end: one that mixed them could not be told from one that sends empty lines.
    end: &'static str,
    left: usize,
    /// Characters that are still to be written, each with the bytes that it counts for.
    queue: VecDeque<(Vec<u8>, usize)>,
    /// Bytes of each line that was written and has no answer, and of the one that is being written.
    on_the_way: VecDeque<usize>,
    begun: usize,
    /// What each report that is awaited has to say.
    awaited: VecDeque<usize>,
    partial: String,
    seen: Arc<Mutex<Seen>>,
}

impl Counting {
    fn count(&self) -> usize {
        self.on_the_way.iter().sum::<usize>() + self.begun
    }

    fn text(&mut self) -> String {
        let x = self.random.below(40);
        let remark = "x".repeat(self.random.below(180) as usize);
        match self.random.below(12) {
            0 => "$G".into(),
            1 => self.random.pick(&["", "%", "$#", "$N", "$I"]).into(),
            2 => "G4 P0.02".into(),
            3 => self
                .random
                .pick(&["G999", "G1 X", "$77=1", "X99999", "%$)("])
                .into(),
            4 => format!("(90 ° — Ñ {remark})"),
            5 => format!("G0 Y{x} ({remark})"),
            _ => format!("G1 X{x} F6000"),
        }
    }

    fn write_line(&mut self) {
        let (text, end) = (self.text(), self.end);
        if self.left == 0 || self.count() + text.len() + 1 > self.budget {
            return;
        }
        self.left -= 1;
        let one = |c: char| {
            let bytes = c.to_string().into_bytes();
            let count = bytes.len();
            (bytes, count)
        };
        self.queue.extend(text.chars().map(one));
        self.queue.push_back((vec![end.as_bytes()[0]], 1));
        if end.len() == 2 {
            // The line has ended before it.
            self.queue.push_back((vec![b'\n'], 0));
        }
        self.seen.lock().unwrap().lines += 1;
    }

    fn hear(&mut self, line: &str) {
        let mut seen = self.seen.lock().unwrap();
        if line == "ok" || line.starts_with("error:") {
            seen.answers += 1;
            self.on_the_way.pop_front();
        } else if line.starts_with('<') {
            seen.reports += 1;
            let free = field(line, "Bf").unwrap().split(',').nth(1).unwrap();
            let expected = ROOM
                - self
                    .awaited
                    .pop_front()
                    .expect("a report that nobody asked for");
            if free.parse() != Ok(expected) {
                let lie = format!("{line}, and {expected} are free");
                if seen.lies.len() < 3 {
                    seen.lies.push(lie);
                }
            }
        }
    }
}

impl VirtualSender for Counting {
    fn period(&mut self, tick: u64, heard: &str, say: &mut Vec<u8>) -> bool {
        for line in lines_when_enabled(&mut self.partial, tick, heard) {
            self.hear(&line);
        }
        if tick < ENABLED_BY {
            return true;
        }
        if self.queue.is_empty() {
            self.write_line();
        }
        for _ in 0..self.random.below(60) {
            if self.random.below(40) == 0 {
                say.push(b'?');
                let now = self.count();
                self.awaited.push_back(now);
            }
            if self.random.below(200) == 0 {
                say.push(self.random.pick(&[0x85, 0x90, 0x91, 0x92, 0x95, 0x99]));
            }
            let Some((bytes, count)) = self.queue.pop_front() else {
                break;
            };
            self.begun += count;
            if matches!(bytes[..], [b'\n' | b'\r']) && count == 1 {
                self.on_the_way.push_back(std::mem::take(&mut self.begun));
            }
            say.extend(bytes);
        }
        let most = self.count();
        let mut seen = self.seen.lock().unwrap();
        seen.most = seen.most.max(most);
        self.left > 0
            || !self.queue.is_empty()
            || !self.on_the_way.is_empty()
            || !self.awaited.is_empty()
    }
}

#[test]
fn free_bytes_are_told_as_they_are() {
    let machine = machine("mill-3axis.toml", &[]);
    let first = std::env::var("TANDEM_SEED").map_or(0, |seed| seed.parse().unwrap());
    let count = if std::env::var_os("TANDEM_SEED").is_some() {
        1
    } else {
        25
    };
    for seed in first..first + count {
        println!("TANDEM_SEED={seed}");
        let mut random = Random::new(seed);
        let seen = Arc::<Mutex<Seen>>::default();
        let counting = Counting {
            budget: random.pick(&[200, 500, ROOM]),
            end: random.pick(&["\n", "\r", "\r\n"]),
            left: 120,
            random,
            queue: VecDeque::new(),
            on_the_way: VecDeque::new(),
            begun: 0,
            awaited: VecDeque::new(),
            partial: String::new(),
            seen: Arc::clone(&seen),
        };
        serve(&machine, vec![Box::new(counting)], vec![]);
        let seen = seen.lock().unwrap();
        assert_eq!(seen.lies, [""; 0]);
        assert_eq!(seen.answers, seen.lines, "each line has one answer");
        assert!(
            seen.reports > 20 && seen.most > 100,
            "{} {}",
            seen.reports,
            seen.most
        );
    }
}
