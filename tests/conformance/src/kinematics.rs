//! Kinematics: there and back, the same each time.

use tandem_sdk::{AxisVector, Kinematics, KinematicsContext, MAX_AXES, Plugin};

use crate::machine::context;
use crate::program::norm;
use crate::random::Random;
use crate::report::Report;
use crate::timing::Timing;
use crate::{Setup, heap};

const PLACES: u64 = 5000;
/// How far a place may be off after there and back, mm.
const ROUND_TRIP_MM: f64 = 1e-9;
/// Judges a kinematics.
pub fn judge(plugin: Plugin, setup: &Setup, report: &mut Report) {
    let axes = context(AxisVector::ZERO).axes;
    let open = |options: &str| plugin.kinematics(options, &KinematicsContext::new(axes));
    let (Some(first), Ok(second)) = (crate::open(setup, report, open), open(&setup.options)) else {
        return;
    };
    report.judged("joints");
    let joints = first.joint_count(axes.count());
    if !(axes.count()..=MAX_AXES).contains(&joints) {
        report.find(
            "joints",
            format!("{joints} joints for {} axes", axes.count()),
        );
    }
    let mut random = Random::new(setup.seed);
    let mut timings = [Timing::new("to_joints"), Timing::new("to_axes")];
    let checks = ["there and back", "determinism"];
    for check in checks {
        report.judged(check);
    }
    let mut uses = 0;
    for _ in 0..PLACES {
        let within = |[low, high]: [f64; 2]| random.between(low, high);
        let place = AxisVector::from_slice(&setup.work_area.map(within));
        let before = heap::uses();
        let found = [
            round_trip(first.as_ref(), &place, &mut timings),
            differs(first.as_ref(), second.as_ref(), &place),
        ];
        uses += heap::uses() - before;
        for (check, words) in checks.iter().zip(found) {
            if let Some(words) = words {
                report.find(
                    check,
                    format!("at {:?}: {}", &place.0[..3], blamed(first.as_ref(), &words)),
                );
            }
        }
    }
    if let Err(error) = first.health() {
        report.find(
            "joints",
            format!("health of one that has not failed: {error}"),
        );
    }
    judge_heap(uses, report);
    report.time(timings);
}

fn judge_heap(uses: u64, report: &mut Report) {
    if !heap::counts() {
        report.skip("allocation", heap::NOT_COUNTED);
    } else if uses > 0 && report.conforms() {
        // What was found wrong is put into words, which takes memory of the kit's own.
        report.find("allocation", format!("{uses} uses of the heap"));
    } else {
        report.judged("allocation");
    }
}

/// What was found, with the plugin's own words where it has any.
fn blamed(kinematics: &dyn Kinematics, words: &str) -> String {
    kinematics
        .health()
        .map_or_else(|error| format!("{words}: {error}"), |()| words.to_string())
}

fn round_trip(
    kinematics: &dyn Kinematics,
    place: &AxisVector,
    timings: &mut [Timing; 2],
) -> Option<String> {
    let joints = timings[0].of(|| kinematics.to_joints(place));
    let back = timings[1].of(|| kinematics.to_axes(&joints));
    let off_mm = norm(&(back - *place));
    // A comparison with NaN is false.
    let near = off_mm <= ROUND_TRIP_MM;
    (!near).then(|| format!("to joints and back is {off_mm} mm off"))
}

fn differs(one: &dyn Kinematics, other: &dyn Kinematics, place: &AxisVector) -> Option<String> {
    let bits = |k: &dyn Kinematics| k.to_joints(place).0.map(f64::to_bits);
    (bits(one) != bits(other)).then(|| "two of it do not agree".to_string())
}
