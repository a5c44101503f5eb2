//! Stops on the computer's clock, where the loop that drives and whoever stops it run beside each other.
//!
//! `TANDEM_STOPS=2000` asks for so many, `TANDEM_SEED=n` for other instants.

use std::time::Duration;

use serde_json::json;
use tandem_rig::Random;
use tandem_session::controller::NoPersistence;

use crate::doors::{Client, with_controller};
use crate::scale::from_environment;
use crate::support::{machine, machine_with};

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
    with_controller(
        &mill,
        Box::new(NoPersistence),
        |_| (),
        |socket, _| run(socket),
    );
    println!("{stops} stops, TANDEM_SEED={seed}: {aborted} aborted, {unbegun} not begun");
    assert!(aborted > 0);
}

/// An abort that is acknowledged ends the job, also where the path has come to its end and the loop that looks, which is slow here, has not
/// seen it yet: the job is aborted, and what was on is off.
#[test]
fn an_abort_at_the_end_of_a_job_is_one() {
    let seed = from_environment("TANDEM_SEED", 1.0) as u64;
    let mut random = Random::new(seed);
    let slow = machine_with("mill-3axis.toml", &[("loops.rough_period_ms", "60")]);
    let mut outcomes = [0, 0];
    let mut run = |socket: &std::path::Path| {
        let mut client = Client::in_control(socket);
        let text = "G21 G91 F3000 M3 S500\nG1 X1\nM2\n";
        client.ok("load", json!({ "text": text, "name": "short.ngc" }));
        for nth in 0..8 {
            let by_hand = nth % 2 == 0;
            let place = format!("abort {nth}, TANDEM_SEED={seed}");
            if by_hand {
                client.say("mdi", json!({ "line": "G91 G1 X-1 F3000 M3 S1000" }));
            } else {
                client.ok("start", json!({}));
            }
            // What has not begun would never begin.
            let is_told =
                |client: &Client<_>| client.aside.iter().any(|told| told["event"] == "job");
            while client.ok("status", json!({}))["job"].is_null() && !is_told(&client) {
                std::thread::yield_now();
            }
            std::thread::sleep(Duration::from_millis(100 + random.below(300)));
            let stop = client.say("abort", json!({}));
            let acknowledged = client.answer(stop).get("ok").is_some();
            let job = client.wait(|told| told["event"] == "job");
            let expected = if acknowledged { "aborted" } else { "done" };
            assert_eq!(job["job"]["outcome"], expected, "{place}: {job}");
            client.until_state("ready");
            let status = client.ok("status", json!({}));
            let is_on = by_hand && !acknowledged;
            assert_eq!(
                status["spindle_rpm"].as_f64() != Some(0.0),
                is_on,
                "{place}"
            );
            let modal = status["modal"].to_string();
            assert_eq!(modal.contains("M3"), is_on, "{place}: {modal}");
            outcomes[usize::from(acknowledged)] += 1;
            client.aside.clear();
        }
    };
    with_controller(
        &slow,
        Box::new(NoPersistence),
        |_| (),
        |socket, _| run(socket),
    );
    println!("TANDEM_SEED={seed}: {outcomes:?} came behind the end, and before it");
}
