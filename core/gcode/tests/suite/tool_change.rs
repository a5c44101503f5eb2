//! M6 as the machine file has it: up before, and by a subroutine.

use tandem_gcode::{Config, Interpreter, Item, Program, Stream, check};
use tempfile::TempDir;

use crate::common::{shown, with_files};

/// Both passes over a program: the items, or the errors.
fn drive(config: &Config, text: &str) -> Result<Vec<String>, Vec<String>> {
    let mut program = Program::spool("part.ngc", text.as_bytes()).unwrap();
    let mut first = Vec::new();
    let mut keep = |block: &tandem_sdk::Block, _: Option<tandem_sdk::Curve<'_>>| {
        first.push(*block);
        Ok(())
    };
    let report = check(&mut program, config, &mut keep).unwrap();
    if !report.is_ok() {
        return Err(report.diagnostics.iter().map(ToString::to_string).collect());
    }
    let mut stream = Stream::new(program, config).unwrap();
    let mut items = Vec::new();
    while stream.next_items(&mut items).unwrap() {}
    let second: Vec<_> = crate::common::only_blocks(&items);
    assert_eq!(format!("{first:?}"), format!("{second:?}"));
    Ok(shown(&items))
}

fn without_events(items: Result<Vec<String>, Vec<String>>) -> Vec<String> {
    let keeps = |item: &String| !item.contains("Select") && !item.contains("Dwell");
    items.unwrap().into_iter().filter(keeps).collect()
}

/// A machine whose tools are changed by `text`.
fn changer(text: &str) -> (TempDir, Config) {
    let (folder, mut config) = with_files(&[("toolchange.ngc", text)]);
    config.tool_change.sub = Some("toolchange".into());
    (folder, config)
}

const CARRIER: &str = "o<toolchange> sub\n(from #2 to #1)\nG53 G0 X[#1 * 10] Y[#2 * 10]\nG53 G0 Z90\no<toolchange> endsub\nM2\n";

#[test]
fn the_tool_goes_up_where_the_machine_says_so_and_not_down() {
    let (_folder, mut config) = with_files(&[]);
    config.tool_change.retract_z_mm = Some(80.0);
    let text = "G54 G10 L2 P1 Z5\nG0 X1 Z2\nM6 T1\nG91 G0 X3\nG90 G53 G0 Z90\nT2 M6\nM6";
    assert_eq!(
        without_events(drive(&config, text)),
        [
            "2: Rapid 0 to 1 0 7 0",
            "3: Rapid 2 to 1 0 80 0",
            "3: ToolChange 1 0 before 4",
            "4: Rapid 4 to 4 0 80 0",
            "5: Rapid 5 to 4 0 90 0",
            "6: ToolChange 2 0 before 7",
            "End",
        ]
    );
    // Beyond its travel it is refused, as any motion.
    config.tool_change.retract_z_mm = Some(101.0);
    let refused = drive(&config, "T1\nM6").unwrap_err();
    assert!(
        refused[0].contains("part.ngc:2:1") && refused[0].contains("beyond its travel"),
        "{refused:?}"
    );
}

#[test]
fn a_subroutine_changes_tools() {
    let (_folder, config) = changer(CARRIER);
    let text =
        "G0 Z2\nT1 M6\nG43 G0 Z0\nT2\nM6 (here)\nG43\nG0 X5\nM6\nT0 M6\nG1 X#<_current_tool> F100";
    let items = without_events(drive(&config, text));
    assert_eq!(
        items,
        [
            "1: Rapid 0 to 0 0 2 0",
            "2: Rapid 2 to 10 0 2 0",
            "2: Rapid 3 to 10 0 90 0",
            // The length is that of the tool that has come.
            "3: Rapid 4 to 10 0 20 0",
            "5: Rapid 6 to 20 10 20 0",
            "5: Rapid 7 to 20 10 90 0",
            "7: Rapid 8 to 5 10 90 0",
            "9: Rapid 10 to 0 20 90 0",
            "End",
        ]
    );
}

#[test]
fn m6_in_the_subroutine_is_the_change_and_comes_once() {
    let (_folder, mut config) =
        changer("o<toolchange> sub\nG53 G0 Z90\nM6\nM6\no<toolchange> endsub [1]\n");
    config.tool_change.retract_z_mm = Some(70.0);
    assert_eq!(
        without_events(drive(&config, "T2\nM6\nM6")),
        [
            "2: Rapid 0 to 0 0 70 0",
            "2: Rapid 2 to 0 0 90 0",
            "2: ToolChange 2 0 before 4",
            "End"
        ]
    );
}

#[test]
fn a_program_has_no_changer_of_its_own() {
    let (_folder, config) = changer(CARRIER);
    let own = "o<toolchange> sub\nG0 X-99\no<toolchange> endsub\n";
    let items = without_events(drive(&config, &format!("{own}T1 M6\no<toolchange> call\n")));
    assert_eq!(
        items,
        [
            "4: Rapid 0 to 10 0 0 0",
            "4: Rapid 1 to 10 0 90 0",
            "2: Rapid 2 to -99 0 90 0",
            "End"
        ]
    );
}

#[test]
fn what_cannot_be_changed_is_refused_with_its_callers() {
    let (_folder, config) = changer("o<toolchange> sub\nG0 X900\no<toolchange> endsub\n");
    let refused = drive(&config, "o1 sub\nT1\nM6\no1 endsub\nG0 X1\no1 call\n").unwrap_err();
    assert!(
        refused[0].contains("toolchange.ngc:2:4")
            && refused[0]
                .contains("in o<toolchange>, called from line 3; in o1, called from line 6"),
        "{refused:?}"
    );
    for beside in ["G0 X4", "G43 H1", "X4", "G54", "M8", "@4"] {
        let refused = drive(&config, &format!("G0\nT1 M6 {beside}\n")).unwrap_err();
        assert!(
            refused[0].contains("split the line"),
            "{beside}: {refused:?}"
        );
    }
    let (_folder, mut config) = with_files(&[("other.ngc", "")]);
    config.tool_change.sub = Some("toolchange".into());
    let refused = drive(&config, "T1 M6").unwrap_err();
    assert!(
        refused[0].contains("no file toolchange.ngc lies in"),
        "{refused:?}"
    );
}

#[test]
fn a_line_by_hand_changes_tools_too() {
    let (_folder, config) = changer(CARRIER);
    let mut interpreter = Interpreter::new(config);
    interpreter.set_file("input");
    let mut take = |number: u32, text: &str| {
        assert_eq!(interpreter.calls(text.as_bytes()), text.contains('M'));
        let mut items: Vec<Item> = Vec::new();
        let done = interpreter.line(number, text.as_bytes(), &mut items);
        interpreter.go_on();
        done.map(|()| without_events(Ok(shown(&items))).join(", "))
            .map_err(|error| error.to_string())
    };
    let ok = |text: &str| Ok(text.to_owned());
    assert_eq!(take(1, "T1"), ok(""));
    assert_eq!(
        take(2, "M6"),
        ok("2: Rapid 0 to 10 0 0 0, 2: Rapid 1 to 10 0 90 0")
    );
    assert!(
        take(3, "T2 M6 G0 X1")
            .unwrap_err()
            .contains("split the line")
    );
    // It goes on where that line would have ended, as behind any that is refused; tool 1 is still in.
    assert_eq!(take(4, "G43 G0 Z0"), ok("4: Rapid 2 to 1 0 20 0"));
    assert!(take(5, "M3 S100").is_ok());
}
