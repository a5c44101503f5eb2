//! `tandem plugin list`.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use tandem_sdk::{ABI_VERSION, OptionDoc, Plugin};

use crate::{REFUSED, built_in};

/// Prints the built-in plugins, or those of the given libraries.
pub fn list(libraries: &[PathBuf], verbose: bool) -> Result<u8, String> {
    let mut status = 0;
    let mut plugins = vec![];
    if libraries.is_empty() {
        plugins.extend(
            built_in::registry()?
                .plugins()
                .iter()
                .map(|plugin| (*plugin, "built in".to_string())),
        );
    }
    for path in libraries {
        match tandem_host::load_plugins(path) {
            Ok(loaded) => plugins.extend(
                loaded
                    .into_iter()
                    .map(|plugin| (plugin, path.display().to_string())),
            ),
            Err(cause) => {
                say!("{}: {cause}", path.display());
                status = REFUSED;
            }
        }
    }
    let text: String = plugins
        .iter()
        .map(|(plugin, from)| described(*plugin, from, verbose))
        .collect();
    // A reader that has gone away is no reason to fail.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(status)
}

fn described(plugin: Plugin, from: &str, verbose: bool) -> String {
    let (kind, name, version) = (plugin.kind().name(), plugin.name(), plugin.version());
    let mut text = format!("{kind:<14} {name:<20} {version}\n");
    if verbose {
        let _ = writeln!(text, "    {from}, plugin contract {ABI_VERSION}");
        match plugin.options() {
            Ok(options) if options.is_empty() => text += "    no options\n",
            Ok(options) => options
                .iter()
                .for_each(|option| text += &described_option(option)),
            Err(cause) => {
                let _ = writeln!(text, "    options: {cause}");
            }
        }
        text.push('\n');
    }
    text
}

fn described_option(option: &OptionDoc) -> String {
    let default = if option.default.is_empty() {
        "not set"
    } else {
        &option.default
    };
    let mut text = format!("    {} = {default}    # {}\n", option.key, option.values);
    for line in wrapped(&option.doc, 100) {
        let _ = writeln!(text, "        {line}");
    }
    text
}

/// `text` in lines of at most `columns`, broken between words.
fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines
            .last_mut()
            .unwrap_or_else(|| unreachable!("it begins with one"));
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= columns {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_string());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_broken_between_words() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(wrapped("unbreakable", 3), ["unbreakable"]);
    }
}
