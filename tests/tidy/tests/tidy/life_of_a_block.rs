//! The chain of functions in `docs/life-of-a-block.md` exists.

use crate::expect_none;
use crate::source::Modules;
use crate::tree::read;

const PAGE: &str = "docs/life-of-a-block.md";

#[test]
fn every_function_named_exists() {
    let modules = Modules::read();
    let mut findings = vec![];
    let mut count = 0;
    for (index, line) in read(PAGE).lines().enumerate() {
        for path in paths(line) {
            count += 1;
            if !modules.has(path) {
                findings.push(format!(
                    "{PAGE}:{}: {path}: there is no such function or type",
                    index + 1
                ));
            }
        }
    }
    assert!(count > 30, "only {count} names were found");
    expect_none("names that do not exist", &findings);
}

/// What stands in backticks and begins with one of our crates.
fn paths(line: &str) -> impl Iterator<Item = &str> {
    let quoted = line.split('`').skip(1).step_by(2);
    quoted.filter(|text| text.starts_with("tandem") && text.contains("::"))
}

#[test]
fn a_name_that_does_not_exist_is_noticed() {
    let modules = Modules::read();
    assert!(modules.has("tandem_sdk::block::Block::at"));
    for wrong in [
        "tandem_sdk::block::Block::nowhere",
        "tandem_sdk::blocks::Block::at",
        "tandem_sdk::segment::at",
        "at",
    ] {
        assert!(!modules.has(wrong), "{wrong}");
    }
    assert_eq!(
        paths("`tandem_a::b` of `Block` and `tandem_c::d`").collect::<Vec<_>>(),
        ["tandem_a::b", "tandem_c::d"]
    );
}
