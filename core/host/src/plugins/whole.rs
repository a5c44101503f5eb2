//! Whether a shared library is there in full. The system's loader maps a file that was cut off like any other, and the
//! process dies where it touches what is missing.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Most bytes that the headers are looked for in.
const HEAD: u64 = 4096;
/// A part of the file that is loaded; the kind of a program header, as the ELF specification numbers them.
const LOADED: u64 = 1;

/// Refuses a file that ends before what is loaded of it. Host, outside the loops.
///
/// # Errors
/// It cannot be read, or is cut off.
pub fn check(path: &Path) -> Result<(), String> {
    let (bytes, head) = head(path).map_err(|e| format!("it cannot be loaded: {e}"))?;
    match end_of_loaded(&head) {
        Some(end) if end > bytes => Err(format!(
            "it is cut off: {bytes} bytes, of at least {end}; build it or copy it once more"
        )),
        _ => Ok(()),
    }
}

/// The file's length, and its beginning.
fn head(path: &Path) -> io::Result<(u64, Vec<u8>)> {
    let file = File::open(path)?;
    let mut head = vec![];
    let bytes = file.metadata()?.len();
    file.take(HEAD).read_to_end(&mut head)?;
    Ok((bytes, head))
}

/// Where the last part that is loaded ends in the file. None for anything but ELF of 64 bits, little-endian, with all its
/// program headers in `head`: the system's loader judges that.
fn end_of_loaded(head: &[u8]) -> Option<u64> {
    let number = |at: usize, bytes: usize| -> Option<u64> {
        let part = head.get(at..at.checked_add(bytes)?)?;
        Some(
            part.iter()
                .rev()
                .fold(0, |number, byte| number << 8 | u64::from(*byte)),
        )
    };
    if !head.starts_with(b"\x7fELF\x02\x01") {
        return None;
    }
    let table = number(32, 8)? as usize;
    let size = number(54, 2)? as usize;
    let count = number(56, 2)? as usize;
    let mut end = 0;
    for header in 0..count {
        let at = table.checked_add(header * size)?;
        if number(at, 4)? == LOADED {
            end = end.max(number(at + 8, 8)?.checked_add(number(at + 32, 8)?)?);
        }
    }
    Some(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Headers of a file with one part that is loaded, `bytes` from `offset` on, and a larger one that is not.
    fn elf(offset: u64, bytes: u64) -> Vec<u8> {
        let mut head = vec![0; 64 + 2 * 56];
        head[..6].copy_from_slice(b"\x7fELF\x02\x01");
        head[32] = 64;
        head[54] = 56;
        head[56] = 2;
        for (at, kind, bytes) in [(64, 1, bytes), (120, 4, 10 * bytes)] {
            head[at] = kind;
            head[at + 8..at + 16].copy_from_slice(&offset.to_le_bytes());
            head[at + 32..at + 40].copy_from_slice(&bytes.to_le_bytes());
        }
        head
    }

    #[test]
    fn what_is_loaded_must_be_there() {
        let written = |head: &[u8], length: u64| {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), head).unwrap();
            file.as_file().set_len(length).unwrap();
            check(file.path())
        };
        assert_eq!(written(&elf(4096, 1000), 5096), Ok(()));
        assert!(
            written(&elf(4096, 1000), 5095)
                .unwrap_err()
                .starts_with("it is cut off: 5095 bytes, of at least 5096")
        );
    }

    #[test]
    fn headers_of_another_form_are_left_to_the_loader() {
        assert_eq!(end_of_loaded(&elf(4096, 1000)), Some(5096));
        for length in 0..64 + 56 {
            assert_eq!(end_of_loaded(&elf(4096, 1000)[..length]), None, "{length}");
        }
        assert_eq!(end_of_loaded(&elf(u64::MAX, 1)), None);
        let mut far = elf(4096, 1000);
        far[32..40].fill(0xff);
        assert_eq!(end_of_loaded(&far), None);
        let mut narrow = elf(4096, 1000);
        narrow[4] = 1;
        assert_eq!(end_of_loaded(&narrow), None);
    }
}
