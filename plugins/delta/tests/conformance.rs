//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

#[test]
fn it_conforms() {
    let setup = Setup {
        options: "rod_mm = 300\nradius_mm = 150".into(),
        work_area: [[-90.0, 90.0], [-90.0, 90.0], [-100.0, 100.0]],
        ..Setup::default()
    };
    judge(tandem_delta::PLUGIN, &setup).assert_conforms();
}
