//! `--set key=value`.

use crate::common::{fixtures, read, refusal};
use tandem_machine::Machine;

fn mill(overrides: &[&str]) -> Machine {
    read(&fixtures().join("parts/mill.toml"), overrides).unwrap()
}

fn refused(overrides: &[&str]) -> String {
    refusal(&fixtures().join("parts/mill.toml"), overrides)
}

#[test]
fn values_are_toml_or_else_strings() {
    assert_eq!(
        mill(&["planner.plugin=block-overlap"]).planner.plugin,
        "block-overlap"
    );
    assert_eq!(
        mill(&["planner.plugin=\"block-overlap\""]).planner.plugin,
        "block-overlap"
    );
    assert_eq!(
        mill(&["axes.x.travel_mm=[-1, 2]"]).limits.axes()[0].max_mm,
        2.0
    );
    assert_eq!(mill(&["loops.rough_period_ms= 16 "]).rough_period_s, 0.016);
    assert_eq!(mill(&["machine.name=2 mills"]).name, "2 mills");
    assert_eq!(
        mill(&["planner.options.junction=tangent"]).planner.options,
        "junction = \"tangent\"\n"
    );
    assert_eq!(
        mill(&["planner.options={ a = 1 }", "planner.options.b=true"])
            .planner
            .options,
        "a = 1\nb = true\n"
    );
}

#[test]
fn the_later_one_counts() {
    assert_eq!(mill(&["machine.name=one", "machine.name=two"]).name, "two");
}

#[test]
fn the_order_of_the_axes_stays() {
    let machine = mill(&[
        "axes.a.start_deg=3",
        "axes.x.start_mm=1",
        "axes.y={ travel_mm = [0, 1] }",
        "axes.y.max_feed_mm_per_min=60",
        "axes.y.max_acceleration_mm_per_s2=1",
    ]);
    let letters: String = (0..4).map(|i| machine.axes.letter(i)).collect();
    assert_eq!(letters, "XZAY");
}

#[test]
fn refusals_name_the_override() {
    let cases = [
        (
            "planner.plugn=x",
            "--set planner.plugn: unknown key; did you mean `planner.plugin`?",
        ),
        (
            "plannr.plugin=x",
            "--set plannr.plugin: plannr: unknown key; did you mean `planner`?",
        ),
        (
            "planner.plugin.name=x",
            "--set planner.plugin.name: planner.plugin: must be a string, not a table",
        ),
        (
            "planner.junction=x",
            "--set planner.junction: unknown key; did you mean `planner.options.junction`?",
        ),
        (
            "axes.x.max_fed_mm_per_min=3",
            "--set axes.x.max_fed_mm_per_min: unknown key; did you mean `axes.x.max_feed_mm_per_min`?",
        ),
        (
            "axes.x.travel_mm=[10, -10]",
            "--set axes.x.travel_mm: the lowest, 10, is not below the highest, -10",
        ),
        (
            "axes.x.travel_deg=[0, 1]",
            "--set axes.x.travel_deg: a linear axis is in mm; did you mean `travel_mm`, or is `kind = \"rotary\"` missing?",
        ),
        (
            "loops.fine_period_ms=1 ms",
            "--set loops.fine_period_ms: must be a number, not a string",
        ),
        (
            "machine.name=7",
            "--set machine.name: must be a string, not a number",
        ),
        (
            "guard={ mod = \"count\" }",
            "--set guard: guard.mod: unknown key; did you mean `guard.mode`?",
        ),
        (
            "axes.x.start_mm=1e999",
            "--set axes.x.start_mm: the number 1e999 is out of range",
        ),
        (
            "planner..plugin=x",
            "--set planner..plugin: a part of the path is empty",
        ),
        ("=x", "--set : a part of the path is empty"),
        (
            "format=2",
            "--set format: belongs to the file and cannot be overridden",
        ),
        (
            "include=[]",
            "--set include: belongs to the file and cannot be overridden",
        ),
    ];
    for (given, expected) in cases {
        assert_eq!(refused(&[given]), expected, "--set {given}");
    }
    let deep = format!("{}x=1", "a.".repeat(100_000));
    assert!(refused(&[&deep]).ends_with(": the path is nested too deep"));
}

#[test]
fn files_and_overrides_are_told_together() {
    let words = refusal(
        &fixtures().join("bad/words.toml"),
        &["loops.fine_period_ms=3", "loops.rough=1"],
    );
    let expected = "bad/words.toml:5:1: guard.mode: must be \"stop\" or \"count\", not \"stpo\"\n\
        bad/words.toml:8:1: motion.jerk: must be \"limit\" or \"report\", not \"none\"\n\
        --set loops.fine_period_ms: the rough period, 8 ms, is not a whole multiple of the fine period, 3 ms\n\
        --set loops.rough: unknown key; did you mean `loops.rough_period_ms`?";
    assert_eq!(words, expected);
}
