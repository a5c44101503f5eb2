//! Two runs of one case, side by side.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use tandem_oracle::{Kind, Machine, Options, Trace, judge};

use crate::cases::Case;
use crate::declared::Declared;
use crate::numbers::{COUNTS, leaves, without_numbers};
use crate::run::{Ran, TRACE, run};

/// Planners that search for the shortest time on a grid: another grid gives another motion, within the same limits. All
/// others give the same motion bit for bit.
const SEARCHING: [&str; 2] = ["smooth", "nurbs"];
/// Greatest ratio of times, new by old, of a program with a planner that searches.
const MAX_TIME_RATIO: f64 = 1.01;
/// Lines of a difference that are shown.
const MAX_LINES_SHOWN: usize = 4;

/// What a comparison found.
#[derive(Debug, Default)]
pub struct Finding {
    /// Differences in words.
    pub differences: Vec<String>,
    /// Whether trace, blocks, summary and messages are the same.
    pub is_same: bool,
    /// The planner, where the run came to a summary.
    pub planner: String,
    /// Times new by old, where the planner searches and the program came to its end.
    pub time_ratio: Option<f64>,
}

impl Finding {
    /// What is printed: nothing where nothing differs.
    pub fn text(&self, name: &str) -> String {
        let mut text = String::new();
        for difference in &self.differences {
            writeln!(text, "{name}: {difference}").expect("a text takes what is written");
        }
        text
    }
}

/// Runs `case` with both builds. The files of one that differs are left in `keep`.
///
/// # Errors
/// A folder or a process.
pub fn compare(
    case: &Case,
    binaries: &[PathBuf; 2],
    declared: &Declared,
    keep: &Path,
) -> Result<Finding, String> {
    let work = tempfile::tempdir().map_err(|e| e.to_string())?;
    let folders = ["old", "new"].map(|name| work.path().join(name));
    let old = run(case, &binaries[0], &folders[0])?;
    let new = run(case, &binaries[1], &folders[1])?;
    let finding = Comparison {
        case,
        declared,
        new_binary: &binaries[1],
        old,
        new,
    }
    .finding();
    if !finding.differences.is_empty() {
        let name: String = case
            .name
            .chars()
            .map(|letter| if "/ =".contains(letter) { '-' } else { letter })
            .collect();
        let kept = keep.join(name);
        std::fs::create_dir_all(&kept).map_err(|e| e.to_string())?;
        for folder in &folders {
            copy(folder, &kept.join(folder.file_name().unwrap_or_default()))
                .map_err(|e| e.to_string())?;
        }
    }
    Ok(finding)
}

fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(to)?;
    for entry in std::fs::read_dir(from)? {
        let path = entry?.path();
        if path.is_file() {
            std::fs::copy(&path, to.join(path.file_name().unwrap_or_default()))?;
        }
    }
    Ok(())
}

struct Comparison<'a> {
    case: &'a Case,
    declared: &'a Declared,
    new_binary: &'a Path,
    old: Ran,
    new: Ran,
}

impl Comparison<'_> {
    fn finding(&self) -> Finding {
        let planner = self.old.summary["planner"]
            .as_str()
            .unwrap_or_default()
            .to_string();
        let may_move_otherwise =
            SEARCHING.contains(&planner.as_str()) && self.old.trace != self.new.trace;
        let mut finding = Finding {
            is_same: !may_move_otherwise,
            planner,
            ..Finding::default()
        };
        if self.old.status != self.new.status {
            let [old, new] = [&self.old, &self.new].map(|ran| {
                ran.status
                    .map_or("none".to_string(), |status| status.to_string())
            });
            finding
                .differences
                .push(format!("exit status {old} -> {new}"));
        }
        if may_move_otherwise {
            self.searched(&mut finding);
        } else {
            self.exact(&mut finding);
        }
        if SEARCHING.contains(&finding.planner.as_str()) && self.old.status == Some(0) {
            finding.time_ratio = self.time_ratio();
        }
        finding
    }

    /// Everything is the same but for messages that are declared.
    fn exact(&self, finding: &mut Finding) {
        let differences = &mut finding.differences;
        self.texts(differences, str::to_string);
        if self.old.trace != self.new.trace {
            differences.push(format!("trace: {}", self.trace_difference()));
        }
        let expected = |(path, value): (String, String)| {
            (
                self.declared.expected(&path),
                self.declared.expected(&value),
            )
        };
        let old: Vec<_> = leaves(&self.old.summary)
            .into_iter()
            .map(expected)
            .collect();
        let new = leaves(&self.new.summary);
        let shown = |leaves: &[(String, String)]| {
            leaves
                .iter()
                .flat_map(|(path, value)| [path, " = ", value, "\n"])
                .collect::<String>()
        };
        differences.extend(first_difference("summary", &shown(&old), &shown(&new)));
        differences.extend(first_difference(
            "blocks",
            &self.with_declared_head(&self.old.blocks),
            &self.new.blocks,
        ));
        differences.extend(first_difference(
            "events",
            &self.with_declared_head(&self.old.events),
            &self.new.events,
        ));
    }

    /// Another motion that keeps the same limits in the same time, and the same words without their numbers.
    fn searched(&self, finding: &mut Finding) {
        self.texts(&mut finding.differences, without_numbers);
        for count in COUNTS {
            let [old, new] =
                [&self.old, &self.new].map(|ran| ran.summary[count].as_u64().unwrap_or_default());
            if new > old || (count == "blocks" && new != old) {
                finding.differences.push(format!("{count} {old} -> {new}"));
            }
        }
        if let Some(ratio) = self
            .time_ratio()
            .filter(|ratio| *ratio > MAX_TIME_RATIO && self.old.status == Some(0))
        {
            finding
                .differences
                .push(format!("takes {ratio:.5} times as long"));
        }
        let broken: Vec<Kind> = self
            .kinds(&self.new)
            .difference(&self.kinds(&self.old))
            .copied()
            .collect();
        if !broken.is_empty() {
            finding.differences.push(format!(
                "the oracle finds broken by the new build only: {broken:?}"
            ));
        }
    }

    fn texts(&self, differences: &mut Vec<String>, seen: impl Fn(&str) -> String) {
        for (what, old, new) in [
            ("output", &self.old.output, &self.new.output),
            ("errors", &self.old.errors, &self.new.errors),
        ] {
            differences.extend(first_difference(
                what,
                &seen(&self.declared.expected(old)),
                &seen(new),
            ));
        }
    }

    /// A table whose columns may have been renamed.
    fn with_declared_head(&self, table: &str) -> String {
        let (head, rest) = table.split_at(table.find('\n').unwrap_or(table.len()));
        self.declared.expected(head) + rest
    }

    fn time_ratio(&self) -> Option<f64> {
        let [old, new] = [&self.old, &self.new].map(|ran| ran.summary["motion_time_s"].as_f64());
        new.zip(old)
            .filter(|(_, old)| *old > 0.0)
            .map(|(new, old)| new / old)
    }

    /// What `tandem trace diff` says.
    fn trace_difference(&self) -> String {
        let [old, new] = [&self.old, &self.new].map(|ran| ran.folder.join(TRACE));
        let said = Command::new(self.new_binary)
            .args(["trace", "diff"])
            .args([old, new])
            .output();
        let said = said
            .map(|said| String::from_utf8_lossy(&said.stdout).into_owned())
            .unwrap_or_default();
        said.lines()
            .take(MAX_LINES_SHOWN)
            .collect::<Vec<_>>()
            .join("; ")
    }

    /// What the oracle finds broken by a run. It is asked with the machine file as it is, whatever the case changes: only
    /// the difference of two runs counts.
    fn kinds(&self, ran: &Ran) -> BTreeSet<Kind> {
        self.judged(ran).unwrap_or_default()
    }

    fn judged(&self, ran: &Ran) -> Option<BTreeSet<Kind>> {
        let (machine, program) = (self.case.machine.as_ref()?, self.case.program.as_ref()?);
        let csv = ran.folder.join("judged.csv");
        let export = Command::new(self.new_binary)
            .args(["trace", "export"])
            .arg(ran.folder.join(TRACE))
            .arg("--csv")
            .arg(&csv)
            .output();
        export.ok().filter(|output| output.status.success())?;
        let machine = Machine::read(&ran.folder.join(machine)).ok()?;
        let program = std::fs::read_to_string(ran.folder.join(program)).ok()?;
        let mut options = Options::with_jerk();
        options.ends_early = ran.status != Some(0);
        let verdict = judge(&Trace::read(&csv).ok()?, &program, &machine, &options);
        Some(
            verdict
                .findings
                .iter()
                .map(|finding| finding.kind)
                .collect(),
        )
    }
}

/// The first line that differs; none where all are the same.
fn first_difference(what: &str, old: &str, new: &str) -> Option<String> {
    if old == new {
        return None;
    }
    let mut number = 1;
    let (mut left, mut right) = (old.lines(), new.lines());
    loop {
        match (left.next(), right.next()) {
            (Some(a), Some(b)) if a == b => number += 1,
            (None, None) => return Some(format!("{what}: the line ends differ")),
            (a, b) => {
                let shown = |line: Option<&str>| {
                    line.map_or("nothing".to_string(), |line| format!("{line:?}"))
                };
                return Some(format!(
                    "{what}, line {number}: {} -> {}",
                    shown(a),
                    shown(b)
                ));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::first_difference;

    #[test]
    fn the_first_line_that_differs_is_shown() {
        assert_eq!(first_difference("output", "a\nb\n", "a\nb\n"), None);
        let shorter = first_difference("output", "a\nb\n", "a\n");
        assert_eq!(shorter.as_deref(), Some("output, line 2: \"b\" -> nothing"));
        let other = first_difference("errors", "a\nb\n", "a\nc\n");
        assert_eq!(other.as_deref(), Some("errors, line 2: \"b\" -> \"c\""));
    }
}
