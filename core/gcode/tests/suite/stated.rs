//! What a program states for somebody who watches for it: in comments and in named parameters, in the order of its lines.

use crate::common;

use common::{mill, run_on};
use tandem_gcode::{Config, Item, Program, Stream, Watched, check};
use tandem_sdk::BlockKind;

fn watching() -> Config {
    let watched = |name: &str, words: &[&str]| Watched {
        name: name.to_string(),
        words: words.iter().map(|word| (*word).to_string()).collect(),
    };
    Config {
        watched: vec![watched("material", &["brass", "steel"]), watched("d", &[])],
        ..mill()
    }
}

/// What `program` states, and where its blocks are between that.
fn stated(config: &Config, program: &str) -> Vec<String> {
    let mut program = Program::spool("part.ngc", program.as_bytes()).unwrap();
    let report = check(&mut program, config, &mut |_, _| Ok(())).unwrap();
    assert!(report.is_ok(), "{:?}", report.diagnostics);
    let mut stream = Stream::new(program, config).unwrap();
    let mut items = vec![];
    while stream.next_items(&mut items).unwrap() {}
    let shown = items.iter().filter_map(|item| match item {
        Item::Stated { which, value } => Some(format!("{which} = {value}")),
        Item::Block(block, _) if block.kind == BlockKind::Line => Some("line".to_string()),
        _ => None,
    });
    shown.collect()
}

#[test]
fn it_holds_for_the_line_that_states_it() {
    let program =
        "F100\nG1 X1\n(material: steel)\nG1 X2 (D=6.)\n#<material>=0 G1 X3\n#<_d> = [1+1]\nM2\n";
    assert_eq!(
        stated(&watching(), program),
        ["line", "0 = 1", "1 = 6", "line", "0 = 0", "line", "1 = 2"]
    );
    assert_eq!(stated(&mill(), program), ["line"; 3], "nobody watches");
}

#[test]
fn subroutines_and_loops_state_it_as_they_are_executed() {
    let program = "F100\no100 sub\n#<material> = #1\nG1 X[#1 + 1]\no100 endsub\no100 call [1]\n\
                   o101 repeat [2]\n(d = 3)\nG91\nG1 X1\nG90\no101 endrepeat\no100 call [0]\nM2\n";
    assert_eq!(
        stated(&watching(), program),
        [
            "0 = 1", "line", "1 = 3", "line", "1 = 3", "line", "0 = 0", "line"
        ]
    );
}

#[test]
fn lines_that_are_left_out_or_wrong_state_nothing() {
    let config = Config {
        block_delete: true,
        ..watching()
    };
    assert_eq!(stated(&config, "F100\n/(d=1)\nG1 X1\nM2\n"), ["line"]);
    let (items, errors) = run_on(watching(), "F100\nG1 X1 Q7 (d=1)\nG1 X2\nM2\n");
    assert_eq!(errors.len(), 1);
    assert!(!items.iter().any(|item| matches!(item, Item::Stated { .. })));
}

#[test]
fn what_cannot_be_read_is_a_warning_with_its_line() {
    let text = "F100\nG1 X1 (material = wood)\nG1 X2 (d=x)\nM2\n";
    let mut program = Program::spool("part.ngc", text.as_bytes()).unwrap();
    let report = check(&mut program, &watching(), &mut |_, _| Ok(())).unwrap();
    assert!(report.is_ok());
    let warnings: Vec<String> = report.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].starts_with("part.ngc:2:")
            && warnings[0]
                .contains("material = \"wood\", which is not a number, nor one of brass, steel"),
        "{warnings:?}"
    );
}
