//! The promises of the contract, judged by the conformance kit, against the emulator.

use tandem_conformance::{CountingAllocator, Report, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

/// Three drives, and a terminal with an input that the probe closes.
fn options(of_bus: &str, of_device: &str) -> String {
    let drive = |position: u32, joint: u32| {
        format!(
            "[[devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{joint}\"\ncounts_per_mm = 8388.608\n\
             {of_device}\n"
        )
    };
    let terminal = "[[devices]]\nposition = 3\nproduct = \"2:0x03f03052\"\ninputs = [0, 1, 2, 3]\n";
    let drives: String = (0..3).map(|n| drive(n, n)).collect();
    format!("interface = \"emulated\"\n{of_bus}\n{drives}{terminal}")
}

fn judged(options: String) -> Report {
    judge(
        tandem_ethercat::PLUGIN,
        &Setup {
            options,
            ..Setup::default()
        },
    )
}

#[test]
fn it_conforms() {
    judged(options("", "")).assert_conforms();
}

#[test]
fn it_conforms_with_distributed_clocks_inverted_counts_and_probes() {
    let probes = "probe = { input = 0, latch = 2 }\ninvert = true\nzero_counts = -40000";
    judged(options("sync = \"dc\"\nphase_us = 300", probes)).assert_conforms();
}
