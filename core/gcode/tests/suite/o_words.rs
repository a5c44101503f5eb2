//! O-words: subroutines, branches and loops, in both passes.

use crate::common;

use std::path::PathBuf;

use common::{mill, only_blocks, short, with_files};
use tandem_gcode::{
    CheckReport, Config, Interpreter, Item, ProbeResult, Program, ProgramError, Stream, check,
};

fn checked(text: &str, config: &Config) -> (Program, CheckReport) {
    let mut program = Program::spool("t.ngc", text.as_bytes()).unwrap();
    let report = check(&mut program, config, &mut |_, _| Ok(())).unwrap();
    (program, report)
}

/// The items of a program; probes touch half way, inputs are 1.
fn items_on(config: &Config, text: &str) -> Vec<Item> {
    let (program, report) = checked(text, config);
    assert!(report.is_ok(), "{}", report.diagnostics[0]);
    let mut stream = Stream::new(program, config).unwrap();
    let mut items = Vec::new();
    while stream.next_items(&mut items).unwrap() {
        if let Some(Item::Block(block, _)) = items.last().filter(|item| item.is_probe()) {
            let touched = (block.start + block.end) * 0.5;
            stream.provide_probe(&ProbeResult {
                touched: Some(touched),
                rest: touched,
            });
        }
        stream.provide_input(1.0);
    }
    items
}

/// Where the blocks end in X, and their lines.
fn path(text: &str) -> String {
    let blocks = only_blocks(&items_on(&mill(), text));
    blocks
        .iter()
        .map(|b| format!("{}:{}", b.line, short(b.end[0])))
        .collect::<Vec<_>>()
        .join(" ")
}

fn errors_on(config: &Config, text: &str) -> Vec<String> {
    let (_, report) = checked(text, config);
    report
        .diagnostics
        .iter()
        .map(|d| format!("{}:{} [{}] {}", d.line, d.column, d.code, d.message))
        .collect()
}

fn errors(text: &str) -> Vec<String> {
    errors_on(&mill(), text)
}

/// Programs lie beside the subroutines that they call, as `LinuxCNC`'s folder of programs has them; the machine's own come first.
#[test]
fn a_subroutine_is_looked_up_beside_its_program() {
    let (folder, mut config) = with_files(&[
        ("main.ngc", "o<drill> call [3]\no<clear> call\n"),
        ("drill.ngc", "o<drill> sub\nG0 X#1\no<drill> endsub\n"),
        ("clear.ngc", "o<clear> sub\nG0 X8\no<clear> endsub\n"),
    ]);
    let (own, _) = with_files(&[("clear.ngc", "o<clear> sub\nG0 X9\no<clear> endsub\n")]);
    let main = folder.path().join("main.ngc");
    let ends = |config: &Config| {
        let mut ends = Vec::new();
        let mut program = Program::open(&main).unwrap();
        let mut planner = |block: &tandem_sdk::Block, _: Option<tandem_sdk::Curve<'_>>| {
            ends.push(block.end[0]);
            Ok(())
        };
        let report = check(&mut program, config, &mut planner).unwrap();
        assert!(report.is_ok(), "{}", report.diagnostics[0]);
        ends
    };
    config.subroutine_path.clear();
    assert_eq!(ends(&config), [3.0, 8.0]);
    config.subroutine_path.push(own.path().to_path_buf());
    assert_eq!(ends(&config), [3.0, 9.0]);
    std::fs::remove_file(folder.path().join("drill.ngc")).unwrap();
    let mut program = Program::open(&main).unwrap();
    let report = check(&mut program, &config, &mut |_, _| Ok(())).unwrap();
    let told = &report.diagnostics[0].message;
    assert!(
        told.contains("no file drill.ngc lies in ") && told.contains(" or beside the program"),
        "{told}"
    );
}

/// A library holds subroutines that nobody calls; what is wrong in one that is called is told at its line.
#[test]
fn a_wrong_block_of_a_subroutine_is_told_when_it_is_called() {
    let text = "o<pick> sub\no150 if [#1 GT 0]\nG0 X1\no160 endif\no<pick> endsub\nG0 X2\n";
    assert_eq!(path(text), "6:2");
    assert_eq!(
        errors(&format!("{text}o<pick> call [1]\n")),
        ["2:1 [o-word] o150 if: it is opened and never closed; in o<pick>, called from line 7"]
    );
}

/// `LinuxCNC`'s `(ABORT, …)`: a subroutine that has found something wrong must not go on as if it had not.
#[test]
fn a_program_that_aborts_says_why() {
    let text = "o<check> sub\no1 if [#1 GT 2]\n( Abort, #1 mm are too much for #<_current_tool>)\no1 endif\n\
                G0 X[#1]\no<check> endsub\no<check> call [1]\no<check> call [2.5]\nG0 X9";
    assert_eq!(
        errors(text),
        [
            "3:1 [abort] the program aborts: 2.5 mm are too much for 0; in o<check>, called from line 8"
        ]
    );
    assert_eq!(
        path(
            &text
                .replace("2.5", "2")
                .replace("X9", "X9 (no abort, as it does not begin so)")
        ),
        "5:1 5:2 9:9"
    );
    let depends =
        "G38.3 Z-5 F60\no1 if [#5070 EQ 0]\n(ABORT, nothing was touched)\no1 endif\nG0 Z1";
    assert!(
        errors(depends).is_empty(),
        "that is decided when it is driven"
    );
}

#[test]
fn branches_take_the_first_that_is_true() {
    let program = |value: u32| {
        format!(
            "#1={value}\no1 if [#1 EQ 1]\nG0 X1\no1 elseif [#1 EQ 2]\nG0 X2\n\
             o1 elseif [#1 EQ 3]\nG0 X3\no1 else\nG0 X4\no1 endif\nG0 X9"
        )
    };
    assert_eq!(path(&program(1)), "3:1 11:9");
    assert_eq!(path(&program(2)), "5:2 11:9");
    assert_eq!(path(&program(3)), "7:3 11:9");
    assert_eq!(path(&program(4)), "9:4 11:9");
    assert_eq!(path("o1 if [0]\nG0 X1\no1 endif\nG0 X2"), "4:2");
}

#[test]
fn loops_repeat_break_and_continue() {
    assert_eq!(
        path("o1 while [#1 LT 3]\n#1=[#1+1]\nG0 X#1\no1 endwhile"),
        "3:1 3:2 3:3"
    );
    assert_eq!(
        path("o1 do\n#1=[#1+1]\nG0 X#1\no1 while [#1 LT 3]\nG0 X9"),
        "3:1 3:2 3:3 5:9"
    );
    assert_eq!(
        path("o1 repeat [2.6]\nG91 G0 X1\no1 endrepeat"),
        "2:1 2:2 2:3"
    );
    assert_eq!(
        path("o1 repeat [2.5]\nG91 G0 X1\no1 endrepeat"),
        "2:1 2:2",
        "halves are rounded to even numbers, as in LinuxCNC"
    );
    assert_eq!(path("o1 repeat [0]\nG0 X1\no1 endrepeat\nG0 X2"), "4:2");
    let left = |how: &str| {
        path(&format!(
            "o1 repeat [4]\n#1=[#1+1]\no2 if [#1 EQ 2]\no1 {how}\no2 endif\nG0 X#1\no1 endrepeat\nG0 X9"
        ))
    };
    assert_eq!(left("break"), "6:1 8:9");
    assert_eq!(left("continue"), "6:1 6:3 6:4 8:9");
    // A break of the outer loop leaves the counter of the inner one behind.
    let nested = "o1 repeat [2]\no2 repeat [3]\n#1=[#1+1]\nG0 X#1\no3 if [#1 EQ 2]\no1 break\no3 endif\n\
                  o2 endrepeat\no1 endrepeat\nG0 X9";
    assert_eq!(path(nested), "4:1 4:2 10:9");
}

#[test]
fn a_subroutine_has_parameters_of_its_own_and_returns_a_value() {
    let text = "o<double it> sub\n#<local>=[#1 * 2]\n#31=[#31+1]\nG0 X#<local>\no<doubleit> return [#<local>]\nG0 X99\n\
                o<doubleit> endsub\n#1=7\no<DOUBLEIT> call [5]\nG0 X[#<_value> + #1 + #31]\nG0 X[EXISTS[#<local>] + #2]";
    assert_eq!(path(text), "4:10 10:18 11:0");
    assert_eq!(
        path("o1 sub\nG0 X[#1 + 10 * #2]\no1 endsub\n#2=5\no1 call [3]\nG0 X#<_value_returned>"),
        "2:3 6:0"
    );
    let recursive = "o1 sub\no2 if [#1 GT 0]\nG0 X#1\no1 call [#1 - 1]\no2 endif\no1 endsub\no1 call [3]\nG0 X#<_call_level>";
    assert_eq!(path(recursive), "3:3 3:2 3:1 8:0");
    assert_eq!(path("o5 sub\nG0 X5\no5 endsub\no[#1 + 5] call"), "2:5");
    // Modes last beyond a subroutine, and one may stand behind the end of the program.
    assert_eq!(
        path("G0 X5\no1 call\nX1\nM2\no1 sub\nG91\no1 endsub"),
        "1:5 3:6 4:6"
    );
}

#[test]
fn a_subroutine_is_looked_up_in_the_folders() {
    let folder = std::env::temp_dir().join(format!("tandem-gcode-subs-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(
        folder.join("drill.ngc"),
        "(a file)\no<drill> sub\nG0 X#1\no<deeper> call\no<drill> endsub\n\
               o<deeper> sub\nG0 X[#1+7]\no<deeper> endsub\n",
    )
    .unwrap();
    let mut config = mill();
    let text = "\n\no<drill> call [3]\nG0 X1";
    let all = errors_on(&config, text);
    assert!(
        all[0].starts_with(
            "3:1 [o-word] there is no subroutine with this label in this file, and the machine"
        ),
        "{all:?}"
    );
    config.subroutine_path = vec![PathBuf::from("/no/such"), folder.clone()];
    let blocks = only_blocks(&items_on(&config, text));
    let shown: Vec<_> = blocks
        .iter()
        .map(|b| format!("{}:{}", b.line, short(b.end[0])))
        .collect();
    assert_eq!(
        shown,
        ["3:3", "3:7", "4:1"],
        "blocks of a file of its own bear the line of the call"
    );
    assert!(
        errors_on(&config, "o<none> call")[0].contains("no file none.ngc lies in /no/such or ")
    );
    // The second pass reads what the first one read.
    let (program, report) = checked(text, &config);
    assert!(report.is_ok());
    std::fs::write(
        folder.join("drill.ngc"),
        "o<drill> sub\nG0 X2\no<drill> endsub\n",
    )
    .unwrap();
    let mut stream = Stream::new(program, &config).unwrap();
    let error = loop {
        match stream.next_items(&mut Vec::new()) {
            Ok(more) => assert!(more, "the change was not seen"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, ProgramError::Changed { .. }), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn errors_name_the_callers() {
    let text = "o1 sub\nG0 X[1/#1]\no1 endsub\no<outer> sub\no1 call [#1]\no<outer> endsub\n\no<outer> call [0]";
    assert_eq!(
        errors(text),
        [
            "2:6 [arithmetic] division by zero; in o1, called from line 5; in o<outer>, called from line 8"
        ]
    );
}

#[test]
fn what_does_not_belong_together_is_named() {
    for (text, message) in [
        (
            "o1 endif",
            "1:1 [o-word] o1 endif: it closes nothing: no block is open",
        ),
        (
            "o1 if [1]\no2 endif\no1 endif",
            "2:1 [o-word] o2 endif: it closes nothing here: open is o1 if of line 1",
        ),
        (
            "G0 X1\no1 while [1]",
            "2:1 [o-word] o1 while: it is opened and never closed",
        ),
        (
            "o1 repeat [1]\no2 break\no1 endrepeat",
            "2:1 [o-word] o2 break: it stands in no while or do or repeat with this label",
        ),
        (
            "o1 sub\no1 endsub\no1 sub\no1 endsub",
            "3:1 [o-word] o1 sub: the subroutine is there already: o1 sub of line 1",
        ),
        (
            "o1 if [0]\no1 else\no1 elseif [1]\no1 endif",
            "3:1 [o-word] o1 elseif: nothing but endif may follow else, o1 else of line 2",
        ),
        (
            "o1 jump",
            "1:4 [o-word] what the O-word does is missing here: one of sub, endsub,",
        ),
        (
            "o1 if\no1 endif",
            "1:1 [value-missing] if needs a value in brackets",
        ),
        (
            "o1 if [1] G0 X1\no1 endif",
            "1:11 [o-word] only values in brackets may follow here",
        ),
        (
            "o1 repeat [1/0]\no1 endrepeat\nG0 Q1",
            "1:12 [arithmetic] division by zero",
        ),
    ] {
        let all = errors(text);
        assert!(
            all.first().is_some_and(|first| first.starts_with(message)),
            "{text}: {all:?}"
        );
    }
    // What is never executed is not looked at, as in LinuxCNC.
    assert!(errors("G0 X1\no1 sub\no2 return\no1 endsub\nM2\no3 endif").is_empty());
    assert_eq!(
        errors("o1 repeat [1/0]\no1 endrepeat\nG0 Q1").len(),
        2,
        "what follows is checked"
    );
}

#[test]
fn a_program_without_end_is_named() {
    let mut config = mill();
    config.max_steps = 1000;
    let endless = errors_on(&config, "G0 X1\no7 while [1]\nG0 X2\no7 endwhile");
    assert!(
        endless[0].contains("o7 while of line 2 goes on after 1000 lines ([program] max_steps)"),
        "{endless:?}"
    );
    let recursive = errors("o1 sub\no1 call\no1 endsub\no1 call");
    assert!(
        recursive[0].contains("calls lie 100 deep within each other"),
        "{recursive:?}"
    );
    assert!(
        recursive[0].contains("called from line 2; and 95 callers before"),
        "{recursive:?}"
    );
    // One mistake in a loop is one message.
    let (_, report) = checked("o1 repeat [50]\nG41\no1 endrepeat", &config);
    assert_eq!((report.diagnostics.len(), report.unlisted), (1, 0));
}

#[test]
fn the_first_pass_ends_where_only_the_machine_knows() {
    let text =
        "F60\nG38.3 Z-5\nG0 Z1\no1 if [#5063 LT -2]\nG0 X1\no1 else\nG0 X2\no1 endif\nG0 X3\nM2";
    let (_, report) = checked(text, &mill());
    assert_eq!((report.seen_to, report.is_ok()), (Some(4), true));
    let warning = report.warnings[0].to_string();
    assert!(
        warning.starts_with("t.ngc:4:1: warning: from here on the program depends on what a probe"),
        "{warning}"
    );
    assert!(path(text).ends_with("5:1 9:3 10:3"), "{}", path(text));
    // What a value that is assumed decides lies further on.
    let (_, report) = checked(
        "M66 P1 L0\n#1=[#5399 * 2]\no1 sub\no2 repeat [#1]\nG0 X1\no2 endrepeat\no1 endsub\no1 call [#1]",
        &mill(),
    );
    assert_eq!(report.seen_to, Some(4));
    let (_, report) = checked("M66 P1 L0\no1 if [1]\nG0 X1\no1 endif", &mill());
    assert_eq!(report.seen_to, None);
}

#[test]
fn a_loop_across_chunks_reads_the_same_text() {
    let filler = "(padding, padding, padding, padding, padding)\n".repeat(4000);
    let text = format!("o1 repeat [3]\nG0 X1\n{filler}G0 X2\n{filler}o1 endrepeat\n");
    assert_eq!(path(&text), "2:1 4003:2 2:1 4003:2 2:1 4003:2");
    let long = format!("o1 call\nM2\n{filler}{filler}{filler}{filler}o1 sub\nG0 X7\no1 endsub\n");
    assert_eq!(path(&long), "16004:7 2:7");
}

#[test]
fn a_subroutine_leaves_the_modes_as_m73_found_them() {
    let program = "o1 sub\nM73\nG91 G20\nG0 X1\no1 endsub\no2 sub\nM70\nG91\no2 endsub\nG0 X5\no1 call\nX1\no2 call\nX1";
    assert_eq!(path(program), "10:5 4:30.4 12:1 14:2");
    let inner = "o1 sub\nM72\no1 endsub\nM70\no1 call";
    assert!(
        errors_on(&mill(), inner)[0].starts_with("2:1 [modal-state]"),
        "each call has its own"
    );
}

#[test]
fn a_return_needs_no_label_of_its_own() {
    let program =
        "o1 sub\no2 if [#1]\no2 return [7]\no2 endif\nG0 X1\no1 endsub\no1 call [1]\nG0 X#<_value>";
    assert_eq!(path(program), "8:7");
}

#[test]
fn subprograms_share_the_parameters_and_are_driven_as_often_as_asked() {
    assert_eq!(
        path("#1=1\nM98 P0100 L3\nG0 X[#1 * 10]\nM30\nO100 (sub)\n#1=[#1+1]\nG0 X#1\nM99\nG0 X99"),
        "7:2 7:3 7:4 3:40 4:40"
    );
    // A call acts behind the move of its line; L0 calls nothing; names are the callee's own.
    let text =
        "#<a>=5\nG0 X1 M98 P2\nM98 P2 L0\nG0 X#<a>\nM2\nO2\n#<a>=7\nG0 X[2 + EXISTS[#<b>]]\nM99";
    assert_eq!(path(text), "2:1 8:2 4:5 5:5");
    // Of two with the same number the one behind the call, and one before it where none is behind.
    let text = "o1 if [0]\nO5\nG0 X3\nM99\no1 endif\nM98 P5\nM98 P6\nM30\nO6\nM98 P5\nM99\nO5\n#31=[#31+4]\nG0 X#31\nM99";
    assert_eq!(path(text), "14:4 14:8 8:8");
    // Loops lie within the call; M99 leaves them.
    let text = "M98 P1 L2\nG0 X9\nM30\nO1\no2 repeat [3]\nG91 G0 X1\nG90\no3 if [#31 EQ 1]\n#31=0\nM99\no3 endif\n\
                #31=1\no2 endrepeat\nM99";
    assert_eq!(path(text), "6:1 6:2 6:3 6:4 2:9 3:9");
}

#[test]
fn what_stands_behind_the_end_is_not_called() {
    for text in [
        "%\nG0 X1\no2 call\n%\no2 sub\nG0 X2\no2 endsub",
        "(title)\n%\nG0 X1\nM98 P2\n%\nO2\nG0 X2\nM99",
    ] {
        let found = errors(text);
        assert!(found[0].contains("there is no subroutine"), "{found:?}");
    }
}

#[test]
fn m99_begins_the_program_again() {
    let text = "%\nO1 (warm up)\n#31=[#31+1]\no7 if [#31 GT 3]\nM30\no7 endif\nG0 X#31\nM99\n%";
    assert_eq!(path(text), "7:1 7:2 7:3 5:3");
    let mut config = mill();
    config.max_steps = 1000;
    let found = errors_on(&config, "G0 X1\nM99\nG0 X2");
    assert!(
        found.len() == 1
            && found[0].contains("[endless] M99 begins the program again, and nothing"),
        "{found:?}"
    );
    let found = errors_on(&config, "o1 if [#31]\no1 endif\nM99");
    assert!(
        found[0].contains(
            "[endless] the program, which M99 of line 3 begins again, goes on after 1000 lines"
        ),
        "{found:?}"
    );
}

/// A planner's refusal shows the line that makes the block, also where that line leads elsewhere.
#[test]
fn a_block_is_blamed_on_its_own_line() {
    let far = "(padding)\n".repeat(20_000);
    let text = format!("F60\nG1 X7 M98 P5\nM30\n{far}O5\nM99");
    let mut program = Program::spool("t.ngc", text.as_bytes()).unwrap();
    let mut refuse = |block: &tandem_sdk::Block, _: Option<tandem_sdk::Curve<'_>>| {
        if block.end[0] == 7.0 && block.length_mm > 0.0 {
            Err("too far".to_owned())
        } else {
            Ok(())
        }
    };
    let report = check(&mut program, &mill(), &mut refuse).unwrap();
    let found = &report.diagnostics[0];
    assert_eq!((found.line, found.excerpt.as_str()), (2, "G1 X7 M98 P5"));
}

#[test]
fn subprograms_and_subs_are_not_mixed() {
    let cases = [
        (
            "M98 P1\nM30\no1 sub\no1 endsub",
            "1:5 [o-word] o1 is a sub: o1 call calls it",
        ),
        (
            "M98 P1\nM30",
            "1:5 [o-word] there is no subroutine with this label in this file",
        ),
        (
            "o1 sub\nM99\no1 endsub\no1 call",
            "2:1 [o-word] M99 ends a subprogram that M98 has called",
        ),
        ("M98", "1:1 [word-missing] M98 needs P"),
        ("M98 P1\nM30\nO1\nG1 X1\nM99", "4:1 [feed-missing]"),
        ("M98 P1\nM30\nO1\nM98 P1\nM99", "calls lie 100 deep"),
        (
            "G0 X1\no<late>",
            "2:1 [o-word] what the O-word does is missing here",
        ),
    ];
    for (text, expected) in cases {
        let found = errors(text);
        assert!(
            found.len() == 1 && found[0].contains(expected),
            "{text}: {found:?}"
        );
    }
    assert!(errors("M98 P1\nM30\nO1\nG1 X1\nM99")[0].ends_with("; in O1, called from line 1"));
    assert_eq!(path("o<title>\nG0 X1"), "2:1");
}

#[test]
fn a_subprogram_that_a_probe_chooses_is_checked_when_it_is_driven() {
    let (_, report) = checked(
        "F60 G38.2 Z-5\nM98 P[1 + #5070]\nM30\nO2\nG0 X1\nM99",
        &mill(),
    );
    assert_eq!((report.is_ok(), report.seen_to), (true, Some(2)));
}

#[test]
fn a_line_by_hand_calls_a_subroutine() {
    let (_folder, config) = with_files(&[
        (
            "step.ngc",
            "o<step> sub\no1 repeat [#1]\nG91 G0 X1\no1 endrepeat\nG90\n#31=[#31 + #1]\no<step> endsub [7]",
        ),
        (
            "touch.ngc",
            "o<touch> sub\nF60 G38.2 Z-5\n(done)\no<touch> endsub",
        ),
        (
            "after.ngc",
            "o<after> sub\nF60 G38.2 Z-8\nG0 Z[#5063]\no<after> endsub",
        ),
        (
            "wrong.ngc",
            "o<wrong> sub\n#31=99\nG0 X1\nG123 X2\no<wrong> endsub",
        ),
        ("end.ngc", "o<end> sub\n#1=5\n#<a>=3\nM2\no<end> endsub"),
        (
            "ever.ngc",
            "o<ever> sub\no1 while [1]\no1 endwhile\no<ever> endsub",
        ),
    ]);
    let mut interpreter = Interpreter::new(config);
    interpreter.set_file("input");
    let mut take = |number: u32, text: &str| {
        let mut items = Vec::new();
        let done = interpreter.line(number, text.as_bytes(), &mut items);
        interpreter.go_on();
        let path = only_blocks(&items);
        let shown: Vec<_> = path
            .iter()
            .map(|b| format!("{}:{}", b.line, short(b.end[0])))
            .collect();
        done.map(|()| shown.join(" "))
            .map_err(|error| error.to_string())
    };
    let ok = |text: &str| Ok(text.to_owned());
    assert_eq!(take(1, "#1=40"), ok(""));
    assert_eq!(take(2, "o<step> call [3]"), ok("2:1 2:2 2:3"));
    assert_eq!(take(3, "G0 X[#1 + #31 + #<_value>]"), ok("3:50"));
    assert_eq!(take(4, "o<touch> call"), ok("4:50 4:50"));
    let later = take(5, "o<after> call").unwrap_err();
    assert!(
        later.contains("after.ngc:3:1") && later.contains("depends on the answer"),
        "{later}"
    );
    let wrong = take(6, "o<wrong> call").unwrap_err();
    assert!(
        wrong.contains("wrong.ngc:4:1") && wrong.contains("in o<wrong>, called from line 6"),
        "{wrong}"
    );
    assert!(
        take(7, "o<none> call")
            .unwrap_err()
            .starts_with("input:7:1")
    );
    assert!(
        take(8, "o<ever> call")
            .unwrap_err()
            .contains("at most 100000 lines")
    );
    assert!(
        take(8, "o1 if [1]")
            .unwrap_err()
            .contains("only calls subroutines")
    );
    // What went wrong has changed nothing, and M2 in a subroutine leaves it.
    assert_eq!(take(9, "G0 X#31"), ok("9:3"));
    assert_eq!(take(10, "o<end> call"), ok("10:3"));
    assert_eq!(take(11, "G0 X[#1 + EXISTS[#<a>]]"), ok("11:40"));
}
