//! Stops on the computer's clock, where the loop that drives and whoever stops it run beside each other.
//!
//! `TANDEM_STOPS=2000` asks for so many, `TANDEM_SEED=n` for other instants.

use std::time::Duration;

use serde_json::json;
use tandem_rig::Random;
use tandem_session::controller::NoKeeper;

use crate::doors::{Client, with_controller};
use crate::scale::from_environment;
use crate::support::machine;

/// An abort that is acknowledged behind a start, however soon: the program is aborted, or was never begun. By itself it would come to
/// its end only after minutes.
#[test]
fn an_abort_behind_a_start_is_never_lost() {
    let stops = from_environment("TANDEM_STOPS", 60.0) as u64;
    let seed = from_environment("TANDEM_SEED", 1.0) as u64;
    let mut random = Random::new(seed);
    let mill = machine("mill-3axis.toml");
    let (mut aborted, mut unbegun) = (0, 0);
    let mut run = |socket: &std::path::Path| {
        let mut client = Client::in_control(socket);
        let text = "G21 G90 F60\nG1 X100\nX0\nM2\n";
        client.ok("load", json!({ "text": text, "name": "slow.ngc" }));
        for nth in 0..stops {
            let place = format!("stop {nth}, TANDEM_SEED={seed}");
            let start = client.say("start", json!({}));
            std::thread::sleep(Duration::from_micros(random.below(15_000)));
            let stop = client.say("abort", json!({}));
            let begins = client.answer(start);
            let stopped = client.answer(stop);
            assert!(stopped.get("ok").is_some(), "{place}: {stopped}");
            if begins.get("ok").is_some() {
                let job = client.wait(|told| told["event"] == "job");
                assert_eq!(job["job"]["outcome"], "aborted", "{place}: {job}");
                aborted += 1;
            } else {
                let why = begins["error"]["why"].as_str().unwrap();
                assert!(
                    why.contains("stopped before this was begun"),
                    "{place}: {why}"
                );
                unbegun += 1;
            }
            client.until_state("ready");
            client.aside.clear();
        }
    };
    with_controller(&mill, Box::new(NoKeeper), |_| (), |socket, _| run(socket));
    println!("{stops} stops, TANDEM_SEED={seed}: {aborted} aborted, {unbegun} not begun");
    assert!(aborted > 0);
}
