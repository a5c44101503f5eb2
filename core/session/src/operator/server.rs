//! The thread that serves clients: one for all of them, of ordinary priority.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::client::{Client, Standing};
use super::house::{House, Look, OneRun};
use super::hub::OperatorHub;
use super::lease::Lease;
use super::listen::{Door, Listen};
use super::places::{crowded, has_place, make_place_for_stranger};

/// Most clients that are let in at a door before those who are there are served again.
const MAX_COMERS: usize = 64;
/// How long a door at which nobody can be let in is not looked at.
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
    /// The TCP address of the door for senders of grbl's protocol, likewise.
    pub grbl_address: Option<SocketAddr>,
}

impl Server {
    /// Opens every door of `listen` and starts the thread. Host, before the run.
    ///
    /// # Errors
    /// The place with the cause: it is taken, or not allowed.
    pub fn start(hub: Arc<OperatorHub>, listen: &Listen) -> Result<Self, String> {
        Self::of(Arc::new(OneRun(hub)), listen)
    }

    /// The same for whoever lives behind the doors.
    ///
    /// # Errors
    /// The place with the cause: it is taken, or not allowed.
    pub(crate) fn of(house: Arc<dyn House>, listen: &Listen) -> Result<Self, String> {
        let doors = Door::open(listen)?;
        let address = doors.iter().find_map(Door::address);
        let grbl_address = doors.iter().find_map(Door::grbl_address);
        let over = Arc::new(AtomicBool::new(false));
        let mut room = Room::new(house, doors);
        let seen = Arc::clone(&over);
        let builder = thread::Builder::new()
            .name("tandem-operator".to_string())
            .stack_size(STACK_BYTES);
        let handle = builder.spawn(move || room.serve(&seen));
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
struct Room {
    house: Arc<dyn House>,
    doors: Vec<Door>,
    /// Until when nobody is let in at each door: the system refuses to.
    shut_until: Vec<Option<Instant>>,
    /// Whether nobody waits at each door, by the system's word.
    nobody_waits: Vec<bool>,
    /// Whether the bell has not rung, likewise.
    bell_is_still: bool,
    clients: Vec<Client>,
    lease: Lease,
    /// Clients that ever came.
    comers: u64,
    /// The place among the clients at which the next status line that is due is looked for.
    next_shown: usize,
}

impl Room {
    fn new(house: Arc<dyn House>, doors: Vec<Door>) -> Self {
        Self {
            house,
            shut_until: vec![None; doors.len()],
            nobody_waits: vec![false; doors.len()],
            bell_is_still: false,
            doors,
            clients: vec![],
            lease: Lease::default(),
            comers: 0,
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
            // Whatever it was, the doors stay open: somebody may need to stop the machine.
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
            let has_place = client.standing() != Standing::Stranger
                || has_place(&self.clients, client.door, Standing::Owner);
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
        self.house.set_clients(
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
        let (lease, client) = (&mut self.lease, &mut self.clients[at]);
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
        let (mut look, mut left) = (Look::default(), MAX_SHOWN);
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
        if let Some(mut bell) = self.house.bell().filter(|_| !is_still) {
            // What rang does not matter.
            let _ = std::io::Read::read(&mut bell, &mut [0; 64]);
        }
        for (to, line) in self.house.post() {
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
        for (to, frame) in self.house.frames() {
            if let Some(client) = self.clients.iter_mut().find(|client| client.number() == to) {
                client.show(&frame, now);
            }
        }
    }

    /// Lets in who waits at the doors, a bounded number of them.
    fn let_in(&mut self, now: Instant) {
        for (at, door) in self.doors.iter().enumerate() {
            if self.shut_until[at].is_some_and(|until| now < until) {
                continue;
            }
            self.shut_until[at] = None;
            if std::mem::take(&mut self.nobody_waits[at]) {
                continue;
            }
            for _ in 0..MAX_COMERS {
                if door.asks_for_token() && !make_place_for_stranger(&mut self.clients, at, now) {
                    self.shut_until[at] = Some(now + DOOR_REST);
                    break;
                }
                let comer = match door.accept() {
                    Ok(comer) => comer,
                    Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                    Err(error) if error.kind() == ErrorKind::ConnectionAborted => continue,
                    // It would be ready to be asked again at once: the system has no file left, say.
                    Err(_) => {
                        self.shut_until[at] = Some(now + DOOR_REST);
                        break;
                    }
                };
                self.comers += 1;
                let talk = match &comer.sender_at {
                    Some(place) => self.house.sender(self.comers, place),
                    None => Some(self.house.newcomer(self.comers, comer.tokens)),
                };
                let Some(talk) = talk else { continue };
                let mut client = Client::new(comer.stream, comer.is_guest, talk, at, now);
                let standing = client.standing();
                if has_place(&self.clients, at, standing) {
                    self.lease.introduce(client.number(), client.name());
                    self.clients.push(client);
                } else {
                    client.turn_away(&crowded(standing), now);
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
        let is_asked =
            |(door, shut): (&Door, &Option<Instant>)| shut.is_none() && door.fd().is_some();
        let doors_asked: Vec<bool> = self
            .doors
            .iter()
            .zip(&self.shut_until)
            .map(is_asked)
            .collect();
        let doors = self
            .doors
            .iter()
            .zip(&doors_asked)
            .filter(|(_, is_asked)| **is_asked);
        let doors =
            doors.filter_map(|(door, _)| Some(PollFd::from_borrowed_fd(door.fd()?, PollFlags::IN)));
        let clients = self.clients.iter().map(|client| {
            let (stream, flags) = client.interest();
            PollFd::from_borrowed_fd(stream.fd(), flags)
        });
        let bell = self
            .house
            .bell()
            .map(|bell| PollFd::new(bell, PollFlags::IN));
        let mut all: Vec<PollFd<'_>> = doors.chain(clients).chain(bell).collect();
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
        self.doors.clear();
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
