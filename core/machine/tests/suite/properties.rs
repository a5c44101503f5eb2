//! Whatever a file holds, reading it ends in a machine that makes sense or in words.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::common::{fixtures, read};
use proptest::prelude::*;
use tandem_machine::{Machine, MachineError};

/// Reads `bytes` as a machine file that stands where the files of the good one are found.
fn read_bytes(bytes: &[u8], overrides: &[(String, String)]) -> Result<Machine, MachineError> {
    let directory = tempfile::tempdir().unwrap();
    let shared = directory.path().join("shared");
    fs::create_dir(&shared).unwrap();
    for name in ["axes.toml", "drives.toml", "tools.toml"] {
        fs::copy(fixtures().join("good/shared").join(name), shared.join(name)).unwrap();
    }
    let path = directory.path().join("machine.toml");
    fs::write(&path, bytes).unwrap();
    Machine::read(&path, overrides)
}

fn good() -> String {
    fs::read_to_string(fixtures().join("good/full.toml")).unwrap()
}

/// What every machine that is accepted holds to, and every refusal.
fn check(result: Result<Machine, MachineError>) {
    match result {
        Ok(machine) => check_machine(&machine),
        Err(error) => {
            assert!(!error.problems.is_empty() && error.problems.len() <= 101);
            assert_eq!(
                error.to_string().lines().count(),
                error.problems.len(),
                "one line each: {error}"
            );
        }
    }
}

fn check_machine(machine: &Machine) {
    let periods = machine.rough_period_s / machine.fine_period_s;
    assert!(
        machine.fine_period_s > 0.0
            && (periods - f64::from(machine.fine_periods_per_rough)).abs() < 1e-6
    );
    let joints = machine.joints.iter().map(|j| (&j.limits, j.home));
    let axes = machine
        .limits
        .axes()
        .iter()
        .enumerate()
        .map(|(i, limits)| (limits, machine.start[i]));
    for (limits, position) in axes.chain(joints) {
        assert!(
            limits.min_mm < limits.max_mm && (limits.min_mm..=limits.max_mm).contains(&position)
        );
        let positive = [
            limits.feed_mm_per_s,
            limits.rapid_mm_per_s,
            limits.acceleration_mm_per_s2,
        ];
        assert!(positive.iter().all(|v| v.is_finite() && *v > 0.0) && limits.jerk_mm_per_s3 > 0.0);
        assert!(limits.speed_difference_mm_per_s >= 0.0);
    }
    assert!(machine.motion.max_feed_ratio >= 1.0);
}

/// A change to the text: what is in the range of bytes gives way to something else.
fn spoil(text: &str, changes: &[(usize, usize, String)]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for (at, length, with) in changes {
        let start = at % bytes.len().max(1);
        let end = (start + length).min(bytes.len());
        bytes.splice(start.min(end)..end, with.bytes());
    }
    bytes
}

fn odd_text() -> impl Strategy<Value = String> {
    let pieces = [
        "",
        "-",
        "nan",
        "inf",
        "1e999",
        "99999999999999999999",
        "\"\"",
        "[]",
        "{}",
        "[[",
        "]]",
        "a.b",
        "=",
        "\n",
        "\"\"\"",
        "µ",
        "0x",
        "1e-320",
        "\0",
        "include = [\"machine.toml\"]\n",
        "[axes.y]\n",
        "[tools]\n",
    ];
    prop_oneof![
        prop::sample::select(pieces.to_vec()).prop_map(str::to_owned),
        ".{0,6}"
    ]
}

/// Swaps two lines, which moves keys into tables where they do not belong.
fn swap_lines(text: &str, first: usize, second: usize) -> String {
    let mut lines: Vec<_> = text.lines().collect();
    let count = lines.len();
    lines.swap(first % count, second % count);
    lines.join("\n")
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) })]

    #[test]
    fn random_bytes_are_refused_in_words(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        check(read_bytes(&bytes, &[]));
    }

    #[test]
    fn a_spoiled_file_is_refused_in_words(changes in prop::collection::vec((any::<usize>(), 0_usize..12, odd_text()), 1..4)) {
        check(read_bytes(&spoil(&good(), &changes), &[]));
    }

    #[test]
    fn swapped_lines_are_refused_in_words(first in any::<usize>(), second in any::<usize>()) {
        check(read_bytes(swap_lines(&good(), first, second).as_bytes(), &[]));
    }

    #[test]
    fn random_overrides_are_refused_in_words(key in "[a-z_.<> ]{0,20}", known in any::<usize>(), value in odd_text()) {
        let keys = tandem_machine::keys();
        let known = keys[known % keys.len()].path.replace("<axis>", "x").replace("<joint>", "x1");
        check(read_bytes(good().as_bytes(), &[(key, value.clone())]));
        check(read_bytes(good().as_bytes(), &[(known, value)]));
    }

    #[test]
    fn a_good_file_says_what_was_written(
        letters in prop::sample::subsequence("xyzabcuv".chars().collect::<Vec<_>>(), 1..=8).prop_shuffle(),
        numbers in prop::collection::vec((-1e4..-1.0, 1.0..1e4, 1.0..1e5, 1.0..1e5), 8),
        fine in 0.05..2.0, count in 1_u32..20,
    ) {
        let numbers: Vec<Axis> = numbers;
        let text = written(&letters, &numbers, fine, f64::from(count) * fine);
        let machine = read_bytes(text.as_bytes(), &[]).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(machine.axes.count(), letters.len());
        prop_assert_eq!(machine.fine_periods_per_rough, count);
        for (i, ((letter, (low, high, feed, acceleration)), limits)) in letters.iter().zip(&numbers).zip(machine.limits.axes()).enumerate() {
            prop_assert_eq!(machine.axes.letter(i), letter.to_ascii_uppercase());
            prop_assert_eq!((limits.min_mm, limits.max_mm), (*low, *high));
            prop_assert_eq!((limits.feed_mm_per_s, limits.acceleration_mm_per_s2), (feed * (1.0 / 60.0), *acceleration));
        }
    }
}

type Axis = (f64, f64, f64, f64);

fn written(letters: &[char], numbers: &[Axis], fine: f64, rough: f64) -> String {
    let mut text = format!(
        "format = 1\nloops = {{ fine_period_ms = {fine:?}, rough_period_ms = {rough:?} }}\n"
    );
    text += "planner.plugin = \"look-ahead\"\ndriver.plugin = \"sim\"\n";
    for (letter, (low, high, feed, acceleration)) in letters.iter().zip(numbers) {
        let _ = writeln!(
            text,
            "[axes.{letter}]\ntravel_mm = [{low:?}, {high:?}]\nmax_feed_mm_per_min = {feed:?}"
        );
        let _ = writeln!(text, "max_acceleration_mm_per_s2 = {acceleration:?}");
    }
    text
}

#[test]
fn the_configuration_in_force_reads_as_the_same_machine() {
    let machine = read(
        &fixtures().join("good/full.toml"),
        &["axes.x.start_mm=17", "planner.options.zeta=2"],
    )
    .unwrap();
    let again = read_bytes(machine.effective_toml().as_bytes(), &[]).unwrap();
    assert_eq!(again.effective_toml(), machine.effective_toml());
    assert_eq!(again.start[0], 17.0);
    let said = |m: &Machine| {
        format!(
            "{:?}",
            (
                m.axes, m.limits, m.home, &m.joints, &m.planner, &m.drivers, &m.tools, &m.policy
            )
        )
    };
    assert_eq!(said(&again), said(&machine));
}

#[test]
fn deep_nesting_and_long_files_are_refused() {
    let arrays = format!(
        "format = 1\nfaults = {{ a = {}1{} }}",
        "[".repeat(70),
        "]".repeat(70)
    );
    let words = read_bytes(arrays.as_bytes(), &[]).unwrap_err().to_string();
    assert!(words.contains(":2:"), "{words}");
    assert!(
        words.contains("faults.a: nested more than 64 levels deep"),
        "{words}"
    );
    check(read_bytes("[".repeat(1_000_000).as_bytes(), &[]));
    check(read_bytes(
        format!("{}a = 1", "a.".repeat(500_000)).as_bytes(),
        &[],
    ));
    let dotted = format!("{}a=", "a.".repeat(78));
    let tables = format!(
        "format = 1\n[{}a]\n{dotted}{}1{}",
        "a.".repeat(78),
        format!("{{{dotted}").repeat(78),
        "}".repeat(78)
    );
    check(read_bytes(tables.as_bytes(), &[]));
    let words = read_bytes("# long\n".repeat(200_000).as_bytes(), &[])
        .unwrap_err()
        .to_string();
    assert!(
        words.ends_with("machine.toml: cannot be read: longer than 1048576 bytes"),
        "{words}"
    );
}

#[test]
fn many_problems_end_in_a_count() {
    let text = (0..50_000).fold(String::new(), |text, i| text + &format!("key{i} = 1\n"));
    let error = read_bytes(format!("format = 1\n{text}").as_bytes(), &[]).unwrap_err();
    assert_eq!(error.problems.len(), 101);
    assert_eq!(
        error.problems[100].what,
        "100 problems so far; the rest is not listed"
    );
}

#[test]
fn text_that_is_not_utf_8_is_refused_with_its_place() {
    let error = read_bytes(b"format = 1\nname = \"\xff\"\n", &[])
        .unwrap_err()
        .to_string();
    assert!(
        error.ends_with("machine.toml:2:9: not UTF-8 text"),
        "{error}"
    );
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let error = Machine::read(Path::new("absent.toml"), &[]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "absent.toml: cannot be read: No such file or directory (os error 2)"
    );
}

#[test]
fn files_that_include_many_others_end() {
    let directory = tempfile::tempdir().unwrap();
    for level in 0..20 {
        let next = format!("{}.toml", level + 1);
        let text = format!("format = 1\ninclude = [\"{next}\", \"{next}\"]\n");
        fs::write(directory.path().join(format!("{level}.toml")), text).unwrap();
    }
    fs::write(directory.path().join("20.toml"), "").unwrap();
    let error = Machine::read(&directory.path().join("0.toml"), &[])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("the machine is made of more than 64 files"),
        "{error}"
    );
}
