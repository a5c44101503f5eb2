//! Which sample of a run went furthest beyond a limit, in words: whatever tolerance or excuse it has, it is told with its size.

use std::collections::BTreeMap;
use std::fmt::Display;

use crate::summary::{OfLimit, OfLimits};

/// A share of a limit that is larger than 1 by less than that is rounding.
const TOLERANCE: f64 = 1e-6;
/// And where jerk is judged, it may be larger by so much.
const JERK_TOLERANCE: f64 = 1e-2;

/// The worst sample beyond a limit that is judged, where `jerk` and the worst of each axis are those of a summary. `None` where no
/// sample is beyond.
pub fn worst_of_judged<S: Display>(
    jerk: &str,
    worst: &BTreeMap<String, OfLimits<S>>,
) -> Option<String> {
    let each = worst.iter().flat_map(|(axis, of)| {
        let jerk = (jerk == "limit").then_some(("jerk", &of.jerk, JERK_TOLERANCE));
        [
            ("velocity", &of.velocity, TOLERANCE),
            ("acceleration", &of.acceleration, TOLERANCE),
        ]
        .into_iter()
        .chain(jerk)
        .map(move |(what, of, tolerance)| (axis, what, of, 1.0 + tolerance))
    });
    let beyond = each.filter(|(_, _, of, _)| of.share > 1.0 + TOLERANCE);
    let (axis, what, of, within) = beyond.max_by(|(_, _, a, within_a), (_, _, b, within_b)| {
        (a.share / within_a).total_cmp(&(b.share / within_b))
    })?;
    let within = if of.share <= within {
        "within"
    } else {
        "beyond"
    };
    let (axis, percent) = (axis.to_uppercase(), of.share * 100.0);
    Some(format!(
        "{axis} {what} {percent:.2} % {}, {within} the tolerance",
        place(of)
    ))
}

/// The worst jerk beyond its limit where jerk is reported and not judged. `None` where none is beyond, and where it is judged: there
/// it is one of [`worst_of_judged`].
pub fn worst_of_reported<S: Display>(
    jerk: &str,
    worst: &BTreeMap<String, OfLimits<S>>,
) -> Option<String> {
    if jerk == "limit" {
        return None;
    }
    let (axis, of) = worst
        .iter()
        .map(|(axis, of)| (axis, &of.jerk))
        .filter(|(_, of)| of.share > 1.0 + TOLERANCE)
        .max_by(|(_, a), (_, b)| a.share.total_cmp(&b.share))?;
    let axis = axis.to_uppercase();
    Some(format!(
        "{axis} {:.2} times its limit {}",
        of.share,
        place(of)
    ))
}

fn place<S: Display>(of: &OfLimit<S>) -> String {
    format!("at tick {}, line {}, {}", of.tick, of.line, of.state)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(velocity: f64, jerk: f64) -> BTreeMap<String, OfLimits<String>> {
        let of = |share| OfLimit {
            share,
            tick: 7,
            line: 3,
            state: "running".to_string(),
        };
        let of = OfLimits {
            velocity: of(velocity),
            acceleration: of(1.0),
            jerk: of(jerk),
        };
        BTreeMap::from([("x".to_string(), of)])
    }

    #[test]
    fn whatever_is_beyond_a_limit_is_told_with_its_size_judged_or_not() {
        let told = |mode: &str, velocity: f64, jerk: f64| {
            let worst = worst(velocity, jerk);
            [
                worst_of_judged(mode, &worst),
                worst_of_reported(mode, &worst),
            ]
            .map(Option::unwrap_or_default)
        };
        let within = "X jerk 100.50 % at tick 7, line 3, running, within the tolerance";
        assert_eq!(told("limit", 1.0, 1.005), [within, ""]);
        let beyond = "X jerk 4500.00 % at tick 7, line 3, running, beyond the tolerance";
        assert_eq!(told("limit", 1.0, 45.0), [beyond, ""]);
        let reported = "X 45.00 times its limit at tick 7, line 3, running";
        assert_eq!(told("report", 1.0, 45.0), ["", reported]);
        let fast = "X velocity 101.00 % at tick 7, line 3, running, beyond the tolerance";
        assert_eq!(told("report", 1.01, 1.0), [fast, ""]);
        assert_eq!(told("limit", 1.0, 1.0), ["", ""]);
    }
}
