//! One sender: its lines in order, each with its answer.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use tandem_gcode::Interpreter;

use super::RX_BYTES;
use super::errors::ErrorNumber;
use super::line::{Asks, check_jog, read};
use super::report::{self, Free, Reports, Said};
use super::scan::{Heard, Scanner, SentLine};
use super::settings::Settings;
use crate::controller::{
    Asked, ControllerState, DiskWork, Dispatcher, Mode, NotTaken, PLACES, RequestId, TakenLine,
};
use crate::judge::Refusal;
use crate::operator::{Answer, Lease, News, Problem, Protocol, StatusText};

/// Bytes that are kept of a sender that does not wait for answers; more of them wait with the system.
const MAX_KEPT_BYTES: usize = 64 * 1024;
/// How long a machine that stands, and has nothing more to do for a sender, is kept for it.
const KEPT_FOR: Duration = Duration::from_secs(2);
/// How soon lines that wait for a place are looked at again.
const LOOK_AGAIN: Duration = Duration::from_millis(4);
/// How long after somebody has opened a terminal it is greeted: programs throw away what comes while they set it up.
const GREET_AFTER: Duration = Duration::from_millis(300);

/// A line that calls a subroutine: its file is read by a thread that may wait for it.
pub(super) enum Called {
    /// It is to be driven.
    Driven(RequestId, SentLine, Later<Result<TakenLine, NotTaken>>),
    /// It is checked.
    Checked(Later<Result<Interpreter, Refusal>>),
}

/// What is there once a thread is done.
type Later<T> = Arc<Mutex<Option<T>>>;

fn take<T>(later: &Later<T>) -> Option<T> {
    later.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// What a line waits for that is answered later.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pending {
    /// It is driven.
    Driven { id: u64, probes: bool, ends: bool },
    /// The machine is homed.
    Homed,
    /// A request is answered.
    Answered { id: u64 },
}

/// A sender of grbl's protocol.
pub struct Sender {
    pub(super) dispatcher: Arc<Dispatcher>,
    pub(super) client: u64,
    place: String,
    settings: Arc<Settings>,
    scanner: Scanner,
    lines: VecDeque<SentLine>,
    /// Bytes of lines without an answer, and of the one among them that is answered when it is done.
    bytes: usize,
    pending_bytes: usize,
    next_id: u64,
    pub(super) pending: Option<Pending>,
    /// Waits for disks; none where everything is done in lockstep.
    disk: Option<DiskWork>,
    pub(super) called: Option<Called>,
    pub(super) said: Said,
    /// The lines of check mode, as far as they have come.
    pub(super) check: Option<Interpreter>,
    pub(super) resetting: bool,
    pub(super) fault: Option<String>,
    pub(super) last_mode: Mode,
    pub(super) reports: Reports,
    pub(super) greet_at: Option<Instant>,
    /// Since when the machine has had nothing to do for it.
    idle_since: Option<Instant>,
    out: String,
}

impl Sender {
    /// Somebody has come in at `place`.
    pub fn new(
        dispatcher: Arc<Dispatcher>,
        settings: Arc<Settings>,
        client: u64,
        place: &str,
    ) -> Self {
        let fault = dispatcher.fault_words();
        Self {
            dispatcher,
            client,
            place: place.to_string(),
            settings,
            scanner: Scanner::default(),
            lines: VecDeque::new(),
            bytes: 0,
            pending_bytes: 0,
            next_id: 1,
            pending: None,
            disk: None,
            called: None,
            said: Said::default(),
            check: None,
            resetting: false,
            fault,
            last_mode: Mode::Idle,
            reports: Reports::default(),
            greet_at: None,
            idle_since: None,
            out: String::new(),
        }
    }

    /// One for which threads of its own wait for disks.
    pub fn with_disk_work(mut self) -> Self {
        self.disk = Some(DiskWork::new(Arc::clone(&self.dispatcher)));
        self
    }

    /// One that is greeted at once, as senders over a network are.
    pub fn greeted(mut self) -> Self {
        self.greet();
        self
    }

    /// One that is greeted a moment later.
    pub fn greeted_after(mut self, now: Instant) -> Self {
        self.greet_at = Some(now + GREET_AFTER);
        self
    }

    pub(super) fn say(&mut self, text: &str) {
        self.out.push_str(text);
    }

    /// Our words, in one line that senders show.
    pub(super) fn message(&mut self, words: &str) {
        let mut line = String::from("[MSG:");
        for c in words.chars() {
            line.push(match c {
                '[' => '(',
                ']' => ')',
                c if c.is_control() => ' ',
                c => c,
            });
        }
        line.push_str("]\r\n");
        self.say(&line);
    }

    fn refuse(&mut self, number: ErrorNumber, words: &str) {
        self.message(words);
        self.say(&format!("error:{}\r\n", number.0));
    }

    pub(super) fn status(&mut self) {
        let waiting = self.dispatcher.with_lines(|lines| lines.count_waiting());
        let free = Free {
            lines: PLACES - waiting.min(PLACES),
            bytes: RX_BYTES.saturating_sub(self.bytes + self.scanner.bytes()),
        };
        let report = self
            .reports
            .next(&self.dispatcher, &self.settings, self.said, free);
        self.say(&report);
    }

    /// Whether the lease is ours; where another client holds it, that is said.
    pub(super) fn may(&mut self, lease: &mut Lease, now: Instant) -> bool {
        match lease.take(self.client, now) {
            Ok(()) => {
                lease.hears(self.client);
                true
            }
            Err(holder) => {
                let who = lease.name_of(holder);
                self.message(&format!("{who} holds the machine"));
                false
            }
        }
    }

    /// Lines that have come are never looked at.
    pub(super) fn forget_lines(&mut self) {
        self.lines.clear();
        self.bytes = 0;
        self.pending_bytes = 0;
        self.pending = None;
        // What a thread still judges is then taken by nobody.
        self.called = None;
    }

    /// Jogs that have come are passed over; each has an answer.
    pub(super) fn forget_jogs(&mut self) {
        for line in &mut self.lines {
            if matches!(read(&line.text), Asks::Jog(_)) {
                line.text.clear();
            }
        }
    }

    fn hear(&mut self, byte: u8, lease: &mut Lease, now: Instant) {
        match self.scanner.push(byte) {
            Some(Heard::RealTime(what)) => self.real_time(what, lease, now),
            Some(Heard::Line(line)) => {
                self.bytes += line.bytes;
                self.lines.push_back(line);
            }
            None => {}
        }
    }

    /// Answers lines as far as that can be done now.
    fn answer_lines(&mut self, lease: &mut Lease, now: Instant) {
        self.settle_call();
        while self.pending.is_none() && self.called.is_none() && !self.resetting && !self.said.holds
        {
            let Some(line) = self.lines.pop_front() else {
                return;
            };
            if self.answer(&line, lease, now) {
                self.pending_bytes = line.bytes;
                self.free_answered();
            } else {
                self.lines.push_front(line);
                return;
            }
        }
    }

    /// Answers one line; `false` where that cannot be done yet.
    fn answer(&mut self, line: &SentLine, lease: &mut Lease, now: Instant) -> bool {
        if line.too_long {
            self.refuse(
                ErrorNumber::TOO_LONG,
                &format!("a line has at most {} bytes", RX_BYTES - 1),
            );
            return true;
        }
        match read(&line.text) {
            Asks::Nothing | Asks::SetStartLine("") => self.say("ok\r\n"),
            Asks::Program(text) if self.check.is_some() => self.check_line(text),
            Asks::Program(text) => return self.drive(text, line, lease, now),
            Asks::Jog(words) => return self.jog(words, lease, now),
            Asks::Help => {
                self.say("[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]\r\nok\r\n");
            }
            Asks::Settings => {
                let list = self.settings.list(&self.dispatcher.machine);
                self.say(&list);
                self.say("ok\r\n");
            }
            Asks::Set(number, value) => {
                match self.settings.set(&self.dispatcher.machine, number, value) {
                    Ok(()) => {
                        self.reports.renew();
                        self.say("ok\r\n");
                    }
                    Err(why) => self.refuse(ErrorNumber::STATEMENT, &why),
                }
            }
            Asks::Offsets => {
                let offsets = report::offsets(&self.dispatcher, self.settings.inches());
                self.say(&offsets);
                self.say("ok\r\n");
            }
            Asks::Modes => {
                let inches = self.settings.inches();
                let modes = match &self.check {
                    Some(check) => report::modes(check, inches),
                    None => self
                        .dispatcher
                        .with_lines(|lines| report::modes(lines.ahead(), inches)),
                };
                self.say(&modes);
                self.say("ok\r\n");
            }
            Asks::Build => {
                let build = report::build(&self.dispatcher.machine, PLACES, RX_BYTES);
                self.say(&build);
                self.say("ok\r\n");
            }
            Asks::StartLines => self.say("$N0=\r\n$N1=\r\nok\r\n"),
            Asks::SetStartLine(_) => {
                self.refuse(ErrorNumber::STATEMENT, "no lines are run at the start");
            }
            Asks::Check => self.switch_check(),
            Asks::Unlock => return self.unlock(lease, now),
            Asks::Home(axis) => return self.home(axis, lease, now),
            Asks::Sleep => return self.sleep(lease, now),
            Asks::Unknown => self.refuse(
                ErrorNumber::STATEMENT,
                &format!("{} is no command here", line.text.trim()),
            ),
        }
        true
    }

    fn id(&mut self) -> RequestId {
        self.next_id += 1;
        RequestId {
            client: self.client,
            id: self.next_id,
        }
    }

    fn drive(&mut self, text: &str, line: &SentLine, lease: &mut Lease, now: Instant) -> bool {
        if !self.may(lease, now) {
            self.say(&format!("error:{}\r\n", ErrorNumber::LOCKED.0));
            return true;
        }
        let from = self.id();
        self.idle_since = None;
        if let Some(disk) = self.disk.as_ref().filter(|_| self.dispatcher.calls(text)) {
            let later = Later::default();
            let text = text.to_string();
            let stops = self.dispatcher.stops();
            let found = Arc::clone(&later);
            let begun = disk.give(move |dispatcher| {
                // A reset of the sender leaves it to this thread alone.
                let is_wanted = || Arc::strong_count(&found) > 1;
                let taken = dispatcher.take_call(from, &text, stops, is_wanted);
                *found.lock().unwrap_or_else(PoisonError::into_inner) = Some(taken);
            });
            if begun {
                self.called = Some(Called::Driven(from, line.clone(), later));
            }
            // Without a thread it is said again.
            return begun;
        }
        let taken = self.dispatcher.take_line(from, text);
        self.settle_taken(from, taken)
    }

    /// `false` where the line is to be said again.
    fn settle_taken(&mut self, from: RequestId, taken: Result<TakenLine, NotTaken>) -> bool {
        match taken {
            Ok(TakenLine { rests: false, .. }) => self.say("ok\r\n"),
            Ok(TakenLine {
                asks_probe, ends, ..
            }) => {
                self.pending = Some(Pending::Driven {
                    id: from.id,
                    probes: asks_probe,
                    ends,
                });
            }
            Err(why) => return self.not_taken(why),
        }
        true
    }

    /// What a thread has found.
    fn settle_call(&mut self) {
        // Looked at first: what is found lies there before the thread has ended.
        let reads = self.disk.as_ref().is_some_and(DiskWork::is_busy);
        match self.called.take() {
            Some(Called::Driven(from, line, later)) => match take(&later) {
                Some(taken) => {
                    if !self.settle_taken(from, taken) {
                        // It counts among those that wait.
                        self.pending_bytes = 0;
                        self.lines.push_front(line);
                    }
                }
                None if reads => self.called = Some(Called::Driven(from, line, later)),
                None => self.refuse(ErrorNumber::STATEMENT, "a defect of the controller"),
            },
            Some(Called::Checked(later)) => match take(&later) {
                Some(checked) => self.settle_check(checked),
                None if reads => self.called = Some(Called::Checked(later)),
                None => self.refuse(ErrorNumber::STATEMENT, "a defect of the controller"),
            },
            None => {}
        }
        self.free_answered();
    }

    /// The bytes of a line are free once it has its answer.
    fn free_answered(&mut self) {
        if self.pending.is_none() && self.called.is_none() {
            self.bytes -= std::mem::take(&mut self.pending_bytes);
        }
    }

    fn jog(&mut self, words: &str, lease: &mut Lease, now: Instant) -> bool {
        if self.check.is_some() {
            self.refuse(ErrorNumber::NOT_IDLE, "nothing moves in check mode");
            return true;
        }
        match check_jog(words) {
            Ok(()) => {}
            Err(Some(why)) => {
                self.refuse(ErrorNumber::JOG, &why);
                return true;
            }
            Err(None) => {
                self.refuse(ErrorNumber::NO_FEED, "a jog needs its feed, F");
                return true;
            }
        }
        if !self.may(lease, now) {
            self.say(&format!("error:{}\r\n", ErrorNumber::LOCKED.0));
            return true;
        }
        let needs_unlock =
            self.dispatcher.state() == ControllerState::HomingNeeded && !self.said.unlocked;
        if needs_unlock {
            self.refuse(ErrorNumber::LOCKED, "'$H'|'$X' to unlock");
            return true;
        }
        let from = self.id();
        self.idle_since = None;
        match self.dispatcher.take_jog(from, words) {
            Ok(_) => self.say("ok\r\n"),
            Err(why) => return self.not_taken(why),
        }
        true
    }

    /// `false` where the line is to be said again.
    fn not_taken(&mut self, why: NotTaken) -> bool {
        match why {
            NotTaken::NotYet => return false,
            NotTaken::Locked(why) => {
                let fault = self.dispatcher.fault_words();
                self.refuse(ErrorNumber::LOCKED, fault.as_ref().unwrap_or(&why));
            }
            NotTaken::NotIdle => self.refuse(
                ErrorNumber::NOT_IDLE,
                "lines are driven: jogs are for a machine that stands",
            ),
            NotTaken::Refused(why) => self.refuse(ErrorNumber::of(&why), &why.cause),
        }
        true
    }

    fn check_line(&mut self, text: &str) {
        let Some(check) = self.check.clone() else {
            return;
        };
        let Some(disk) = self.disk.as_ref().filter(|_| self.dispatcher.calls(text)) else {
            let checked = self.dispatcher.with_lines(|l| l.check(&check, text));
            return self.settle_check(checked);
        };
        let (later, text) = (Later::default(), text.to_string());
        let found = Arc::clone(&later);
        let begun = disk.give(move |dispatcher| {
            let checked = dispatcher.check_call(&check, &text);
            *found.lock().unwrap_or_else(PoisonError::into_inner) = Some(checked);
        });
        if begun {
            self.called = Some(Called::Checked(later));
        } else {
            let why = "the computer has no thread that reads the file";
            self.refuse(ErrorNumber::STATEMENT, why);
        }
    }

    fn settle_check(&mut self, checked: Result<Interpreter, Refusal>) {
        match checked {
            Ok(behind) => {
                self.check = Some(behind);
                self.say("ok\r\n");
            }
            Err(why) => self.refuse(ErrorNumber::of(&why), &why.cause),
        }
    }

    /// Check mode begins where the machine stands, and ends with a reset, as grbl has it.
    fn switch_check(&mut self) {
        if self.check.take().is_some() {
            self.said.checks = false;
            self.message("Disabled");
            self.say("ok\r\n");
            self.resetting = true;
        } else if self.dispatcher.state() == ControllerState::Ready && self.dispatcher.is_still() {
            self.check = Some(self.dispatcher.standing());
            self.said.checks = true;
            self.message("Enabled");
            self.say("ok\r\n");
        } else {
            self.refuse(
                ErrorNumber::NOT_IDLE,
                "check mode begins where the machine stands and is ready",
            );
        }
    }

    fn unlock(&mut self, lease: &mut Lease, now: Instant) -> bool {
        let request = match self.dispatcher.state() {
            ControllerState::EmergencyStop | ControllerState::Fault => "reset",
            ControllerState::Disabled => "enable",
            ControllerState::Stopping => return false,
            ControllerState::HomingNeeded => {
                self.said.unlocked = true;
                self.message("Caution: Unlocked");
                self.message("jogs are taken; lines wait for '$H'");
                self.say("ok\r\n");
                return true;
            }
            _ => {
                self.said.unlocked = true;
                self.say("ok\r\n");
                return true;
            }
        };
        self.said.asleep = false;
        self.ask(request, Map::new(), lease, now, |id| Pending::Answered {
            id,
        })
    }

    fn home(&mut self, axis: Option<char>, lease: &mut Lease, now: Instant) -> bool {
        if self.dispatcher.machine.homing.is_empty() {
            self.refuse(
                ErrorNumber::HOMING_OFF,
                "this machine needs no homing: its drives know where they stand",
            );
            return true;
        }
        if self.dispatcher.state() == ControllerState::Stopping {
            return false;
        }
        if !self.dispatcher.is_still() {
            self.refuse(
                ErrorNumber::NOT_IDLE,
                "homing begins where the machine stands",
            );
            return true;
        }
        let mut with = Map::new();
        if let Some(axis) = axis {
            with.insert("axis".to_string(), json!(axis.to_string()));
        }
        self.ask("home", with, lease, now, |_| Pending::Homed)
    }

    fn sleep(&mut self, lease: &mut Lease, now: Instant) -> bool {
        if !self.dispatcher.is_still() {
            self.refuse(
                ErrorNumber::NOT_IDLE,
                "sleep begins where the machine stands",
            );
            return true;
        }
        self.said.asleep = true;
        self.ask("disable", Map::new(), lease, now, |id| Pending::Answered {
            id,
        })
    }

    fn ask(
        &mut self,
        request: &str,
        with: Map<String, Value>,
        lease: &mut Lease,
        now: Instant,
        pending: impl Fn(u64) -> Pending,
    ) -> bool {
        if !self.may(lease, now) {
            self.say(&format!("error:{}\r\n", ErrorNumber::LOCKED.0));
            return true;
        }
        let from = self.id();
        let asked = Asked {
            id: from.id,
            request: request.to_string(),
            with,
        };
        match self.dispatcher.ask(from, &asked) {
            None => self.pending = Some(pending(from.id)),
            Some(Ok(_)) => self.say("ok\r\n"),
            Some(Err(why)) => self.refuse(ErrorNumber::LOCKED, &why),
        }
        true
    }

    pub(super) fn tell_probe(&mut self) {
        let Some(probed) = self.dispatcher.with_lines(|lines| lines.probed()) else {
            return;
        };
        let place = report::vector(
            &self.dispatcher.machine.axes,
            &probed.position,
            self.settings.inches(),
        );
        let touched = u8::from(probed.touched);
        self.say(&format!("[PRB:{place}:{touched}]\r\n"));
    }

    /// What was waited for has come, or will not.
    fn settle(&mut self, done: Result<(), &str>) {
        let Some(pending) = self.pending.take() else {
            return;
        };
        self.bytes -= std::mem::take(&mut self.pending_bytes);
        match (pending, done) {
            (Pending::Driven { probes, ends, .. }, Ok(())) => {
                if probes {
                    self.tell_probe();
                }
                if ends {
                    self.message("Pgm End");
                }
                self.say("ok\r\n");
            }
            (Pending::Homed, Ok(())) => self.say("ok\r\n"),
            (Pending::Answered { .. }, Ok(())) => {
                self.message(if self.said.asleep {
                    "Sleeping"
                } else {
                    "Caution: Unlocked"
                });
                self.say("ok\r\n");
            }
            (_, Err(why)) => {
                self.pending = Some(pending);
                self.look_for_fault();
                self.pending = None;
                self.refuse(ErrorNumber::LOCKED, why);
            }
        }
    }

    /// Something has changed.
    fn hear_news(&mut self, news: &Value) {
        let id = news["id"].as_u64();
        let is_ours = |of: u64| id == Some(of);
        match (news["event"].as_str(), self.pending) {
            (Some("driven"), Some(Pending::Driven { id, .. })) if is_ours(id) => {
                self.settle(Ok(()));
            }
            (Some("not-driven"), Some(Pending::Driven { id, .. })) if is_ours(id) => {
                self.settle(Err("the line was not driven to its end"));
            }
            (Some("job"), Some(Pending::Homed)) if news["job"]["job"] == "home" => {
                if news["job"]["outcome"] == "done" {
                    self.settle(Ok(()));
                } else {
                    self.settle(Err("homing did not come to its end"));
                }
            }
            (Some("waits"), _) => {
                let line = &news["line"];
                self.message(&format!("line {line} waits for the operator: ~ goes on"));
            }
            (Some("refused"), _) => {
                if let Some(why) = news["why"].as_str() {
                    self.message(why);
                }
            }
            (None, Some(Pending::Answered { id })) if is_ours(id) => {
                self.hear_answer(news);
            }
            (None, Some(Pending::Homed)) if news.get("error").is_some() => self.hear_answer(news),
            _ => {}
        }
    }

    fn hear_answer(&mut self, news: &Value) {
        match news["error"]["why"].as_str() {
            Some(why) => self.settle(Err(why)),
            None => self.settle(Ok(())),
        }
    }

    /// The machine is let go of where it has had nothing to do for a while.
    fn let_go(&mut self, lease: &mut Lease, now: Instant) {
        let waits = self.pending.is_some() || self.called.is_some();
        let busy = !self.lines.is_empty() || waits || !self.dispatcher.is_still();
        if busy || !lease.is_held_by(self.client) {
            self.idle_since = None;
        } else if now.duration_since(*self.idle_since.get_or_insert(now)) >= KEPT_FOR {
            lease.release(self.client);
            self.idle_since = None;
        }
    }

    fn take_out(&mut self) -> String {
        std::mem::take(&mut self.out)
    }
}

impl Protocol for Sender {
    fn client(&self) -> u64 {
        self.client
    }

    fn name(&self) -> String {
        format!("the sender at {} (client {})", self.place, self.client)
    }

    fn is_known(&self) -> bool {
        true
    }

    fn set_has_place(&mut self, _has_place: bool) {}

    fn is_raw(&self) -> bool {
        true
    }

    fn takes_bytes(&self) -> bool {
        self.bytes < MAX_KEPT_BYTES
    }

    fn bytes(&mut self, bytes: &[u8], lease: &mut Lease, now: Instant) -> Answer {
        self.dispatcher.note(|all| all.bytes(self.client, bytes));
        for byte in bytes {
            self.hear(*byte, lease, now);
        }
        self.answer_lines(lease, now);
        Answer {
            line: self.take_out(),
            last: false,
        }
    }

    fn turn(&mut self, lease: &mut Lease, now: Instant) -> String {
        if self.greet_at.is_some_and(|at| at <= now) {
            self.greet_at = None;
            self.greet();
        }
        self.look_for_fault();
        let mode = self.dispatcher.mode();
        if mode != Mode::Idle {
            self.last_mode = mode;
        }
        self.end_reset(lease);
        self.answer_lines(lease, now);
        self.let_go(lease, now);
        self.take_out()
    }

    fn told(&mut self, line: &str) -> String {
        if let Ok(news) = serde_json::from_str::<Value>(line) {
            self.hear_news(&news);
        }
        self.take_out()
    }

    fn max_line_bytes(&self) -> usize {
        RX_BYTES
    }

    fn line(&mut self, text: &str, lease: &mut Lease, now: Instant) -> Answer {
        let line = format!("{text}\n");
        self.bytes(line.as_bytes(), lease, now)
    }

    fn close(&self, problem: &Problem) -> Answer {
        Answer {
            line: format!("[MSG:{}]\r\n", problem.why),
            last: true,
        }
    }

    fn too_long(&mut self) -> Answer {
        Answer::default()
    }

    fn is_due(&mut self, _now: Instant) -> bool {
        false
    }

    fn due(&self) -> Option<Instant> {
        let waits = !self.lines.is_empty() || self.resetting || self.called.is_some();
        let soon = waits.then(|| Instant::now() + LOOK_AGAIN);
        [soon, self.greet_at].into_iter().flatten().min()
    }

    fn telemetry(&mut self, _lost: u64, _look: &mut StatusText) -> String {
        String::new()
    }

    fn ended(&self, _lost: u64) -> String {
        "[MSG:the controller ends]\r\n".to_string()
    }

    fn tell_of_lease(&self, news: News) -> String {
        match news {
            News::AskedBy(client) => format!("[MSG:client {client} asks for the machine]\r\n"),
            News::LostTo(client) => format!("[MSG:client {client} has taken the machine over]\r\n"),
        }
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        self.dispatcher.note(|all| all.leaves(self.client));
    }
}
