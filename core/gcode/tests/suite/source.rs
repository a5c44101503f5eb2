//! Files: pipes, endings, changes between the passes, and what is no program at all.

use crate::common;

use std::io::Write;

use common::{mill, only_blocks, shown};
use tandem_gcode::{CheckReport, Item, MAX_DIAGNOSTICS, Program, ProgramError, Stream, check};

fn spool(bytes: &[u8]) -> Program {
    Program::spool("t.ngc", bytes).unwrap()
}

fn report_of(bytes: &[u8]) -> CheckReport {
    check(&mut spool(bytes), &mill(), &mut |_, _| Ok(())).unwrap()
}

fn items_of(bytes: &[u8]) -> Vec<Item> {
    let mut program = spool(bytes);
    let report = check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
    assert!(report.is_ok(), "{}", report.diagnostics[0]);
    let mut stream = Stream::new(program, &mill()).unwrap();
    let mut items = Vec::new();
    while stream.next_items(&mut items).unwrap() {}
    items
}

#[test]
fn line_ends_byte_order_marks_and_comments_in_any_encoding() {
    let plain = shown(&items_of(b"G0 X1\nG0 X2\n"));
    assert_eq!(
        shown(&items_of(b"\xef\xbb\xbfG0 X1\r\nG0 X2 (\xe4 caf\xe9)\r\n")),
        plain
    );
    assert_eq!(shown(&items_of(b"G0 X1\nG0 X2")), plain);
    assert_eq!(shown(&items_of(b"")), ["End"]);
    assert_eq!(shown(&items_of(b"\n\n")), ["End"]);
    assert_eq!(
        shown(&items_of(b"M30\n\x1a")),
        ["1: ProgramEnd 0 0 before 0", "End"]
    );
}

#[test]
fn a_report_counts() {
    let report = report_of(b"F60\nG1 X3 Y4\nG0 X0\nG4 P1\nM30\nignored");
    assert_eq!((report.lines, report.blocks), (5, 3));
    assert!((report.length_mm - 8.0).abs() < 1e-12);
}

/// A `%` that nothing opened ends the program; what stands behind it was left out without a word.
#[test]
fn text_behind_a_percent_sign_is_not_dropped_without_a_word() {
    let found = |bytes: &[u8]| {
        let report = report_of(bytes);
        let shown = |list: &[tandem_gcode::Diagnostic]| {
            list.iter()
                .map(|d| format!("{}:{} {}", d.line, d.column, d.code))
                .collect::<Vec<_>>()
                .join(", ")
        };
        (
            shown(&report.diagnostics),
            shown(&report.warnings),
            report.blocks,
        )
    };
    let error = |place: &str, blocks| (format!("{place} behind-percent"), String::new(), blocks);
    let warning = |place: &str, blocks| (String::new(), format!("{place} behind-percent"), blocks);
    let nothing = |blocks| (String::new(), String::new(), blocks);
    assert_eq!(found(b"G0 X1\n%\nG0 X2\nM2\n"), error("3:1", 1));
    assert_eq!(found(b"G0 X1\n%\n\n (here) G0 X2\n"), error("4:9", 1));
    assert_eq!(
        found(b"/G0 X1\n%\n/G0 X2\n"),
        error("3:2", 1),
        "block delete is off: the line is driven"
    );
    assert_eq!(found(b"G0 X1\n%\n(not closed\n"), error("3:1", 1));
    assert_eq!(
        found(b"G0 X1\n% (end)\n\n%\n (a comment) ; one more\n\x1a"),
        nothing(1)
    );
    // RS274/NGC: whatever follows the second % is none of the program. It is said all the same.
    assert_eq!(found(b"\n(head)\n%\nG0 X1\n%\nG0 X2\n"), warning("6:1", 1));
    assert_eq!(found(b"%\nG0 X1\n%\n%\n\n"), nothing(1));
    assert_eq!(
        found(b"%\nG0 X1\nM30\n%\nnotes"),
        nothing(2),
        "M30 is the end, and comes to rest"
    );
    // Far behind, and no program text at all.
    let mut long = b"%\nG0 X1\n%\n".to_vec();
    long.extend(std::iter::repeat_n(b'\n', 200_000));
    assert_eq!(found(&long), nothing(1));
    long.extend(b"\x00\x01");
    assert!(found(&long).1.ends_with("binary"));
    assert_eq!(
        shown(&items_of(b"%\nG0 X1\n%\nG0 X2\n")),
        ["2: Rapid 0 to 1 0 0 0", "End"]
    );
    let told = report_of(b"%\nG0 X1\n%\nG0 X2\n").warnings[0].to_string();
    let said = "t.ngc:4:1: warning: this and all that follows is not driven: the % of line 3 has ended the program";
    assert!(told.starts_with(said), "{told}");
}

/// Controls write the name of the program behind the `%` that opens it.
#[test]
fn the_percent_sign_that_opens_a_program_may_be_followed_by_its_name() {
    for name in [
        "%prog1",
        "% PART-7.nc (a)",
        "%1000",
        "%O0012",
        "%_N_BOX_MPF",
    ] {
        let text = format!("(head)\n{name}\nG0 X1\nM2\n");
        assert_eq!(
            shown(&items_of(text.as_bytes()))[0],
            "3: Rapid 0 to 1 0 0 0",
            "{name}"
        );
        let open = report_of(format!("{name}\nG0 X1\n").as_bytes());
        assert_eq!(open.diagnostics[0].code, "truncated", "{name}");
    }
    // What could be a word is none, and later there is no program to be named.
    for text in [
        "%G0 X1",
        "%M3",
        "%X1",
        "%T1",
        "G0 X1\n%prog1\n",
        "%\nG0 X1\n%prog1\n",
    ] {
        assert_eq!(
            report_of(text.as_bytes()).diagnostics[0].code,
            "percent",
            "{text}"
        );
    }
}

/// Such comments come from `FreeCAD`'s posts, where a name holds parentheses.
#[test]
fn parentheses_that_close_too_often_end_their_comment() {
    for text in [
        "(Path: FirstOp-T1))\nG0 X1",
        "G0 (a (b))) X1",
        "G0 X1 (a)) ) (b)",
    ] {
        let blocks = report_of(text.as_bytes()).blocks;
        assert_eq!(blocks, 1, "{text}");
    }
    assert_eq!(report_of(b"G0 (a) X1 )").diagnostics[0].code, "unexpected");
}

#[test]
fn a_line_of_ten_megabytes_is_one_error() {
    let mut text = b"G0 X1\n(".to_vec();
    text.resize(10_000_000, b'x');
    text.extend_from_slice(b")\nG0 Q1\n");
    let report = report_of(&text);
    let lines: Vec<_> = report
        .diagnostics
        .iter()
        .map(|d| (d.line, d.code))
        .collect();
    assert_eq!(lines, [(2, "line-long"), (3, "unused-word")]);
    assert_eq!(report.lines, 3);
    assert!(report.diagnostics[0].to_string().len() < 300);
}

#[test]
fn lines_are_whole_across_chunks() {
    let line = |n: u32| {
        format!(
            "X{} (some words that move the chunks)\n",
            f64::from(n % 250) + 0.5
        )
    };
    let text = "F600 G1\n".to_owned() + &(0..20_000).map(line).collect::<String>();
    let items = items_of(text.as_bytes());
    let blocks = only_blocks(&items);
    assert_eq!(blocks.len(), 20_000);
    assert!(
        blocks
            .iter()
            .zip(2..)
            .all(|(block, line)| block.line == line)
    );
    for length in 4090..4100 {
        let text = format!("({})\nG0 X1", "x".repeat(length - 2));
        assert_eq!(
            report_of(text.as_bytes()).is_ok(),
            length <= 4096,
            "{length}"
        );
    }
}

#[test]
fn binary_files_are_no_programs() {
    let report = report_of(b"G0 X1\nG0 X2 \0\0\nG0 Q\n");
    assert_eq!(report.diagnostics.len(), 1);
    assert_eq!(
        (
            report.diagnostics[0].line,
            report.diagnostics[0].column,
            report.diagnostics[0].code
        ),
        (2, 7, "binary")
    );
    assert!(
        report_of(b"\xff\xfeG\x00X\x00").diagnostics[0]
            .message
            .contains("UTF-16")
    );
}

#[test]
fn errors_are_listed_up_to_a_thousand_and_then_counted() {
    let report = report_of("G76\n".repeat(1500).as_bytes());
    assert_eq!(
        (report.diagnostics.len(), report.unlisted),
        (MAX_DIAGNOSTICS, 500)
    );
}

#[test]
fn a_refused_block_is_an_error_of_its_line() {
    let mut refuse = |block: &tandem_sdk::Block, _: Option<tandem_sdk::Curve<'_>>| {
        if block.index == 1 {
            Err("too short".to_owned())
        } else {
            Ok(())
        }
    };
    let report = check(&mut spool(b"G0 X1\n\n  G0 X2\n"), &mill(), &mut refuse).unwrap();
    assert_eq!(
        report.diagnostics[0].to_string(),
        "t.ngc:3:1: error: too short\n    G0 X2\n  ^^^^^^^"
    );
}

#[test]
fn a_file_that_changes_between_the_passes_stops_before_the_change() {
    let mut file = tempfile();
    let text = "G0 X1 (padding, padding)\nG0 X2 (padding, padding)\n".repeat(3000);
    file.write_all(text.as_bytes()).unwrap();
    let path = file.path.clone();
    let mut program = Program::open(&path).unwrap();
    check(&mut program, &mill(), &mut |_, _| Ok(())).unwrap();
    let at = text.len() - 2;
    std::fs::write(
        &path,
        [&text.as_bytes()[..at], b"(", &text.as_bytes()[at + 1..]].concat(),
    )
    .unwrap();
    let mut stream = Stream::new(program, &mill()).unwrap();
    let mut items = Vec::new();
    let error = loop {
        match stream.next_items(&mut items) {
            Ok(more) => assert!(more, "the change was not seen"),
            Err(error) => break error,
        }
    };
    let ProgramError::Changed { first_line, .. } = &error else {
        panic!("{error}")
    };
    let handed_out = only_blocks(&items).last().unwrap().line;
    assert_eq!(handed_out + 1, *first_line);
    assert!(
        error
            .to_string()
            .contains("has changed since it was checked"),
        "{error}"
    );
}

#[test]
fn an_unchecked_program_does_not_stream() {
    assert!(matches!(
        Stream::new(spool(b"G0 X1"), &mill()),
        Err(ProgramError::Unchecked(_))
    ));
}

#[test]
fn a_waiting_stream_needs_its_input() {
    let mut program = spool(b"G0 X1\nM66 P1 L0\nG0 X[#5399 + 5]");
    assert!(
        check(&mut program, &mill(), &mut |_, _| Ok(()))
            .unwrap()
            .is_ok()
    );
    let mut stream = Stream::new(program, &mill()).unwrap();
    let mut items = Vec::new();
    stream.next_items(&mut items).unwrap();
    stream.next_items(&mut items).unwrap();
    assert!(matches!(items.last(), Some(Item::Wait(_))));
    assert!(matches!(
        stream.next_items(&mut items),
        Err(ProgramError::WaitsForInput(_))
    ));
    stream.provide_input(1.0);
    stream.next_items(&mut items).unwrap();
    assert_eq!(only_blocks(&items).last().unwrap().end[0], 6.0);
}

#[test]
fn files_that_cannot_be_opened() {
    let missing = Program::open(std::path::Path::new("/no/such.ngc")).unwrap_err();
    assert!(
        missing.to_string().starts_with("/no/such.ngc: "),
        "{missing}"
    );
    let folder = Program::open(std::path::Path::new("/")).unwrap_err();
    assert!(folder.to_string().contains("directory"), "{folder}");
}

/// A named temporary file.
struct Named {
    path: std::path::PathBuf,
    file: std::fs::File,
}

fn tempfile() -> Named {
    let path = std::env::temp_dir().join(format!("tandem-gcode-{}.ngc", std::process::id()));
    Named {
        file: std::fs::File::create(&path).unwrap(),
        path,
    }
}

impl Write for Named {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

impl Drop for Named {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}
