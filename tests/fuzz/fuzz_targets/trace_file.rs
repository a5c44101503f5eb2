//! `tandem_readers::trace_file`, led by coverage.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tandem_readers::trace_file::judge(bytes));
