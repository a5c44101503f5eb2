//! A terminal of our own, for senders that know serial ports only: they open a link, and find a device in raw mode.
//!
//! The other end stays with us. While nobody has the terminal open, the system calls our end hung up: that tells
//! who comes from who goes, though a serial line knows neither.

use std::fs::{self, File, Permissions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

use super::stream::Stream;

/// The terminal, and the link to it, which goes with this.
#[derive(Debug)]
pub struct PtyListener {
    ours: File,
    theirs: PathBuf,
    link: PathBuf,
    /// Somebody has it open, and is served.
    taken: Arc<AtomicBool>,
}

impl PtyListener {
    /// Makes a terminal that its owner alone may open, and `link` to it. A link to a terminal that is there is replaced.
    ///
    /// # Errors
    /// The path with the cause: something else is there, or the system refuses.
    pub fn open(link: &Path) -> Result<Self, String> {
        let at = |why: String| format!("{}: {why}", link.display());
        if let Ok(found) = fs::symlink_metadata(link) {
            let leads_to = fs::read_link(link).unwrap_or_default();
            if !found.file_type().is_symlink() || !leads_to.starts_with("/dev/pts") {
                return Err(at(
                    "it exists and is no link to a terminal; it is left as it is".into(),
                ));
            }
        }
        let (ours, theirs) = terminal().map_err(|e| at(format!("no terminal: {e}")))?;
        // A link is made beside its place and moved there, so that no moment is without one.
        let mut beside = link.as_os_str().to_owned();
        beside.push(format!(".{}", std::process::id()));
        let beside = PathBuf::from(beside);
        let linked = symlink(&theirs, &beside).and_then(|()| fs::rename(&beside, link));
        linked.map_err(|e| at(e.to_string()))?;
        Ok(Self {
            ours,
            theirs,
            link: link.to_owned(),
            taken: Arc::default(),
        })
    }

    /// Where it is, in words.
    pub fn place(&self) -> String {
        self.link.display().to_string()
    }

    /// Whoever has opened it.
    ///
    /// # Errors
    /// Nobody has, or is served already ([`ErrorKind::WouldBlock`]); or the system refuses.
    pub fn accept(&self) -> io::Result<Box<dyn Stream>> {
        if self.taken.load(Ordering::Acquire) || !self.is_open()? {
            return Err(ErrorKind::WouldBlock.into());
        }
        // What was said to those who have gone is not for those who come.
        let theirs = open_theirs(&self.theirs)?;
        let _ = tcflush(&theirs, QueueSelector::IFlush);
        drop(theirs);
        let ours = self.ours.try_clone()?;
        self.taken.store(true, Ordering::Release);
        let taken = Arc::clone(&self.taken);
        Ok(Box::new(PtyStream { ours, taken }))
    }

    fn is_open(&self) -> io::Result<bool> {
        let mut one = [PollFd::new(&self.ours, PollFlags::IN)];
        let at_once = Timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        poll(&mut one, Some(&at_once))?;
        let ready = one[0].revents();
        Ok(!ready.contains(PollFlags::HUP) || ready.contains(PollFlags::IN))
    }
}

impl Drop for PtyListener {
    fn drop(&mut self) {
        // Another program may have put its own in this place.
        if fs::read_link(&self.link).is_ok_and(|leads_to| leads_to == self.theirs) {
            let _ = fs::remove_file(&self.link);
        }
    }
}

/// Our end and the path of theirs: raw, open to its owner alone, and opened once, so that our end knows of nobody.
fn terminal() -> io::Result<(File, PathBuf)> {
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&ours)?;
    unlockpt(&ours)?;
    let name = ptsname(&ours, vec![])?;
    let theirs = PathBuf::from(name.to_string_lossy().into_owned());
    let ours = File::from(ours);
    let flags = rustix::fs::fcntl_getfl(&ours)? | OFlags::NONBLOCK;
    rustix::fs::fcntl_setfl(&ours, flags)?;
    fs::set_permissions(&theirs, Permissions::from_mode(0o600))?;
    let opened = open_theirs(&theirs)?;
    let mut raw = tcgetattr(&opened)?;
    raw.make_raw();
    tcsetattr(&opened, OptionalActions::Now, &raw)?;
    Ok((ours, theirs))
}

fn open_theirs(path: &Path) -> io::Result<File> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    Ok(File::from(rustix::fs::open(path, flags, Mode::empty())?))
}

/// The terminal while somebody has it open.
struct PtyStream {
    ours: File,
    taken: Arc<AtomicBool>,
}

impl Read for PtyStream {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.ours.read(bytes) {
            // The last who had it open has gone.
            Err(error) if error.raw_os_error() == Some(Errno::IO.raw_os_error()) => Ok(0),
            other => other,
        }
    }
}

impl Write for PtyStream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.ours.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Stream for PtyStream {
    fn fd(&self) -> BorrowedFd<'_> {
        self.ours.as_fd()
    }

    fn end_writing(&self) {}
}

impl Drop for PtyStream {
    fn drop(&mut self) {
        self.taken.store(false, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use super::*;

    fn read(stream: &mut dyn Stream) -> Vec<u8> {
        let mut bytes = [0; 64];
        let mut all = vec![];
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            all.extend_from_slice(&bytes[..count]);
        }
        all
    }

    #[test]
    fn comers_and_goers_of_a_terminal_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("grbl");
        let listener = PtyListener::open(&link).unwrap();
        assert_eq!(fs::metadata(&link).unwrap().mode() & 0o777, 0o600);
        assert!(listener.accept().is_err(), "nobody has it open");
        for round in 0..3 {
            let mut theirs = File::options().read(true).write(true).open(&link).unwrap();
            let mut ours = listener.accept().unwrap();
            assert!(listener.accept().is_err(), "it is served already");
            theirs.write_all(b"?\x18\x03\n").unwrap();
            assert_eq!(read(ours.as_mut()), b"?\x18\x03\n", "no byte is special");
            ours.write_all(b"ok\r\n").unwrap();
            if round == 0 {
                let mut heard = [0; 4];
                theirs.read_exact(&mut heard).unwrap();
                assert_eq!(&heard, b"ok\r\n", "nor is one echoed");
            }
            drop(theirs);
            assert_eq!(ours.read(&mut [0; 8]).unwrap(), 0, "it has gone");
            drop(ours);
            assert!(listener.accept().is_err());
        }
    }

    #[test]
    fn a_link_to_a_terminal_is_replaced_and_a_file_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("grbl");
        let first = PtyListener::open(&link).unwrap();
        let second = PtyListener::open(&link).unwrap();
        drop(first);
        assert!(link.exists(), "it is the second's");
        drop(second);
        assert!(fs::symlink_metadata(&link).is_err());
        fs::write(&link, "kept").unwrap();
        assert!(PtyListener::open(&link).unwrap_err().contains("no link"));
        assert_eq!(fs::read_to_string(&link).unwrap(), "kept");
    }
}
