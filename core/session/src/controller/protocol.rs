//! One client's conversation with a controller.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Map, Value, json};

use super::disk_work::DiskWork;
use super::dispatcher::{Answered, Dispatcher, RequestId};
use super::request::{Asked, read};
use super::words::word_of;
use crate::grbl::{Sender, Settings};
use crate::operator::{
    Answer, Lease, MAX_OWNERS, News, Problem, Protocol, Rhythm, Role, Service, StatusText, Tokens,
};

/// The protocol's number, in the greeting.
const PROTOCOL: u32 = 2;
/// Longest line, bytes: a program may be in it. Who has not said who it is has less.
const MAX_LINE_BYTES: usize = 8 << 20;
const MAX_STRANGERS_LINE_BYTES: usize = 4096;
/// Requests that wait behind one that waits for a disk, and their bytes.
const MAX_BEHIND: usize = 4096;
const MAX_BEHIND_BYTES: usize = 32 << 20;
/// Requests that have waited and are done in one round.
const MAX_A_ROUND: usize = 8;
/// Lowest and highest rate of a subscription, Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// The service of a controller.
pub struct ControllerService {
    pub dispatcher: Arc<Dispatcher>,
    /// How senders of grbl's protocol are told.
    pub settings: Arc<Settings>,
}

impl Service for ControllerService {
    fn new_client(&self, number: u64, tokens: Option<Arc<Tokens>>) -> Box<dyn Protocol> {
        Box::new(Protocol2 {
            dispatcher: Arc::clone(&self.dispatcher),
            client: number,
            tokens,
            has_place: true,
            role: Role::SetUp,
            subscription: None,
            disk: Some(DiskWork::new(Arc::clone(&self.dispatcher))),
            behind: VecDeque::new(),
            behind_bytes: 0,
            brings: false,
        })
    }

    fn sender(&self, number: u64, place: &str) -> Option<Box<dyn Protocol>> {
        let dispatcher = Arc::clone(&self.dispatcher);
        let settings = Arc::clone(&self.settings);
        let sender = Sender::new(dispatcher, settings, number, place).with_disk_work();
        Some(Box::new(sender.greeted_after(Instant::now())))
    }

    fn set_clients(&self, _count: usize) {}

    fn post(&self) -> Vec<(Option<u64>, String)> {
        self.dispatcher.take_post()
    }

    fn frames(&self) -> Vec<(u64, String)> {
        self.dispatcher.take_frames()
    }

    fn bell(&self) -> Option<&std::os::unix::net::UnixStream> {
        Some(self.dispatcher.bell())
    }
}

/// A client of a controller.
pub struct Protocol2 {
    dispatcher: Arc<Dispatcher>,
    client: u64,
    /// Until it has named one of them.
    tokens: Option<Arc<Tokens>>,
    has_place: bool,
    role: Role,
    subscription: Option<Subscription>,
    /// Waits for disks; none where everything is done in lockstep.
    disk: Option<DiskWork>,
    /// What came behind a request that waits for a disk.
    behind: VecDeque<Waiting>,
    behind_bytes: usize,
    /// It has begun to bring a program.
    brings: bool,
}

/// A request that was granted and waits.
struct Waiting {
    asked: Asked,
    bytes: usize,
    /// So many stops had been asked for when it came.
    stops: u64,
}

/// Status lines that a client has asked for.
struct Subscription {
    rhythm: Rhythm,
    /// These fields alone; all where it names none.
    fields: Vec<String>,
    /// Only what is otherwise than in the line before.
    changes: bool,
    before: Map<String, Value>,
}

impl Protocol2 {
    /// A client that needs no token.
    pub fn known(dispatcher: Arc<Dispatcher>, client: u64) -> Self {
        Self {
            dispatcher,
            client,
            tokens: None,
            has_place: true,
            role: Role::SetUp,
            subscription: None,
            disk: None,
            behind: VecDeque::new(),
            behind_bytes: 0,
            brings: false,
        }
    }

    fn greeting_line(&self) -> String {
        let greeting = json!({ "tandem": {
            "protocol": PROTOCOL,
            "version": env!("CARGO_PKG_VERSION"),
            "machine": self.dispatcher.machine.name,
            "client": self.client,
            "state": self.dispatcher.state().name(),
            "role": self.role.name(),
        } });
        format!("{greeting}\n")
    }

    fn refused(&self, id: Option<u64>, why: &str) -> String {
        let state = self.dispatcher.state().name();
        format!(
            "{}\n",
            json!({ "id": id, "error": { "what": "refused", "why": why, "state": state } })
        )
    }

    fn introduce(&mut self, asked: Option<&Asked>) -> Answer {
        let Some((asked, given)) = asked
            .filter(|asked| asked.request == "token")
            .and_then(|asked| Some((asked, asked.text("token").ok()?)))
        else {
            let why = "the first line over TCP is {\"id\":0,\"request\":\"token\",\"token\":\"…\"}"
                .to_string();
            return self.close(&Problem::refused("the whole line", why));
        };
        match self.tokens.as_ref().and_then(|all| all.role_of(given)) {
            Some(role) if self.has_place => {
                self.tokens = None;
                self.role = role;
                if role != Role::SetUp {
                    // The token is for nobody else to read; what it allows is said by this.
                    let says =
                        json!({ "id": asked.id, "request": "role", "as": role.name() }).to_string();
                    self.dispatcher.note(|all| all.line(self.client, &says));
                }
                Answer {
                    line: self.greeting_line(),
                    last: false,
                }
            }
            Some(_) => self.close(&Problem::crowded(MAX_OWNERS)),
            None => self.close(&Problem::refused(
                "key \"token\"",
                "it is another token".to_string(),
            )),
        }
    }

    /// Whether this client may ask for it now.
    fn permit(&self, asked: &Asked, lease: &Lease) -> Result<(), String> {
        let name = asked.name();
        let needs_lease = word_of(name).is_some_and(|word| word.lease);
        if let Some(word) = word_of(name).filter(|word| word.role > self.role) {
            return Err(format!(
                "{} may only be asked by who may {}; this client may {}",
                asked.request,
                word.role.name(),
                self.role.name()
            ));
        }
        if needs_lease && !lease.is_held_by(self.client) {
            let holder = lease
                .holder()
                .map_or("nobody holds it".to_string(), |client| {
                    format!("{} holds it", lease.name_of(client))
                });
            return Err(format!(
                "it needs the control lease, and {holder}; stops, hold and what only looks need none"
            ));
        }
        Ok(())
    }

    /// Does what is asked for, or sees to it that it is done: behind what waits for a disk, unless it stops the machine.
    fn grant(&mut self, asked: Asked, bytes: usize, lease: &mut Lease, now: Instant) -> Answered {
        if let Err(why) = self.permit(&asked, lease) {
            return Some(Err(why));
        }
        match asked.request.as_str() {
            "lease" => return Some(self.lease(&asked, lease, now)),
            "subscribe" => return Some(self.subscribe(&asked, now)),
            "role" => return Some(self.step_down(&asked, lease)),
            "token" => return Some(Err("no token is asked for here".to_string())),
            _ => {}
        }
        let stops = self.dispatcher.stops();
        if !self.is_busy() || asked.is_stop() {
            return self.begin(asked, stops);
        }
        if self.behind.len() >= MAX_BEHIND || self.behind_bytes + bytes > MAX_BEHIND_BYTES {
            return Some(Err(
                "too many requests wait for their answers: wait for some".to_string(),
            ));
        }
        self.behind_bytes += bytes;
        self.behind.push_back(Waiting {
            asked,
            bytes,
            stops,
        });
        None
    }

    /// Does it here, or has it done where a disk is waited for.
    fn begin(&mut self, asked: Asked, stops: u64) -> Answered {
        let from = RequestId {
            client: self.client,
            id: asked.id,
        };
        self.brings |= asked.request == "upload";
        let disk = self
            .disk
            .as_ref()
            .filter(|_| self.dispatcher.waits_for_disk(&asked));
        let Some(disk) = disk else {
            return self.dispatcher.ask_since(from, &asked, stops);
        };
        let begun = disk.give(move |dispatcher| {
            let defect = Defect(dispatcher, from);
            let answer = dispatcher.ask_since(from, &asked, stops);
            std::mem::forget(defect);
            if let Some(answer) = answer {
                dispatcher.answer(from, answer);
            }
        });
        (!begun).then(|| Err("the computer has no thread that waits for the disk".to_string()))
    }

    fn answer_line(&self, id: u64, answer: Answered) -> String {
        match answer {
            None => String::new(),
            Some(Ok(ok)) => format!("{}\n", json!({ "id": id, "ok": ok })),
            Some(Err(why)) => self.refused(Some(id), &why),
        }
    }

    /// The client may do less from here on: for whoever speaks for somebody who named another token.
    fn step_down(&mut self, asked: &Asked, lease: &mut Lease) -> Result<Value, String> {
        check(asked)?;
        let role = Role::of_name(asked.text("as")?).ok_or("there is no such role")?;
        if role > self.role {
            let now = self.role.name();
            return Err(format!("a role is never widened: this client may {now}"));
        }
        self.role = role;
        if role < Role::Operate {
            lease.release(self.client);
        }
        Ok(json!({ "role": role.name() }))
    }

    fn lease(&self, asked: &Asked, lease: &mut Lease, now: Instant) -> Result<Value, String> {
        check(asked)?;
        match asked.text("how")? {
            "take" => lease.take(self.client, now).map_err(|holder| {
                let holder = lease.name_of(holder);
                format!(
                    "{holder} holds it and is asked whether it is there; \"take-over\" takes it now"
                )
            })?,
            "take-over" => lease.take_over(self.client),
            "release" if lease.release(self.client) => {}
            "release" => return Err("this client does not hold it".to_string()),
            _ => return Err("\"how\" is take, take-over or release".to_string()),
        }
        Ok(json!({ "lease": asked.with["how"] }))
    }

    fn subscribe(&mut self, asked: &Asked, now: Instant) -> Result<Value, String> {
        check(asked)?;
        let rate_hz = asked.number("rate_hz")?;
        if rate_hz != 0.0 && !RATES_HZ.contains(&rate_hz) {
            return Err(format!(
                "{rate_hz} is neither 0 nor within {} to {}",
                RATES_HZ.start(),
                RATES_HZ.end()
            ));
        }
        let fields: Vec<String> = asked
            .texts("fields")
            .iter()
            .map(ToString::to_string)
            .collect();
        let status = self.dispatcher.status();
        if let Some(none) = fields.iter().find(|field| status.get(field).is_none()) {
            return Err(format!("the status has no field \"{none}\""));
        }
        self.subscription = (rate_hz != 0.0).then(|| Subscription {
            rhythm: Rhythm::new(rate_hz, now),
            fields,
            changes: asked.is_on("changes"),
            before: Map::new(),
        });
        Ok(json!({ "rate_hz": rate_hz }))
    }
}

impl Subscription {
    /// Whether less than everything is told.
    fn picks(&self) -> bool {
        self.changes || !self.fields.is_empty()
    }

    /// What of `status` is told now.
    fn pick(&mut self, status: Value) -> Value {
        let Value::Object(mut all) = status else {
            return status;
        };
        if !self.fields.is_empty() {
            all.retain(|name, _| self.fields.contains(name));
        }
        if self.changes {
            let before = std::mem::replace(&mut self.before, all.clone());
            all.retain(|name, value| before.get(name) != Some(value));
        }
        Value::Object(all)
    }
}

impl Protocol for Protocol2 {
    fn client(&self) -> u64 {
        self.client
    }

    fn is_known(&self) -> bool {
        self.tokens.is_none()
    }

    fn set_has_place(&mut self, has_place: bool) {
        self.has_place = has_place;
    }

    fn greeting(&self) -> Option<String> {
        self.is_known().then(|| self.greeting_line())
    }

    fn max_line_bytes(&self) -> usize {
        if self.is_known() {
            MAX_LINE_BYTES
        } else {
            MAX_STRANGERS_LINE_BYTES
        }
    }

    fn line(&mut self, text: &str, lease: &mut Lease, now: Instant) -> Answer {
        lease.hears(self.client);
        let asked = read(text);
        if !self.is_known() {
            return self.introduce(asked.as_ref().ok());
        }
        self.dispatcher.note(|all| all.line(self.client, text));
        let line = match asked {
            Err((id, why)) => format!(
                "{}\n",
                json!({ "id": id, "error": { "what": "malformed line", "why": why } })
            ),
            Ok(asked) => {
                let id = asked.id;
                let steps_down = asked.request == "role";
                let answer = self.grant(asked, text.len(), lease, now);
                let is_done = matches!(answer, Some(Ok(_)));
                let line = self.answer_line(id, answer);
                if steps_down && is_done {
                    line + &self.greeting_line()
                } else {
                    line
                }
            }
        };
        Answer { line, last: false }
    }

    fn is_busy(&self) -> bool {
        !self.behind.is_empty() || self.disk.as_ref().is_some_and(DiskWork::is_busy)
    }

    fn turn(&mut self, _lease: &mut Lease, _now: Instant) -> String {
        let mut said = String::new();
        for _ in 0..MAX_A_ROUND {
            if self.disk.as_ref().is_some_and(DiskWork::is_busy) {
                break;
            }
            let Some(next) = self.behind.pop_front() else {
                break;
            };
            self.behind_bytes -= next.bytes;
            let id = next.asked.id;
            let answer = self.begin(next.asked, next.stops);
            said.push_str(&self.answer_line(id, answer));
        }
        said
    }

    fn close(&self, problem: &Problem) -> Answer {
        let error = json!({ "what": problem.what, "where": problem.place, "why": problem.why });
        Answer {
            line: format!("{}\n", json!({ "id": null, "error": error })),
            last: true,
        }
    }

    fn too_long(&mut self) -> Answer {
        let why = format!("it is longer than {} bytes", self.max_line_bytes());
        self.close(&Problem::malformed("the whole line", &why))
    }

    fn is_due(&mut self, now: Instant) -> bool {
        self.subscription
            .as_mut()
            .is_some_and(|of| of.rhythm.is_due(now))
    }

    fn due(&self) -> Option<Instant> {
        // What has waited is gone on with at once; the end of what waits for a disk rings.
        let waits = self.disk.as_ref().is_some_and(DiskWork::is_busy) || self.behind.is_empty();
        let now = (!waits).then(Instant::now);
        [now, self.subscription.as_ref().map(|of| of.rhythm.due())]
            .into_iter()
            .flatten()
            .min()
    }

    fn telemetry(&mut self, lost: u64, look: &mut StatusText) -> String {
        match &mut self.subscription {
            Some(of) if of.picks() => {
                let picked = of.pick(self.dispatcher.status());
                status_line(lost, &picked.to_string())
            }
            _ => status_line(lost, look.text(|| self.dispatcher.shown())),
        }
    }

    fn ended(&self, _lost: u64) -> String {
        format!(
            "{}\n",
            json!({ "event": "end", "why": "the controller ends" })
        )
    }

    fn frame(&self, lost: u64, frame: &str) -> String {
        frame_line(lost, frame)
    }

    fn tell_of_lease(&self, news: News) -> String {
        let words = match news {
            News::AskedBy(client) => json!({ "event": "lease", "asked_by": client }),
            News::LostTo(client) => json!({ "event": "lease", "lost_to": client }),
        };
        format!("{words}\n")
    }
}

/// Whether the keys of a request are as its table says.
fn check(asked: &Asked) -> Result<(), String> {
    word_of(&asked.request).map_or(Ok(()), |word| word.check(&asked.with))
}

/// A status line that was subscribed to, behind so many that were lost.
fn status_line(lost: u64, status: &str) -> String {
    format!("{{\"event\":\"status\",\"lost\":{lost},\"status\":{status}}}\n")
}

/// A frame of the scope as a line, behind so many that were lost.
pub fn frame_line(lost: u64, frame: &str) -> String {
    format!("{{\"event\":\"scope\",\"lost\":{lost},{frame}\n")
}

impl Drop for Protocol2 {
    fn drop(&mut self) {
        self.dispatcher.scope().forget(self.client);
        self.dispatcher.note(|all| all.leaves(self.client));
        if !self.brings {
            return;
        }
        let client = self.client;
        let forget = move |dispatcher: &Dispatcher| dispatcher.forget_upload(client);
        match &self.disk {
            // Without a thread it stays where it is until the next one of its name.
            Some(disk) => _ = disk.give(forget),
            None => forget(&self.dispatcher),
        }
    }
}

/// Answers a request whose doing has failed in a way that nobody has foreseen.
struct Defect<'a>(&'a Dispatcher, RequestId);

impl Drop for Defect<'_> {
    fn drop(&mut self) {
        let why = "a defect of the controller: the request may have been done in part";
        self.0.answer(self.1, Err(why.to_string()));
    }
}
