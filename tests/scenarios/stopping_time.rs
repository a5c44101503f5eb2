//! How long a hold takes, against the shortest time that the limits allow, found without the governor.

use std::fmt::Write;

use crate::bench::{Bench, Ran};
use crate::optimal_stop::OptimalStop;
use crate::plan::Plan;
use crate::replay::some_of;

const PERIOD_S: f64 = 1e-3;
const ACCELERATION: [f64; 3] = [1000.0; 3];

/// Periods from the hold to the standstill: the first sample of the hold to the first that does not move.
fn stopping_periods(ran: &Ran, tick: usize) -> usize {
    ran.samples[tick..]
        .iter()
        .position(|sample| sample.feed_mm_per_s == 0.0)
        .unwrap()
}

/// The program time of each sample of an undisturbed run, s.
fn times_s(plan: &Plan, free: &Ran) -> Vec<f64> {
    let mut path_mm = 0.0;
    let place = |sample: &tandem_rings::Sample| {
        path_mm += sample.feed_mm_per_s * PERIOD_S;
        plan.time_s(path_mm)
    };
    free.samples.iter().map(place).collect()
}

/// The greatest stopping time in units of the shortest possible, over holds at every `step`-th tick of those stops that
/// take long enough for whole periods not to matter. Shorter ones may take `most` times the shortest, and three periods:
/// the rate is linear over a period, and slow motion that speeds up at the limit cannot be turned within one.
fn worst(name: &str, text: &str, step: usize, most: f64) -> f64 {
    let bench = Bench::text(text);
    let free = bench.run("");
    free.expect_clean().unwrap();
    let plan = Plan::new(&free.segments);
    let optimal = OptimalStop::of(&plan, &ACCELERATION, PERIOD_S);
    let times_s = times_s(&plan, &free);
    let (mut worst, mut runs): ((f64, usize), u32) = ((0.0, 0), 0);
    for tick in some_of(3, name, (1..free.samples.len() - 1).step_by(step)) {
        let ran = bench.run(&format!("{tick},hold\n{},resume", tick + 500));
        ran.expect_clean().unwrap();
        let (taken, best) = (
            stopping_periods(&ran, tick) as f64,
            optimal.time_s(times_s[tick - 1]) / PERIOD_S,
        );
        assert!(
            taken <= most * best + 3.0,
            "{name}, hold at {tick}: {taken} periods, {best} would do"
        );
        if best >= LONG_PERIODS {
            runs += 1;
            worst = if taken / best > worst.0 {
                (taken / best, tick)
            } else {
                worst
            };
        }
    }
    assert!(runs > 6, "{runs} stops of {LONG_PERIODS} periods or more");
    println!(
        "{name}: worst of {runs} stops of {LONG_PERIODS} periods or more: {:.4} x the optimum, at tick {}",
        worst.0, worst.1
    );
    worst.0
}

/// Stops that take at least so long are compared without any allowance for whole periods.
const LONG_PERIODS: f64 = 20.0;

fn circle() -> String {
    "G21 G90 G17 G64\nF4000\nG1 X10\nG3 X10 Y0 I0 J12\nG1 X0\nM2\n".to_string()
}

/// Half circles that grow, drawn out to ovals by lines between them, and climb.
fn spiral() -> String {
    let mut text = String::from("G21 G90 G17 G64\nF5000\nG1 X0 Y-2\n");
    let mut low = -2.0;
    for turn in 0..5 {
        let radius = 2.0 + 1.5 * f64::from(turn);
        let high = low + 2.0 * radius;
        writeln!(
            text,
            "G1 X12\nG3 X12 Y{high} Z{:.2} I0 J{radius}",
            0.3 * f64::from(turn)
        )
        .unwrap();
        low = high - 2.0 * radius - 1.5;
        writeln!(text, "G1 X0\nG3 X0 Y{low} I0 J{}", (low - high) / 2.0).unwrap();
    }
    text + "M2\n"
}

/// An ellipse that grows, 60 mm by 25 mm in the end, in chords of about half a millimetre.
fn chords() -> String {
    let mut text = String::from("G21 G90 G17 G64\nF5000\n");
    for step in 0..700 {
        let angle = f64::from(step) * 0.018;
        let size = 0.5 + 0.5 * f64::from(step) / 700.0;
        writeln!(
            text,
            "G1 X{:.4} Y{:.4}",
            30.0 * size * angle.cos(),
            12.5 * size * angle.sin()
        )
        .unwrap();
    }
    text + "M2\n"
}

/// Chords of 1 mm whose direction swings, with a corner every eleven of them.
fn corners() -> String {
    let mut text = String::from("G21 G90 G17 G64\nF6000\n");
    let (mut x, mut y, mut angle) = (0.0f64, 0.0f64, 0.0f64);
    for step in 0..260 {
        angle += if step % 11 == 10 {
            0.9
        } else {
            0.03 * f64::from(step % 5 - 2)
        };
        (x, y) = (x + 4.0 * angle.cos(), y + 4.0 * angle.sin());
        writeln!(text, "G1 X{x:.4} Y{y:.4}").unwrap();
    }
    text + "M2\n"
}

#[test]
fn on_a_line_a_hold_takes_v_over_a_within_a_period() {
    for feed_mm_per_min in [600.0, 3000.0, 5000.0, 9000.0, 15000.0f64] {
        let bench = Bench::text(&format!("G21 G90\nF{feed_mm_per_min}\nG1 X200\nM2\n"));
        let speed_mm_per_s = feed_mm_per_min / 60.0;
        let tick = (speed_mm_per_s as usize).max(50) + 200;
        let ran = bench.run(&format!("{tick},hold\n{},resume", tick + 500));
        assert!((ran.samples[tick - 1].feed_mm_per_s - speed_mm_per_s).abs() < 1e-9);
        let (taken, ideal) = (
            stopping_periods(&ran, tick) as f64,
            speed_mm_per_s / 1000.0 / PERIOD_S,
        );
        assert!(
            (taken - ideal).abs() <= 1.0,
            "{feed_mm_per_min} mm/min: {taken} periods instead of {ideal}"
        );
        // The search finds the same without a governor.
        let plan = Plan::new(&ran.segments);
        let optimal = OptimalStop::of(&plan, &ACCELERATION, PERIOD_S);
        let found = optimal.time_s(plan.end_s() / 2.0) / PERIOD_S;
        assert!(
            (found - ideal).abs() <= 0.01 * ideal,
            "{feed_mm_per_min} mm/min: found {found} for {ideal}"
        );
    }
}

#[test]
fn on_curves_a_hold_takes_little_more_than_the_optimum() {
    for (name, text, step) in [
        ("circle", circle(), 7),
        ("spiral", spiral(), 7),
        ("corners", corners(), 37),
    ] {
        assert!(worst(name, &text, step, 1.1) <= 1.1);
    }
}

/// In chords that take some ten periods the plan takes back the steps of the junctions: it alternates between speeding
/// up and braking at the limit within a few periods. The search slows down in every stretch that speeds up; the
/// governor's rate is linear over a period, and a period that holds any of the braking leaves it nothing.
#[test]
fn in_short_chords_a_hold_takes_longer() {
    assert!(worst("chords", &chords(), 31, 1.3) <= 1.3);
}

#[test]
fn the_search_does_not_depend_on_its_grid() {
    let bench = Bench::text(&circle());
    let plan = Plan::new(&bench.run("").segments);
    let [coarse, fine] =
        [PERIOD_S, PERIOD_S / 3.0].map(|step_s| OptimalStop::of(&plan, &ACCELERATION, step_s));
    for tenth in 1..10 {
        let at_s = plan.end_s() * f64::from(tenth) / 10.0;
        let (a, b) = (coarse.time_s(at_s), fine.time_s(at_s));
        assert!((a - b).abs() < 0.01 * b, "{a} and {b} at {at_s} s");
    }
}
