//! The tie: the published forms against the planners, on the zig-zag over a surface.

use std::fmt::Write as _;

use serde_json::Value;
use tandem_estimate::{
    Choice, Coefficients, Constants, Element, LookAhead, Overlap, Regression, Rule, Switch,
    estimate, total_s,
};
use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Run, Switches};
use tandem_machine::Machine;

use crate::common::{array, assert_near, case, elements, error, limits, number, zigzag};

const A: f64 = 1_200_000.0 / 3600.0;

/// Rows of the case, with the blocks at their feed.
fn rows(machine: &Value) -> Vec<(&Value, Vec<Element>)> {
    let rows = machine["rows"].as_array().unwrap().iter();
    let points = zigzag();
    rows.map(|row| (row, elements(&points, number(&row["F"]), &limits(A))))
        .collect()
}

fn total(mut model: impl tandem_estimate::Model, elements: &[Element]) -> f64 {
    total_s(&mut model, elements.iter().copied())
}

#[test]
fn the_program_is_that_of_the_case() {
    let (file, elements) = (case("tie_zigzag"), elements(&zigzag(), 1000.0, &limits(A)));
    assert_eq!(elements.len() as u64, file["n_blocks"].as_u64().unwrap());
    let length: f64 = elements.iter().map(|e| e.length_mm).sum();
    assert_near(length, number(&file["length_mm"]), 1e-6, "length");
}

#[test]
fn overlap_machines_as_predicted() {
    let file = case("tie_zigzag");
    for (name, tau_s) in [("M1 overlap tau=30", 0.03), ("M1 overlap tau=50", 0.05)] {
        let machine = &file["machines"][name];
        let calibrated = Coefficients {
            short: array(&machine["cal"]["p9"]),
            long: array(&machine["cal"]["p11"]),
            switch: Switch::Fixed(0.5),
            acceleration_mm_per_s2: A,
            ramp_s: None,
            rapid_acceleration_mm_per_s2: None,
        };
        for (row, elements) in rows(machine) {
            let [true_s, printed, refit, moving, plain] =
                ["T", "printed", "refit", "refit_sw", "overlap"].map(|key| number(&row[key]));
            let near =
                |actual, expected, what: &str| assert_near(actual, expected, 1e-6 * expected, what);
            near(
                total(Regression::new(Coefficients::default()), &elements),
                printed,
                "printed",
            );
            near(
                total(Regression::new(calibrated.clone()), &elements),
                refit,
                "refitted",
            );
            let measured_s = number(&machine["cal"]["tau_ms"]) / 1e3;
            let switch = Coefficients {
                switch: Switch::Moving(measured_s),
                ..calibrated.clone()
            };
            let paper_s = total(Regression::new(switch), &elements);
            near(paper_s, moving, "moving switch");
            assert!((paper_s / true_s - 1.0).abs() < 0.05);
            let overlap = |time_constant_s, tick_s| {
                let constants = Constants {
                    time_constant_s,
                    obeys_program: true,
                    tick_s,
                    rapid_acceleration_mm_per_s2: None,
                };
                total(Overlap::new(constants), &elements)
            };
            near(overlap(measured_s, None), plain, "overlap");
            assert!((plain / true_s - 1.0).abs() < 0.01);
            assert_near(
                overlap(tau_s, Some(0.001)),
                true_s,
                1e-6,
                "overlap in ticks",
            );
        }
    }
}

#[test]
fn the_look_ahead_machine_as_predicted() {
    let file = case("tie_zigzag");
    let machine = &file["machines"]["M2 look-ahead A=333,Ts=1ms"];
    let rule = Rule::Tangent {
        acceleration_mm_per_s2: None,
        period_s: 1e-3,
        speed_difference_mm_per_s: 100.0 / 60.0,
    };
    for (row, elements) in rows(machine) {
        let true_s = number(&row["T"]);
        assert_near(
            total(LookAhead::new(rule.clone(), None), &elements),
            true_s,
            1e-6,
            "junction feeds",
        );
    }
}

/// The zig-zag, and the same in blocks of 1.2 mm in the mean, as coarse as those of the case, on the overlap machine of
/// 30 ms: the closed forms against its time in whole ticks.
#[test]
fn coarser_programs_stay_within_the_spread_of_the_case() {
    let (spread, file) = (case("tie_spread"), case("tie_zigzag"));
    let calibration = &file["machines"]["M1 overlap tau=30"]["cal"];
    let regression = |switch| Coefficients {
        short: array(&calibration["p9"]),
        long: array(&calibration["p11"]),
        switch,
        acceleration_mm_per_s2: A,
        ramp_s: None,
        rapid_acceleration_mm_per_s2: None,
    };
    let overlap = |tick_s| Constants {
        time_constant_s: 0.03,
        obeys_program: true,
        tick_s,
        rapid_acceleration_mm_per_s2: None,
    };
    let mut fixed_worst = 0.0_f64;
    for every in [1, 2] {
        let points: Vec<_> = zigzag().into_iter().step_by(every).collect();
        for (index, feed) in [1000.0, 2000.0, 3000.0, 5000.0].into_iter().enumerate() {
            let elements = elements(&points, feed, &limits(A));
            let true_s = total(Overlap::new(overlap(Some(0.001))), &elements);
            let off = |time_s: f64| time_s / true_s - 1.0;
            let fixed = off(total(
                Regression::new(regression(Switch::Fixed(0.5))),
                &elements,
            ));
            let moving = off(total(
                Regression::new(regression(Switch::Moving(0.03))),
                &elements,
            ));
            let plain = off(total(Overlap::new(overlap(None)), &elements));
            println!(
                "every {every} at {feed}: fixed {fixed:+.4}, moving {moving:+.4}, overlap {plain:+.4}"
            );
            assert!(
                moving.abs() < 0.05 && plain.abs() < 0.01,
                "every {every} at {feed}: {moving}, {plain}"
            );
            if every == 1 {
                assert_near(
                    moving,
                    number(&spread["d_a_choice"][index]["own"]),
                    1e-6,
                    "own half length",
                );
            }
            fixed_worst = fixed_worst.max(fixed.abs());
        }
    }
    let worst = number(&spread["worst"]["switch"]);
    assert!(
        fixed_worst > 2.0 * worst,
        "the fixed switch fails on coarse programs, by {fixed_worst}"
    );
}

pub const LOOK_AHEAD: &[(&str, &str)] = &[];
pub const TANGENT: &[(&str, &str)] = &[
    ("planner.options.junction", "tangent"),
    ("guard.mode", "count"),
];
pub const OVERLAP: &[(&str, &str)] = &[
    ("planner.plugin", "block-overlap"),
    ("planner.options.corner_control", "off"),
    ("planner.options.limits", "off"),
    ("guard.mode", "count"),
    ("motion.time_constant_ms", "30"),
];

pub fn mill(overrides: &[(&str, &str)]) -> Machine {
    let path = format!(
        "{}/../../examples/machines/mill-3axis.toml",
        env!("CARGO_MANIFEST_DIR")
    );
    let owned: Vec<_> = overrides
        .iter()
        .map(|(key, value)| ((*key).to_string(), (*value).to_string()))
        .collect();
    Machine::read(path.as_ref(), &owned).unwrap()
}

pub fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.register(tandem_look_ahead::PLUGIN).unwrap();
    registry.register(tandem_block_overlap::PLUGIN).unwrap();
    registry.register(tandem_sim::PLUGIN).unwrap();
    registry
}

/// A tenth of the zig-zag, a square with long sides, an arc, a rapid and a dwell.
fn program(feed: f64) -> String {
    let mut text = format!("G21 G90 G64\nG0 X0 Y0 Z3.3879\nF{feed}\n");
    for point in &zigzag()[..600] {
        let _ = writeln!(text, "G1 X{} Y{} Z{}", point[0], point[1], point[2]);
    }
    text + "G0 Z20\nX0 Y0\nG1 X20\nY20\nX0\nY0\nG4 P0.25\nX10.7\nG3 X10.7 Y20 J10\nG1 X0\nM2\n"
}

fn opened(text: &str) -> Program {
    Program::spool("test", text.as_bytes()).unwrap()
}

#[test]
fn the_simulation_is_the_run_to_the_tick() {
    for overrides in [LOOK_AHEAD, OVERLAP] {
        let (machine, text) = (mill(overrides), program(3000.0));
        let run = Run::prepare(
            machine.clone(),
            &registry(),
            opened(&text),
            Switches::default(),
        )
        .unwrap();
        let summary = run.drive(Clock::Virtual, &[], &mut ()).unwrap().summary;
        let estimate = estimate(
            &machine,
            &registry(),
            opened(&text),
            Switches::default(),
            &Choice::Simulate,
        )
        .unwrap();
        assert_eq!(estimate.estimated_s, summary.motion_time_s);
        // The planner's times are those before every rest waits for its tick.
        assert_near(
            estimate.tally.all.time_s,
            summary.motion_time_s,
            0.05,
            "the planner's own times",
        );
        assert_near(
            estimate.tally.all.nominal_s,
            summary.nominal_time_s,
            1e-9,
            "nominal",
        );
        assert_eq!(estimate.tally.all.blocks, summary.blocks);
    }
}

#[test]
fn the_closed_forms_follow_the_planners_of_this_workspace() {
    for (overrides, name, most) in [
        (LOOK_AHEAD, "look-ahead", 2e-3),
        (TANGENT, "look-ahead", 2e-3),
        (OVERLAP, "overlap", 1e-2),
    ] {
        for feed in [1000.0, 3000.0, 5000.0] {
            let (machine, text) = (mill(overrides), program(feed));
            let time = |choice: &Choice| {
                estimate(
                    &machine,
                    &registry(),
                    opened(&text),
                    Switches::default(),
                    choice,
                )
                .unwrap()
            };
            let (form, run) = (
                time(&Choice::named(name, &machine).unwrap()),
                time(&Choice::Simulate),
            );
            let off = error(&form, run.estimated_s);
            println!(
                "{name} {overrides:?} F{feed}: {} s, {off:+.5}",
                run.estimated_s
            );
            assert!(
                off.abs() < most,
                "{name} at {feed}: {} instead of {}",
                form.estimated_s,
                run.estimated_s
            );
        }
    }
}
