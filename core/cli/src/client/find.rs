//! Where a controller's socket is, where nobody names it.

use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

use rustix::process::getuid;

use crate::serve::socket_folders;

/// The socket of the only controller that answers here: in the folders in which `tandem serve` puts its socket, of this user
/// or of root.
///
/// # Errors
/// There is none, or there are several; in words.
pub fn only_controller() -> Result<PathBuf, String> {
    let folders = socket_folders();
    let mut found: Vec<PathBuf> = folders
        .iter()
        .flat_map(|folder| answering(folder))
        .collect();
    found.sort();
    found.dedup();
    let shown = |paths: &[PathBuf]| -> String {
        let shown: Vec<String> = paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        shown.join(", ")
    };
    match found.len() {
        0 => Err(format!(
            "no controller answers in {}: tandem serve starts one, --connect SOCKET names one elsewhere",
            shown(&folders)
        )),
        1 => Ok(found.remove(0)),
        _ => Err(format!(
            "several controllers are there; --connect names one of {}",
            shown(&found)
        )),
    }
}

/// The sockets of controllers in a folder, of those who may be trusted with a machine.
fn answering(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return vec![];
    };
    let is_one = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let ours = path.symlink_metadata().is_ok_and(|data| {
            data.file_type().is_socket() && [0, getuid().as_raw()].contains(&data.uid())
        });
        name.starts_with("tandem-")
            && name.ends_with(".socket")
            && ours
            && UnixStream::connect(path).is_ok()
    };
    entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(is_one)
        .collect()
}
