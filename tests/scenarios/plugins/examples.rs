//! The plugins of `tests/third-party`, one of each kind: loaded, driven, judged.

use std::path::Path;
use std::process::Command;

use crate::harness::{Scenario, root};
use crate::plugins::built::{built_in, third_party};

const LINES: &str =
    "G21 G90\nF3000\nG1 X40 Y10\nG4 P0.1\nG1 X0.01\nG0 X-30 Y-20 Z5\nG1 X0 Y0 Z0\nM2\n";
const CIRCLES: &str = "G21 G90\nF3000\nG1 X20\nG3 X20 Y0 I-20 J0\nG3 X20 Y0 I-20 J0\nM2\n";

fn set(key: &str, value: &Path) -> [String; 2] {
    ["--set".to_string(), format!("{key}={}", value.display())]
}

fn with(scenario: Scenario, arguments: &[String]) -> Scenario {
    scenario.with(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

fn tandem(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(arguments)
        .output()
        .unwrap();
    let [out, err] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    (output.status.code().unwrap(), out, err)
}

#[test]
fn a_planner_drives_within_limits() {
    let planner = set("planner.plugin", &third_party("one-block"));
    let share = ["--set", "planner.options.acceleration_share=0.05"].map(str::to_string);
    let full = with(Scenario::text(LINES), &planner).run();
    full.assert_within_limits();
    let gentle = with(with(Scenario::text(LINES), &planner), &share).run();
    gentle.assert_within_limits();
    assert!(
        gentle.number("motion_time_s") > 1.1 * full.number("motion_time_s"),
        "its options reach it"
    );
    let refused = with(Scenario::text(CIRCLES), &planner).run();
    assert_eq!(refused.status(), 1, "{}", refused.errors());
    assert!(
        refused
            .errors()
            .contains("one-block drives lines and dwells"),
        "{}",
        refused.errors()
    );
}

#[test]
fn a_feed_strategy_lowers_the_feed_and_shows_its_signal() {
    let strategy = set("feed_strategy.plugin", &third_party("current-limit"));
    let settings = [
        "--set",
        "driver.options.model=second-order",
        "--set",
        "feed_strategy.options.max_current_a=0.03",
    ];
    let plain = Scenario::text(CIRCLES).with(&settings[..2]).run();
    let done = with(Scenario::text(CIRCLES).with(&settings), &strategy).run();
    done.assert_within_limits();
    assert!(done.number("motion_time_s") > 1.2 * plain.number("motion_time_s"));
    assert!(
        done.column("sig_current_a")
            .iter()
            .any(|current_a| *current_a > 0.03)
    );
    let ratios = done.column("ratio");
    assert!(
        ratios.iter().all(|ratio| (0.1..=1.0).contains(ratio))
            && ratios.iter().any(|ratio| *ratio < 0.9)
    );
}

#[test]
fn a_driver_records_what_it_was_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("recorded.csv");
    let settings = [
        set("driver.plugin", &third_party("csv-recorder")),
        set("driver.options.file", &file),
    ]
    .concat();
    let done = with(Scenario::text(LINES), &settings).run();
    done.assert_within_limits();
    let recorded = std::fs::read_to_string(&file).unwrap();
    let position = |row: &str| -> Vec<f64> {
        let (_, numbers) = row.split_once(",[").unwrap();
        numbers
            .trim_end_matches(']')
            .split(", ")
            .map(|number| number.parse().unwrap())
            .collect()
    };
    let rows: Vec<Vec<f64>> = recorded.lines().map(position).collect();
    let (x, z) = (done.column("x_cmd_mm"), done.column("z_cmd_mm"));
    let all = x
        .iter()
        .zip(&z)
        .all(|(x, z)| rows.iter().any(|row| row[0] == *x && row[2] == *z));
    assert!(
        rows.len() > 100 && all,
        "every sample of the trace was told to the driver"
    );
}

#[test]
fn a_kinematics_moves_the_joints_of_a_corexy_machine() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("recorded.csv");
    let settings = [
        set("kinematics.plugin", &third_party("core-xy")),
        set("driver.plugin", &third_party("csv-recorder")),
        set("driver.options.file", &file),
    ];
    let machine = root().join("examples/machines/corexy.toml");
    let scenario = Scenario::text("G21 G90\nF1000\nG1 X20 Y4\nM2\n").on(&machine);
    let done = with(scenario, &settings.concat()).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let recorded = std::fs::read_to_string(&file).unwrap();
    assert!(
        recorded
            .lines()
            .last()
            .unwrap()
            .ends_with("[24.0, 16.0, 0.0]"),
        "{:?}",
        recorded.lines().last()
    );
    assert_eq!(
        done.column("x_fb_mm").last(),
        Some(&20.0),
        "feedback comes back as axes"
    );
}

#[test]
fn all_of_them_conform() {
    let folder = tempfile::tempdir().unwrap();
    let file = format!("file={}", folder.path().join("recorded.csv").display());
    for (name, settings) in [
        ("one-block", vec![]),
        ("current-limit", vec![]),
        ("csv-recorder", vec!["--set", &file]),
        ("core-xy", vec![]),
    ] {
        let library = third_party(name);
        let (status, out, err) = tandem(
            &[
                &["plugin", "check", library.to_str().unwrap()],
                &settings[..],
            ]
            .concat(),
        );
        assert_eq!(status, 0, "{out}{err}");
        assert!(
            out.contains(&format!("{name} 1.0.0, seed 1")) && out.contains("ok     determinism"),
            "{out}"
        );
        assert!(out.contains("allocation: not judged"), "{out}");
    }
}

/// An arm does not reach everywhere within 200 mm of zero: it is judged where it is said to work.
#[test]
fn an_arm_is_judged_on_its_work_area() {
    let library = built_in("tandem-scara");
    let library = library.to_str().unwrap();
    let check = |more: &[&str]| {
        let arm = [
            "plugin",
            "check",
            library,
            "--set",
            "upper_arm_mm=300",
            "--set",
            "forearm_mm=250",
            "--set",
            "shoulder_mm=[0, -350]",
        ];
        tandem(&[&arm[..], more].concat())
    };
    let (status, out, err) = check(&["--work-area=-150,150,-100,100,-50,50"]);
    assert_eq!(status, 0, "{out}{err}");
    assert!(out.contains("ok     there and back"), "{out}");
    for elsewhere in [&[][..], &["--work-area", "-150,150,100,300,-50,50"]] {
        let (status, out, _) = check(elsewhere);
        assert_eq!(status, 1, "{out}");
        assert!(out.contains("the arm does not reach that far"), "{out}");
    }
    for wrong in [
        "-150,150,-100,100,-50",
        "-150,150,100,-100,-50,50",
        "-150,150,-100,100,-50,inf",
        "-150,150,-100,100,-50,50,0",
        "",
    ] {
        let (status, _, err) = check(&[&format!("--work-area={wrong}")]);
        assert_eq!(status, 2, "{wrong}: {err}");
        assert!(err.contains("from low to high"), "{wrong}: {err}");
    }
}

#[test]
fn options_are_listed_with_meaning_and_default() {
    let library = third_party("one-block");
    let (status, out, _) = tandem(&["plugin", "list", "-v", library.to_str().unwrap()]);
    assert_eq!(status, 0);
    let contract = format!("plugin contract {}", tandem_sdk::ABI_VERSION);
    for words in [
        "planner",
        "one-block",
        "1.0.0",
        &contract,
        "buffer_blocks = 64",
        "Blocks taken ahead",
    ] {
        assert!(out.contains(words), "{words}: {out}");
    }
    let (_, out, _) = tandem(&["plugin", "list", "--verbose"]);
    for words in [
        "look-ahead",
        "junction = \"axis\"    # \"tangent\" | \"axis\"",
        "sim",
        "built in",
    ] {
        assert!(out.contains(words), "{words}: {out}");
    }
}

#[test]
fn a_driver_takes_under_50_lines_and_a_strategy_under_40() {
    for (name, most) in [("csv-recorder", 50), ("current-limit", 40)] {
        let text = std::fs::read_to_string(
            root()
                .join("tests/third-party")
                .join(name)
                .join("src/lib.rs"),
        )
        .unwrap();
        let lines = text.lines().count();
        assert!(lines < most, "{name}: {lines} lines");
    }
}

#[test]
fn they_are_locked_to_what_the_workspace_has() {
    let packages = |file: &str| -> Vec<(String, String)> {
        let lock: toml::Table = std::fs::read_to_string(root().join(file))
            .unwrap()
            .parse()
            .unwrap();
        let all = lock["package"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|package| package.get("source").is_some());
        let text = |package: &toml::Value, key: &str| package[key].as_str().unwrap().to_string();
        all.map(|package| (text(package, "name"), text(package, "version")))
            .collect()
    };
    let ours = packages("Cargo.lock");
    let missing: Vec<_> = packages("tests/third-party/Cargo.lock")
        .into_iter()
        .filter(|p| !ours.contains(p))
        .collect();
    assert!(
        missing.is_empty(),
        "cp Cargo.lock tests/third-party, then build there: {missing:?}"
    );
}
