//! `tandem_readers::machine_file`, led by coverage.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tandem_readers::machine_file::judge(bytes));
