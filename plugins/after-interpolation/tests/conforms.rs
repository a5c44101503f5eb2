//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

#[test]
fn it_conforms() {
    judge(
        tandem_after_interpolation::PLUGIN,
        &Setup {
            programs: 3,
            ..Setup::default()
        },
    )
    .assert_conforms();
}
