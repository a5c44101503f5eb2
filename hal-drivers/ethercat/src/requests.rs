//! Objects that another process asks for while this one drives the bus: over the socket by which an interface is this process's
//! alone, a line for what is asked and a line for the answer.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::time::Duration;

use crate::bus::Bus;
use crate::survey::{Object, Value};

/// How long an answer is waited for: a mailbox that does not answer is given up within this by the process that drives the bus.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest line.
const MAX_LINE: usize = 256;
/// How often whoever has connected is looked at before it is let go of without a line from it.
const MAX_LOOKS: u32 = 200;

/// What is asked of an object: to be read, or to be written and read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// The object.
    pub object: Object,
    /// What is written; none where it is read.
    pub value: Option<Value>,
}

impl Request {
    fn line(&self) -> String {
        let Object { place, index, sub } = self.object;
        let value = self.value.map_or(String::new(), |value| {
            format!(" {} {}", value.number, value.bits)
        });
        format!("{place} {index} {sub}{value}\n")
    }

    fn of_line(line: &str) -> Option<Self> {
        let mut words = line.split_whitespace();
        let object = Object {
            place: words.next()?.parse().ok()?,
            index: words.next()?.parse().ok()?,
            sub: words.next()?.parse().ok()?,
        };
        let value = match words.next() {
            Some(number) => Some(Value {
                number: number.parse().ok()?,
                bits: words.next()?.parse().ok()?,
            }),
            None => None,
        };
        let fits = value.is_none_or(|value| {
            matches!(value.bits, 8 | 16 | 32) && value.number <= u32::MAX >> (32 - value.bits)
        });
        (fits && words.next().is_none()).then_some(Self { object, value })
    }
}

fn address(interface: &str) -> std::io::Result<SocketAddr> {
    SocketAddr::from_abstract_name(format!("tandem-ethercat-{interface}"))
}

/// Takes an interface for this process alone, for as long as the socket lives. Its name is known in the network namespace of the
/// interface and nowhere else, and nothing of it is left when a process is killed.
pub(crate) fn lock(interface: &str) -> Result<UnixListener, String> {
    address(interface)
        .and_then(|address| UnixListener::bind_addr(&address))
        .map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => format!("another process drives the interface {interface}"),
            _ => format!("the lock of the interface {interface}: {error}"),
        })
}

/// Asks the process that drives an interface for an object; none where nobody drives it. Host; waits.
pub fn ask_whoever_drives(interface: &str, request: &Request) -> Option<Result<Value, String>> {
    let mut stream = UnixStream::connect_addr(&address(interface).ok()?).ok()?;
    let mut answer = String::new();
    let talked = stream
        .set_read_timeout(Some(PATIENCE))
        .and_then(|()| stream.write_all(request.line().as_bytes()))
        .and_then(|()| stream.read_to_string(&mut answer));
    let silent = || format!("the process that drives the interface {interface} does not answer");
    Some(match (talked, answer.trim_end().split_once(' ')) {
        (Ok(_), Some(("ok", value))) => {
            let numbers = value.split_once(' ');
            let value = numbers.and_then(|(number, bits)| {
                Some(Value {
                    number: number.parse().ok()?,
                    bits: bits.parse().ok()?,
                })
            });
            value.ok_or_else(silent)
        }
        (Ok(_), Some(("refused", why))) => Err(why.to_string()),
        _ => Err(silent()),
    })
}

/// Whoever asks for objects, one at a time. It is looked at between exchanges, and never waited for.
#[derive(Debug)]
pub(crate) struct ObjectServer {
    listener: UnixListener,
    client: Option<Client>,
}

#[derive(Debug)]
struct Client {
    stream: UnixStream,
    line: Vec<u8>,
    looks: u32,
    /// The bus is asked for it.
    asked: bool,
}

impl ObjectServer {
    /// At the lock of the interface; none where that cannot be looked at without waiting.
    pub(crate) fn at(lock: &UnixListener) -> Option<Self> {
        let listener = lock.try_clone().ok()?;
        listener.set_nonblocking(true).ok()?;
        Some(Self {
            listener,
            client: None,
        })
    }

    /// Whether somebody is being served.
    pub(crate) fn is_busy(&self) -> bool {
        self.client.is_some()
    }

    /// Looks at who asks, and hands on what the bus has answered. Soft side.
    pub(crate) fn look(&mut self, bus: &mut Bus) {
        if self.client.is_none()
            && let Ok((stream, _)) = self.listener.accept()
            && may_ask(&stream)
            && stream.set_nonblocking(true).is_ok()
        {
            self.client = Some(Client {
                stream,
                line: vec![],
                looks: 0,
                asked: false,
            });
        }
        let Some(client) = &mut self.client else {
            return;
        };
        let answer = if client.asked {
            bus.take_answer()
        } else {
            client.ask(bus)
        };
        if let Some(answer) = answer {
            let line = match answer {
                Ok(value) => format!("ok {} {}\n", value.number, value.bits),
                Err(why) => format!("refused {why}\n"),
            };
            // Who has gone meanwhile needs no answer.
            let _ = client.stream.write_all(line.as_bytes());
            self.client = None;
        }
    }
}

impl Client {
    /// Takes what has come of its line, and asks the bus once it is there; an answer where that is refused.
    fn ask(&mut self, bus: &mut Bus) -> Option<Result<Value, String>> {
        let mut bytes = [0; MAX_LINE];
        let came = self.stream.read(&mut bytes);
        self.looks += 1;
        match came {
            Ok(count) if count > 0 => self.line.extend(&bytes[..count]),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            _ => return Some(Err("nothing was asked".to_string())),
        }
        let Some(end) = self.line.iter().position(|byte| *byte == b'\n') else {
            let over = self.looks > MAX_LOOKS || self.line.len() > MAX_LINE;
            return over.then(|| Err("nothing was asked".to_string()));
        };
        let line = String::from_utf8_lossy(&self.line[..end]);
        let Some(request) = Request::of_line(&line) else {
            return Some(Err(format!("{line:?} asks for no object")));
        };
        match bus.ask(&request) {
            Ok(()) => self.asked = true,
            Err(why) => return Some(Err(why)),
        }
        None
    }
}

/// Whether who has connected is root, or the user that drives the bus: the socket itself is open to everybody.
fn may_ask(stream: &UnixStream) -> bool {
    let mut peer = libc::ucred {
        pid: 0,
        uid: u32::MAX,
        gid: u32::MAX,
    };
    let mut length = size_of::<libc::ucred>() as libc::socklen_t;
    // SAFETY: the socket is open, and the kernel writes as many bytes as `length` says, which are those of `peer`.
    let failed = unsafe {
        libc::getsockopt(
            stream.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_PEERCRED,
            (&raw mut peer).cast(),
            &raw mut length,
        )
    };
    // SAFETY: it reads what the process is, and cannot fail.
    let own = unsafe { libc::geteuid() };
    failed == 0 && (peer.uid == 0 || peer.uid == own)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_read_as_it_was_written_and_nothing_else_is() {
        let object = Object {
            place: 2,
            index: 0x6085,
            sub: 1,
        };
        for value in [None, Some((7, 8)), Some((0xffff, 16)), Some((u32::MAX, 32))] {
            let value = value.map(|(number, bits)| Value { number, bits });
            let request = Request { object, value };
            assert_eq!(Request::of_line(request.line().trim_end()), Some(request));
        }
        for line in [
            "",
            "2",
            "2 24709",
            "2 24709 1 7",
            "2 24709 1 256 8",
            "2 24709 1 7 9",
            "2 24709 1 7 0",
            "2 24709 1 7 8 9",
            "2 70000 1",
            "-1 24709 1",
        ] {
            assert_eq!(Request::of_line(line), None, "{line}");
        }
    }
}
