//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

const OPTIONS: &str = "axis = \"y\"\nradius_mm = 30\n";

#[test]
fn it_conforms() {
    let setup = Setup {
        options: OPTIONS.to_string(),
        ..Setup::default()
    };
    judge(tandem_wrapped_rotary::PLUGIN, &setup).assert_conforms();
}
