//! What is refused, and in which words.

use std::path::{Path, PathBuf};

use tandem_sdk::abi;

use crate::harness::Scenario;
use crate::plugins::built::{built_in, mill_without, third_party};

const PROGRAM: &str = "G21 G90\nF600\nG1 X1\nM2\n";

/// What the command says when `key` is this file.
fn refusal(key: &str, file: &Path) -> String {
    let setting = format!("{key}={}", file.display());
    let done = Scenario::text(PROGRAM).with(&["--set", &setting]).run();
    assert_eq!(done.status(), 1, "{}", done.errors());
    let errors = done.errors();
    assert!(
        errors.starts_with(&format!("--set {key}: {}", file.display())),
        "{errors}"
    );
    errors
}

fn expect(key: &str, file: &Path, words: &str) {
    let errors = refusal(key, file);
    assert!(errors.contains(words), "{words}: {errors}");
}

/// A copy of a library with some bytes changed.
struct Patched(tempfile::TempDir, PathBuf);

impl Patched {
    fn new(name: &str, file: &str, from: &[u8], to: &[u8]) -> Self {
        let mut bytes = std::fs::read(third_party(name)).unwrap();
        let places: Vec<usize> = (0..bytes.len() - from.len())
            .filter(|at| bytes[*at..].starts_with(from))
            .collect();
        assert!(
            !places.is_empty(),
            "{name} does not hold what is to be changed"
        );
        for place in places {
            bytes[place..place + to.len()].copy_from_slice(to);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        std::fs::write(&path, bytes).unwrap();
        Self(folder, path)
    }

    fn path(&self) -> &Path {
        assert!(self.0.path().is_dir());
        &self.1
    }
}

#[test]
fn what_is_no_plugin() {
    let folder = tempfile::tempdir().unwrap();
    expect(
        "planner.plugin",
        &folder.path().join("libnone.so"),
        "there is no such file",
    );
    let text = folder.path().join("libtext.so");
    std::fs::write(&text, "not a library").unwrap();
    expect("driver.plugin", &text, "it cannot be loaded: ");
    let cut = folder.path().join("libcut.so");
    std::fs::write(
        &cut,
        &std::fs::read(third_party("one-block")).unwrap()[..20_000],
    )
    .unwrap();
    expect(
        "planner.plugin",
        &cut,
        "it is cut off: 20000 bytes, of at least ",
    );
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let library = maps.lines().find_map(|line| {
        line.split_whitespace()
            .last()
            .filter(|path| path.contains("libc.so"))
    });
    expect(
        "planner.plugin",
        Path::new(library.unwrap()),
        "it is no Tandem plugin: it does not export",
    );
}

#[test]
fn another_contract() {
    let head = |version: u32, layout: u64| -> Vec<u8> {
        let size = size_of::<abi::Library>() as u32;
        [
            &size.to_le_bytes()[..],
            &version.to_le_bytes(),
            &layout.to_le_bytes(),
        ]
        .concat()
    };
    let ours = head(tandem_sdk::ABI_VERSION, abi::LAYOUT);
    let newer = Patched::new("one-block", "libone_block.so", &ours, &head(7, abi::LAYOUT));
    let words = format!(
        "it is built for version 7 of the plugin contract; this host has {}",
        tandem_sdk::ABI_VERSION
    );
    expect("planner.plugin", newer.path(), &words);
    let other = Patched::new(
        "one-block",
        "libone_block.so",
        &ours,
        &head(tandem_sdk::ABI_VERSION, !abi::LAYOUT),
    );
    expect(
        "planner.plugin",
        other.path(),
        "it is built with another revision of tandem-sdk",
    );
    let symbol = Patched::new(
        "one-block",
        "libone_block.so",
        b"tandem_plugin_v1__",
        b"tandem_plugin_v2__",
    );
    expect(
        "planner.plugin",
        symbol.path(),
        "it exports tandem_plugin_v2__one_block; this host reads",
    );
}

#[test]
fn a_renamed_library_is_found_out() {
    let same = Patched::new(
        "one-block",
        "renamed.so",
        b"tandem_plugin_v1__",
        b"tandem_plugin_v1__",
    );
    let setting = format!("planner.plugin={}", same.path().display());
    let done = Scenario::text(PROGRAM).with(&["--set", &setting]).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
}

#[test]
fn the_wrong_kind_or_a_name_that_is_taken() {
    expect(
        "driver.plugin",
        &third_party("one-block"),
        "it is no driver: it holds planner one-block",
    );
    expect(
        "feed_strategy.plugin",
        &third_party("core-xy"),
        "it is no feed strategy: it holds kinematics core-xy",
    );
    let words = "it calls itself look-ahead, and a planner of that name is there already";
    expect("planner.plugin", &built_in("tandem-look-ahead"), words);
}

#[test]
fn options_are_refused_where_they_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let machine = folder.path().join("machine.toml");
    std::fs::copy(
        third_party("one-block"),
        folder.path().join("libone_block.so"),
    )
    .unwrap();
    let refused = |options: &str| {
        let plugin = "[planner]\nplugin = \"libone_block.so\"\n[planner.options]\n";
        std::fs::write(
            &machine,
            format!("{}{plugin}{options}", mill_without("planner")),
        )
        .unwrap();
        let done = Scenario::text(PROGRAM).on(&machine).run();
        assert_eq!(done.status(), 1, "{}", done.errors());
        let line = std::fs::read_to_string(&machine).unwrap().lines().count();
        let place = format!("{}:{line}:", machine.display());
        assert!(
            done.errors().starts_with(&place),
            "{place}: {}",
            done.errors()
        );
        done.errors()
    };
    let unknown = refused("bufer_blocks = 3\n");
    assert!(
        unknown.contains("planner.options.bufer_blocks") && unknown.contains("buffer_blocks"),
        "{unknown}"
    );
    let wrong_type = refused("buffer_blocks = \"many\"\n");
    assert!(
        wrong_type.contains("planner.options.buffer_blocks: planner one-block: invalid type"),
        "{wrong_type}"
    );
    let range = refused("acceleration_share = 2.0\n");
    assert!(
        range.contains("planner.options.acceleration_share: planner one-block: must be 0.01 to 1"),
        "{range}"
    );
}
