//! A client's connection, whichever way it came.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;

/// A client's end, whichever way it came. Reading and writing never wait.
pub trait Stream: Read + Write + Send {
    /// For waiting until it is ready.
    fn fd(&self) -> BorrowedFd<'_>;

    /// Nothing more will be written. What fails here is broken anyway.
    fn end_writing(&self);
}

macro_rules! stream {
    ($kind:ty) => {
        impl Stream for $kind {
            fn fd(&self) -> BorrowedFd<'_> {
                self.as_fd()
            }

            fn end_writing(&self) {
                let _ = self.shutdown(std::net::Shutdown::Write);
            }
        }
    };
}

stream!(UnixStream);
stream!(TcpStream);
