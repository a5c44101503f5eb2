//! Feeds block by block, and what is not judged at all.

use crate::common;

use common::{
    Profile, assert_finds, assert_passes, at, polyline, smooth_machine, stop_at_all, trace, verdict,
};
use tandem_oracle::{Check, Kind, Machine, Options, Outcome, Position, judge};

fn xy(points: &[(f64, f64)]) -> Vec<Position> {
    points.iter().map(|&(x, y)| at(x, y, 0.0)).collect()
}

fn run(points: &[(f64, f64)]) -> Vec<Position> {
    stop_at_all(&xy(points), 50.0, 990.0)
}

#[test]
fn each_block_keeps_its_own_feed() {
    let samples = |first: f64, second: f64| {
        let mut samples = stop_at_all(&xy(&[(0.0, 0.0), (20.0, 0.0)]), first, 990.0);
        samples.extend(stop_at_all(&xy(&[(20.0, 0.0), (40.0, 0.0)]), second, 990.0));
        samples
    };
    let program = "F3000\nG1 X20\nF1200 X40\n";
    assert_passes(&verdict(&samples(50.0, 20.0), program));
    assert_finds(&verdict(&samples(50.0, 20.2), program), &[Kind::Feed]);
    assert_finds(&verdict(&samples(50.0, 50.0), program), &[Kind::Feed]);
    // The same line back and forth at two feeds: which leg a sample is on matters.
    let there_and_back = |out: f64, back: f64| {
        let mut samples = stop_at_all(&xy(&[(0.0, 0.0), (20.0, 0.0)]), out, 990.0);
        samples.extend(stop_at_all(&xy(&[(20.0, 0.0), (0.0, 0.0)]), back, 990.0));
        samples
    };
    let program = "F1200\nG1 X20\nF3000 X0\n";
    assert_passes(&verdict(&there_and_back(20.0, 50.0), program));
    assert_finds(
        &verdict(&there_and_back(50.0, 50.0), program),
        &[Kind::Feed],
    );
    assert_finds(
        &verdict(&there_and_back(20.0, 50.5), program),
        &[Kind::Feed],
    );
}

#[test]
fn passing_a_junction_too_fast_by_a_sample_is_found() {
    // 50 mm/s up to 0.3 mm beyond the junction, then braking: 6 samples and the ramp are too fast.
    let profile = Profile::default()
        .then(0.0, 50.0, 20.0, 20.3, 990.0)
        .then(20.0, 20.0, 0.0, 19.7, 990.0);
    let samples = profile.samples(polyline(xy(&[(0.0, 0.0), (40.0, 0.0)])));
    let found = verdict(&samples, "F3000\nG1 X20\nF1200 X40\n");
    assert_finds(&found, &[Kind::Feed]);
    let profile = Profile::default()
        .then(0.0, 50.0, 20.0, 20.0, 990.0)
        .then(20.0, 20.0, 0.0, 20.0, 990.0);
    let samples = profile.samples(polyline(xy(&[(0.0, 0.0), (40.0, 0.0)])));
    assert_passes(&verdict(&samples, "F3000\nG1 X20\nF1200 X40\n"));
}

#[test]
fn inverse_time_gives_a_duration() {
    let samples = run(&[(0.0, 0.0), (20.0, 0.0)]);
    // 20 mm in 0.4 s are 50 mm/s.
    assert_passes(&verdict(&samples, "G93 G1 X20 F150\n"));
    assert_finds(&verdict(&samples, "G93 G1 X20 F149\n"), &[Kind::Feed]);
    let missing = verdict(
        &run(&[(0.0, 0.0), (20.0, 0.0), (30.0, 0.0)]),
        "G93 G1 X20 F150\nX30\n",
    );
    assert!(
        matches!(&missing.outcome, Outcome::NotJudged { reason } if reason.contains("line 2")),
        "{missing}"
    );
}

#[test]
fn a_feed_hold_on_the_path_passes() {
    let path = || polyline(xy(&[(0.0, 0.0), (20.0, 0.0), (20.0, 15.0)]));
    let held = Profile::default()
        .then(0.0, 50.0, 0.0, 7.0, 990.0)
        .samples(path());
    let rest = Profile::default()
        .then(0.0, 50.0, 0.0, 13.0, 990.0)
        .then(0.0, 50.0, 0.0, 15.0, 990.0);
    let rest = rest.samples(|length| path()(7.0 + length));
    let samples = [held, rest].concat();
    let options = Options {
        sample_tolerance_mm: Some(2e-6),
        ..Options::default()
    };
    assert_passes(&judge(
        &trace(&samples),
        "F3000\nG1 X20\nY15\n",
        &smooth_machine(),
        &options,
    ));
}

#[test]
fn a_trace_in_other_units_than_the_machine_is_not_judged() {
    let mut other = trace(&run(&[(0.0, 0.0), (20.0, 0.0)]));
    other.degrees.clear();
    let found = judge(
        &other,
        "G1 X20 F3000",
        &smooth_machine(),
        &Options::default(),
    );
    assert_eq!(
        found.outcome,
        Outcome::NotJudged {
            reason: "the trace has axis A in mm".into()
        }
    );
}

#[test]
fn nothing_asked_is_nothing_judged() {
    let samples = run(&[(0.0, 0.0), (20.0, 0.0)]);
    let found = judge(
        &trace(&samples),
        "G1 X20 F3000",
        &smooth_machine(),
        &Options::only(&[]),
    );
    assert!(
        matches!(found.outcome, Outcome::NotJudged { .. }),
        "{found}"
    );
    let found = judge(
        &trace(&samples),
        "",
        &smooth_machine(),
        &Options::only(&[Check::Travel]),
    );
    assert_passes(&found);
}

#[test]
fn the_options_of_a_machine_are_those_of_its_planner() {
    let text = common::MACHINE.replace("[planner]\nplugin = \"look-ahead\"\n", "");
    let unnamed = Machine::from_toml(&text, "machine.toml").expect("the machine reads");
    for machine in [unnamed, common::machine()] {
        let options = Options::for_machine(&machine);
        assert_eq!(options.speed_difference_mm_per_s, Some(100.0 / 60.0));
        assert_eq!(options.speed_difference_deg_per_s, Some(100.0 / 60.0));
    }
    let options = Options::for_machine(&smooth_machine());
    assert_eq!(
        (
            options.speed_difference_mm_per_s,
            options.speed_difference_deg_per_s
        ),
        (Some(0.0), Some(0.0))
    );
}
