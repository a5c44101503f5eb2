//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

/// All but one: a planner of curves allocates for each block that it accepts, on the rough loop.
#[test]
fn it_conforms_but_for_the_memory_of_its_blocks() {
    for options in ["", "form = \"windowed\""] {
        let report = judge(
            tandem_nurbs::PLUGIN,
            &Setup {
                options: options.to_string(),
                programs: 6,
                ..Setup::default()
            },
        );
        println!("{options} {report}");
        assert!(
            report
                .findings()
                .iter()
                .all(|finding| finding.check == "allocation"),
            "{report}"
        );
        assert!(
            ["limits", "feed"]
                .iter()
                .all(|check| report.checks().contains(check)),
            "{report}"
        );
    }
}
