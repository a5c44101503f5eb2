//! Kinematics that are not linear: an arm and a delta drive programs as fast as their joints allow, and no faster.

use std::path::PathBuf;

use crate::harness::{Done, Scenario, root};

/// How far apart places of a block are for the reference, mm.
const STEP_MM: f64 = 0.1;
/// How far the tool is moved to see how joints follow, mm.
const APART_MM: f64 = 0.02;
/// By how much a run may be slower than the reference, for which the steps of corners cost nothing: on chains of chords no run that
/// makes up for them is as fast.
const SLOWER: f64 = 1.03;

type Place = [f64; 3];

/// A machine as the reference knows it: limits of axes and joints, mm or rad, in its own words.
struct Limits {
    joints: fn(&Place) -> Place,
    speed: [f64; 6],
    acceleration: [f64; 6],
    step: [f64; 6],
}

/// The arm of examples/machines/scara.toml.
fn arm() -> Limits {
    let joints = |at: &Place| {
        let (x, y) = (at[0], at[1] + 250.0);
        let far = x.hypot(y);
        let angle = |a: f64, b: f64, c: f64| ((a * a + b * b - c * c) / (2.0 * a * b)).acos();
        let elbow = angle(220.0, 200.0, far) - std::f64::consts::PI;
        [y.atan2(x) + angle(220.0, far, 200.0), elbow, at[2]]
    };
    let rad = |deg: f64| deg.to_radians();
    Limits {
        joints,
        speed: [250.0, 250.0, 150.0, rad(20.0), rad(25.0), 150.0],
        acceleration: [2000.0, 2000.0, 1000.0, rad(150.0), rad(200.0), 1000.0],
        step: [
            5.0 / 3.0,
            5.0 / 3.0,
            5.0 / 3.0,
            rad(1.0 / 3.0),
            rad(1.0 / 3.0),
            5.0 / 3.0,
        ],
    }
}

/// The carriages of examples/machines/delta.toml.
fn delta() -> Limits {
    let joints = |at: &Place| {
        std::array::from_fn(|i| {
            let angle = std::f64::consts::TAU * i as f64 / 3.0;
            let across = (at[0] - 140.0 * angle.cos()).hypot(at[1] - 140.0 * angle.sin());
            at[2] + (300.0f64 * 300.0 - across * across).sqrt()
        })
    };
    Limits {
        joints,
        speed: [250.0, 250.0, 150.0, 40.0, 40.0, 40.0],
        acceleration: [2000.0, 2000.0, 1000.0, 600.0, 600.0, 600.0],
        step: [5.0 / 3.0; 6],
    }
}

/// A place of the path: how axes and joints go along it, and how that turns, within the block behind and the block ahead.
struct Spot {
    along: [f64; 6],
    turn: [f64; 6],
}

fn spot(limits: &Limits, at: &Place, direction: &Place) -> Spot {
    let beside = |way: f64| {
        let place: Place = std::array::from_fn(|i| at[i] + way * direction[i]);
        (limits.joints)(&place)
    };
    let (here, before, behind) = (beside(0.0), beside(-APART_MM), beside(APART_MM));
    Spot {
        along: std::array::from_fn(|i| match i.checked_sub(3) {
            None => direction[i],
            Some(j) => (behind[j] - before[j]) / (2.0 * APART_MM),
        }),
        turn: std::array::from_fn(|i| match i.checked_sub(3) {
            None => 0.0,
            Some(j) => (behind[j] - 2.0 * here[j] + before[j]) / (APART_MM * APART_MM),
        }),
    }
}

/// The range of path accelerations at the square of the speed `w`.
fn range(limits: &Limits, spot: &Spot, w: f64) -> [f64; 2] {
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for i in 0..6 {
        let (along, turn, most) = (spot.along[i], spot.turn[i] * w, limits.acceleration[i]);
        if along.abs() > 1e-9 {
            let ends = [(-most - turn) / along, (most - turn) / along];
            range = [
                range[0].max(ends[0].min(ends[1])),
                range[1].min(ends[0].max(ends[1])),
            ];
        } else if turn.abs() > most {
            return [1.0, -1.0];
        }
    }
    range
}

/// A stretch of the path, with the square of the highest speed at its start and behind it.
struct Stretch {
    length_mm: f64,
    ends: [Spot; 2],
    highest: f64,
}

/// The path of a run as it was programmed, from the file of its blocks: stretches, and the highest squares where they begin. No step
/// of a corner costs anything here but its own limit, so that the reference is rather too fast.
fn stretches(done: &Done, limits: &Limits) -> Vec<Stretch> {
    let mut reader = csv::Reader::from_path(done.file("blocks.csv")).unwrap();
    let headers = reader.headers().unwrap().clone();
    let column = |name: &str| headers.iter().position(|header| header == name).unwrap();
    let [kind, feed] = ["kind", "feed_mm_s"].map(column);
    let ends = ["x_end_mm", "y_end_mm", "z_end_mm"].map(column);
    let (mut at, mut all, mut last): (Place, Vec<Stretch>, Option<[f64; 6]>) =
        ([0.0; 3], vec![], None);
    for record in reader.records() {
        let record = record.unwrap();
        let number = |column: usize| record[column].parse::<f64>().unwrap_or(f64::INFINITY);
        let end: Place = ends.map(number);
        let way: Place = std::array::from_fn(|i| end[i] - at[i]);
        let length_mm = way.iter().map(|w| w * w).sum::<f64>().sqrt();
        let rests = record.get(kind) != Some("line");
        if rests {
            last = None;
        }
        if length_mm == 0.0 {
            continue;
        }
        let direction = way.map(|w| w / length_mm);
        let parts = (length_mm / STEP_MM).ceil();
        let place = |share: f64| -> Place { std::array::from_fn(|i| at[i] + share * way[i]) };
        for part in 0..parts as usize {
            let shares = [part as f64 / parts, (part + 1) as f64 / parts];
            let ends = shares.map(|share| spot(limits, &place(share), &direction));
            let mut fastest = if rests { f64::INFINITY } else { number(feed) };
            for (speed, along) in limits.speed.iter().zip(&ends[0].along) {
                fastest = fastest.min(speed / along.abs());
            }
            if part == 0 {
                let Some(before) = last else {
                    all.push(Stretch {
                        length_mm: length_mm / parts,
                        ends,
                        highest: 0.0,
                    });
                    continue;
                };
                for (i, step) in limits.step.iter().enumerate() {
                    fastest = fastest.min(step / (ends[0].along[i] - before[i]).abs());
                }
            }
            all.push(Stretch {
                length_mm: length_mm / parts,
                ends,
                highest: fastest * fastest,
            });
        }
        last = (!rests).then(|| all[all.len() - 1].ends[1].along);
        at = end;
    }
    all
}

/// The shortest time along the path, s: backward the highest squares of the speed from which what follows can be kept, forward as
/// much of them as can be reached.
fn reference_s(done: &Done, limits: &Limits) -> f64 {
    let all = stretches(done, limits);
    let mut highest = vec![0.0; all.len() + 1];
    for (i, stretch) in all.iter().enumerate().rev() {
        let keeps = |w: f64| {
            let range = range(limits, &stretch.ends[0], w);
            let then = (highest[i + 1] - w) / (2.0 * stretch.length_mm);
            range[0] <= range[1] && range[0] <= then
        };
        let (mut good, mut bad) = (0.0, stretch.highest);
        if keeps(bad) {
            good = bad;
        }
        for _ in 0..50 {
            let w = f64::midpoint(good, bad);
            *(if keeps(w) { &mut good } else { &mut bad }) = w;
        }
        highest[i] = good;
    }
    let (mut w, mut time_s) = (0.0, 0.0);
    for (i, stretch) in all.iter().enumerate() {
        let most = range(limits, &stretch.ends[0], w)[1];
        let next = (w + 2.0 * stretch.length_mm * most).clamp(0.0, highest[i + 1]);
        time_s += 2.0 * stretch.length_mm / (f64::sqrt(w) + f64::sqrt(next));
        w = next;
    }
    time_s
}

fn machine(name: &str) -> PathBuf {
    root().join("examples/machines").join(name)
}

fn program(name: &str) -> PathBuf {
    root().join("examples/programs").join(name)
}

fn machines() -> [(&'static str, Limits); 2] {
    [("scara.toml", arm()), ("delta.toml", delta())]
}

/// `cargo test -p tandem --test scenarios arms -- --nocapture` prints the table of docs/kinematics.md.
#[test]
fn joints_that_are_not_linear_are_planned_for() {
    let mut programs = vec!["serpentine", "square", "two-step-arcs"];
    if std::env::var_os("TANDEM_EVERY").is_some() {
        programs.extend(["raster", "spiral", "corners", "two-step-square"]);
    }
    for (name, limits) in machines() {
        for program_name in &programs {
            let done = Scenario::of(&program(&format!("{program_name}.ngc")))
                .on(&machine(name))
                .run();
            done.assert_within_limits();
            let (took_s, best_s) = (done.number("motion_time_s"), reference_s(&done, &limits));
            let slower = took_s / best_s;
            println!("| {name} | {program_name} | {took_s:.3} | {best_s:.3} | {slower:.4} |");
            assert!(
                slower <= SLOWER,
                "{name}, {program_name}: {took_s} s, {best_s} s can be"
            );
            // Faster than what is known to be the best would be a limit that is not kept.
            assert!(
                slower >= 0.995,
                "{name}, {program_name}: {took_s} s, {best_s} s can be"
            );
        }
    }
}

/// Where the tool is held and slowed down anywhere, the joints keep their limits too.
#[test]
fn a_hold_keeps_the_limits_of_joints_that_are_not_linear() {
    for (name, _) in machines() {
        for first in [40, 333, 777] {
            let mut commands = String::new();
            for k in 0..6 {
                let tick = first + 500 * k;
                let ratio = if k % 2 == 0 { 0.4 } else { 1.0 };
                let lines = [
                    format!("{tick},hold\n"),
                    format!("{},resume\n", tick + 230),
                    format!("{},feed-override,{ratio}\n", tick + 300),
                ];
                commands.extend(lines);
            }
            let done = Scenario::of(&program("serpentine.ngc"))
                .on(&machine(name))
                .commands(&commands)
                .run();
            done.assert_driven("", &[]);
            let verdict = done.judge(|_| {});
            assert!(verdict.passed(), "{name}, {first}: {verdict}");
        }
    }
}
