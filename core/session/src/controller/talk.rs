//! One client's conversation with a controller.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};

use super::desk::{Desk, From};
use super::request::{Asked, read};
use super::words::{Role, word_of};
use crate::grbl::{Sender, Settings};
use crate::operator::{Answer, House, Lease, MAX_OWNERS, News, Problem, Talk, is_same};

/// The protocol's number, in the greeting.
const PROTOCOL: u32 = 2;
/// Longest line, bytes: a program may be in it. Who has not said who it is has less.
const MAX_LINE_BYTES: usize = 8 << 20;
const MAX_STRANGERS_LINE_BYTES: usize = 4096;
/// Lowest and highest rate of a subscription, Hz.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.01..=100.0;
/// Who lives behind the doors of a controller.
pub struct Office {
    pub desk: Arc<Desk>,
    /// How senders of grbl's protocol are told.
    pub settings: Arc<Settings>,
}

impl House for Office {
    fn newcomer(&self, number: u64, token: Option<String>) -> Box<dyn Talk> {
        Box::new(Protocol2 {
            desk: Arc::clone(&self.desk),
            client: number,
            token,
            has_place: true,
            role: Role::SetUp,
            subscription: None,
        })
    }

    fn sender(&self, number: u64, place: &str) -> Option<Box<dyn Talk>> {
        let (desk, settings) = (Arc::clone(&self.desk), Arc::clone(&self.settings));
        let sender = Sender::new(desk, settings, number, place);
        Some(Box::new(sender.greeted_after(Instant::now())))
    }

    fn set_clients(&self, _count: usize) {}

    fn post(&self) -> Vec<(Option<u64>, String)> {
        self.desk.take_post()
    }

    fn frames(&self) -> Vec<(u64, String)> {
        self.desk.take_frames()
    }

    fn bell(&self) -> Option<&std::os::unix::net::UnixStream> {
        Some(self.desk.bell())
    }
}

/// A client of a controller.
pub struct Protocol2 {
    desk: Arc<Desk>,
    client: u64,
    token: Option<String>,
    has_place: bool,
    role: Role,
    subscription: Option<Subscription>,
}

/// Status lines that a client has asked for.
struct Subscription {
    every: Duration,
    due: Instant,
    /// These fields alone; all where it names none.
    fields: Vec<String>,
    /// Only what is otherwise than in the line before.
    changes: bool,
    before: Map<String, Value>,
}

impl Protocol2 {
    /// A client that needs no token.
    pub fn known(desk: Arc<Desk>, client: u64) -> Self {
        Self {
            desk,
            client,
            token: None,
            has_place: true,
            role: Role::SetUp,
            subscription: None,
        }
    }

    fn greeting_line(&self) -> String {
        let greeting = json!({ "tandem": {
            "protocol": PROTOCOL,
            "version": env!("CARGO_PKG_VERSION"),
            "machine": self.desk.machine.name,
            "client": self.client,
            "state": self.desk.state().name(),
            "role": self.role.name(),
        } });
        format!("{greeting}\n")
    }

    fn refused(&self, id: Option<u64>, why: &str) -> String {
        let state = self.desk.state().name();
        format!(
            "{}\n",
            json!({ "id": id, "error": { "what": "refused", "why": why, "state": state } })
        )
    }

    fn introduce(&mut self, asked: Option<&Asked>) -> Answer {
        let expected = self.token.as_deref().unwrap_or_default();
        let given = asked
            .filter(|asked| asked.request == "token")
            .and_then(|asked| asked.text("token").ok());
        match given {
            Some(given) if is_same(given, expected) && self.has_place => {
                self.token = None;
                Answer {
                    line: self.greeting_line(),
                    last: false,
                }
            }
            Some(given) if is_same(given, expected) => self.close(&Problem::crowded(MAX_OWNERS)),
            Some(_) => self.close(&Problem::refused(
                "key \"token\"",
                "it is another token".to_string(),
            )),
            None => {
                let why =
                    "the first line over TCP is {\"id\":0,\"request\":\"token\",\"token\":\"…\"}"
                        .to_string();
                self.close(&Problem::refused("the whole line", why))
            }
        }
    }

    fn grant(
        &mut self,
        asked: &Asked,
        lease: &mut Lease,
        now: Instant,
    ) -> Option<Result<Value, String>> {
        let is_stop = asked.request == "jog" && asked.with.contains_key("stop");
        let name = if is_stop { "jog-stop" } else { &asked.request };
        let needs_lease = word_of(name).is_some_and(|word| word.lease);
        if let Some(word) = word_of(name).filter(|word| word.role > self.role) {
            return Some(Err(format!(
                "{} may only be asked by who may {}; this client may {}",
                asked.request,
                word.role.name(),
                self.role.name()
            )));
        }
        if needs_lease && !lease.is_held_by(self.client) {
            let holder = lease
                .holder()
                .map_or("nobody holds it".to_string(), |client| {
                    format!("{} holds it", lease.name_of(client))
                });
            return Some(Err(format!(
                "it needs the control lease, and {holder}; stops, hold and what only looks need none"
            )));
        }
        match asked.request.as_str() {
            "lease" => Some(self.lease(asked, lease, now)),
            "subscribe" => Some(self.subscribe(asked, now)),
            "token" => Some(Err("no token is asked for here".to_string())),
            _ => self.desk.ask(
                From {
                    client: self.client,
                    id: asked.id,
                },
                asked,
            ),
        }
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
        let status = self.desk.status();
        if let Some(none) = fields.iter().find(|field| status.get(field).is_none()) {
            return Err(format!("the status has no field \"{none}\""));
        }
        self.subscription = (rate_hz != 0.0).then(|| Subscription {
            every: Duration::from_secs_f64(1.0 / rate_hz),
            due: now,
            fields,
            changes: asked.is_on("changes"),
            before: Map::new(),
        });
        Ok(json!({ "rate_hz": rate_hz }))
    }
}

impl Subscription {
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

impl Talk for Protocol2 {
    fn client(&self) -> u64 {
        self.client
    }

    fn is_known(&self) -> bool {
        self.token.is_none()
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
        let line = match asked {
            Err((id, why)) => format!(
                "{}\n",
                json!({ "id": id, "error": { "what": "malformed line", "why": why } })
            ),
            Ok(asked) => match self.grant(&asked, lease, now) {
                None => String::new(),
                Some(Ok(ok)) => format!("{}\n", json!({ "id": asked.id, "ok": ok })),
                Some(Err(why)) => self.refused(Some(asked.id), &why),
            },
        };
        Answer { line, last: false }
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
        let Some(due) = self.subscription.as_mut().filter(|of| of.due <= now) else {
            return false;
        };
        // After a stall the rate starts anew: what was missed is not made up for.
        due.due = (due.due + due.every).max(now);
        true
    }

    fn due(&self) -> Option<Instant> {
        self.subscription.as_ref().map(|of| of.due)
    }

    fn telemetry(&mut self, lost: u64) -> String {
        let status = self.desk.status();
        let told = match &mut self.subscription {
            Some(of) => of.pick(status),
            None => status,
        };
        format!(
            "{}\n",
            json!({ "event": "status", "lost": lost, "status": told })
        )
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

/// A frame of the scope as a line, behind so many that were lost.
pub fn frame_line(lost: u64, frame: &str) -> String {
    format!("{{\"event\":\"scope\",\"lost\":{lost},{frame}\n")
}

impl Drop for Protocol2 {
    fn drop(&mut self) {
        self.desk.forget(self.client);
    }
}
