//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

#[test]
fn it_conforms() {
    let setup = Setup {
        options: "upper_arm_mm = 300\nforearm_mm = 250\nshoulder_mm = [0, -350]".into(),
        work_area: [[-150.0, 150.0], [-100.0, 100.0], [-50.0, 50.0]],
        ..Setup::default()
    };
    judge(tandem_scara::PLUGIN, &setup).assert_conforms();
}
