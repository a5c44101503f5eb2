//! The unix socket's file: nobody else can reach it, and it replaces nothing that is in use.

use std::fs::{self, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, RenameFlags, renameat_with};

/// The file of a listening socket; it is removed with this.
#[derive(Debug)]
pub struct SocketFile {
    path: PathBuf,
    inode: u64,
}

/// Listens at `path`, with mode 0600 before anybody can reach it.
///
/// # Errors
/// The path with the cause: something is there that is not a dead socket, or the system refuses.
pub fn listen(path: &Path) -> Result<(UnixListener, SocketFile), String> {
    remove_dead(path)
        .and_then(|()| bind(path))
        .map_err(|why| format!("{}: {why}", path.display()))
}

/// Removes a socket that nobody listens at any more.
fn remove_dead(path: &Path) -> Result<(), String> {
    let Ok(found) = fs::symlink_metadata(path) else {
        return Ok(());
    };
    if !found.file_type().is_socket() {
        return Err("it exists and is no socket; it is left as it is".to_string());
    }
    match UnixStream::connect(path) {
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
            fs::remove_file(path).map_err(|e| e.to_string())
        }
        Err(error) => Err(format!("it exists and cannot be looked at: {error}")),
        Ok(_) => Err("another program listens there".to_string()),
    }
}

/// Binds in a folder of our own, sets the mode, and moves the socket to its place.
fn bind(path: &Path) -> Result<(UnixListener, SocketFile), String> {
    let parent = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let folder = parent.join(format!(".t{}", std::process::id()));
    fs::DirBuilder::new()
        .mode(0o700)
        .create(&folder)
        .map_err(|e| format!("{}: {e}", folder.display()))?;
    let made = bind_in(&folder.join("s"), path);
    // What is left in it would be a socket that could not be moved.
    let _ = fs::remove_dir_all(&folder);
    made.map_err(|e| e.to_string())
}

fn bind_in(place: &Path, path: &Path) -> io::Result<(UnixListener, SocketFile)> {
    let listener = UnixListener::bind(place)?;
    fs::set_permissions(place, Permissions::from_mode(0o600))?;
    listener.set_nonblocking(true)?;
    renameat_with(CWD, place, CWD, path, RenameFlags::NOREPLACE)?;
    let inode = fs::symlink_metadata(path)?.ino();
    Ok((
        listener,
        SocketFile {
            path: path.to_owned(),
            inode,
        },
    ))
}

impl Drop for SocketFile {
    fn drop(&mut self) {
        // Another program may have put its own in this place.
        if fs::symlink_metadata(&self.path).is_ok_and(|found| found.ino() == self.inode) {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_socket_is_its_owners_alone_and_goes_with_its_listener() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s");
        let (listener, file) = listen(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            1,
            "nothing is left beside it"
        );
        assert!(UnixStream::connect(&path).is_ok());
        assert!(
            listen(&path)
                .unwrap_err()
                .contains("another program listens")
        );
        drop((listener, file));
        assert!(!path.exists());
    }

    #[test]
    fn a_dead_socket_is_replaced_and_a_file_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s");
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists());
        drop(listen(&path).unwrap());
        fs::write(&path, "kept").unwrap();
        assert!(listen(&path).unwrap_err().contains("no socket"));
        assert_eq!(fs::read_to_string(&path).unwrap(), "kept");
    }
}
