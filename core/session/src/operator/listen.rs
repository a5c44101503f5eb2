//! Where clients can reach a run.

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::Arc;

use super::pty::PtyListener;
use super::role::Role;
use super::socket_file::{self, SocketFile};
use super::stream::Stream;
use super::token::Tokens;

/// Bytes that the system keeps for a client: telemetry that waits longer is old.
const SEND_BUFFER_BYTES: usize = 16 * 1024;

/// Where clients may come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listen {
    /// Path of a unix socket.
    pub unix: Option<PathBuf>,
    /// Loopback address and port for TCP.
    pub tcp: Option<SocketAddr>,
    /// File of the token that clients over TCP name.
    pub token_file: Option<PathBuf>,
    /// Files of the tokens that let clients over TCP do less.
    pub role_token_files: Vec<(PathBuf, Role)>,
    /// Loopback address and port for senders of grbl's protocol, who name no token.
    pub grbl_tcp: Option<SocketAddr>,
    /// Path of the link to a terminal of our own, for senders of grbl's protocol.
    pub grbl_pty: Option<PathBuf>,
}

impl Listen {
    /// Whether nobody can come.
    pub fn is_nowhere(&self) -> bool {
        self.unix.is_none()
            && self.tcp.is_none()
            && self.grbl_tcp.is_none()
            && self.grbl_pty.is_none()
    }
}

/// A client that has just come.
pub struct Connection {
    /// Its end.
    pub stream: Box<dyn Stream>,
    /// The tokens of which its first line must name one.
    pub tokens: Option<Arc<Tokens>>,
    /// Whether it runs as another user.
    pub is_guest: bool,
    /// For a sender of grbl's protocol: the place where it has come in, in words.
    pub sender_at: Option<String>,
}

/// A place where clients are accepted.
#[derive(Debug)]
pub enum Listener {
    /// The file's mode lets the owner in alone.
    Unix(
        UnixListener,
        #[allow(dead_code, reason = "the file goes with it")] SocketFile,
    ),
    /// Whoever knows a token.
    Tcp(TcpListener, Arc<Tokens>),
    /// Senders of grbl's protocol, from this computer.
    GrblTcp(TcpListener),
    /// Senders of grbl's protocol that open a terminal whose mode lets the owner in alone.
    GrblPty(PtyListener),
}

impl Listener {
    /// Opens every listener asked for.
    ///
    /// # Errors
    /// The place with the cause.
    pub fn open(listen: &Listen) -> Result<Vec<Self>, String> {
        let mut listeners = vec![];
        if let Some(path) = &listen.unix {
            let (listener, file) = socket_file::listen(path)?;
            listeners.push(Self::Unix(listener, file));
        }
        if let Some(address) = listen.tcp {
            listeners.push(tcp(address, listen)?);
        }
        if let Some(address) = listen.grbl_tcp {
            listeners.push(Self::GrblTcp(bind(address)?));
        }
        if let Some(path) = &listen.grbl_pty {
            listeners.push(Self::GrblPty(PtyListener::open(path)?));
        }
        Ok(listeners)
    }

    /// The next client that waits.
    ///
    /// # Errors
    /// None waits ([`ErrorKind::WouldBlock`](io::ErrorKind::WouldBlock)), or the system refuses.
    pub fn accept(&self) -> io::Result<Connection> {
        match self {
            Self::Unix(listener, _) => {
                let stream = listener.accept()?.0;
                stream.set_nonblocking(true)?;
                bound_buffer(&stream);
                let is_guest = !is_owner(&stream);
                Ok(Connection {
                    stream: Box::new(stream),
                    tokens: None,
                    is_guest,
                    sender_at: None,
                })
            }
            Self::Tcp(listener, tokens) => {
                let (stream, _) = accept_tcp(listener)?;
                Ok(Connection {
                    stream: Box::new(stream),
                    tokens: Some(Arc::clone(tokens)),
                    is_guest: false,
                    sender_at: None,
                })
            }
            Self::GrblTcp(listener) => {
                let (stream, from) = accept_tcp(listener)?;
                Ok(Connection {
                    stream: Box::new(stream),
                    tokens: None,
                    is_guest: false,
                    sender_at: Some(from.to_string()),
                })
            }
            Self::GrblPty(pty) => Ok(Connection {
                stream: pty.accept()?,
                tokens: None,
                is_guest: false,
                sender_at: Some(pty.place()),
            }),
        }
    }

    /// Whether clients must say who they are.
    pub fn asks_for_token(&self) -> bool {
        matches!(self, Self::Tcp(..))
    }

    /// For waiting until a client comes; none where only a look now and then tells.
    pub fn fd(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Self::Unix(listener, _) => Some(listener.as_fd()),
            Self::Tcp(listener, _) | Self::GrblTcp(listener) => Some(listener.as_fd()),
            Self::GrblPty(_) => None,
        }
    }

    /// The TCP address, with the port that the system chose for port 0.
    pub fn address(&self) -> Option<SocketAddr> {
        match self {
            Self::Tcp(listener, _) => listener.local_addr().ok(),
            _ => None,
        }
    }

    /// The TCP address for senders of grbl's protocol, likewise.
    pub fn grbl_address(&self) -> Option<SocketAddr> {
        match self {
            Self::GrblTcp(listener) => listener.local_addr().ok(),
            _ => None,
        }
    }
}

/// Whether the process at the other end runs as the same user, or as root, whom no mode of a file keeps out.
fn is_owner(stream: &UnixStream) -> bool {
    let owners = [rustix::process::geteuid(), rustix::process::Uid::ROOT];
    rustix::net::sockopt::socket_peercred(stream).is_ok_and(|peer| owners.contains(&peer.uid))
}

/// Where the system keeps its own size, telemetry only gets older.
fn bound_buffer(stream: &impl AsFd) {
    let _ = rustix::net::sockopt::set_socket_send_buffer_size(stream, SEND_BUFFER_BYTES);
}

/// Who waits at `listener`; answers are short and wait for nothing.
fn accept_tcp(listener: &TcpListener) -> io::Result<(TcpStream, SocketAddr)> {
    let (stream, from) = listener.accept()?;
    stream.set_nonblocking(true)?;
    let _ = stream.set_nodelay(true);
    bound_buffer(&stream);
    Ok((stream, from))
}

/// Listens at `address` of this computer.
fn bind(address: SocketAddr) -> Result<TcpListener, String> {
    if !address.ip().is_loopback() {
        return Err(format!(
            "{address}: operators are let in from this computer alone: 127.0.0.1 or [::1]"
        ));
    }
    let listening = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        Ok(listener)
    });
    listening.map_err(|e| format!("{address}: {e}"))
}

fn tcp(address: SocketAddr, listen: &Listen) -> Result<Listener, String> {
    let listener = bind(address)?;
    let file = listen
        .token_file
        .as_ref()
        .ok_or("a TCP address needs a token file: anybody on this computer reaches it")?;
    let others = listen.role_token_files.iter();
    let files = [(file.as_path(), Role::SetUp)]
        .into_iter()
        .chain(others.map(|(file, role)| (file.as_path(), *role)));
    Ok(Listener::Tcp(listener, Arc::new(Tokens::of_files(files)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tcp_is_for_this_computer_and_needs_a_token() {
        let folder = tempfile::tempdir().unwrap();
        let listen = |address: &str, token: bool| Listen {
            tcp: Some(address.parse().unwrap()),
            token_file: token.then(|| folder.path().join("token")),
            ..Listen::default()
        };
        for elsewhere in ["0.0.0.0:0", "192.168.0.1:5000", "[::]:0"] {
            assert!(
                Listener::open(&listen(elsewhere, true))
                    .unwrap_err()
                    .contains("this computer alone"),
                "{elsewhere}"
            );
        }
        assert!(
            Listener::open(&listen("127.0.0.1:0", false))
                .unwrap_err()
                .contains("token file")
        );
        let listeners = Listener::open(&listen("127.0.0.1:0", true)).unwrap();
        assert_ne!(listeners[0].address().unwrap().port(), 0);
    }
}
