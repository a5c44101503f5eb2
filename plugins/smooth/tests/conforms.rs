//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

#[test]
fn it_conforms() {
    judge(
        tandem_smooth::PLUGIN,
        &Setup {
            programs: 2,
            ..Setup::default()
        },
    )
    .assert_conforms();
}

/// Programs of the kit in which once an acceleration or a feed was exceeded between the places that the check looked at, a
/// block had the feed of one long before it, or a window needed new memory after a reset.
const HARD: [u64; 4] = [12_884_901_900, 8_589_934_620, 4_294_967_308, 4_294_967_300];

#[test]
fn hard_programs() {
    for seed in HARD {
        judge(
            tandem_smooth::PLUGIN,
            &Setup {
                programs: 1,
                seed,
                ..Setup::default()
            },
        )
        .assert_conforms();
    }
}
