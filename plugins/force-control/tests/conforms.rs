//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

const OPTIONS: &str = "reference_torque_nm = 0.1\nmin_feed_mm_per_min = 10\nmax_feed_mm_per_min = 300\nteeth = 2\n\
                       stability = { torque_per_feed_nm_min_per_mm = 0.001 }\n\
                       axes.x = { lead_mm = 20, torque_constant_nm_per_a = 0.378, inertia_kg_m2 = 1.842e-4 }\n\
                       axes.y = { lead_mm = 20, torque_constant_nm_per_a = 0.378, inertia_kg_m2 = 1.842e-4 }\n\
                       axes.z = { lead_mm = 20, torque_constant_nm_per_a = 0.378, inertia_kg_m2 = 1.842e-4 }\n";

#[test]
fn it_conforms() {
    let setup = Setup {
        options: OPTIONS.to_string(),
        ..Setup::default()
    };
    judge(tandem_force_control::PLUGIN, &setup).assert_conforms();
}
