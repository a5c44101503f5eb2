//! The interpreter. One program for all of these tests: linking one for each costs a clean build a minute.

#[path = "../common/mod.rs"]
mod common;
mod curves;
mod messages;
mod o_words;
mod probe;
mod properties;
mod source;
mod stated;
mod tool_change;
mod words;
