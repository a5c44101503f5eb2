//! Random programs from a printed seed.

use std::fmt::Write;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

pub use tandem_rig::Random;

use crate::harness::{Scenario, root};
use crate::replay::for_each_seed;

/// Runs with the planner that lets blocks overlap.
pub const OVERLAP: &[&str] = &["--set", "planner.plugin=block-overlap"];

/// A program of lines, arcs, helices, chords, dwells, exact stops and feed changes, well inside the travel.
pub fn program(seed: u64) -> String {
    let mut random = Random::new(seed);
    let mut text = String::from("G21 G90 G94 G17\nG64\nF2000\n");
    let mut at = [0.0f64; 3];
    for _ in 0..random.below(80) + 3 {
        element(&mut random, &mut at, &mut text);
    }
    text.push_str("M2\n");
    text
}

fn element(random: &mut Random, at: &mut [f64; 3], text: &mut String) {
    match random.below(12) {
        0 => writeln!(text, "F{:.0}", random.between(50.0, 15000.0)).unwrap(),
        1 => writeln!(
            text,
            "{}",
            ["G61", "G64", "G61.1", "G64 P0.02"][random.below(4) as usize]
        )
        .unwrap(),
        2 => writeln!(text, "G4 P{:.3}", random.between(0.0, 0.02)).unwrap(),
        3 => line(random, at, text, "G0", 30.0),
        4 => arc(random, at, text),
        5 => chords(random, at, text),
        6 => line(random, at, text, "G1", 0.02),
        7 => line(random, at, text, "G1", 0.5),
        _ => line(random, at, text, "G1", 15.0),
    }
}

fn line(random: &mut Random, at: &mut [f64; 3], text: &mut String, word: &str, reach: f64) {
    let axes = random.below(7) + 1;
    write!(text, "{word}").unwrap();
    for (axis, letter) in "XYZ"
        .chars()
        .enumerate()
        .filter(|(axis, _)| axes >> axis & 1 == 1)
    {
        at[axis] = (at[axis] + random.between(-reach, reach)).clamp(-60.0, 60.0);
        write!(text, " {letter}{:.6}", at[axis]).unwrap();
        at[axis] = format!("{:.6}", at[axis]).parse().unwrap();
    }
    text.push('\n');
}

/// A full circle or helix in one of the planes; it ends where it began in the plane.
fn arc(random: &mut Random, at: &mut [f64; 3], text: &mut String) {
    let word = if random.below(2) == 0 { "G2" } else { "G3" };
    let (plane, first, second, across) = [
        ("G17", 'I', 'J', 2),
        ("G18", 'I', 'K', 1),
        ("G19", 'J', 'K', 0),
    ][random.below(3) as usize];
    let (a, b) = (random.between(-8.0, 8.0), random.between(0.1, 8.0));
    write!(text, "{plane} {word} {first}{a:.4} {second}{b:.4}").unwrap();
    if random.below(2) == 0 {
        at[across] = (at[across] + random.between(-3.0, 3.0)).clamp(-60.0, 60.0);
        write!(text, " {}{:.6}", ['X', 'Y', 'Z'][across], at[across]).unwrap();
        at[across] = format!("{:.6}", at[across]).parse().unwrap();
    }
    text.push_str("\nG17\n");
}

/// A stretch of short chords along a bending path, as CAM writes it.
fn chords(random: &mut Random, at: &mut [f64; 3], text: &mut String) {
    let (mut angle, bend, step) = (
        random.between(0.0, std::f64::consts::TAU),
        random.between(-0.2, 0.2),
        random.between(0.005, 0.4),
    );
    for _ in 0..random.below(60) + 5 {
        angle += bend;
        at[0] = (at[0] + step * angle.cos()).clamp(-60.0, 60.0);
        at[1] = (at[1] + step * angle.sin()).clamp(-60.0, 60.0);
        writeln!(text, "G1 X{:.4} Y{:.4}", at[0], at[1]).unwrap();
        at[0] = format!("{:.4}", at[0]).parse().unwrap();
        at[1] = format!("{:.4}", at[1]).parse().unwrap();
    }
}

/// What panics in `attempt` is told with the seed.
pub fn attempted(attempt: impl FnOnce() + std::panic::UnwindSafe) -> Result<(), String> {
    std::panic::catch_unwind(attempt).map_err(|_| "see above".to_string())
}

#[test]
fn random_programs_run_within_limits() {
    for_each_seed("random_programs_run_within_limits", 80, |seed| {
        attempted(|| {
            let done = Scenario::text(&program(seed)).run();
            done.assert_within_limits();
            assert_eq!(done.number("starvations"), 0.0);
        })
    });
}

#[test]
fn random_holds_and_stalls_keep_the_limits() {
    for_each_seed("random_holds_and_stalls_keep_the_limits", 60, |seed| {
        let lines = holds_and_stalls(&mut Random::new(seed | 1 << 40));
        attempted(|| {
            Scenario::text(&program(seed))
                .commands(&lines)
                .run()
                .assert_within_limits();
        })
    });
}

fn holds_and_stalls(random: &mut Random) -> String {
    let mut lines = String::new();
    let mut tick = 0;
    for _ in 0..6 {
        tick += random.below(150) + 1;
        let command = match random.below(3) {
            0 => format!("{tick},hold\n{},resume\n", tick + random.below(150)),
            1 => format!("{tick},feed-override,{:.2}\n", random.between(0.0, 1.0)),
            _ => format!("{tick},stall-rough,{}\n", random.below(60)),
        };
        lines += &command;
        tick += 150;
    }
    lines + &format!("{},feed-override,1\n", tick + 1)
}

#[test]
fn random_programs_pass_the_check() {
    for_each_seed("random_programs_pass_the_check", 20, |seed| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.ngc");
        std::fs::write(&path, program(seed)).unwrap();
        let checked = std::process::Command::new(env!("CARGO_BIN_EXE_tandem"))
            .args(["check".as_ref(), path.as_os_str(), "--machine".as_ref()])
            .arg(root().join("examples/machines/mill-3axis.toml"))
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&checked.stderr).into_owned();
        checked.status.success().then_some(()).ok_or(errors)
    });
}

/// The program of a seed with a time constant in every fifth line of motion.
fn program_with_constants(seed: u64) -> String {
    let mut random = Random::new(seed | 1 << 44);
    let mut text = String::new();
    for line in program(seed).lines() {
        text.push_str(line);
        if line.starts_with("G1") && random.below(5) == 0 {
            write!(
                text,
                " TA{}",
                [1, 2, 5, 10, 20, 50, 80, 150][random.below(8) as usize]
            )
            .unwrap();
        }
        text.push('\n');
    }
    text
}

#[test]
fn random_programs_overlap_within_limits_and_tolerance() {
    let blocks = AtomicU64::new(0);
    let tried = for_each_seed(
        "random_programs_overlap_within_limits_and_tolerance",
        160,
        |seed| {
            attempted(|| {
                let limits = if seed % 4 == 0 { "stretch" } else { "slow" };
                let option = format!("planner.options.limits={limits}");
                let done = Scenario::text(&program_with_constants(seed))
                    .with(OVERLAP)
                    .with(&["--set", &option])
                    .run();
                done.assert_within_tolerance();
                assert_eq!(done.number("starvations"), 0.0);
                blocks.fetch_add(done.number("blocks") as u64, Relaxed);
            })
        },
    );
    let judged = blocks.load(Relaxed);
    println!("{judged} blocks judged");
    assert!(
        tried < 10 || judged >= 100 * tried as u64,
        "{judged} blocks are too few"
    );
}

#[test]
fn random_holds_and_stalls_of_overlapping_blocks_keep_the_limits() {
    for_each_seed(
        "random_holds_and_stalls_of_overlapping_blocks_keep_the_limits",
        80,
        |seed| {
            let lines = holds_and_stalls(&mut Random::new(seed | 1 << 40));
            attempted(|| {
                let text = program_with_constants(seed);
                Scenario::text(&text)
                    .with(OVERLAP)
                    .commands(&lines)
                    .run()
                    .assert_within_tolerance();
            })
        },
    );
}
