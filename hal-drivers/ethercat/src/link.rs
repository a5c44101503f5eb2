//! What frames go over: a network interface, or the emulator in this process on virtual or real time.

use std::os::unix::net::UnixListener;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::recorder::Recorder;
use crate::requests::lock;
use tandem_ethercat_emulator::{BusDescription, MAX_FRAME, RawSocket, Wire, is_ethercat};

/// How long a wire is listened to before anything is sent: three cycles of another master that sends every 10 ms.
const LISTEN_NS: u64 = 30_000_000;

/// One end of a bus. Times are ns since it was opened; on virtual time they pass only by waiting.
#[derive(Debug)]
pub(crate) struct Link {
    medium: Medium,
    /// When it was opened; none on virtual time.
    opened: Option<Instant>,
    virtual_ns: u64,
    recorder: Option<Box<Recorder>>,
}

#[derive(Debug)]
enum Medium {
    Emulated(Box<Wire>),
    Interface {
        socket: RawSocket,
        buffer: Box<[u8; MAX_FRAME]>,
        lock: UnixListener,
    },
}

impl Link {
    /// The emulator, with its devices just powered on.
    ///
    /// In real time a reply is back at once: whoever sleeps for the time that a frame takes on a cable is woken much later on a
    /// computer with other work, and the period is missed.
    pub(crate) fn emulated(bus: &BusDescription, real_time: bool) -> Result<Self, String> {
        let mut wire = Wire::new(bus).map_err(|error| format!("the emulated bus: {error}"))?;
        wire.set_travel(!real_time);
        Ok(Self {
            medium: Medium::Emulated(Box::new(wire)),
            opened: real_time.then(Instant::now),
            virtual_ns: 0,
            recorder: None,
        })
    }

    /// A network interface that no other process drives, and on whose wire no other master is.
    pub(crate) fn interface(name: &str) -> Result<Self, String> {
        let lock = lock(name)?;
        let socket = RawSocket::open(name).map_err(|error| error.to_string())?;
        let medium = Medium::Interface {
            socket,
            buffer: Box::new([0; MAX_FRAME]),
            lock,
        };
        let mut link = Self {
            medium,
            opened: Some(Instant::now()),
            virtual_ns: 0,
            recorder: None,
        };
        link.listen(name)?;
        Ok(link)
    }

    /// Opens the interface once more where it has gone and another one has its name: an adapter that was pulled out and is back. Its
    /// lock stays.
    pub(crate) fn renew(&mut self, name: &str) -> Result<(), String> {
        match &mut self.medium {
            Medium::Interface { socket, .. } if !socket.is_current() => {
                *socket = RawSocket::open(name).map_err(|error| error.to_string())?;
            }
            _ => return Ok(()),
        }
        self.listen(name)
    }

    /// Whether frames can be sent, and nobody else sends any.
    fn listen(&mut self, name: &str) -> Result<(), String> {
        if let Medium::Interface { socket, .. } = &mut self.medium {
            socket.judge().map_err(|error| error.to_string())?;
        }
        let mut frame = [0; MAX_FRAME];
        let until_ns = self.now_ns() + LISTEN_NS;
        while let Some(length) = self.receive(until_ns, &mut frame) {
            if is_ethercat(&frame[..length]) {
                let [a, b, c, d, e, f] = std::array::from_fn(|byte| frame[6 + byte]);
                return Err(format!(
                    "another master is on the wire of {name}: a frame from {a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{f:02x} \
                     came before anything was sent; end it, or take another interface"
                ));
            }
        }
        Ok(())
    }

    /// Whether time is virtual.
    pub(crate) fn is_virtual(&self) -> bool {
        self.opened.is_none()
    }

    /// Its time, ns.
    pub(crate) fn now_ns(&self) -> u64 {
        self.opened
            .map_or(self.virtual_ns, |opened| opened.elapsed().as_nanos() as u64)
    }

    /// The emulator, where it is one.
    pub(crate) fn wire_mut(&mut self) -> Option<&mut Wire> {
        match &mut self.medium {
            Medium::Emulated(wire) => Some(wire),
            Medium::Interface { .. } => None,
        }
    }

    /// What makes an interface this process's alone; none where the bus is emulated.
    pub(crate) fn lock(&self) -> Option<&UnixListener> {
        match &self.medium {
            Medium::Emulated(_) => None,
            Medium::Interface { lock, .. } => Some(lock),
        }
    }

    /// Writes every frame from here on into a file.
    pub(crate) fn record(&mut self, path: &Path) -> Result<(), String> {
        self.recorder = Some(Box::new(Recorder::create(path)?));
        Ok(())
    }

    fn note(&mut self, frame: &[u8]) {
        let now_ns = self.now_ns();
        if let Some(recorder) = &mut self.recorder {
            recorder.add(now_ns, frame);
        }
    }

    /// Sends a frame; one that cannot be sent is one that is not answered.
    pub(crate) fn send(&mut self, frame: &[u8]) {
        let now_ns = self.now_ns();
        self.note(frame);
        match &mut self.medium {
            Medium::Emulated(wire) => wire.send(now_ns, frame),
            Medium::Interface { socket, .. } => drop(socket.send(frame)),
        }
    }

    /// The next frame that comes by `until_ns`, and its length.
    pub(crate) fn receive(&mut self, until_ns: u64, into: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let length = self.receive_next(until_ns, into)?;
        self.note(&into[..length]);
        Some(length)
    }

    fn receive_next(&mut self, until_ns: u64, into: &mut [u8; MAX_FRAME]) -> Option<usize> {
        if self.is_virtual() {
            return self.receive_virtual(until_ns, into);
        }
        loop {
            let now_ns = self.now_ns();
            let next_ns = match &mut self.medium {
                Medium::Emulated(wire) => {
                    if let Some(length) = wire.receive(now_ns, into) {
                        return Some(length);
                    }
                    // What is not on its way yet does not come: nothing happens behind this thread's back.
                    wire.next_reply_ns().filter(|due_ns| *due_ns <= until_ns)?
                }
                Medium::Interface { socket, buffer, .. } => {
                    if let Ok(Some(frame)) = socket.receive(buffer) {
                        into[..frame.len()].copy_from_slice(frame);
                        return Some(frame.len());
                    }
                    until_ns
                }
            };
            if now_ns >= until_ns {
                return None;
            }
            self.doze(next_ns.saturating_sub(now_ns));
        }
    }

    fn receive_virtual(&mut self, until_ns: u64, into: &mut [u8; MAX_FRAME]) -> Option<usize> {
        let Medium::Emulated(wire) = &mut self.medium else {
            return None;
        };
        let due_ns = wire.next_reply_ns().filter(|due_ns| *due_ns <= until_ns);
        self.virtual_ns = self.virtual_ns.max(due_ns.unwrap_or(until_ns));
        due_ns.and_then(|_| wire.receive(self.virtual_ns, into))
    }

    fn doze(&self, at_most_ns: u64) {
        match &self.medium {
            Medium::Emulated(_) => std::thread::sleep(Duration::from_nanos(at_most_ns)),
            Medium::Interface { socket, .. } => socket.wait(at_most_ns),
        }
    }

    /// Lets time pass until then.
    pub(crate) fn wait_until(&mut self, at_ns: u64) {
        match self.opened {
            None => self.virtual_ns = self.virtual_ns.max(at_ns),
            Some(_) => {
                std::thread::sleep(Duration::from_nanos(at_ns.saturating_sub(self.now_ns())));
            }
        }
    }
}
