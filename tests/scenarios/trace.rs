//! The binary trace through the command: written, exported, cut short, compared.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

use crate::harness::{mill, root};

/// The machine with a rotary axis.
fn with_a_rotary_axis() -> PathBuf {
    root().join("examples/machines/mill-4axis.toml")
}

fn tandem(arguments: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn trace(arguments: &[&Path]) -> (i32, String, String) {
    let output = tandem(&[&["trace".as_ref()], arguments].concat());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().unwrap(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

/// Runs `program` on `machine` and writes the trace `name`.
fn run(folder: &TempDir, program: &Path, machine: &Path, name: &str) -> PathBuf {
    let path = folder.path().join(name);
    let [run, on, to] = ["run", "--machine", "--trace"].map(Path::new);
    let output = tandem(&[run, program, on, machine, to, &path]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    path
}

fn square(folder: &TempDir, name: &str) -> PathBuf {
    run(
        folder,
        &root().join("examples/programs/square.ngc"),
        &mill(),
        name,
    )
}

fn export(folder: &TempDir, from: &Path) -> (i32, String, PathBuf) {
    let csv = folder.path().join("exported.csv");
    let (status, _, errors) = trace(&["export".as_ref(), from, "--csv".as_ref(), &csv]);
    (status, errors, csv)
}

/// The export is the CSV of the same run byte for byte, and `diff` finds them the same.
fn exports_the_csv(program: &Path, machine: &Path) {
    let folder = TempDir::new().unwrap();
    let [binary, csv] = ["trace.ttr", "trace.csv"].map(|name| run(&folder, program, machine, name));
    let (status, errors, exported) = export(&folder, &binary);
    assert_eq!((status, errors.as_str()), (0, ""));
    assert!(std::fs::read(exported).unwrap() == std::fs::read(&csv).unwrap());
    let (status, said, _) = trace(&["diff".as_ref(), &binary, &csv]);
    assert_eq!(status, 0, "{said}");
    assert!(said.starts_with("the same "), "{said}");
}

#[test]
fn the_export_is_the_csv_byte_for_byte() {
    exports_the_csv(&root().join("examples/programs/serpentine.ngc"), &mill());
}

#[test]
fn the_export_of_a_rotary_axis_is_the_csv_too() {
    let folder = TempDir::new().unwrap();
    let program = folder.path().join("turn.ngc");
    std::fs::write(&program, "G21 G90 G94\nF600\nG1 X5 A33\nG1 A-12.5\nM2\n").unwrap();
    exports_the_csv(&program, &with_a_rotary_axis());
}

#[test]
fn the_same_program_gives_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let [first, second] =
        ["first.ttr", "second.ttr"].map(|name| std::fs::read(square(&folder, name)).unwrap());
    assert!(first == second);
}

#[test]
fn a_trace_that_breaks_off_is_read_as_far_as_it_goes() {
    let folder = TempDir::new().unwrap();
    let path = square(&folder, "trace.ttr");
    let (_, whole, _) = trace(&["info".as_ref(), &path]);
    assert!(
        whole.ends_with("complete\n") && whole.contains("three-axis mill"),
        "{whole}"
    );
    let csv = std::fs::read_to_string(export(&folder, &path).2).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for cut in [bytes.len() - 1, bytes.len() / 2, bytes.len() / 3 + 1, 200] {
        let part = folder.path().join("part.ttr");
        std::fs::write(&part, &bytes[..cut]).unwrap();
        let (status, errors, exported) = export(&folder, &part);
        assert_eq!(status, 1);
        assert!(errors.contains("truncated at byte "), "{errors}");
        let exported = std::fs::read_to_string(exported).unwrap();
        assert!(
            csv.starts_with(&exported) && exported.ends_with('\n'),
            "cut at {cut}"
        );
        let (status, said, _) = trace(&["info".as_ref(), &part]);
        assert!(status == 1 && said.contains("truncated at byte "), "{said}");
    }
}

#[test]
fn damage_is_told_with_its_place_and_cost() {
    let folder = TempDir::new().unwrap();
    let path = square(&folder, "trace.ttr");
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    std::fs::write(&path, &bytes).unwrap();
    let (status, said, errors) = trace(&["info".as_ref(), &path]);
    assert_eq!(status, 1);
    assert!(said.contains("damaged in 1 places"), "{said}");
    assert!(
        errors.contains("bytes ") && errors.contains("records lost"),
        "{errors}"
    );
}

#[test]
fn one_changed_bit_is_found() {
    let folder = TempDir::new().unwrap();
    let [first, second] = ["first.csv", "second.csv"].map(|name| square(&folder, name));
    assert_eq!(trace(&["diff".as_ref(), &first, &second]).0, 0);
    let text = std::fs::read_to_string(&second).unwrap();
    let rows: Vec<_> = text.lines().collect();
    let mut cells: Vec<_> = rows[501].split(',').map(str::to_string).collect();
    let value: f64 = cells[2].parse().unwrap();
    cells[2] = format!("{:.16e}", f64::from_bits(value.to_bits() ^ 1));
    let changed = [&rows[..501], &[cells.join(",").as_str()], &rows[502..]]
        .concat()
        .join("\n");
    std::fs::write(&second, changed + "\n").unwrap();
    let binary = square(&folder, "first.ttr");
    for other in [&first, &binary] {
        let (status, said, _) = trace(&["diff".as_ref(), other, &second]);
        assert_eq!(status, 1);
        assert!(
            said.starts_with("first difference: tick 500 (t_s 0.5): x_cmd_mm: "),
            "{said}"
        );
    }
}

/// Only commands were compared: feedback, state and feed could differ as they liked.
#[test]
fn every_column_is_compared_unless_only_the_commands_are_asked_for() {
    let folder = TempDir::new().unwrap();
    let ideal = square(&folder, "ideal.ttr");
    let lagging = folder.path().join("lagging.ttr");
    let program = root().join("examples/programs/square.ngc");
    let machine = mill();
    let arguments = [
        "run",
        program.to_str().unwrap(),
        "--machine",
        machine.to_str().unwrap(),
    ]
    .map(Path::new);
    let drives = [
        "--set",
        "driver.options.model=second-order",
        "--trace",
        lagging.to_str().unwrap(),
    ]
    .map(Path::new);
    assert_eq!(tandem(&[arguments, drives].concat()).status.code(), Some(0));
    let (status, said, _) = trace(&["diff".as_ref(), &ideal, &lagging]);
    assert_eq!(status, 1);
    assert!(
        said.starts_with("first difference: tick ") && said.contains(": x_fb_mm: "),
        "{said}"
    );
    for column in ["x_fb_mm: ", "y_fb_mm: "] {
        let line = said
            .lines()
            .find(|line| line.starts_with(column))
            .unwrap_or_else(|| panic!("{said}"));
        assert!(line.contains(" samples differ, by at most "), "{line}");
    }
    assert!(
        !said.contains("x_cmd_mm") && !said.contains("z_fb_mm"),
        "{said}"
    );
    let (status, said, _) = trace(&[
        "diff".as_ref(),
        "--commands-only".as_ref(),
        &ideal,
        &lagging,
    ]);
    assert_eq!(
        (status, said.contains("samples in 3 columns")),
        (0, true),
        "{said}"
    );
}

#[test]
fn one_changed_byte_is_noticed() {
    let folder = TempDir::new().unwrap();
    let [first, second] = ["first.ttr", "second.ttr"].map(|name| square(&folder, name));
    assert_eq!(trace(&["diff".as_ref(), &first, &second]).0, 0);
    let mut bytes = std::fs::read(&second).unwrap();
    for place in [3, 40, bytes.len() / 3, bytes.len() - 2] {
        bytes[place] ^= 1;
        std::fs::write(&second, &bytes).unwrap();
        assert_eq!(
            trace(&["diff".as_ref(), &first, &second]).0,
            1,
            "byte {place}"
        );
        bytes[place] ^= 1;
    }
}

#[test]
fn what_is_no_trace_is_refused() {
    let folder = TempDir::new().unwrap();
    let program = root().join("examples/programs/square.ngc");
    let csv = folder.path().join("out.csv");
    let (status, _, errors) = trace(&["export".as_ref(), &program, "--csv".as_ref(), &csv]);
    assert!(
        status == 1 && errors.contains("square.ngc: byte 0: not a Tandem trace"),
        "{errors}"
    );
    assert!(!csv.exists());
    let (status, _, errors) = trace(&["diff".as_ref(), &program, &program]);
    assert!(status == 1 && errors.contains("no column t_s"), "{errors}");
    assert_eq!(
        trace(&["info".as_ref(), &folder.path().join("none.ttr")]).0,
        1
    );
    assert_eq!(trace(&["export".as_ref(), &program]).0, 2);
}

const COMMANDS: &str = "0,feed-override,0.7\n150,hold\n400,resume\n500,feed-override,1\n501,rapid-override,0.25\n\
    700,single-block,1\n720,single-block,0\n800,stall-rough,60\n1500,abort\n";

#[test]
fn the_commands_of_a_run_are_in_its_trace_and_give_the_same_run_again() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("given.csv"), COMMANDS).unwrap();
    let (program, machine) = (root().join("examples/programs/serpentine.ngc"), mill());
    let driven = |commands: &str, name: &str| {
        let (commands, path) = (at(commands), at(name));
        let [run, on, by, to] = ["run", "--machine", "--commands", "--trace"].map(Path::new);
        let output = tandem(&[run, &program, on, &machine, by, &commands, to, &path]);
        assert_eq!(
            output.status.code(),
            Some(3),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        path
    };
    let first = driven("given.csv", "first.ttr");
    let [ttr, csv, commands] = ["first.ttr", "first.csv", "commands.csv"].map(at);
    let [export, to, with] = ["export", "--csv", "--commands"].map(Path::new);
    assert_eq!(trace(&[export, &ttr, to, &csv, with, &commands]).0, 0);
    let written = std::fs::read_to_string(&commands).unwrap();
    assert_eq!(written, format!("# tick,command[,value]\n{COMMANDS}"));
    let second = driven("commands.csv", "second.ttr");
    assert!(std::fs::read(&first).unwrap() == std::fs::read(&second).unwrap());
    let (_, said, _) = trace(&["info".as_ref(), &first]);
    assert!(
        said.contains("commands     9") && said.contains("  501,rapid-override,0.25"),
        "{said}"
    );
}

#[test]
fn a_trace_of_format_1_is_read() {
    let old = root().join("tests/fixtures/traces/format-1.ttr");
    let (status, said, _) = trace(&["info".as_ref(), &old]);
    assert_eq!(status, 0, "{said}");
    for words in [
        "format 1",
        "program      old.ngc\n",
        "commands     0",
        "complete",
    ] {
        assert!(said.contains(words), "{words:?} is not in {said}");
    }
}

/// What the program that wrote it exported is what this one exports: columns that it has not are not made up.
#[test]
fn traces_of_formats_2_and_3_are_read_and_exported_as_they_were() {
    for format in [2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let fixture = |end: &str| {
            root()
                .join("tests/fixtures/traces")
                .join(format!("format-{format}.{end}"))
        };
        let (old, csv) = (fixture("ttr"), folder.path().join("old.csv"));
        let (status, said, _) = trace(&["info".as_ref(), &old]);
        assert!(
            status == 0 && said.contains(&format!("format {format}")) && said.contains("complete"),
            "{said}"
        );
        assert_eq!(
            trace(&["export".as_ref(), &old, "--csv".as_ref(), &csv]).0,
            0
        );
        assert_eq!(
            std::fs::read_to_string(&csv).unwrap(),
            std::fs::read_to_string(fixture("csv")).unwrap()
        );
        assert_eq!(trace(&["diff".as_ref(), &old, &csv]).0, 0);
    }
}
