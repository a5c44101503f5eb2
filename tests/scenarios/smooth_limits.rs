//! The planner inside the tolerance where a limit is met between the places that a window is planned at: ends of the travel,
//! speed and acceleration, memory.

use std::fmt::Write;
use std::path::PathBuf;

use crate::harness::{Done, Scenario, root};
use crate::random::Random;
use crate::replay::for_each_seed;

fn machine() -> PathBuf {
    root().join("examples/machines/mill-3axis-smooth.toml")
}

fn assert_undisturbed(done: &Done) {
    done.assert_driven("", &["governed_samples", "jerk_relaxed_samples"]);
}

#[test]
fn a_path_along_the_end_of_the_travel_does_not_leave_it() {
    let program = "G21 G90 G64\nF3000\nG0 X-240 Y0\nG1 X-250 Y10\nG1 Y30\nG1 X-240 Y40\nG2 X-240 Y20 I0 J-10\nM2\n";
    assert_undisturbed(&Scenario::text(program).on(&machine()).run());
}

/// A triangle whose first corner is an end of the travel, on a machine that is slow there.
#[test]
fn a_path_that_begins_at_the_end_of_the_travel_is_driven_once() {
    let run = |low_mm: f64| {
        let axis = |name: &str, low_mm: f64, limits: [f64; 3]| {
            let [feed, acceleration, jerk] = limits;
            format!(
                "[axes.{name}]\ntravel_mm = [{low_mm}, 700]\nmax_feed_mm_per_min = {feed}\n\
                 max_acceleration_mm_per_s2 = {acceleration}\nmax_jerk_mm_per_s3 = {jerk}\n"
            )
        };
        let machine = format!(
            "format = 1\n[motion]\npath_tolerance_mm = 0.04\n{}{}[planner]\nplugin = \"smooth\"\n[driver]\nplugin = \"sim\"\n",
            axis("x", low_mm, [2000.0, 20.0, 2000.0]),
            axis("y", -700.0, [20_000.0, 2000.0, 70_000.0])
        );
        let done = run_on(&machine, "F3218\nG1 X0.3\nY0.3\nX0 Y0\nM2\n");
        assert_undisturbed(&done);
        done
    };
    let (free, at_the_end) = (run(-100.0), run(0.0));
    let x = at_the_end.column("x_cmd_mm");
    let furthest = x.iter().position(|x| *x > 0.25).unwrap();
    assert!(
        x[..furthest].is_sorted(),
        "it goes back on its way to the first corner"
    );
    assert!(at_the_end.number("motion_time_s") < 1.1 * free.number("motion_time_s"));
}

/// Walks whose corners lie on the ends of the travel of X and Y, on a machine with no travel to spare.
#[test]
fn random_programs_along_the_ends_of_the_travel_keep_inside() {
    for_each_seed(
        "random_programs_along_the_ends_of_the_travel_keep_inside",
        40,
        |seed| {
            let mut random = Random::new(seed);
            let size = [random.between(1.0, 20.0), random.between(1.0, 20.0)]
                .map(|v| (v * 1e3).round() / 1e3);
            let tolerance = ["G64", "G64 P0.05", "G64 P0.5"][random.below(3) as usize];
            let mut program = format!(
                "G21 G90 G94 G17\n{tolerance}\nF{:.0}\n",
                random.between(300.0, 15000.0)
            );
            for _ in 0..random.below(35) + 5 {
                let at = size
                    .map(|most| [0.0, most, random.between(0.0, most)][random.below(3) as usize]);
                writeln!(
                    program,
                    "G1 X{:.3} Y{:.3}",
                    at[0].min(size[0]),
                    at[1].min(size[1])
                )
                .unwrap();
            }
            program.push_str("M2\n");
            let travel = |axis: &str, most: f64| format!("axes.{axis}.travel_mm=[0, {most}]");
            let travels = [travel("x", size[0]), travel("y", size[1])];
            let scenario = Scenario::text(&program).on(&machine());
            let done = scenario
                .with(&["--set", &travels[0], "--set", &travels[1]])
                .run();
            if done.status() == 0 {
                Ok(())
            } else {
                Err(done.errors())
            }
        },
    );
}

/// A machine whose three axes are alike.
fn alike(
    periods_ms: [f64; 2],
    tolerance_mm: f64,
    feed_ratio: f64,
    limits: [f64; 3],
    rest: &str,
) -> String {
    let [rough, fine] = periods_ms;
    let mut text = format!(
        "format = 1\n[loops]\nrough_period_ms = {rough}\nfine_period_ms = {fine}\n[motion]\npath_tolerance_mm = \
         {tolerance_mm}\nmax_feed_ratio = {feed_ratio}\nallowable_speed_difference_mm_per_min = 0\n"
    );
    for axis in ["x", "y", "z"] {
        let [feed, acceleration, jerk] = limits;
        write!(
            text,
            "[axes.{axis}]\ntravel_mm = [-200, 200]\nmax_feed_mm_per_min = {feed}\nmax_acceleration_mm_per_s2 = \
             {acceleration}\nmax_jerk_mm_per_s3 = {jerk}\n"
        )
        .unwrap();
    }
    text + rest + "[planner]\nplugin = \"smooth\"\n[driver]\nplugin = \"sim\"\n"
}

fn run_on(machine: &str, program: &str) -> Done {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    std::fs::write(&path, machine).unwrap();
    Scenario::text(program).on(&path).run()
}

/// What is largest between two places looked at: the speed of an axis on an arc, and acceleration on a slow machine.
#[test]
fn peaks_between_the_knots_of_a_window_are_within_limits() {
    let fast = alike(
        [16.0, 1.0],
        0.01,
        1.2,
        [
            1_676.209_650_858_652_1,
            6_113.433_532_641_78,
            977_967.371_561_811_5,
        ],
        "",
    );
    let arcs = "F591.138\nG1 X-0.1710 Y2.3988 Z0.0000\nF1760.137\nG1 X35.1016 Y8.4035 Z5.5238\n\
                G3 X34.9632 Y8.4947 Z5.5238 I0.1119 J0.3205\nG2 X37.7967 Y4.7399 Z5.5238 I-1.3789 J-3.9871\n";
    assert_undisturbed(&run_on(&fast, &format!("{arcs}M2\n")));
    let slow = alike(
        [16.0, 2.0],
        0.001,
        1.0,
        [
            894.958_547_590_573_6,
            98.301_957_509_343_3,
            18_641.077_385_451_645,
        ],
        "",
    );
    assert_undisturbed(&run_on(
        &slow,
        "F637.980\nG1 X-6.0065 Y0.1601 Z11.6270\nG1 X-6.1569 Y-0.1044 Z11.6270\nM2\n",
    ));
}
