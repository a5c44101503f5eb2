//! The promises of the contract, judged by the conformance kit.

use tandem_conformance::{CountingAllocator, Report, Setup, judge};

#[global_allocator]
static COUNTING: CountingAllocator = CountingAllocator;

fn judged(options: &str) -> Report {
    judge(
        tandem_sim::PLUGIN,
        &Setup {
            options: options.to_string(),
            ..Setup::default()
        },
    )
}

#[test]
fn it_conforms() {
    judged("").assert_conforms();
}

#[test]
fn it_conforms_however_demanding_it_is() {
    let switch = "[[switches]]\ninput = 0\njoint = 0\nabove_mm = 3\n";
    let demanding = "enable_s = [0.1, 0.3]\nbrake_s = [0.05, 0.1, 0]\nsag_mm_per_s = [0, 0, -5]\nencoder_count_mm = 0.001\n\
                     encoder_noise_mm = 0.002\nstart_spread_mm = 20\ndelay_periods = 2\npatience_periods = 20\n\
                     lost_frames = { probability = 0.02, periods = 2 }\nlate_frames = { probability = 0.01 }\n\
                     bus_clock = { drift_ppm = 70, jitter_us = 100 }\n";
    for options in [
        "model = \"second-order\"\n".to_string() + demanding + switch,
        demanding.to_string() + switch,
        "watchdog_periods = 0\nlate_frames = { ticks = [600], periods = 2000 }\n".to_string(),
        "[[faults]]\njoint = 1\ntick = 700\ncode = 9\n[[faults]]\njoint = 2\ntick = 900\nlost = true\n".to_string(),
        "encoder = \"incremental\"\nspindle_time_constant_s = 0.3\n".to_string() + switch,
    ] {
        judged(&options).assert_conforms();
    }
}
