//! Random programs, judged by the interpreter of another control, rs274: both must say the same moves, or both refuse.
//!
//! The judge is the command `rs274` of Debian's package linuxcnc-uspace, on the path or named by `RS274`; where it is not
//! installed nothing is judged, which the test prints. `JUDGE_PROGRAMS=5000` judges more programs, `JUDGE_SEED=17` one.

mod canon;
#[path = "../common/mod.rs"]
mod common;
mod programs;

use std::path::{Path, PathBuf};

use tandem_gcode::{Config, Item, Program, Stream, check};
use tandem_sdk::{Axes, AxisVector, BlockKind};

/// What both say of a program, in machine coordinates of X Y Z, mm.
#[derive(Clone, Debug, PartialEq)]
pub enum Move {
    /// Its end.
    Rapid([f64; 3]),
    /// Its end.
    Line([f64; 3]),
    /// End, and the distance of the centre from it in the two axes of the plane.
    Arc([f64; 3], [f64; 2]),
    /// Seconds.
    Dwell(f64),
}

/// Half a unit of the last decimal that the judge prints, in inches, with the sum of some offsets.
const SAME_MM: f64 = 0.02;

impl Move {
    fn end(&self) -> Option<[f64; 3]> {
        match self {
            Self::Rapid(end) | Self::Line(end) | Self::Arc(end, _) => Some(*end),
            Self::Dwell(_) => None,
        }
    }

    fn is_like(&self, other: &Self) -> bool {
        let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME_MM);
        match (self, other) {
            (Self::Rapid(a), Self::Rapid(b)) | (Self::Line(a), Self::Line(b)) => near(a, b),
            (Self::Arc(a, c), Self::Arc(b, d)) => near(a, b) && near(c, d),
            (Self::Dwell(a), Self::Dwell(b)) => (a - b).abs() < 1e-3,
            _ => false,
        }
    }
}

/// Leaves out moves that go nowhere.
fn moving(moves: Vec<Move>) -> Vec<Move> {
    let mut at = [0.0; 3];
    let mut kept = Vec::new();
    for step in moves {
        let still = match &step {
            Move::Rapid(end) | Move::Line(end) => end.iter().zip(&at).all(|(a, b)| (a - b).abs() < SAME_MM),
            Move::Arc(..) => false,
            Move::Dwell(seconds) => *seconds == 0.0,
        };
        at = step.end().unwrap_or(at);
        if !still {
            kept.push(step);
        }
    }
    kept
}

fn machine(folder: &Path) -> Config {
    let axes = Axes::new(&[('X', false), ('Y', false), ('Z', false), ('A', true)]).unwrap();
    let mut config = Config::new(axes);
    config.subroutine_path.push(folder.to_path_buf());
    for (number, length) in [(1, 20.0), (2, 25.0)] {
        let offset = AxisVector::from_slice(&[0.0, 0.0, length]);
        config.tools.push(tandem_gcode::Tool { number, pocket: Some(number), offset, diameter_mm: 6.0 });
    }
    config
}

/// What this interpreter says; the first message where it refuses.
fn ours(path: &Path, folder: &Path) -> Result<Vec<Move>, String> {
    let config = machine(folder);
    let mut program = Program::open(path).map_err(|e| e.to_string())?;
    let report = check(&mut program, &config, &mut |_| Ok(())).map_err(|e| e.to_string())?;
    if let Some(first) = report.diagnostics.first() {
        return Err(first.to_string());
    }
    let mut stream = Stream::new(program, &config).map_err(|e| e.to_string())?;
    let mut items = Vec::new();
    while stream.next_items(&mut items).map_err(|e| e.to_string())? {}
    let mut moves = Vec::new();
    for item in &items {
        let Item::Block(block) = item else { continue };
        let end = [block.end[0], block.end[1], block.end[2]];
        moves.push(match block.kind {
            BlockKind::Rapid => Move::Rapid(end),
            BlockKind::Dwell => Move::Dwell(block.dwell_s),
            BlockKind::Arc => {
                let [a, b] = block.arc.plane.map(|axis| axis as usize);
                Move::Arc(end, [block.arc.center_mm[0] - end[a], block.arc.center_mm[1] - end[b]])
            }
            _ => Move::Line(end),
        });
    }
    assert_eq!(items.iter().filter(|item| matches!(item, Item::Block(_))).count() as u64, report.blocks);
    Ok(moving(moves))
}

/// Where the two part, in words; `None` where they say the same.
fn difference(text: &str, judge: &Path, folder: &Path) -> Option<String> {
    let path = folder.join("program.ngc");
    std::fs::write(&path, text).unwrap();
    let (mine, theirs) = (ours(&path, folder), canon::judged(judge, &path, folder).map(moving));
    match (mine, theirs) {
        (Err(_), Err(_)) => None,
        (Ok(_), Err(theirs)) if theirs == canon::NEVER_ENDS => {
            println!("not judged: {theirs}");
            None
        }
        (Err(mine), Ok(_)) => Some(format!("refused here, taken by the judge: {mine}")),
        (Ok(_), Err(theirs)) => Some(format!("taken here, refused by the judge: {theirs}")),
        (Ok(mine), Ok(theirs)) => {
            let same = mine.iter().zip(&theirs).take_while(|(a, b)| a.is_like(b)).count();
            let all = same == mine.len() && same == theirs.len();
            (!all).then(|| format!("move {same}: here {:?}, judge {:?}", mine.get(same), theirs.get(same)))
        }
    }
}

fn judge() -> Option<PathBuf> {
    if let Some(path) = std::env::var_os("RS274") {
        return Some(path.into());
    }
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).map(|folder| folder.join("rs274")).find(|file| file.is_file())
}

fn judge_all(kind: &str, count: u64, program: fn(u64) -> String) {
    let Some(judge) = judge() else {
        println!("skipped: rs274 (Debian's linuxcnc-uspace) is not installed, and RS274 names none");
        return;
    };
    let folder = std::env::temp_dir().join(format!("tandem-judge-{kind}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
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
            None => taken += u64::from(ours(&folder.join("program.ngc"), &folder).is_ok()),
        }
    }
    let _ = std::fs::remove_dir_all(&folder);
    println!("{kind}: {taken} of {} the same, {} differ", seeds.end - seeds.start, wrong.len());
    assert!(
        wrong.is_empty(),
        "{} differ:\n{}",
        wrong.len(),
        wrong.iter().take(5).cloned().collect::<Vec<_>>().join("\n")
    );
    assert!(taken * 10 >= (seeds.end - seeds.start) * 9, "nearly all of these programs are valid, {taken} were taken");
}

#[test]
fn programs_with_o_words() {
    judge_all("o-words", 60, programs::with_o_words);
}

#[test]
fn programs_with_canned_cycles() {
    judge_all("cycles", 60, programs::with_cycles);
}

#[test]
fn programs_with_offsets_and_rotation() {
    judge_all("offsets", 60, programs::with_offsets);
}
