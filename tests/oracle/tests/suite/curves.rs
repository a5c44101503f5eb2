//! NURBS curves: a quarter of a circle as a curve is that quarter, and nothing beside it.

use crate::common;

use common::{Profile, assert_finds, assert_passes, at, stop_at_all, verdict};
use tandem_oracle::{Kind, Outcome, Position};

const RADIUS_MM: f64 = 10.0;

/// From 0 0 around 0 10 to 10 10, at the arc length.
fn quarter(length_mm: f64) -> Position {
    let (sine, cosine) = (length_mm / RADIUS_MM).sin_cos();
    at(RADIUS_MM * sine, RADIUS_MM * (1.0 - cosine), 0.0)
}

fn samples(path: impl Fn(f64) -> Position) -> Vec<Position> {
    Profile::rest_to_rest(50.0, RADIUS_MM * std::f64::consts::FRAC_PI_2, 400.0).samples(path)
}

const FANUC: &str =
    "G6.2 P3 K0 X0 Y0 F3000\nK0 X10 Y0 R0.70710678118654752\nK0 X10 Y10\nK1\nK1\nK1\nM2\n";
const LINUXCNC: &str = "F3000\nG5.2 L3\n(the corner)\nX10 P0.70710678118654752\n\nY10\nG5.3\n";

#[test]
fn a_quarter_of_a_circle() {
    for program in [FANUC, LINUXCNC] {
        assert_passes(&verdict(&samples(quarter), program));
        let outside = samples(|length| quarter(length).map(|part| part * 1.01));
        assert!(!verdict(&outside, program).passed());
    }
    let corner = [at(0.0, 0.0, 0.0), at(10.0, 0.0, 0.0), at(10.0, 10.0, 0.0)];
    assert!(
        verdict(&stop_at_all(&corner, 50.0, 990.0), FANUC)
            .kinds()
            .contains(&Kind::PathDeviation)
    );
}

#[test]
fn no_part_may_be_missed() {
    // The chord between the ends of a small loop: on the path at both ends, within tolerance nowhere between.
    let program = "F3000\nG91 G1 X5\nG5.2 L4\nX5 Y5\nX-5 Y0\nX5 Y-5\nG5.3\nG1 X5\n";
    let line = stop_at_all(&[at(0.0, 0.0, 0.0), at(15.0, 0.0, 0.0)], 50.0, 990.0);
    assert!(!verdict(&line, program).passed());
}

#[test]
fn the_feed_is_that_of_the_curve() {
    let slow = FANUC.replace("F3000", "F1500");
    assert_finds(&verdict(&samples(quarter), &slow), &[Kind::Feed]);
    let inverse =
        "G93 G6.2 P3 K0 F190.9859 X0 Y0\nK0 X10 Y0 R0.70710678118654752\nK0 X10 Y10\nK1\nK1\nK1\n";
    assert_passes(&verdict(&samples(quarter), inverse));
    assert_finds(
        &verdict(&samples(quarter), &inverse.replace("F190", "F180")),
        &[Kind::Feed],
    );
}

#[test]
fn bezier_curves() {
    // The parabola y = x²/10 from 0 0 to 10 10, sampled evenly in x: too fast for no axis.
    let mut parabola: Vec<Position> = Vec::new();
    let x = Profile::rest_to_rest(10.0, 10.0, 100.0);
    parabola.extend(x.samples(|x| at(x, x * x / 10.0, 0.0)));
    for program in [
        "F3000 G5.1 X10 Y10 I5 J0\n",
        "F3000 G5 X10 Y10 I3.333333333333 J0 P-3.333333333333 Q-6.666666666667\n",
    ] {
        assert_passes(&verdict(&parabola, program));
        assert!(!verdict(&parabola, &program.replace("J0", "J0.2")).passed());
    }
}

#[test]
fn what_is_not_complete_is_not_judged() {
    for program in [
        "F3000\nG5.2\nX10\nX20\n",
        "G6.2 K0 F3000\nK0 X1\nG1 X3\n",
        "F3000 G5.1 X1 I1 B3\n",
        "F3000 G5 X1 P1 Q1\n",
    ] {
        let verdict = verdict(&[at(0.0, 0.0, 0.0); 3], program);
        assert!(
            matches!(verdict.outcome, Outcome::NotJudged { .. }),
            "{program}: {verdict}"
        );
    }
}
