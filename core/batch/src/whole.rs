//! Files that are there whole or not at all, however many processes write them at once.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use tempfile::NamedTempFile;

/// The names of files that are being written begin with this.
const UNFINISHED: &str = ".tmp";

/// Writes `bytes` to `path` so that whoever looks finds nothing or all of it, however many write it at once.
///
/// # Errors
/// The system's words.
pub fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = unfinished(path.parent().unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    file.persist(path)?;
    Ok(())
}

/// A file to write, with a lock that ends with the process, whatever ends that.
fn unfinished(folder: &Path) -> io::Result<NamedTempFile> {
    loop {
        let file = NamedTempFile::with_prefix_in(UNFINISHED, folder)?;
        // Where the file system knows no locks, nothing is cleared away either.
        let is_locked = file.as_file().lock().is_ok();
        // Another process may have cleared it away before it had its lock.
        if !is_locked || file.path().exists() {
            return Ok(file);
        }
    }
}

/// Removes what processes that were killed while they wrote have left in `folder`. What another process writes now is locked
/// and stays.
pub fn clear_unfinished(folder: &Path) {
    // What cannot be read or removed is in nobody's way.
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let is_unfinished = entry
            .file_name()
            .as_encoded_bytes()
            .starts_with(UNFINISHED.as_bytes())
            && entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_unfinished
            && let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_process_left_goes_and_what_is_being_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        fs::write(file(".tmpKilled"), "half of a res").unwrap();
        fs::write(file("result.json"), "a whole one").unwrap();
        fs::create_dir(file(".tmpFolder")).unwrap();
        let mut writing = unfinished(folder.path()).unwrap();
        writing.write_all(b"another").unwrap();
        clear_unfinished(folder.path());
        assert!(!file(".tmpKilled").exists());
        assert!(file("result.json").exists() && file(".tmpFolder").exists());
        writing.persist(file("other.json")).unwrap();
        assert_eq!(fs::read(file("other.json")).unwrap(), b"another");
    }

    /// Threads that write and clear at once: nothing that is written is lost, and nothing but it is left.
    #[test]
    fn clearing_takes_nothing_from_those_who_write() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for writer in 0..4 {
                let path = folder.path().join(format!("{writer}.json"));
                scope.spawn(move || {
                    for number in 0..200u32 {
                        write_whole(&path, &number.to_le_bytes()).unwrap();
                    }
                });
            }
            scope.spawn(|| (0..400).for_each(|_| clear_unfinished(folder.path())));
        });
        let mut names: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        assert_eq!(names, ["0.json", "1.json", "2.json", "3.json"]);
    }
}
