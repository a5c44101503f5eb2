//! What the pages show as a command's output is what the command prints.
//!
//! A page shows a command in a fence `sh` and what it prints in the fence `text` after it. The commands run in a folder of
//! their own, beside which the repository's folders stand. Files that a page tells its reader to write, `target/NAME` in the
//! words before a fence, are written first. What a page leaves out of an output it may replace with `…`. An output that no
//! second run prints again, or that a compiler of scripts is needed for, has the fence `text once`.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A part of a page between two lines of three backquotes.
struct Fence {
    line: usize,
    kind: String,
    text: String,
    /// The words between the fence before and this one.
    before: String,
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .unwrap()
}

fn fences(page: &str) -> Vec<Fence> {
    let mut found: Vec<Fence> = Vec::new();
    let mut before = String::new();
    let mut open: Option<(Fence, usize)> = None;
    for (index, line) in page.lines().enumerate() {
        let Some(kind) = line.trim_start().strip_prefix("```") else {
            if let Some((fence, indent)) = &mut open {
                let (blank, rest) = line.split_at((*indent).min(line.len()));
                assert!(
                    blank.trim().is_empty(),
                    "line {}: less indented than its fence",
                    index + 1
                );
                fence.text += rest;
                fence.text.push('\n');
            } else {
                before += line;
                before.push('\n');
            }
            continue;
        };
        if let Some((fence, _)) = open.take() {
            found.push(fence);
        } else {
            let indent = line.len() - line.trim_start().len();
            let fence = Fence {
                line: index + 1,
                kind: kind.to_string(),
                text: String::new(),
                before: std::mem::take(&mut before),
            };
            open = Some((fence, indent));
        }
    }
    assert!(open.is_none(), "a fence without an end");
    found
}

/// The file that the words before a fence tell the reader to write its text to.
fn file_to_write(fence: &Fence) -> Option<&str> {
    if fence.kind.starts_with("sh") || fence.kind.starts_with("text") {
        return None;
    }
    let paragraph = fence.before.trim_end().rsplit("\n\n").next()?;
    let name = paragraph
        .split('`')
        .find(|word| word.starts_with("target/") && word.contains('.'))?;
    paragraph.ends_with(':').then_some(name)
}

/// Whether `shown` is what the commands before it print: at most one paragraph stands between them.
fn is_output(commands: &Fence, shown: &Fence) -> bool {
    let between = shown.before.trim();
    commands.kind == "sh"
        && shown.kind == "text"
        && !between.contains("\n\n")
        && !between.starts_with('#')
}

/// A folder in which the commands of the pages do what they do in the repository, with the binary under test.
fn reader_of_pages() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = repository();
    for name in ["tests", "docs", "scripts"] {
        symlink(root.join(name), folder.path().join(name)).unwrap();
    }
    // A reader may go there, and back by `..`.
    let copied = Command::new("cp")
        .arg("-r")
        .arg(root.join("examples"))
        .arg(folder.path())
        .status()
        .unwrap();
    assert!(copied.success());
    fs::create_dir_all(folder.path().join("target/release")).unwrap();
    symlink(
        env!("CARGO_BIN_EXE_tandem"),
        folder.path().join("target/release/tandem"),
    )
    .unwrap();
    folder
}

/// What the commands of pages find in place of a release build and of a browser, which prints nothing that a page shows.
fn stand_ins(folder: &Path) -> String {
    // Tests of the whole workspace have built it beside the command; alone it would be built with other features, which takes long.
    let built = Path::new(env!("CARGO_BIN_EXE_tandem")).with_file_name("oracle");
    let oracle = if built.exists() {
        format!("\"{}\"", built.display())
    } else {
        let root = repository().join("Cargo.toml");
        let root = root.display();
        format!("\"$CARGO\" run -q --manifest-path \"{root}\" -p tandem-oracle --")
    };
    format!(
        r#"tandem() {{ "{folder}/target/release/tandem" "$@"; }}
cargo() {{
  case "$*" in
    "run --release -p tandem -- "*) shift 5; tandem "$@" ;;
    "run --release -p tandem-oracle -- "*) shift 5; {oracle} "$@" ;;
  esac
}}
chromium() {{ :; }}
"#,
        folder = folder.display(),
    )
}

/// All that the commands print, on either stream.
fn output(commands: &str, folder: &Path) -> String {
    let script = format!("exec 2>&1\n{}{commands}", stand_ins(folder));
    let mut shell = Command::new("bash");
    shell
        .args(["-c", &script])
        .current_dir(folder)
        .stdin(Stdio::null());
    if std::env::var_os("CARGO").is_none() {
        shell.env("CARGO", "cargo");
    }
    String::from_utf8_lossy(&shell.output().unwrap().stdout).into_owned()
}

/// White space does not count: pages break long lines.
fn joined(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The first piece of what is shown that the output lacks.
fn missing<'a>(shown: &'a str, printed: &str) -> Option<&'a str> {
    let mut rest = printed;
    for piece in shown
        .split('…')
        .map(str::trim)
        .filter(|piece| !piece.is_empty())
    {
        let Some(at) = rest.find(piece) else {
            return Some(piece);
        };
        rest = &rest[at + piece.len()..];
    }
    None
}

/// Runs every command of a page that is followed by its output; the number of them.
fn judge(name: &str) -> usize {
    let page = fs::read_to_string(repository().join(name)).unwrap();
    let folder = reader_of_pages();
    let all = fences(&page);
    let mut judged = 0;
    for (index, fence) in all.iter().enumerate() {
        if let Some(file) = file_to_write(fence) {
            fs::write(folder.path().join(file), &fence.text).unwrap();
        }
        if index == 0 || !is_output(&all[index - 1], fence) {
            continue;
        }
        let printed = joined(&output(&all[index - 1].text, folder.path()));
        let shown = joined(&fence.text);
        if let Some(piece) = missing(&shown, &printed) {
            panic!(
                "{name}:{}: the command does not print\n  {piece}\nit prints\n  {printed}",
                fence.line
            );
        }
        judged += 1;
    }
    judged
}

macro_rules! pages {
    ($($test:ident: $page:literal, $outputs:literal;)*) => {
        /// Every page with an output, and how many it shows.
        const PAGES: &[&str] = &[$($page),*];
        $(
            #[test]
            fn $test() {
                assert_eq!(judge($page), $outputs, "outputs of the page");
            }
        )*
    };
}

pages! {
    readme: "README.md", 2;
    batch: "docs/batch.md", 1;
    ethercat: "docs/ethercat.md", 3;
    faults: "docs/faults.md", 2;
    force_control: "docs/force-control.md", 2;
    homing: "docs/homing.md", 1;
    jog: "docs/jog.md", 1;
    look_ahead: "docs/look-ahead.md", 2;
    machining_time: "docs/machining-time.md", 1;
    mdi: "docs/mdi.md", 2;
    nurbs: "docs/nurbs.md", 1;
    own_machine: "docs/own-machine.md", 3;
    probing: "docs/probing.md", 1;
    simulation: "docs/simulation.md", 4;
    stopping: "docs/stopping.md", 1;
    tune: "docs/tune.md", 1;
}

/// A page that gets its first output is judged as well.
#[test]
fn every_page_with_an_output_is_judged() {
    let root = repository();
    let mut names = vec!["README.md".to_string(), "CONTRIBUTING.md".to_string()];
    for entry in fs::read_dir(root.join("docs")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if Path::new(&name).extension().is_some_and(|is| is == "md") {
            names.push(format!("docs/{name}"));
        }
    }
    for name in names.iter().filter(|name| !PAGES.contains(&name.as_str())) {
        let all = fences(&fs::read_to_string(root.join(name)).unwrap());
        let outputs = all.windows(2).filter(|pair| is_output(&pair[0], &pair[1]));
        let lines: Vec<usize> = outputs.map(|pair| pair[1].line).collect();
        assert!(
            lines.is_empty(),
            "{name} shows outputs at {lines:?} and is in no row of `pages!`"
        );
    }
}

#[test]
fn an_output_that_has_changed_is_found() {
    assert_eq!(missing("a 1 … c 3", "a 1 b 2 c 3"), None);
    assert_eq!(missing("a 1 … c 4", "a 1 b 2 c 3"), Some("c 4"));
    assert_eq!(missing("c 3 … a 1", "a 1 b 2 c 3"), Some("a 1"));
}
