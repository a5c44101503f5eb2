//! The tokens of which a client over TCP names one in its first line, and what each lets it do.

use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write as _};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;

use rustix::rand::{GetRandomFlags, getrandom};

use super::role::Role;

/// Random bytes of a new token.
const BYTES: usize = 32;
/// Shortest token that is taken from a file.
const MIN_CHARACTERS: usize = 16;

/// Tokens, each with what it lets a client do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tokens(Vec<(String, Role)>);

impl Tokens {
    /// One token that lets everything be done.
    pub fn of_owner(token: String) -> Self {
        Self(vec![(token, Role::SetUp)])
    }

    /// The tokens of files, each made where it does not exist.
    ///
    /// # Errors
    /// What is wrong with a file, as [`of_file`] says; two have the same token.
    pub fn of_files<'a>(files: impl IntoIterator<Item = (&'a Path, Role)>) -> Result<Self, String> {
        let mut all = Self::default();
        for (path, role) in files {
            all.add(path, role)?;
        }
        Ok(all)
    }

    /// Adds the token of a file.
    ///
    /// # Errors
    /// What is wrong with the file; it is one of the tokens that there are.
    pub fn add(&mut self, path: &Path, role: Role) -> Result<(), String> {
        let token = of_file(path)?;
        if let Some(same) = self.role_of(&token) {
            return Err(format!(
                "{}: whoever names this token may {} already: it needs another one",
                path.display(),
                same.name()
            ));
        }
        self.0.push((token, role));
        Ok(())
    }

    /// All of them.
    pub fn all(&self) -> &[(String, Role)] {
        &self.0
    }

    /// What `given` lets a client do; none where it is no token. It takes a time that does not tell which it is like.
    pub fn role_of(&self, given: &str) -> Option<Role> {
        self.0.iter().fold(None, |found, (token, role)| {
            if is_same(given, token) {
                Some(*role)
            } else {
                found
            }
        })
    }
}

/// The token of `path`; a random one in a new file of mode 0600 where there is none.
///
/// # Errors
/// The file with the cause: it cannot be read or made, others may read it, or what is in it is too short.
pub fn of_file(path: &Path) -> Result<String, String> {
    let made = make(path);
    let read = || -> Result<String, String> {
        let metadata = fs::metadata(path).map_err(|e| e.to_string())?;
        if metadata.mode() & 0o077 != 0 {
            return Err(format!(
                "others may read it (mode {:o}); `chmod 600` it",
                metadata.mode() & 0o777
            ));
        }
        let text = fs::read_to_string(path).map_err(|e| e.to_string())?;
        let token = text.trim();
        if token.chars().count() < MIN_CHARACTERS {
            return Err(format!(
                "the token in it has fewer than {MIN_CHARACTERS} characters"
            ));
        }
        Ok(token.to_string())
    };
    made.and_then(|()| read())
        .map_err(|why| format!("{}: {why}", path.display()))
}

/// Makes the file where it does not exist.
fn make(path: &Path) -> Result<(), String> {
    let mut file = match OpenOptions::new()
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(path)
    {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::AlreadyExists => return Ok(()),
        Err(error) => return Err(error.to_string()),
    };
    writeln!(file, "{}", new()?).map_err(|e| e.to_string())
}

/// A random token.
///
/// # Errors
/// The system has no random numbers.
pub fn new() -> Result<String, String> {
    let mut random = [0_u8; BYTES];
    let filled = getrandom(&mut random, GetRandomFlags::empty()).map_err(|e| e.to_string())?;
    let mut text = String::new();
    for byte in &random[..filled] {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}

/// Whether two tokens are the same, in a time that does not tell how far they agree.
pub fn is_same(a: &str, b: &str) -> bool {
    let differences = a
        .bytes()
        .zip(b.bytes())
        .fold(0, |all, (a, b)| all | (a ^ b));
    a.len() == b.len() && std::hint::black_box(differences) == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn a_new_file_holds_a_random_token_for_its_owner_alone() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        let token = of_file(&a).unwrap();
        assert_eq!(fs::metadata(&a).unwrap().mode() & 0o777, 0o600);
        assert_eq!(token.len(), 2 * BYTES);
        assert_eq!(of_file(&a).unwrap(), token);
        assert_ne!(of_file(&b).unwrap(), token);
    }

    #[test]
    fn a_file_that_others_may_read_is_refused_and_so_is_a_short_token() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        of_file(&path).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        assert!(of_file(&path).unwrap_err().contains("mode 640"));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        fs::write(&path, "secret\n").unwrap();
        assert!(of_file(&path).unwrap_err().contains("fewer than 16"));
    }

    #[test]
    fn each_token_lets_do_what_its_file_is_for_and_no_two_are_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let (set_up, watch) = (file("set-up"), file("watch"));
        let files = [(&*set_up, Role::SetUp), (&*watch, Role::Watch)];
        let tokens = Tokens::of_files(files).unwrap();
        for (path, role) in files {
            assert_eq!(tokens.role_of(&of_file(path).unwrap()), Some(role));
        }
        assert_eq!(tokens.role_of(""), None);
        fs::copy(&watch, file("copy")).unwrap();
        let both = [(&*watch, Role::Watch), (&*file("copy"), Role::Operate)];
        let why = Tokens::of_files(both).unwrap_err();
        assert!(why.contains("may watch already"), "{why}");
    }

    #[test]
    fn tokens_are_compared_in_full() {
        assert!(is_same("abc", "abc") && is_same("", ""));
        for other in ["abd", "ab", "abcd", ""] {
            assert!(!is_same("abc", other), "{other}");
        }
    }
}
