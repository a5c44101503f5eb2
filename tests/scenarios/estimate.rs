//! `tandem estimate` and `tandem calibrate`: the table, the list, the page, the experiment, and the refusals.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::harness::{Scenario, mill, root};

/// The published overlap machine.
const OVERLAP: [&str; 10] = [
    "--set",
    "planner.plugin=block-overlap",
    "--set",
    "planner.options.corner_control=off",
    "--set",
    "planner.options.limits=off",
    "--set",
    "guard.mode=count",
    "--set",
    "motion.time_constant_ms=30",
];

fn tandem(command: &str, arguments: &[&str]) -> Output {
    let machine = mill();
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .arg(command)
        .args(arguments)
        .args(["--machine".as_ref(), machine.as_os_str()])
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn example(name: &str) -> String {
    root()
        .join(format!("examples/programs/{name}.ngc"))
        .display()
        .to_string()
}

fn estimates(arguments: &[&str]) -> Vec<Value> {
    let output = tandem("estimate", &[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key} of {value}"))
}

#[test]
fn the_simulation_says_what_the_run_takes_to_the_tick() {
    let programs = ["raster", "serpentine", "square"].map(example);
    let list = estimates(&programs.each_ref().map(String::as_str));
    for (program, estimate) in programs.iter().zip(&list) {
        let run = Scenario::of(Path::new(program)).run();
        assert_eq!(estimate["program"], program.as_str());
        assert_eq!(number(estimate, "estimated_s"), run.number("motion_time_s"));
        assert_eq!(number(estimate, "blocks"), run.number("blocks"));
        assert!((number(estimate, "nominal_s") - run.number("nominal_time_s")).abs() < 1e-9);
        let parts: f64 = ["rapid_s", "cutting_s", "dwell_s"]
            .iter()
            .map(|key| number(estimate, key))
            .sum();
        assert!((parts / number(estimate, "estimated_s") - 1.0).abs() < 0.02);
        let cases: u64 = ["1", "2", "3", "4"]
            .iter()
            .map(|case| estimate["cases"][case].as_u64().unwrap())
            .sum();
        assert_eq!(
            cases,
            estimate["cases"]["long"].as_u64().unwrap()
                + estimate["cases"]["short"].as_u64().unwrap()
        );
        assert!(
            (number(&estimate["shares"], "rapid") + number(&estimate["shares"], "cutting") - 1.0)
                .abs()
                < 1e-9
        );
    }
}

#[test]
fn every_model_has_a_table_and_a_page_that_fetches_nothing() {
    let folder = tempfile::TempDir::new().unwrap();
    let page = folder.path().join("page.html");
    for model in ["simulate", "look-ahead", "overlap", "regression"] {
        let page = page.display().to_string();
        let arguments = [
            &*example("square"),
            &*example("serpentine"),
            "--model",
            model,
            "--report",
            &page,
        ];
        let output = tandem("estimate", &arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(
            output.stderr.is_empty(),
            "quiet in a pipe: {}",
            text(&output.stderr)
        );
        let table = text(&output.stdout);
        assert_eq!(table.lines().count(), 4, "{table}");
        assert!(table.lines().nth(1).unwrap().contains(model), "{table}");
        let html = std::fs::read_to_string(&page).unwrap();
        assert_eq!(html.matches("<svg").count(), 2);
        assert!(
            html.contains("<rect") && !html.contains("http:") && !html.contains("https:"),
            "{model}"
        );
    }
}

#[test]
fn tools_and_lines_have_their_shares() {
    let folder = tempfile::TempDir::new().unwrap();
    let program = folder.path().join("tools.ngc");
    std::fs::write(
        &program,
        "G21 F600\nT1 M6\nG1 X10\nT2 M6\nG1 X40\nG4 P1\nM2\n",
    )
    .unwrap();
    let list = estimates(&[&program.display().to_string(), "--model", "look-ahead"]);
    let tools = list[0]["shares"]["tools"].as_array().unwrap();
    let share = |tool: u64| {
        number(
            tools.iter().find(|t| t["tool"] == tool).unwrap(),
            "nominal_s",
        )
    };
    assert!(
        (share(1) - 1.0).abs() < 1e-9 && (share(2) - 4.0).abs() < 1e-9,
        "{tools:?}"
    );
    let lines = list[0]["shares"]["lines"].as_array().unwrap();
    let sum: f64 = lines.iter().map(|range| number(range, "share")).sum();
    assert!((sum - 1.0).abs() < 1e-9);
    assert_eq!(number(&list[0], "dwell_s"), 1.0);
}

#[test]
fn what_is_wrong_is_refused_with_its_place() {
    let folder = tempfile::TempDir::new().unwrap();
    let file = |name: &str, content: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        path.display().to_string()
    };
    let (bad, good) = (
        file("bad.ngc", "G21 F600\nG1 X10 Q\nM2\n"),
        example("square"),
    );
    let output = tandem("estimate", &[&bad, &good, "--model", "look-ahead"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains("bad.ngc:2:"),
        "{}",
        text(&output.stderr)
    );
    assert!(
        text(&output.stdout).contains("square.ngc"),
        "the other one is estimated all the same"
    );

    let model = file(
        "m.toml",
        "format = 1\nmodel = \"overlap\"\n[overlap]\ntime_constant_s = 3.0\n",
    );
    let output = tandem("estimate", &[&good, "--model", &model]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains("m.toml:4:1: unknown field `time_constant_s`"),
        "{}",
        text(&output.stderr)
    );

    let output = tandem("estimate", &[&good, "--model", "guess"]);
    assert!(text(&output.stderr).contains("no model is called guess"));

    let times = file(
        "t.csv",
        "n,side_mm,repetitions,seconds\n3,0.1,3400,304\n4,0.1,2500,-1\n",
    );
    let output = tandem("calibrate", &["--from", &times, "--out", "/dev/null"]);
    assert!(
        text(&output.stderr).contains("t.csv:3: seconds: -1 is not above zero"),
        "{}",
        text(&output.stderr)
    );
}

/// Calibrates and gives what was printed and the model file.
fn calibrated(folder: &Path, arguments: &[&str]) -> (Output, String) {
    let model = folder.join("model.toml").display().to_string();
    (
        tandem("calibrate", &[arguments, &["--out", &model]].concat()),
        model,
    )
}

#[test]
fn a_calibrated_look_ahead_machine_is_estimated_within_two_tenths_of_a_percent() {
    let folder = tempfile::TempDir::new().unwrap();
    let (output, model) = calibrated(folder.path(), &[]);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(
        said.contains("this is a look-ahead control") && said.contains("residuals of look-ahead"),
        "{said}"
    );
    for program in ["raster", "serpentine", "spiral"].map(example) {
        let (form, run) = (
            estimates(&[&program, "--model", &model]),
            estimates(&[&program]),
        );
        let off = number(&form[0], "estimated_s") / number(&run[0], "estimated_s") - 1.0;
        assert!(off.abs() < 2e-3, "{program}: {off:+.5}");
    }
}

#[test]
fn the_linear_regression_refuses_a_look_ahead_machine() {
    let folder = tempfile::TempDir::new().unwrap();
    let (output, model) = calibrated(folder.path(), &["--model", "regression"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said.contains("the linear regression does not describe this machine"),
        "{said}"
    );
    assert!(
        said.contains("a look-ahead control") && said.contains("R2 = 0."),
        "{said}"
    );
    assert!(!Path::new(&model).exists(), "no model is written");
}

#[test]
fn a_calibrated_overlap_machine_is_estimated_by_both_forms() {
    let folder = tempfile::TempDir::new().unwrap();
    let programs = ["raster", "serpentine", "spiral", "square"].map(example);
    let programs: Vec<&str> = programs.iter().map(String::as_str).collect();
    let run = estimates(&[&programs[..], &OVERLAP[..]].concat());
    for (form, most) in [("overlap", 0.01), ("regression", 0.05)] {
        let (output, model) =
            calibrated(folder.path(), &[&["--model", form], &OVERLAP[..]].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(
            text(&output.stdout).contains("this is an overlap control"),
            "{}",
            text(&output.stdout)
        );
        let list = estimates(&[&programs[..], &["--model", &*model], &OVERLAP[..]].concat());
        for (estimate, run) in list.iter().zip(&run) {
            let off = number(estimate, "estimated_s") / number(run, "estimated_s") - 1.0;
            assert!(off.abs() < most, "{form} on {}: {off:+.5}", run["program"]);
        }
    }
}

#[test]
fn the_experiment_as_a_program_is_a_program() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("experiment.ngc").display().to_string();
    let output = tandem("calibrate", &["--program", &path]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let checked = tandem("check", &[&path]);
    assert!(checked.status.success(), "{}", text(&checked.stderr));
    let program = std::fs::read_to_string(&path).unwrap();
    assert_eq!(
        program.matches("M0").count(),
        program.matches("note the seconds").count()
    );
    assert!(program.contains("n 3 side 0.1 repetitions 667"));
}

#[test]
fn axes_that_are_not_alike_are_calibrated_each_by_itself() {
    let unequal = [
        "--set",
        "axes.x.max_acceleration_mm_per_s2=300",
        "--set",
        "axes.y.max_acceleration_mm_per_s2=900",
        "--set",
        "axes.z.max_acceleration_mm_per_s2=500",
    ];
    let folder = tempfile::TempDir::new().unwrap();
    let (output, model) = calibrated(folder.path(), &unequal);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}{}", text(&output.stderr));
    assert!(said.contains("along X and"), "{said}");
    for program in ["raster", "serpentine", "spiral"].map(example) {
        let with =
            |model: &str| estimates(&[&[&*program, "--model", model], &unequal[..]].concat());
        let [estimate, run] =
            [&*model, "simulate"].map(|model| number(&with(model)[0], "estimated_s"));
        assert!(
            (estimate / run - 1.0).abs() < 0.01,
            "{program}: {estimate} of {run}"
        );
    }
}

#[test]
fn a_fit_that_is_worse_than_asked_for_is_taken_knowingly() {
    // Block-overlap that keeps tolerance and limits is no look-ahead control.
    let set = [
        "--set",
        "planner.plugin=block-overlap",
        "--model",
        "look-ahead",
    ];
    let folder = tempfile::TempDir::new().unwrap();
    let (refused, model) = calibrated(folder.path(), &set);
    assert_eq!(refused.status.code(), Some(1));
    let said = text(&refused.stderr);
    assert!(said.contains("--accept takes the fit as it is"), "{said}");
    assert!(!Path::new(&model).exists());
    let (accepted, model) = calibrated(folder.path(), &[&set[..], &["--accept"]].concat());
    assert!(accepted.status.success(), "{}", text(&accepted.stderr));
    let said = text(&accepted.stderr);
    assert!(
        said.contains("accepted: ") && said.contains("% (rms)"),
        "{said}"
    );
    let written = std::fs::read_to_string(&model).unwrap();
    assert!(written.contains(" %, accepted\""), "{written}");
    let estimate = estimates(&[&example("square"), "--model", &model]);
    assert!(number(&estimate[0], "estimated_s") > 0.0);
}

#[test]
fn estimates_stand_beside_what_was_measured() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("measured.csv");
    let written = |rows: &str| std::fs::write(&path, rows).unwrap();
    written(
        "program,seconds,reading_error_s\nraster.ngc,28.1,0.2\nserpentine.ngc,4.2,0.1\nsquare.ngc,1.287,0\n",
    );
    let programs = ["raster", "serpentine", "square"].map(example);
    let measured = path.to_str().unwrap();
    let mut arguments: Vec<&str> = programs.iter().map(String::as_str).collect();
    arguments.extend(["--model", "look-ahead", "--measured", measured]);
    let output = tandem("estimate", &arguments);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{said}");
    let row = |name: &str| {
        let rows = said
            .lines()
            .skip_while(|line| !line.contains("measured, s"));
        rows.filter(|line| line.contains(name)).collect::<String>()
    };
    assert!(row("raster").ends_with("within the reading"), "{said}");
    assert!(!row("serpentine").contains("within"), "{said}");
    assert!(
        said.contains("shorter blocks: ") && said.contains("ms for each block"),
        "{said}"
    );
    written("program,seconds\nraster.ngc,0\n");
    let refused = text(&tandem("estimate", &arguments).stderr);
    assert!(
        refused.contains("measured.csv:2: seconds: 0 is not above zero"),
        "{refused}"
    );
}
