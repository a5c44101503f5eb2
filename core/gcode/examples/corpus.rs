//! Walks folders of part programs, compares each with what the interpreter of another control says, and ranks what keeps
//! programs from being taken.
//!
//! `cargo run --release --example corpus -- FOLDER…` prints a line a file and then the ranking. The judge is the command
//! `rs274` of Debian's package linuxcnc-uspace, on the path or named by `RS274`; without it only the ranking of refusals is
//! printed. The machine has the axes X Y Z A B C U V, a probe and no tool table, which counts as a table of lengths of zero.

#[path = "../tests/judge/canon.rs"]
mod canon;
#[path = "../tests/judge/compare.rs"]
mod compare;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use canon::Tables;
use compare::{judge, moving, ours, parting};
use tandem_gcode::{Config, ProbeInput};
use tandem_sdk::Axes;

/// Endings of part programs.
const ENDINGS: [&str; 8] = ["ngc", "nc", "gcode", "tap", "cnc", "gc", "ncd", "mpf"];
/// Longest reason that the ranking tells apart, characters.
const MAX_REASON: usize = 90;
/// Tools that the judge knows; the control has no table.
const TOOLS: u32 = 99;

fn main() {
    let roots: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    if roots.is_empty() {
        eprintln!("usage: corpus FOLDER…");
        std::process::exit(2);
    }
    let mut files = Vec::new();
    for root in &roots {
        match root.canonicalize() {
            Ok(root) => walk(&root, &mut files),
            Err(error) => eprintln!("{}: {error}", root.display()),
        }
    }
    files.sort();
    let judge = judge();
    if judge.is_none() {
        println!(
            "rs274 (Debian's linuxcnc-uspace) is not installed, and RS274 names none: nothing is compared"
        );
    }
    let folder = std::env::temp_dir().join(format!("tandem-corpus-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for temporary files");
    let mut ranking = BTreeMap::<(Verdict, String), Vec<&Path>>::new();
    for file in &files {
        let (verdict, why) = judged(file, judge.as_deref(), &folder);
        println!(
            "{}: {}{}{why}",
            file.display(),
            verdict.name(),
            if why.is_empty() { "" } else { ": " }
        );
        ranking
            .entry((verdict, reason(&why)))
            .or_default()
            .push(file);
    }
    let _ = std::fs::remove_dir_all(&folder);
    print(&ranking, files.len());
}

fn walk(place: &Path, files: &mut Vec<PathBuf>) {
    // What links point to is walked where it lies, or not at all.
    if place.is_symlink() {
        return;
    }
    if let Ok(entries) = std::fs::read_dir(place) {
        entries
            .flatten()
            .for_each(|entry| walk(&entry.path(), files));
    } else if place
        .extension()
        .is_some_and(|ending| ENDINGS.iter().any(|e| ending.eq_ignore_ascii_case(e)))
    {
        files.push(place.to_path_buf());
    }
}

/// What became of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    Same,
    /// Taken, but there is no judge, or it does not end.
    Taken,
    BothRefuse,
    RefusedHere,
    RefusedThere,
    Differs,
}

impl Verdict {
    fn name(self) -> &'static str {
        match self {
            Self::Same => "the same",
            Self::Taken => "taken, not judged",
            Self::BothRefuse => "refused by both",
            Self::RefusedHere => "refused here only",
            Self::RefusedThere => "refused by the judge only",
            Self::Differs => "other moves",
        }
    }

    fn is_taken(self) -> bool {
        !matches!(self, Self::BothRefuse | Self::RefusedHere)
    }
}

fn machine(file: &Path) -> Config {
    let axes = "XYZABCUV"
        .chars()
        .map(|letter| (letter, "ABC".contains(letter)))
        .collect::<Vec<_>>();
    let mut config = Config::new(Axes::new(&axes).expect("eight axes"));
    config.probe = Some(ProbeInput {
        input: 0,
        inverted: false,
    });
    config.zero_length_without_table = true;
    config
        .subroutine_path
        .extend(file.parent().map(Path::to_path_buf));
    config
}

fn judged(file: &Path, judge: Option<&Path>, folder: &Path) -> (Verdict, String) {
    let mine = ours(file, &machine(file));
    let Some(judge) = judge else {
        return mine.map_or_else(
            |why| (Verdict::RefusedHere, why),
            |_| (Verdict::Taken, String::new()),
        );
    };
    let tools: Vec<_> = (1..=TOOLS).map(|number| (number, 0.0, 0.0)).collect();
    let theirs = canon::judged(judge, file, folder, &Tables::of_tools(&tools)).map(moving);
    match (mine, theirs) {
        (Err(why), Err(_)) => (Verdict::BothRefuse, why),
        (Err(why), Ok(_)) => (Verdict::RefusedHere, why),
        (Ok(_), Err(why)) if why == canon::NEVER_ENDS => (Verdict::Taken, why),
        (Ok(_), Err(why)) => (Verdict::RefusedThere, why),
        (Ok(mine), Ok(theirs)) => parting(&mine, &theirs).map_or_else(
            || (Verdict::Same, String::new()),
            |why| (Verdict::Differs, why),
        ),
    }
}

/// A message without its place and its numbers, so that equal reasons are counted as one.
fn reason(why: &str) -> String {
    let why = why.lines().next().unwrap_or_default();
    let why = why
        .split_once("error: ")
        .map_or(why, |(_, message)| message);
    if why.starts_with("move ") {
        return "other moves".to_owned();
    }
    why.chars().take(MAX_REASON).collect()
}

fn print(ranking: &BTreeMap<(Verdict, String), Vec<&Path>>, count: usize) {
    let mut rows: Vec<_> = ranking.iter().collect();
    rows.sort_by_key(|((verdict, _), files)| (*verdict, std::cmp::Reverse(files.len())));
    println!();
    for ((verdict, reason), files) in &rows {
        println!(
            "{:5}  {}: {reason} ({})",
            files.len(),
            verdict.name(),
            files[0].display()
        );
    }
    let taken: usize = rows
        .iter()
        .filter(|((verdict, _), _)| verdict.is_taken())
        .map(|(_, files)| files.len())
        .sum();
    println!("\n{taken} of {count} files taken");
}
