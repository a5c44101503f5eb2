//! Lines, functions, files; and what no committed file may say.

use crate::expect_none;
use crate::tree::{File, files};

/// Columns of a line.
const COLUMNS: usize = 130;
/// Lines of a Rust file.
const FILE_LINES: usize = 400;
/// Longer files: the fine loop reads as one.
const LONGER_FILES: &[(&str, usize)] = &[];
/// Lines of a Rust file above which it is listed.
const LISTED_LINES: usize = 200;
/// Lines of a function.
const FUNCTION_LINES: usize = 70;

/// Files with longer lines: texts and tables that are read more easily unbroken.
const LONGER: &[(&str, usize)] = &[
    ("core/cli/src/run.rs", 139),
    ("core/gcode/src/execute.rs", 166),
    ("core/gcode/tests/messages.rs", 133),
    ("core/gcode/tests/properties.rs", 139),
    ("core/host/src/command.rs", 132),
    ("core/host/src/record/blocks_csv.rs", 140),
    ("core/machine/src/keys.rs", 165),
    ("core/machine/tests/suite/properties.rs", 141),
    ("core/motion/src/segment.rs", 136),
    ("core/trace/tests/suite/damage.rs", 133),
    ("hal-drivers/sim/src/joint.rs", 136),
    ("tests/oracle/src/path/tests.rs", 135),
];

#[test]
fn lines_are_not_too_long() {
    let mut findings = vec![];
    for file in files(&[".rs", ".toml", ".md"]) {
        let most = LONGER.iter().find(|(name, _)| *name == file.name).map_or(COLUMNS, |(_, columns)| *columns);
        let markdown = std::path::Path::new(&file.name).extension().is_some_and(|e| e == "md");
        for (number, line) in file.lines() {
            let columns = line.chars().count();
            // A row of a Markdown table cannot be broken.
            if columns > most && !(markdown && line.starts_with('|')) {
                findings.push(format!("{}:{number}: {columns} columns, {most} are allowed", file.name));
            }
        }
    }
    expect_none("long lines", &findings);
}

#[test]
fn files_are_not_too_long() {
    let mut findings = vec![];
    for file in files(&[".rs"]) {
        let lines = file.lines().count();
        if lines > LISTED_LINES {
            println!("{}: {lines} lines", file.name);
        }
        let most = LONGER_FILES.iter().find(|(name, _)| *name == file.name).map_or(FILE_LINES, |(_, lines)| *lines);
        if lines > most {
            findings.push(format!("{}:{lines}: {most} lines are allowed", file.name));
        }
    }
    expect_none("long files", &findings);
}

#[test]
fn functions_are_not_too_long() {
    let files = files(&[".rs"]);
    let mut count = 0;
    let mut findings = vec![];
    for file in &files {
        for (number, lines) in functions(file) {
            count += 1;
            if lines > FUNCTION_LINES {
                findings.push(format!("{}:{number}: {lines} lines, {FUNCTION_LINES} are allowed", file.name));
            }
        }
    }
    assert!(count > 500, "only {count} functions were found");
    expect_none("long functions", &findings);
}

/// First line and number of lines of each function, as rustfmt lays them out: a function ends with the brace at its own
/// indentation.
fn functions(file: &File) -> Vec<(usize, usize)> {
    let lines: Vec<&str> = file.text.lines().collect();
    let mut found = vec![];
    for (index, line) in lines.iter().enumerate() {
        if !begins_function(line) {
            continue;
        }
        let indent = line.len() - line.trim_start().len();
        let ends = |l: &&str| l.len() > indent && l[..indent].trim().is_empty() && "};".contains(&l[indent..=indent]);
        let one_line = line.ends_with('}') || line.ends_with(';');
        let length = if one_line { 0 } else { lines[index + 1..].iter().position(ends).map_or(0, |at| at + 1) };
        found.push((index + 1, length + 1));
    }
    found
}

fn begins_function(line: &str) -> bool {
    let mut words = line.split_whitespace();
    let before = words.by_ref().take_while(|word| *word != "fn");
    let only_qualifiers = before
        .into_iter()
        .all(|word| word.starts_with("pub") || ["const", "unsafe", "async", "extern", "\"C\""].contains(&word));
    only_qualifiers && words.next().is_some()
}

#[test]
fn functions_are_measured() {
    let text =
        "fn one() {}\n\nimpl A {\n    pub(crate) const fn two(\n        a: u8,\n    ) -> u8 {\n        a\n    }\n}\n";
    let file = File { name: String::new(), text: text.to_string() };
    assert_eq!(functions(&file), [(1, 1), (4, 5)]);
}

#[test]
fn no_file_names_a_place_outside_the_repository() {
    // Put together here, so that this file does not find itself.
    let absolute = ["/wo", "rk/"].concat();
    let beside = ["../sha", "red/"].concat();
    let mut findings = vec![];
    for file in files(&[""]) {
        for (number, line) in file.lines() {
            if let Some(found) = [&absolute, &beside].into_iter().find(|place| line.contains(place.as_str())) {
                findings.push(format!("{}:{number}: names {found}", file.name));
            }
        }
    }
    expect_none("places outside the repository", &findings);
}
