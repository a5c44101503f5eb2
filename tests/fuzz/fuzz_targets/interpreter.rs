//! `tandem_readers::interpreter`, led by coverage.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tandem_readers::interpreter::judge(bytes));
