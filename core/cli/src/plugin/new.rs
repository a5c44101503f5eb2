//! `tandem plugin new`.

use std::fs;
use std::path::{Path, PathBuf};

use crate::args::Kind;

const MANIFEST: &str = include_str!("templates/Cargo.toml.txt");
const README: &str = include_str!("templates/README.md.txt");
const CONFORMS: &str = include_str!("templates/conforms.rs.txt");
const PLANNER: &str = include_str!("../../../../tests/third-party/one-block/src/lib.rs");
const PLANNER_DRIVE: &str = include_str!("../../../../tests/third-party/one-block/src/drive.rs");
const FEED_STRATEGY: &str = include_str!("templates/feed_strategy.rs.txt");
const DRIVER: &str = include_str!("templates/driver.rs.txt");
const KINEMATICS: &str = include_str!("../../../../tests/third-party/core-xy/src/lib.rs");

/// Options of the kinematics, and the joints that go with them.
const JOINTS: &str = "reversed = true

# Every joint with what it may do, in the order of the drives. One that is an axis says so.
[joints.a]
max_feed_mm_per_min = 15000
max_acceleration_mm_per_s2 = 1500
[joints.b]
max_feed_mm_per_min = 15000
max_acceleration_mm_per_s2 = 1500
[joints.z]
axis = \"z\"";

/// Names with which a crate or its test does not compile: Rust's keywords, its own crates, and those of Tandem that a plugin
/// uses.
const TAKEN: &str = "\
    abstract alloc as async await become box break const continue core crate do dyn else enum extern false final fn for gen \
    if impl in let loop macro match mod move mut override priv proc-macro pub ref return self static std struct super \
    tandem-conformance tandem-sdk test trait true try type typeof unsafe unsized use virtual where while yield";

/// Makes a crate with a first plugin of `kind` in the folder `folder`; `sdk` is where Tandem's source is.
pub fn new(folder: &Path, kind: Kind, sdk: Option<&str>) -> Result<u8, String> {
    let name = folder
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(plain) {
        let rule =
            "the name of a plugin has the characters a-z, 0-9 and - only, and begins with a letter";
        return Err(format!("{}: {rule}", folder.display()));
    }
    if TAKEN.split_whitespace().any(|taken| taken == name) {
        return Err(format!(
            "{}: no crate with a test can be called {name}: the name is Rust's or Tandem's",
            folder.display()
        ));
    }
    if folder.exists() {
        return Err(format!("{}: is there already", folder.display()));
    }
    let source = Source::find(sdk)?;
    for (file, text) in files(kind) {
        let text = filled(text, &name, kind, &source);
        write(&folder.join(file), &text)?;
    }
    say!(
        "{} is the plugin. What comes next:",
        folder.join("src/lib.rs").display()
    );
    say!("  cd {}", folder.display());
    say!("  cargo test                # the conformance kit judges it");
    say!("  cargo build --release     # {}", library(&name));
    say!("  tandem plugin check {}", library(&name));
    Ok(0)
}

/// Where cargo puts the shared library of the crate `name`.
fn library(name: &str) -> String {
    let (prefix, suffix) = (std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    format!("target/release/{prefix}{}{suffix}", name.replace('-', "_"))
}

fn files(kind: Kind) -> Vec<(&'static str, &'static str)> {
    let mut files = vec![
        ("Cargo.toml", MANIFEST),
        ("README.md", README),
        ("tests/conforms.rs", CONFORMS),
        (".gitignore", "target\n"),
    ];
    files.extend(match kind {
        Kind::Planner => vec![("src/lib.rs", PLANNER), ("src/drive.rs", PLANNER_DRIVE)],
        Kind::FeedStrategy => vec![("src/lib.rs", FEED_STRATEGY)],
        Kind::Driver => vec![("src/lib.rs", DRIVER)],
        Kind::Kinematics => vec![("src/lib.rs", KINEMATICS)],
    });
    files
}

/// A template with everything in its place. The planner and the kinematics are the examples of the tests, whose name gives
/// way too.
fn filled(text: &str, name: &str, kind: Kind, source: &Source) -> String {
    let (words, section, example, options) = match kind {
        Kind::Planner => (
            "planner",
            "planner",
            "one-block",
            "acceleration_share = 0.8",
        ),
        Kind::FeedStrategy => (
            "feed strategy",
            "feed_strategy",
            "NAME",
            "max_current_a = 6",
        ),
        Kind::Driver => ("driver", "driver", "NAME", "interface = \"eth0\""),
        Kind::Kinematics => ("kinematics", "kinematics", "core-xy", JOINTS),
    };
    text.replace(example, "NAME")
        .replace("NAME", name)
        .replace("CRATE", &name.replace('-', "_"))
        .replace("KIND", words)
        .replace("SECTION", section)
        .replace("OPTIONS", options)
        .replace("{ SDK }", &source.dependency("core/sdk"))
        .replace("{ CONFORMANCE }", &source.dependency("tests/conformance"))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

/// Where a plugin's crate finds the SDK and the conformance kit.
#[derive(Debug, PartialEq)]
enum Source {
    /// The root of a checkout of Tandem.
    Folder(PathBuf),
    /// A git repository.
    Git(String),
}

impl Source {
    /// What the command line says; else the checkout around the current folder, around this program, or that it was built
    /// from.
    fn find(stated: Option<&str>) -> Result<Self, String> {
        if let Some(place) = stated {
            let git = place.contains("://") || place.starts_with("git@");
            return if git {
                Ok(Self::Git(place.to_string()))
            } else {
                Self::folder(Path::new(place))
            };
        }
        let built_from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let places = [
            std::env::current_dir().ok(),
            std::env::current_exe().ok(),
            Some(built_from),
        ];
        let found = places
            .into_iter()
            .flatten()
            .find_map(|place| place.ancestors().find_map(|p| Self::folder(p).ok()));
        found.ok_or_else(|| {
            "the source of Tandem is not found: --sdk says where it is, as a folder or as the URL of a git repository"
                .to_string()
        })
    }

    fn folder(path: &Path) -> Result<Self, String> {
        if !path.join("core/sdk/Cargo.toml").is_file()
            || !path.join("tests/conformance/Cargo.toml").is_file()
        {
            return Err(format!(
                "{}: is no checkout of Tandem: it has no core/sdk",
                path.display()
            ));
        }
        path.canonicalize()
            .map(Self::Folder)
            .map_err(|e| format!("{}: {e}", path.display()))
    }

    /// What a manifest says of a package in `folder` of the source.
    fn dependency(&self, folder: &str) -> String {
        let text = |value: &str| toml::Value::String(value.to_string()).to_string();
        match self {
            Self::Folder(root) => format!(
                "{{ path = {} }}",
                text(&root.join(folder).to_string_lossy())
            ),
            Self::Git(url) => format!("{{ git = {} }}", text(url)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_which_nothing_compiles_is_refused() {
        for name in ["fn", "test", "core", "tandem-sdk"] {
            let refusal = new(
                &std::env::temp_dir().join("no-such-folder").join(name),
                Kind::Driver,
                None,
            )
            .unwrap_err();
            assert!(
                refusal.ends_with("the name is Rust's or Tandem's"),
                "{refusal}"
            );
        }
    }

    #[test]
    fn a_name_that_holds_that_of_an_example_stays() {
        let source = Source::Git("https://example.org/tandem.git".to_string());
        for (kind, name) in [
            (Kind::Planner, "core-xy-2"),
            (Kind::Planner, "one-block-2"),
            (Kind::Kinematics, "core-xy-2"),
        ] {
            let (_, text) = files(kind)
                .into_iter()
                .find(|(file, _)| *file == "src/lib.rs")
                .unwrap();
            let text = filled(text, name, kind, &source);
            assert!(
                text.contains(&format!(" \"{name}\" =")) && !text.contains("NAME"),
                "{text}"
            );
        }
    }

    #[test]
    fn the_sdk_is_found_by_folder_or_by_url() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../..")
            .canonicalize()
            .unwrap();
        assert_eq!(
            Source::find(root.to_str()),
            Ok(Source::Folder(root.clone()))
        );
        let git = Source::find(Some("https://example.org/tandem.git")).unwrap();
        assert_eq!(
            git.dependency("core/sdk"),
            "{ git = \"https://example.org/tandem.git\" }"
        );
        assert!(
            Source::find(Some("/no/such/folder"))
                .unwrap_err()
                .contains("core/sdk")
        );
    }
}
