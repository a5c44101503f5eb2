//! Rules that the compiler does not know: dependency directions, links, names in the documentation.
//!
//! `UPDATE_DOCS=1 cargo test -p tandem-tidy` rewrites the generated parts of the documentation.

mod dependencies;
mod generated;
mod life_of_a_block;
mod links;
mod places;
mod published;
mod source;
mod tree;

/// Fails with all findings, a line each, as `file:line: what is wrong`.
fn expect_none(rule: &str, findings: &[String]) {
    assert!(findings.is_empty(), "{rule}:\n{}", findings.join("\n"));
}
