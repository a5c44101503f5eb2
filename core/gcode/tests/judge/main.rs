//! Random programs, judged by the interpreter of another control, rs274: both must say the same moves, or both refuse.
//!
//! The judge is the command `rs274` of Debian's package linuxcnc-uspace, on the path or named by `RS274`; where it is not
//! installed nothing is judged, which the test prints. `JUDGE_PROGRAMS=5000` judges more programs, `JUDGE_SEED=17` one.

mod canon;
#[path = "../common/mod.rs"]
mod common;
mod compare;
mod programs;

use std::path::Path;

use canon::Tables;
use compare::{judge, moving, ours};
use tandem_gcode::Config;
use tandem_sdk::{Axes, AxisVector};

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

/// Where the two part, in words; `None` where they say the same.
fn difference(text: &str, judge: &Path, folder: &Path) -> Option<String> {
    let path = folder.join("program.ngc");
    std::fs::write(&path, text).unwrap();
    let theirs = canon::judged(judge, &path, folder, &Tables::of_tools(&TOOLS)).map(moving);
    let mine = ours(&path, &machine(folder));
    match (mine, theirs) {
        (Err(_), Err(_)) => None,
        (Ok(_), Err(theirs)) if theirs == canon::NEVER_ENDS => {
            println!("not judged: {theirs}");
            None
        }
        // The judge does not look back where an arc follows around an outside corner.
        (Err(mine), Ok(_)) if mine.contains(canon::UNSEEN) => {
            println!("{}: {mine}", canon::UNSEEN);
            None
        }
        (Err(mine), Ok(_)) => Some(format!("refused here, taken by the judge: {mine}")),
        (Ok(_), Err(theirs)) => Some(format!("taken here, refused by the judge: {theirs}")),
        (Ok(mine), Ok(theirs)) => compare::parting(&mine, &theirs),
    }
}

fn judge_all(kind: &str, count: u64, least_tenths: u64, program: fn(u64) -> String) {
    let Some(judge) = judge() else {
        println!(
            "skipped: rs274 (Debian's linuxcnc-uspace) is not installed, and RS274 names none"
        );
        return;
    };
    let folder = std::env::temp_dir().join(format!("tandem-judge-{kind}-{}", std::process::id()));
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
    let (mut taken, mut wrong) = (0, Vec::new());
    for seed in seeds.clone() {
        let text = program(seed);
        match difference(&text, &judge, &folder) {
            Some(why) => wrong.push(format!("JUDGE_SEED={seed}: {why}\n{text}")),
            None => {
                taken += u64::from(ours(&folder.join("program.ngc"), &machine(&folder)).is_ok());
            }
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
    println!(
        "{kind}: {taken} of {} the same, {} differ",
        seeds.end - seeds.start,
        wrong.len()
    );
    assert!(
        wrong.is_empty(),
        "{} differ:\n{}",
        wrong.len(),
        wrong.iter().take(5).cloned().collect::<Vec<_>>().join("\n")
    );
    let enough = taken * 10 >= (seeds.end - seeds.start) * least_tenths;
    assert!(
        enough,
        "{least_tenths} of ten of these programs are valid, {taken} were taken"
    );
}

#[test]
fn programs_with_o_words() {
    judge_all("o-words", 60, 9, programs::with_o_words);
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
