//! Plugins from shared libraries.

use std::ffi::{CString, OsStr};
use std::path::Path;

use libloading::Library;
use tandem_sdk::Plugin;
use tandem_sdk::abi::{self, SYMBOL_PREFIX};

use crate::plugins::{plugin_log, whole};

/// What every version of the symbol begins with.
const ANY_VERSION: &str = "tandem_plugin_v";

/// The plugins of the shared library at `path`. It stays loaded until the process ends: what it gave out is used from
/// anywhere. Host, outside the loops.
///
/// # Errors
/// There is no such file; it is no library, cut off, or none with plugins; it was built against another contract.
pub fn load(path: &Path) -> Result<Vec<Plugin>, String> {
    // The system's loader looks for a bare name in folders of its own.
    let path = std::path::absolute(path).map_err(|e| e.to_string())?;
    if path.is_dir() {
        return Err(
            "it is a folder: name the shared library that cargo built in it, under target/release"
                .to_string(),
        );
    }
    if !path.is_file() {
        return Err("there is no such file".to_string());
    }
    whole::check(&path)?;
    // SAFETY: loading runs the library's initialisers; who names a plugin in machine.toml trusts it with the machine.
    let library = unsafe { Library::new(&path) }
        .map_err(|e| format!("it cannot be loaded: {}", cause(&e)))?;
    let library: &'static Library = Box::leak(Box::new(library));
    let descriptor = symbol(library, &symbol_by_name(&path))
        .or_else(|| symbol(library, &symbol_in(&path)?))
        .ok_or_else(|| missing(&path))?;
    // SAFETY: the symbol is that of a plugin crate, and the library is never unloaded.
    unsafe { abi::Library::plugins(descriptor, plugin_log::table()) }
}

fn symbol(library: &'static Library, name: &str) -> Option<*const abi::Library> {
    let name = CString::new(name).ok()?;
    // SAFETY: nothing else exports a symbol with this prefix.
    let symbol = unsafe { library.get::<*const abi::Library>(name.as_bytes_with_nul()) }.ok()?;
    Some(*symbol)
}

/// The symbol of the crate that cargo builds as a file of this name.
fn symbol_by_name(path: &Path) -> String {
    let stem = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
    format!(
        "{SYMBOL_PREFIX}{}",
        stem.strip_prefix("lib").unwrap_or(stem)
    )
}

/// The symbol as it stands in the library's table of names, for a file that was renamed.
fn symbol_in(path: &Path) -> Option<String> {
    let bytes = std::fs::read(path).ok()?;
    names(&bytes).find(|name| name.starts_with(SYMBOL_PREFIX))
}

fn missing(path: &Path) -> String {
    let bytes = std::fs::read(path).unwrap_or_default();
    if let Some(other) = names(&bytes).next() {
        return format!("it exports {other}; this host reads {SYMBOL_PREFIX}…");
    }
    let wanted = symbol_by_name(path);
    format!("it is no Tandem plugin: it does not export {wanted} (see docs/writing-a-plugin.md)")
}

/// What looks like a plugin's symbol of any version.
fn names(bytes: &[u8]) -> impl Iterator<Item = String> {
    let begin = ANY_VERSION.as_bytes();
    bytes
        .windows(begin.len() + 1)
        .enumerate()
        .filter_map(move |(at, window)| {
            let numbered = window.starts_with(begin) && window[begin.len()].is_ascii_digit();
            let name = || {
                bytes[at..]
                    .iter()
                    .take_while(|b| b.is_ascii_alphanumeric() || **b == b'_')
            };
            let whole = numbered && bytes.get(at + name().count()) == Some(&0);
            whole.then(|| name().map(|b| *b as char).collect())
        })
}

/// The loader's own words, which the error keeps behind it.
fn cause(error: &dyn std::error::Error) -> String {
    error
        .source()
        .map_or_else(|| error.to_string(), ToString::to_string)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_are_found_among_bytes() {
        let bytes = b"..tandem_plugin_v1__\0tandem_plugin_v\0\0tandem_plugin_v2__my_planner\0tandem_plugin_v1__x!";
        assert_eq!(
            names(bytes).collect::<Vec<_>>(),
            ["tandem_plugin_v1__", "tandem_plugin_v2__my_planner"]
        );
    }

    #[test]
    fn what_is_no_library_is_refused() {
        assert_eq!(
            load(Path::new("no/such/libx.so")).unwrap_err(),
            "there is no such file"
        );
        assert!(
            load(&std::env::temp_dir())
                .unwrap_err()
                .starts_with("it is a folder: ")
        );
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "not a library").unwrap();
        let refusal = load(file.path()).unwrap_err();
        assert!(refusal.starts_with("it cannot be loaded: "), "{refusal}");
    }
}
