//! `tandem_readers::policy_module`, led by coverage.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tandem_readers::policy_module::judge(bytes));
