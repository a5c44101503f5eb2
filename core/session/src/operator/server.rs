//! The thread that serves clients: one for all of them, of ordinary priority.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::client::{Client, ClientKind};
use super::hub::OperatorHub;
use super::lease::Lease;
use super::listen::{Listen, Listener};
use super::places::{crowded, has_place, make_place_for_stranger};
use super::service::{RunService, Service, StatusText};

/// Most clients that are let in at a listener before those who are there are served again.
const MAX_COMERS: usize = 64;
/// How long a listener at which nobody can be let in is not looked at.
const DOOR_REST: Duration = Duration::from_millis(10);
/// Longest sleep: how soon the end of the run is seen.
const LONGEST_SLEEP: Duration = Duration::from_millis(50);
/// How long clients have to read their last line when the run is over.
const FAREWELL: Duration = Duration::from_secs(1);
/// Most clients that are shown the machine in a round: who asks waits behind so many lines and no more.
const MAX_SHOWN: usize = 4;
/// Stack of the thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 256 * 1024;

/// Serves clients while it lives. Dropping it tells them that the run is over, and closes.
#[derive(Debug)]
pub struct Server {
    over: Arc<AtomicBool>,
    handle: Option<JoinHandle<()>>,
    /// The TCP address, with the port that the system chose for port 0.
    pub address: Option<SocketAddr>,
    /// The TCP address of the listener for senders of grbl's protocol, likewise.
    pub grbl_address: Option<SocketAddr>,
}

impl Server {
    /// Opens every listener of `listen` and starts the thread. Host, before the run.
    ///
    /// # Errors
    /// The place with the cause: it is taken, or not allowed.
    pub fn start(hub: Arc<OperatorHub>, listen: &Listen) -> Result<Self, String> {
        Self::of(Arc::new(RunService(hub)), listen)
    }

    /// The same for any service.
    ///
    /// # Errors
    /// The place with the cause: it is taken, or not allowed.
    pub(crate) fn of(service: Arc<dyn Service>, listen: &Listen) -> Result<Self, String> {
        let listeners = Listener::open(listen)?;
        let address = listeners.iter().find_map(Listener::address);
        let grbl_address = listeners.iter().find_map(Listener::grbl_address);
        let over = Arc::new(AtomicBool::new(false));
        let mut server = ServerLoop::new(service, listeners);
        let seen = Arc::clone(&over);
        let builder = thread::Builder::new()
            .name("tandem-operator".to_string())
            .stack_size(STACK_BYTES);
        let handle = builder.spawn(move || server.serve(&seen));
        let handle =
            handle.map_err(|e| format!("the thread for operators cannot be started: {e}"))?;
        Ok(Self {
            over,
            handle: Some(handle),
            address,
            grbl_address,
        })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(handle) = self.handle.take() {
            // How it ended does not matter any more: the run is over.
            let _ = handle.join();
        }
    }
}

/// Everybody who is there.
struct ServerLoop {
    service: Arc<dyn Service>,
    listeners: Vec<Listener>,
    /// Until when nobody is let in at each listener: the system refuses to.
    shut_until: Vec<Option<Instant>>,
    /// Whether nobody waits at each listener, by the system's word.
    nobody_waits: Vec<bool>,
    /// Whether the bell has not rung, likewise.
    bell_is_still: bool,
    clients: Vec<Client>,
    lease: Lease,
    /// Clients that ever came.
    connections: u64,
    /// The place among the clients at which the next status line that is due is looked for.
    next_shown: usize,
}

impl ServerLoop {
    fn new(service: Arc<dyn Service>, listeners: Vec<Listener>) -> Self {
        Self {
            service,
            shut_until: vec![None; listeners.len()],
            nobody_waits: vec![false; listeners.len()],
            bell_is_still: false,
            listeners,
            clients: vec![],
            lease: Lease::default(),
            connections: 0,
            next_shown: 0,
        }
    }

    fn serve(&mut self, over: &AtomicBool) {
        while !over.load(Ordering::Acquire) {
            let turn = catch_unwind(AssertUnwindSafe(|| {
                self.sleep(LONGEST_SLEEP);
                let now = Instant::now();
                self.let_in(now);
                self.round(now);
            }));
            // Whatever it was, the listeners stay open: somebody may need to stop the machine.
            if turn.is_err() {
                thread::sleep(LONGEST_SLEEP);
            }
        }
        self.farewell();
    }

    /// Serves each client once.
    fn round(&mut self, now: Instant) {
        for at in 0..self.clients.len() {
            let client = &self.clients[at];
            // Who is known needs none, and has one.
            let has_place = client.kind() != ClientKind::Stranger
                || has_place(&self.clients, client.listener, ClientKind::Owner);
            self.guarded(at, now, |client, lease| client.serve(lease, has_place, now));
        }
        self.show_status(now);
        for (number, news) in self.lease.news() {
            if let Some(client) = self
                .clients
                .iter_mut()
                .find(|client| client.number() == number)
            {
                client.tell_of_lease(news, now);
            }
        }
        self.deliver(now);
        self.show_frames(now);
        for client in self.clients.iter().filter(|client| client.is_gone()) {
            self.lease.forget(client.number());
        }
        self.clients.retain(|client| !client.is_gone());
        self.service.set_clients(
            self.clients
                .iter()
                .filter(|client| client.is_talking())
                .count(),
        );
    }

    /// Serves a client with `serve`. A panic costs the client in whose handling it happened.
    fn guarded<R>(
        &mut self,
        at: usize,
        now: Instant,
        serve: impl FnOnce(&mut Client, &mut Lease) -> R,
    ) -> Option<R> {
        let lease = &mut self.lease;
        let client = &mut self.clients[at];
        let served = catch_unwind(AssertUnwindSafe(|| serve(client, lease)));
        if served.is_err() {
            let failed = catch_unwind(AssertUnwindSafe(|| client.fail(lease, now)));
            if failed.is_err() {
                client.drop_now();
            }
        }
        served.ok()
    }

    /// Sends some of the status lines that are due: whoever asks meanwhile is answered before the others.
    fn show_status(&mut self, now: Instant) {
        let mut look = StatusText::default();
        let mut left = MAX_SHOWN;
        let (count, first) = (self.clients.len(), self.next_shown);
        for step in 0..count {
            let at = (first + step) % count;
            if self.guarded(at, now, |client, _| client.show_status(&mut look, now)) == Some(false)
            {
                continue;
            }
            self.next_shown = at + 1;
            left -= 1;
            if left == 0 {
                return;
            }
        }
    }

    /// Hands out what nobody has asked for in this moment.
    fn deliver(&mut self, now: Instant) {
        let is_still = std::mem::take(&mut self.bell_is_still);
        if let Some(mut bell) = self.service.bell().filter(|_| !is_still) {
            // What rang does not matter.
            let _ = std::io::Read::read(&mut bell, &mut [0; 64]);
        }
        for (to, line) in self.service.post() {
            let for_it = |client: &&mut Client| {
                client.is_talking() && to.is_none_or(|to| client.number() == to)
            };
            self.clients
                .iter_mut()
                .filter(for_it)
                .for_each(|client| client.post(&line, now));
        }
    }

    /// Hands out frames of streams.
    fn show_frames(&mut self, now: Instant) {
        for (to, frame) in self.service.frames() {
            if let Some(client) = self.clients.iter_mut().find(|client| client.number() == to) {
                client.show(&frame, now);
            }
        }
    }

    /// Lets in who waits at the listeners, a bounded number of them.
    fn let_in(&mut self, now: Instant) {
        for (at, listener) in self.listeners.iter().enumerate() {
            if self.shut_until[at].is_some_and(|until| now < until) {
                continue;
            }
            self.shut_until[at] = None;
            if std::mem::take(&mut self.nobody_waits[at]) {
                continue;
            }
            for _ in 0..MAX_COMERS {
                if listener.asks_for_token() && !make_place_for_stranger(&mut self.clients, at, now)
                {
                    self.shut_until[at] = Some(now + DOOR_REST);
                    break;
                }
                let connection = match listener.accept() {
                    Ok(connection) => connection,
                    Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                    Err(error) if error.kind() == ErrorKind::ConnectionAborted => continue,
                    // It would be ready to be asked again at once: the system has no file left, say.
                    Err(_) => {
                        self.shut_until[at] = Some(now + DOOR_REST);
                        break;
                    }
                };
                self.connections += 1;
                let protocol = match &connection.sender_at {
                    Some(place) => self.service.sender(self.connections, place),
                    None => Some(self.service.new_client(self.connections, connection.tokens)),
                };
                let Some(protocol) = protocol else { continue };
                let mut client =
                    Client::new(connection.stream, connection.is_guest, protocol, at, now);
                let kind = client.kind();
                if has_place(&self.clients, at, kind) {
                    self.lease.introduce(client.number(), client.name());
                    self.clients.push(client);
                } else {
                    client.turn_away(&crowded(kind), now);
                }
            }
        }
    }

    /// Sleeps until somebody comes, says something, can be told something or is due a status line. Who has said nothing is not asked
    /// in the round that follows: of sixteen who look on, one is served in most rounds, and reading of the others takes longer than
    /// serving it.
    fn sleep(&mut self, most: Duration) {
        let now = Instant::now();
        let due = self.clients.iter().filter_map(Client::due).min();
        let doors_due = self.shut_until.iter().flatten().min();
        let due = [due, doors_due.copied()].into_iter().flatten().min();
        let sleep = due.map_or(most, |due| due.saturating_duration_since(now).min(most));
        let is_asked = |(listener, shut): (&Listener, &Option<Instant>)| {
            shut.is_none() && listener.fd().is_some()
        };
        let doors_asked: Vec<bool> = self
            .listeners
            .iter()
            .zip(&self.shut_until)
            .map(is_asked)
            .collect();
        let listeners = self
            .listeners
            .iter()
            .zip(&doors_asked)
            .filter(|(_, is_asked)| **is_asked);
        let listeners = listeners.filter_map(|(listener, _)| {
            Some(PollFd::from_borrowed_fd(listener.fd()?, PollFlags::IN))
        });
        let clients = self.clients.iter().map(|client| {
            let (stream, flags) = client.interest();
            PollFd::from_borrowed_fd(stream.fd(), flags)
        });
        let bell = self
            .service
            .bell()
            .map(|bell| PollFd::new(bell, PollFlags::IN));
        let mut all: Vec<PollFd<'_>> = listeners.chain(clients).chain(bell).collect();
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: i64::from(sleep.subsec_nanos()),
        };
        // A signal ends the sleep early: then nothing was said of anybody, and the round asks all of them.
        let is_told = poll(&mut all, Some(&timeout)).is_ok();
        let said: Vec<PollFlags> = all
            .iter()
            .filter(|_| is_told)
            .map(PollFd::revents)
            .collect();
        let mut said = said.into_iter();
        for (nobody_waits, is_asked) in self.nobody_waits.iter_mut().zip(doors_asked) {
            *nobody_waits = is_asked && said.next().is_some_and(|said| said.is_empty());
        }
        for client in &mut self.clients {
            client.hears(said.next());
        }
        self.bell_is_still = said.next().is_some_and(|said| said.is_empty());
    }

    /// The run is over: everybody is told, and has a moment to read it.
    fn farewell(&mut self) {
        self.listeners.clear();
        let start = Instant::now();
        // What was said until now comes before the farewell.
        self.clients
            .iter_mut()
            .for_each(|client| client.hears(None));
        self.round(start);
        for client in &mut self.clients {
            client.dismiss(start);
        }
        while !self.clients.is_empty() && start.elapsed() < FAREWELL {
            self.round(Instant::now());
            self.sleep(Duration::from_millis(5));
        }
    }
}

#[cfg(test)]
#[path = "server_tests.rs"]
mod tests;
