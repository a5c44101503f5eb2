//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

/// All but two: the planner allocates for each window, on the rough loop, and at low feeds a sample may be a ten-thousandth
/// faster than programmed.
#[test]
fn it_conforms_but_for_its_memory_and_the_last_digits_of_the_feed() {
    let report = judge(tandem_nurbs::PLUGIN, &Setup { programs: 3, ..Setup::default() });
    println!("{report}");
    assert!(report.findings().iter().all(|finding| ["allocation", "feed"].contains(&finding.check)), "{report}");
    assert!(report.checks().contains(&"limits"));
}
