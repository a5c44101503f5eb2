//! `tandem_readers::ethercat_frame`, led by coverage.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tandem_readers::ethercat_frame::judge(bytes));
