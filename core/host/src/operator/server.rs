//! The thread that serves clients: one for all of them, of ordinary priority.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::client::Client;
use super::desk::Desk;
use super::lease::Lease;
use super::listen::{Door, Listen};
use super::reply::Problem;
use super::session::Session;

/// Most clients at a time.
const MAX_CLIENTS: usize = 16;
/// Longest sleep: how soon the end of the run is seen.
const LONGEST_SLEEP: Duration = Duration::from_millis(50);
/// How long clients have to read their last line when the run is over.
const FAREWELL: Duration = Duration::from_secs(1);
/// Stack of the thread, bytes: it is locked into memory with the rest.
const STACK_BYTES: usize = 256 * 1024;

/// Serves clients while it lives. Dropping it tells them that the run is over, and closes.
#[derive(Debug)]
pub struct Server {
    over: Arc<AtomicBool>,
    handle: Option<JoinHandle<()>>,
    /// The TCP address, with the port that the system chose for port 0.
    pub address: Option<SocketAddr>,
}

impl Server {
    /// Opens every door of `listen` and starts the thread. Host, before the run.
    ///
    /// # Errors
    /// The place with the cause: it is taken, or not allowed.
    pub fn start(desk: Arc<Desk>, listen: &Listen) -> Result<Self, String> {
        let doors = Door::open(listen)?;
        let address = doors.iter().find_map(Door::address);
        let over = Arc::new(AtomicBool::new(false));
        let mut room = Room { desk, doors, clients: vec![], lease: Lease::default(), comers: 0 };
        let seen = Arc::clone(&over);
        let builder = thread::Builder::new().name("tandem-operator".to_string()).stack_size(STACK_BYTES);
        let handle = builder.spawn(move || room.serve(&seen));
        let handle = handle.map_err(|e| format!("the thread for operators cannot be started: {e}"))?;
        Ok(Self { over, handle: Some(handle), address })
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
    desk: Arc<Desk>,
    doors: Vec<Door>,
    clients: Vec<Client>,
    lease: Lease,
    /// Clients that ever came.
    comers: u64,
}

impl Room {
    fn serve(&mut self, over: &AtomicBool) {
        while !over.load(Ordering::Acquire) {
            self.sleep(LONGEST_SLEEP);
            let now = Instant::now();
            self.let_in(now);
            self.round(now);
        }
        self.farewell();
    }

    /// Serves each client once.
    fn round(&mut self, now: Instant) {
        for client in &mut self.clients {
            client.serve(&self.desk, &mut self.lease, now);
        }
        self.clients.retain(|client| !client.is_gone());
        self.desk.set_clients(self.clients.iter().filter(|client| client.is_talking()).count());
    }

    fn let_in(&mut self, now: Instant) {
        for door in &self.doors {
            let Some((stream, token)) = door.accept() else { continue };
            self.comers += 1;
            let session = Session::new(self.comers, token);
            let crowded = self.clients.len() >= MAX_CLIENTS;
            let refusal = crowded.then(|| {
                session.close(&Problem::refused("the connection", format!("{MAX_CLIENTS} clients are here already")))
            });
            let mut client = Client::new(stream, session, now);
            match refusal {
                None => self.clients.push(client),
                // One round is all that it gets: what does not fit into its socket is lost with it.
                Some(answer) => {
                    client.turn_away(&answer, now);
                    client.serve(&self.desk, &mut self.lease, now);
                }
            }
        }
    }

    /// Sleeps until somebody comes, says something, can be told something or is due a status line.
    fn sleep(&self, most: Duration) {
        let now = Instant::now();
        let due = self.clients.iter().filter_map(Client::due).min();
        let sleep = due.map_or(most, |due| due.saturating_duration_since(now).min(most));
        let doors = self.doors.iter().map(|door| PollFd::from_borrowed_fd(door.fd(), PollFlags::IN));
        let clients = self.clients.iter().map(|client| {
            let (stream, flags) = client.interest();
            PollFd::from_borrowed_fd(stream.fd(), flags)
        });
        let mut all: Vec<PollFd<'_>> = doors.chain(clients).collect();
        let timeout = Timespec { tv_sec: 0, tv_nsec: i64::from(sleep.subsec_nanos()) };
        // A signal ends the sleep early: a round more does no harm.
        let _ = poll(&mut all, Some(&timeout));
    }

    /// The run is over: everybody is told, and has a moment to read it.
    fn farewell(&mut self) {
        self.doors.clear();
        let start = Instant::now();
        for client in &mut self.clients {
            client.dismiss(&self.desk, start);
        }
        while !self.clients.is_empty() && start.elapsed() < FAREWELL {
            self.round(Instant::now());
            self.sleep(Duration::from_millis(5));
        }
    }
}
