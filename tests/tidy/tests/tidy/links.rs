//! Links between Markdown files.

use std::path::Path;

use crate::expect_none;
use crate::tree::{files, root};

#[test]
fn links_lead_somewhere() {
    let mut findings = vec![];
    let mut count = 0;
    for file in files(&[".md"]) {
        for (number, line) in file.lines() {
            for target in targets(line) {
                count += 1;
                if let Err(why) = follow(&file.name, &file.text, target) {
                    findings.push(format!("{}:{number}: {target}: {why}", file.name));
                }
            }
        }
    }
    assert!(count > 20, "only {count} links were found");
    expect_none("broken links", &findings);
}

/// What stands in `](…)`.
fn targets(line: &str) -> impl Iterator<Item = &str> {
    line.split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
}

fn follow(from: &str, text: &str, target: &str) -> Result<(), &'static str> {
    if target.starts_with("http://") || target.starts_with("https://") {
        return Ok(());
    }
    let (path, heading) = target.split_once('#').unwrap_or((target, ""));
    let folder = Path::new(from).parent().unwrap_or(Path::new(""));
    let place = root().join(folder).join(path);
    let read;
    let there = if path.is_empty() {
        text
    } else if place.exists() {
        read = std::fs::read_to_string(place).unwrap_or_default();
        &read
    } else {
        return Err("there is no such file");
    };
    let found = heading.is_empty()
        || there
            .lines()
            .filter(|l| l.starts_with('#'))
            .any(|l| anchor(l) == heading);
    if found {
        Ok(())
    } else {
        Err("there is no such heading")
    }
}

/// The anchor that a heading gets.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = text
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn anchors_and_targets() {
    assert_eq!(
        anchor("## What `run` does, and why"),
        "what-run-does-and-why"
    );
    assert_eq!(
        targets("see [a](b.md) and ![c](d.png)").collect::<Vec<_>>(),
        ["b.md", "d.png"]
    );
    assert!(
        follow("README.md", "# A b", "#a-b").is_ok() && follow("README.md", "# A b", "#c").is_err()
    );
    assert!(
        follow("docs/x.md", "", "../Cargo.toml").is_ok()
            && follow("docs/x.md", "", "Cargo.toml").is_err()
    );
}
