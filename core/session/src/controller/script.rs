//! Clients of a controller on the virtual clock: lines of a script by their ticks, and senders in this process that answer to
//! what they hear.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tandem_host::Clock;

use super::dispatcher::Dispatcher;
use super::protocol::Protocol2;
use crate::grbl::{Sender, Settings};
use crate::operator::{Lease, Protocol};

/// Senders that were added by [`super::Controller::add_sender`] have numbers from this one on.
const FIRST_ADDED: u64 = 1 << 32;

/// A sender of grbl's protocol in this process, on the virtual clock.
pub trait VirtualSender: Send {
    /// A fine period follows, and `heard` was said since the one before. Adds what it says to `say`; `false` where it hangs up.
    fn period(&mut self, uptime_periods: u64, heard: &str, say: &mut Vec<u8>) -> bool;
}

struct AddedSender {
    number: u64,
    sender: Box<dyn VirtualSender>,
}

/// A line of a client, before a fine period of the process.
#[derive(Clone, Debug)]
pub struct ScriptLine {
    /// The fine period.
    pub tick: u64,
    /// The client's number.
    pub client: u64,
    /// What it says; empty where it leaves.
    pub line: String,
}

impl ScriptLine {
    /// Reads `{"tick":120,"client":1,"say":{"id":1,"request":"status"}}`; without a client it is number 1. With `"leaves":true` in
    /// place of what it says the client is gone, which is an empty line.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let value: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let tick = value["tick"]
            .as_u64()
            .ok_or("it has no \"tick\", the number of a fine period")?;
        let client = value
            .get("client")
            .map_or(Some(1), Value::as_u64)
            .ok_or("\"client\" is a number")?;
        if value["leaves"] == true {
            let line = String::new();
            return Ok(Self { tick, client, line });
        }
        let say = value
            .get("say")
            .ok_or("it has no \"say\", the line of the client")?;
        let line = say.as_str().map_or_else(|| say.to_string(), str::to_string);
        Ok(Self { tick, client, line })
    }
}

/// Who is told what the controller has to say beside its protocol, and on the virtual clock the protocol.
pub type Tell<'a> = &'a mut dyn FnMut(&str);

/// The clients of a controller on the virtual clock.
pub struct Script {
    pub lines: VecDeque<ScriptLine>,
    clients: BTreeMap<u64, Box<dyn Protocol>>,
    senders: Vec<AddedSender>,
    /// What senders have heard since they were asked last.
    heard: BTreeMap<u64, String>,
    lease: Lease,
    settings: Arc<Settings>,
    began: Instant,
}

impl Script {
    pub fn new(lines: Vec<ScriptLine>) -> Self {
        Self {
            lines: lines.into(),
            clients: BTreeMap::new(),
            senders: vec![],
            heard: BTreeMap::new(),
            lease: Lease::default(),
            settings: Arc::default(),
            began: Instant::now(),
        }
    }

    /// Whether nobody has anything left to say.
    pub fn is_over(&self) -> bool {
        self.lines.is_empty() && self.senders.is_empty()
    }

    /// Adds a sender, which speaks from the next fine period on.
    pub fn add_sender(&mut self, dispatcher: &Arc<Dispatcher>, sender: Box<dyn VirtualSender>) {
        let number = FIRST_ADDED + self.senders.len() as u64;
        self.client(dispatcher, number, true);
        self.senders.push(AddedSender { number, sender });
    }

    fn client(
        &mut self,
        dispatcher: &Arc<Dispatcher>,
        number: u64,
        sends: bool,
    ) -> &mut Box<dyn Protocol> {
        let lease = &mut self.lease;
        let settings = &self.settings;
        self.clients.entry(number).or_insert_with(|| {
            let dispatcher = Arc::clone(dispatcher);
            let protocol: Box<dyn Protocol> = if sends {
                let place = "the virtual clock";
                Box::new(Sender::new(dispatcher, Arc::clone(settings), number, place).greeted())
            } else {
                Box::new(Protocol2::known(dispatcher, number))
            };
            lease.introduce(number, protocol.name());
            protocol
        })
    }

    /// Machine time as wall time, so that what lasts for a while lasts as long in every replay.
    fn now(&self, dispatcher: &Dispatcher, tick: u64) -> Instant {
        self.began + Duration::from_secs_f64(tick as f64 * dispatcher.machine.fine_period_s)
    }

    /// What is due before the fine period `tick`.
    pub fn say_due(&mut self, dispatcher: &Arc<Dispatcher>, tick: u64, tell: Tell<'_>) {
        let now = self.now(dispatcher, tick);
        while self.lines.front().is_some_and(|line| line.tick <= tick) {
            let Some(ScriptLine { client, line, .. }) = self.lines.pop_front() else {
                return;
            };
            if line.is_empty() {
                self.lease.release(client);
                self.clients.remove(&client);
                continue;
            }
            let bytes = bytes_of(&line);
            self.client(dispatcher, client, bytes.is_some());
            let Some(protocol) = self.clients.get_mut(&client) else {
                return;
            };
            let answer = match bytes {
                Some(bytes) => protocol.bytes(&bytes, &mut self.lease, now),
                None => protocol.line(&line, &mut self.lease, now),
            };
            self.print(tick, Some(client), &answer.line, tell);
        }
        self.ask_senders(tick, now, tell);
        let raw: Vec<u64> = self
            .clients
            .iter()
            .filter(|(_, protocol)| protocol.is_raw())
            .map(|(number, _)| *number)
            .collect();
        for number in raw {
            let Some(protocol) = self.clients.get_mut(&number) else {
                continue;
            };
            let said = protocol.turn(&mut self.lease, now);
            self.print(tick, Some(number), &said, tell);
        }
    }

    fn ask_senders(&mut self, tick: u64, now: Instant, tell: Tell<'_>) {
        let mut said = vec![];
        let mut gone = vec![];
        for AddedSender { number, sender } in &mut self.senders {
            let heard = self.heard.remove(number).unwrap_or_default();
            let mut bytes = vec![];
            let stays = sender.period(tick, &heard, &mut bytes);
            said.push((*number, bytes));
            if !stays {
                gone.push(*number);
            }
        }
        for (number, bytes) in said {
            if let Some(protocol) = self.clients.get_mut(&number).filter(|_| !bytes.is_empty()) {
                let answer = protocol.bytes(&bytes, &mut self.lease, now);
                self.print(tick, Some(number), &answer.line, tell);
            }
        }
        for number in gone {
            self.lease.release(number);
            self.clients.remove(&number);
            self.senders.retain(|one| one.number != number);
        }
    }

    fn print(&mut self, tick: u64, client: Option<u64>, line: &str, tell: Tell<'_>) {
        let Some(number) = client else {
            print(tick, client, line, tell);
            return;
        };
        if line.is_empty() {
            return;
        }
        if number >= FIRST_ADDED {
            self.heard.entry(number).or_default().push_str(line);
        } else if self
            .clients
            .get(&number)
            .is_some_and(|protocol| protocol.is_raw())
        {
            tell(&json!({ "tick": tick, "client": number, "told": { "grbl": line } }).to_string());
        } else {
            print(tick, client, line, tell);
        }
    }

    /// Hands out lines that no client has asked for.
    pub fn flush(&mut self, dispatcher: &Dispatcher, tick: u64, clock: Clock, tell: Tell<'_>) {
        if clock != Clock::Virtual {
            return;
        }
        for (client, line) in dispatcher.take_post() {
            let for_it = |number: &u64| client.is_none_or(|client| client == *number);
            let raw: Vec<u64> = self
                .clients
                .iter()
                .filter(|(number, protocol)| protocol.is_raw() && for_it(number))
                .map(|(number, _)| *number)
                .collect();
            for number in &raw {
                if let Some(protocol) = self.clients.get_mut(number) {
                    let told = protocol.told(&line);
                    self.print(tick, Some(*number), &told, tell);
                }
            }
            if client.is_none() || raw.is_empty() {
                print(tick, client, &line, tell);
            }
        }
        for (client, frame) in dispatcher.take_frames() {
            print(
                tick,
                Some(client),
                &super::protocol::frame_line(0, &frame),
                tell,
            );
        }
    }
}

fn print(tick: u64, client: Option<u64>, line: &str, tell: Tell<'_>) {
    for line in line.lines() {
        if let Ok(told) = serde_json::from_str::<Value>(line) {
            tell(&json!({ "tick": tick, "client": client, "told": told }).to_string());
        }
    }
}

/// The bytes of a sender, where a line has the form `{"grbl":"G1 X1\n"}`: a character a byte.
fn bytes_of(line: &str) -> Option<Vec<u8>> {
    let value: Value = serde_json::from_str(line).ok()?;
    let text = value.get("grbl")?.as_str()?;
    text.chars()
        .map(|c| u8::try_from(u32::from(c)).ok())
        .collect()
}
