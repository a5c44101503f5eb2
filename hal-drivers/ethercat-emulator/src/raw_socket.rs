//! A network interface on which whole Ethernet frames are sent and received.

use std::io;
use std::mem::MaybeUninit;
use std::os::fd::AsFd;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::netdevice::name_to_index;
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
use thiserror::Error;

use crate::bus::MAX_FRAME;
use crate::frame::ETHERTYPE;

/// Why an interface cannot be used.
#[derive(Debug, Error)]
pub enum RawError {
    /// It is not there.
    #[error("there is no network interface {0}")]
    NoInterface(String),
    /// The process may not.
    #[error(
        "raw sockets need the capability CAP_NET_RAW: run as root, or `setcap cap_net_raw+ep` the command"
    )]
    NoPermission,
    /// It is down.
    #[error("the network interface {0} is down: `ip link set {0} up`")]
    Down(String),
    /// Anything else that the system says.
    #[error("network interface {0}: {1}")]
    System(String, io::Error),
}

/// A raw socket at one interface, for EtherCAT alone.
#[derive(Debug)]
pub struct RawSocket {
    socket: Socket,
    name: String,
    /// The system's number of the interface: one that is made again under the same name has another.
    index: u32,
}

impl RawSocket {
    /// Opens an interface by its name.
    ///
    /// # Errors
    /// It is not there, or not allowed.
    pub fn open(name: &str) -> Result<Self, RawError> {
        let system = |error: io::Error| match error.kind() {
            io::ErrorKind::PermissionDenied => RawError::NoPermission,
            _ => RawError::System(name.to_string(), error),
        };
        let protocol = ETHERTYPE.to_be();
        let socket = Socket::new(
            Domain::PACKET,
            Type::RAW,
            Some(Protocol::from(i32::from(protocol))),
        )
        .map_err(system)?;
        let index =
            name_to_index(&socket, name).map_err(|_| RawError::NoInterface(name.to_string()))?;
        socket
            .bind(&link_address(index, protocol).map_err(system)?)
            .map_err(system)?;
        socket.set_nonblocking(true).map_err(system)?;
        Ok(Self {
            socket,
            name: name.to_string(),
            index,
        })
    }

    /// Whether the interface of this name is still the one that was opened: it may have gone, and been made again.
    pub fn is_current(&self) -> bool {
        name_to_index(&self.socket, &self.name) == Ok(self.index)
    }

    /// Whether frames can be sent and received now.
    ///
    /// # Errors
    /// The interface is down, or something is wrong with it.
    pub fn judge(&self) -> Result<(), RawError> {
        // A socket that was bound to an interface that is down says so by an error that waits; it is told once.
        match self.socket.take_error() {
            Ok(None) => Ok(()),
            Ok(Some(error)) | Err(error) => Err(self.failed(error)),
        }
    }

    /// Waits for a frame for at most `timeout_ns`.
    pub fn wait(&self, timeout_ns: u64) {
        let timeout = Timespec {
            tv_sec: (timeout_ns / 1_000_000_000).cast_signed(),
            tv_nsec: (timeout_ns % 1_000_000_000).cast_signed(),
        };
        let socket = self.socket.as_fd();
        // Whatever ends the wait, the next look at the socket says more.
        let _ = poll(&mut [PollFd::new(&socket, PollFlags::IN)], Some(&timeout));
    }

    /// The next frame that came in, if any. Neither waits nor allocates.
    ///
    /// # Errors
    /// The interface went away or down.
    pub fn receive<'a>(&self, into: &'a mut [u8; MAX_FRAME]) -> Result<Option<&'a [u8]>, RawError> {
        let mut buffer = [MaybeUninit::uninit(); MAX_FRAME];
        match self.socket.recv(&mut buffer) {
            Ok(length) => {
                for (byte, new) in into.iter_mut().zip(&buffer[..length]) {
                    // SAFETY: `recv` has written the first `length` bytes.
                    *byte = unsafe { new.assume_init() };
                }
                Ok(Some(&into[..length]))
            }
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
                ) =>
            {
                Ok(None)
            }
            Err(error) => Err(self.failed(error)),
        }
    }

    /// Sends a frame. Does not allocate.
    ///
    /// # Errors
    /// The interface went away or down.
    pub fn send(&self, frame: &[u8]) -> Result<(), RawError> {
        self.socket
            .send(frame)
            .map(|_| ())
            .map_err(|error| self.failed(error))
    }

    fn failed(&self, error: io::Error) -> RawError {
        match error.kind() {
            io::ErrorKind::NetworkDown => RawError::Down(self.name.clone()),
            _ => RawError::System(self.name.clone(), error),
        }
    }
}

/// The address of an interface at which frames of a protocol are taken.
fn link_address(index: u32, protocol: u16) -> io::Result<SockAddr> {
    // SAFETY: the storage is larger than a link address and aligned for one; it is written before its length is stated.
    let ((), address) = unsafe {
        SockAddr::try_init(|storage, length| {
            let link = storage.cast::<libc::sockaddr_ll>();
            (*link).sll_family = libc::AF_PACKET as u16;
            (*link).sll_protocol = protocol;
            (*link).sll_ifindex = index.cast_signed();
            *length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
            Ok(())
        })?
    };
    Ok(address)
}
