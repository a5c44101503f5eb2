//! `tandem plugin check`.

use std::io::Write;
use std::path::Path;

use tandem_conformance::{Setup, judge};

use crate::REFUSED;

/// Loads a shared library and judges all plugins in it.
pub fn check(library: &Path, options: &[(String, String)], setup: &Setup) -> Result<u8, String> {
    let plugins = tandem_host::load_plugins(library)
        .map_err(|cause| format!("{}: {cause}", library.display()))?;
    let setup = Setup {
        options: options_text(options)?,
        ..setup.clone()
    };
    let mut status = 0;
    for plugin in plugins {
        let report = judge(plugin, &setup);
        // A reader that has gone away is no reason to fail.
        let _ = write!(std::io::stdout(), "{report}");
        if !report.conforms() {
            status = REFUSED;
        }
    }
    Ok(status)
}

/// The options as TOML. A value that is not TOML is a text, as with `--set`.
fn options_text(options: &[(String, String)]) -> Result<String, String> {
    let line = |(key, value): &(String, String)| {
        let line = format!("{key} = {value}\n");
        let readable = line.parse::<toml::Table>().is_ok();
        if readable {
            line
        } else {
            format!("{key} = {}\n", toml::Value::String(value.clone()))
        }
    };
    let text: String = options.iter().map(line).collect();
    text.parse::<toml::Table>()
        .map(|_| text)
        .map_err(|e| format!("--set: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_toml_or_text() {
        let pair = |key: &str, value: &str| (key.to_string(), value.to_string());
        let text = options_text(&[
            pair("share", "0.5"),
            pair("file", "a b.csv"),
            pair("on", "true"),
        ])
        .unwrap();
        assert_eq!(text, "share = 0.5\nfile = \"a b.csv\"\non = true\n");
        assert!(options_text(&[pair("a b", "1")]).is_err());
    }
}
