//! Plugins that do not come back: the process says who, keeps what was recorded, and ends, so that the drives' own watchdog acts.

use crate::harness::{Done, Scenario, mill, root};
use crate::plugins::built::third_party;

const PROGRAM: &str = "G21 G90\nF3000\nG1 X40 Y10\nG1 X0 Y20\nG1 X10 Y0\nM2\n";

/// What the run does whose plugin hangs in this call of `method`.
fn hang(section: &str, method: &str, call: u32, clock: &str) -> Done {
    let library = third_party("hostile");
    let plugin = format!("{section}.plugin={}", library.display());
    let options = format!("{section}.options={{misbehave='hang',method='{method}',call={call}}}");
    // Short for a test, and long for a computer that is busy with others.
    let patience = [
        "--set",
        "loops.soft_hang_after_s=1.5",
        "--set",
        "loops.fine_hang_after_ms=1500",
    ];
    // A kinematics whose joints are no linear function of the axes is asked in every period.
    let options = if section == "kinematics" {
        options.replace("call", "curved=true,call")
    } else {
        options
    };
    let corexy = root().join("examples/machines/corexy.toml");
    let machine = if section == "kinematics" {
        corexy
    } else {
        mill()
    };
    let acceleration: &[&str] = if section == "kinematics" {
        &["--set", "joints.a.max_acceleration_mm_per_s2=5000"]
    } else {
        &[]
    };
    let settings = [
        "--set",
        &plugin,
        "--set",
        &options,
        "--clock",
        clock,
        "--set",
        "loops.max_missed_periods=1000000",
        "--set",
        "loops.max_missed_share=1",
    ];
    Scenario::text(PROGRAM)
        .on(&machine)
        .with(acceleration)
        .with(&settings)
        .with(&patience)
        .run()
}

fn assert_told(done: &Done, section: &str, method: &str) {
    let what = format!(
        "{section} {}: {method} does not come back",
        third_party("hostile").display()
    );
    assert_eq!(done.status(), 3, "{section}, {method}: {}", done.errors());
    assert!(
        done.errors().contains(&format!("fault: {what}")),
        "{what}: {}",
        done.errors()
    );
}

#[test]
fn a_driver_whose_exchange_never_returns_ends_the_process_on_either_clock_and_leaves_summary_and_trace()
 {
    for clock in ["virtual", "wall"] {
        let done = hang("driver", "exchange", 900, clock);
        assert_told(&done, "driver", "exchange");
        let summary = done.summary();
        assert!(
            summary["fault"]
                .as_str()
                .unwrap()
                .contains("exchange does not come back"),
            "{clock}: {summary}"
        );
        assert_eq!(summary["incomplete"], true, "{clock}");
        assert!(
            summary["counters"]["samples"].as_u64().unwrap() > 500,
            "{clock}: {summary}"
        );
        std::fs::rename(done.file("trace.csv.part"), done.file("trace.csv")).unwrap();
        let rows = done.cells("state");
        let ticks = summary["counters"]["samples"].as_u64().unwrap() as usize;
        assert!(
            rows.len() > 400 && rows.len() <= ticks + 1,
            "{clock}: {} rows of {ticks}",
            rows.len()
        );
    }
}

#[test]
fn a_planner_or_strategy_that_hangs_leaves_a_machine_at_rest_on_the_path() {
    for (section, method, call) in [("planner", "advance", 2), ("feed_strategy", "update", 60)] {
        let done = hang(section, method, call, "wall");
        assert_told(
            &done,
            if section == "planner" {
                section
            } else {
                "feed strategy"
            },
            method,
        );
        std::fs::rename(done.file("trace.csv.part"), done.file("trace.csv")).unwrap();
        let feeds = done.column("feed_mm_s");
        assert!(
            feeds.iter().any(|feed| *feed > 1.0),
            "{section}: it has moved"
        );
    }
}

#[test]
fn a_kinematics_that_hangs_is_told_whichever_loop_asks_it() {
    let library = third_party("hostile");
    for clock in ["virtual", "wall"] {
        let done = hang("kinematics", "to_joints", 2000, clock);
        // The fine loop asks an instance of its own, and the recorder another: which of them comes first to that call is open.
        let name = format!("kinematics {}", library.display());
        assert_eq!(done.status(), 3, "{clock}: {}", done.errors());
        assert!(
            done.errors().contains(&name) && done.errors().contains("does not come back"),
            "{}",
            done.errors()
        );
    }
}

#[test]
fn a_plugin_that_hangs_before_or_behind_the_motion_is_told_too() {
    for (section, method, told) in [
        ("driver", "new", "its constructor"),
        ("driver", "open", "open"),
        ("driver", "start", "start"),
        ("driver", "stop", "stop"),
        ("planner", "new", "its constructor"),
        ("planner", "check", "check"),
        ("planner", "accept", "accept"),
    ] {
        assert_told(&hang(section, method, 1, "virtual"), section, told);
    }
}
