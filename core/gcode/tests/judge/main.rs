//! Random programs, judged by the interpreter of another control, rs274: both must say the same moves, or both refuse.
//!
//! The judge is the command `rs274` of Debian's package linuxcnc-uspace, on the path, named by `RS274`, or where
//! `core/gcode/tests/judge/install` puts it; where there is none nothing is judged, which the test prints. `JUDGE_PROGRAMS=5000` judges more programs, `JUDGE_SEED=17` one.

mod canon;
#[path = "../common/mod.rs"]
mod common;
mod compare;
mod flat;
mod programs;

use std::path::{Path, PathBuf};

use canon::Tables;
use compare::{judge, moving, ours};
use tandem_gcode::Config;
use tandem_sdk::{Axes, AxisVector};

/// What is said of a move that radius compensation would turn around, which the judge drives in some cases.
const UNSEEN: &str = "the corner lies before the start of the first, and the tool would cut";
/// Number, length and diameter, mm.
const TOOLS: [(u32, f64, f64); 2] = [(1, 20.0, 2.0), (2, 25.0, 0.5)];

fn machine(folder: &Path) -> Config {
    let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap();
    let mut config = Config::new(axes);
    config.subroutine_path.push(folder.to_path_buf());
    for (number, length, diameter_mm) in TOOLS {
        let offset = AxisVector::from_slice(&[0.0, 0.0, length]);
        config.tools.push(tandem_gcode::Tool {
            number,
            pocket: Some(number),
            offset,
            diameter_mm,
        });
    }
    config
}

/// What comes of comparing the two.
enum Verdict {
    Same,
    BothRefuse,
    NotJudged(String),
    /// Where they part, in words.
    Differ(String),
}

fn verdict(text: &str, judge: &Path, folder: &Path) -> Verdict {
    let path = folder.join("program.ngc");
    std::fs::write(&path, text).unwrap();
    let theirs = canon::judged(judge, &path, folder, &Tables::of_tools(&TOOLS)).map(moving);
    let mine = ours(&path, &machine(folder));
    match (mine, theirs) {
        (_, Err(theirs)) if theirs == canon::NEVER_ENDS => Verdict::NotJudged(theirs),
        (Err(_), Err(_)) => Verdict::BothRefuse,
        // The judge does not look back where an arc follows around an outside corner.
        (Err(mine), Ok(_)) if mine.contains(UNSEEN) => Verdict::NotJudged(mine),
        (Err(mine), Ok(_)) => Verdict::Differ(format!("refused here, taken by the judge: {mine}")),
        (Ok(_), Err(theirs)) => {
            Verdict::Differ(format!("taken here, refused by the judge: {theirs}"))
        }
        (Ok(mine), Ok(theirs)) => {
            compare::parting(&mine, &theirs).map_or(Verdict::Same, Verdict::Differ)
        }
    }
}

/// Where the judge writes: in memory, because it waits for a disk with each of its programs.
fn scratch() -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let is_there = std::fs::metadata(&memory).is_ok_and(|what| !what.permissions().readonly());
    if is_there {
        memory
    } else {
        std::env::temp_dir()
    }
}

/// Writes a program from a seed.
type Writer = fn(u64) -> String;

fn judge_all(kind: &str, count: u64, min_tenths: u64, program: Writer) {
    let Some(judge) = judge() else {
        println!(
            "skipped: rs274 (Debian's linuxcnc-uspace) is not there: core/gcode/tests/judge/install gets it"
        );
        return;
    };
    let folder = scratch().join(format!("tandem-judge-{kind}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let number = |name| {
        std::env::var(name)
            .ok()
            .and_then(|text| text.parse::<u64>().ok())
    };
    let seeds = match number("JUDGE_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..number("JUDGE_PROGRAMS").unwrap_or(count),
    };
    println!("{kind}: seeds {seeds:?}");
    let (mut same, mut refused, mut open, mut wrong) = (0, 0, 0, Vec::new());
    for seed in seeds.clone() {
        let text = program(seed);
        match verdict(&text, &judge, &folder) {
            Verdict::Same => same += 1,
            Verdict::BothRefuse => refused += 1,
            Verdict::NotJudged(why) => {
                println!("JUDGE_SEED={seed} is not judged: {why}");
                open += 1;
            }
            Verdict::Differ(why) => wrong.push(format!("JUDGE_SEED={seed}: {why}\n{text}")),
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
    println!(
        "{kind}: {same} of {} the same, {refused} refused by both, {open} not judged, {} differ",
        seeds.end - seeds.start,
        wrong.len()
    );
    assert!(
        wrong.is_empty(),
        "{} differ:\n{}",
        wrong.len(),
        wrong.iter().take(5).cloned().collect::<Vec<_>>().join("\n")
    );
    let enough = same * 10 >= (seeds.end - seeds.start) * min_tenths;
    assert!(
        enough,
        "{min_tenths} of ten of these programs are valid, {same} were the same"
    );
}

#[test]
fn programs_with_o_words() {
    judge_all("o-words", 60, 9, programs::with_o_words);
}

#[test]
fn programs_with_subprograms() {
    judge_all("subprograms", 60, 9, programs::with_subprograms);
}

#[test]
fn programs_with_canned_cycles() {
    judge_all("cycles", 60, 9, programs::with_cycles);
}

#[test]
fn programs_with_radius_compensation() {
    // Many of these contours cannot be driven by their tools, which both must say.
    judge_all("compensation", 120, 2, programs::with_compensation);
}

#[test]
fn programs_with_offsets_and_rotation() {
    judge_all("offsets", 60, 9, programs::with_offsets);
}

#[test]
fn programs_with_modes() {
    judge_all("modes", 60, 8, programs::with_modes);
}

/// Calls, loops, cycles and offsets leave nothing in the path that their moves alone would not: a planner drives both in the same
/// time. And a program makes the same blocks whenever it is read.
#[test]
fn moves_written_out_are_the_same_blocks() {
    let folder = std::env::temp_dir().join(format!("tandem-written-out-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let config = machine(&folder);
    let [program, plain] = ["program.ngc", "plain.ngc"].map(|name| folder.join(name));
    let kinds: [(&str, Writer); 5] = [
        ("o-words", programs::with_o_words),
        ("subprograms", programs::with_subprograms),
        ("cycles", programs::with_cycles),
        ("offsets", programs::with_offsets),
        ("compensation", programs::with_compensation),
    ];
    for (kind, write) in kinds {
        let mut compared = 0;
        for seed in 0..40 {
            let text = write(seed);
            std::fs::write(&program, &text).unwrap();
            let Some(blocks) = flat::blocks(&program, &config) else {
                continue;
            };
            let again = flat::blocks(&program, &config).unwrap();
            assert_eq!(flat::shown(&blocks), flat::shown(&again), "{kind} {seed}");
            std::fs::write(&plain, flat::written_out(&blocks)).unwrap();
            let written = flat::blocks(&plain, &config)
                .unwrap_or_else(|| panic!("{kind} {seed}: the moves are refused\n{text}"));
            if let Some(why) = flat::parting(&blocks, &written) {
                panic!("{kind} {seed}: {why}\n{text}");
            }
            compared += blocks.len();
        }
        println!("{kind}: {compared} blocks");
        assert!(compared > 150, "{kind}: {compared} blocks are too few");
    }
    let _ = std::fs::remove_dir_all(&folder);
}
