//! Machine files that `tandem machine` writes: whatever they say, they are taken, and programs run within their limits.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tandem_rig::Random;
use tempfile::TempDir;

fn tandem(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tandem"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// An axis as it is drawn.
struct Drawn {
    letter: char,
    low: f64,
    high: f64,
    feed: f64,
    acceleration: f64,
}

fn draw(random: &mut Random) -> Vec<Drawn> {
    let letters = ["x", "xy", "xyz", "xyza", "yz", "xzuvw"][random.below(6) as usize];
    letters
        .chars()
        .map(|letter| {
            let low = random.between(-400.0, 100.0).round();
            Drawn {
                letter,
                low,
                high: low + random.length(5.0, 1000.0).round(),
                feed: random.length(100.0, 60_000.0).round(),
                acceleration: random.length(20.0, 20_000.0).round(),
            }
        })
        .collect()
}

/// Lines in random directions from wherever the machine stands, short and long.
fn program(random: &mut Random, axes: &[Drawn]) -> String {
    let mut program = String::from("G21 G90 G94 G64\n");
    let feed = axes.iter().map(|axis| axis.feed).fold(0.0, f64::max);
    writeln!(program, "F{:.1}", feed * random.between(0.2, 1.0)).unwrap();
    let mut at: Vec<f64> = axes
        .iter()
        .map(|axis| f64::midpoint(axis.low, axis.high))
        .collect();
    for line in 0..random.below(30) + 3 {
        let rapid = line == 0 || random.below(6) == 0;
        program += if rapid { "G0" } else { "G1" };
        let reach = if random.below(2) == 0 { 0.02 } else { 0.4 };
        for (at, axis) in at.iter_mut().zip(axes) {
            let by = (axis.high - axis.low) * reach * random.between(-1.0, 1.0);
            *at = (*at + by).clamp(axis.low, axis.high);
            write!(program, " {}{at:.4}", axis.letter.to_ascii_uppercase()).unwrap();
        }
        program.push('\n');
    }
    program + "M2\n"
}

/// The file in `folder` is taken, and a random program runs within its limits.
fn assert_runs(folder: &Path, random: &mut Random, axes: &[Drawn], seed: u64) {
    std::fs::write(folder.join("p.ngc"), program(random, axes)).unwrap();
    let file = || std::fs::read_to_string(folder.join("m.toml")).unwrap_or_default();
    let check = tandem(folder, &["check", "p.ngc", "--machine", "m.toml"]);
    assert_eq!(
        check.status.code(),
        Some(0),
        "seed {seed}: {}\n{}",
        text(&check.stderr),
        file()
    );
    let run = tandem(
        folder,
        &["run", "p.ngc", "--machine", "m.toml", "--summary", "s.json"],
    );
    assert_eq!(
        run.status.code(),
        Some(0),
        "seed {seed}: {}\n{}",
        text(&run.stderr),
        file()
    );
    let summary: Value =
        serde_json::from_slice(&std::fs::read(folder.join("s.json")).unwrap()).unwrap();
    for count in [
        "limit_violations",
        "guard_stops",
        "governed_samples",
        "starvations",
    ] {
        assert_eq!(summary[count], 0, "seed {seed}: {count}\n{}", file());
    }
}

#[test]
fn whatever_is_asked_for_runs_within_its_limits() {
    for seed in 0..12 {
        let mut random = Random::new(seed);
        let axes = draw(&mut random);
        let folder = TempDir::new().unwrap();
        let mut arguments = vec!["machine".to_string(), "new".into(), "m.toml".into()];
        for axis in &axes {
            arguments.extend([
                "--axis".into(),
                format!("{}={}:{}", axis.letter, axis.low, axis.high),
            ]);
            arguments.extend(["--feed".into(), format!("{}={}", axis.letter, axis.feed)]);
            arguments.extend([
                "--acceleration".into(),
                format!("{}={}", axis.letter, axis.acceleration),
            ]);
        }
        let without_jerk = random.below(2) == 0;
        if without_jerk {
            arguments.extend(["--jerk".into(), "none".into()]);
        }
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let new = tandem(folder.path(), &arguments);
        assert_eq!(
            new.status.code(),
            Some(0),
            "seed {seed}: {}",
            text(&new.stderr)
        );
        let planner = if without_jerk {
            "block-overlap"
        } else {
            "smooth"
        };
        assert!(text(&new.stdout).contains(planner), "seed {seed}");
        assert_runs(folder.path(), &mut random, &axes, seed);
    }
}

#[test]
fn whatever_linuxcnc_states_runs_within_its_limits() {
    for seed in 100..110 {
        let mut random = Random::new(seed);
        let axes = draw(&mut random);
        let coordinates: String = axes.iter().map(|axis| axis.letter).collect();
        let mut ini = format!(
            "[EMC]\nMACHINE = drawn {seed}\n[KINS]\nKINEMATICS = trivkins coordinates={coordinates}\n[TRAJ]\nLINEAR_UNITS = mm\n\
             [EMCMOT]\nSERVO_PERIOD = {}\n",
            [500_000, 1_000_000, 2_000_000][random.below(3) as usize]
        );
        for (joint, axis) in axes.iter().enumerate() {
            writeln!(
                ini,
                "[AXIS_{}]\nMIN_LIMIT = {}\nMAX_LIMIT = {}\nMAX_VELOCITY = {}\nMAX_ACCELERATION = {}\n\
                 [JOINT_{joint}]\nHOME = {}\nFERROR = {}\nBACKLASH = 0.01",
                axis.letter.to_ascii_uppercase(),
                axis.low,
                axis.high,
                axis.feed / 60.0,
                axis.acceleration,
                random.between(axis.low, axis.high),
                random.between(5.0, 50.0),
            )
            .unwrap();
        }
        let folder = TempDir::new().unwrap();
        std::fs::write(folder.path().join("shop.ini"), ini).unwrap();
        let mut arguments = vec!["machine", "import", "shop.ini", "--out", "m.toml"];
        if random.below(2) == 0 {
            arguments.push("--jerk");
        }
        let import = tandem(folder.path(), &arguments);
        let said = text(&import.stderr);
        assert_eq!(import.status.code(), Some(0), "seed {seed}: {said}");
        assert!(
            said.contains("BACKLASH = 0.01: backlash and screw errors are not compensated"),
            "{said}"
        );
        assert_runs(folder.path(), &mut random, &axes, seed);
    }
}

#[test]
fn whatever_grbl_states_runs_within_its_limits() {
    for seed in 200..210 {
        let mut random = Random::new(seed);
        let mut axes = draw(&mut random);
        let mut dump = String::from("Grbl 1.1h ['$' for help]\n$11=0.010\n$30=10000\n$31=0\n");
        for axis in &mut axes {
            let at = "xyzabcuvw".find(axis.letter).unwrap();
            (axis.low, axis.high) = (axis.low - axis.high, 0.0);
            writeln!(
                dump,
                "${}=80.000\n${}={}\n${}={}\n${}={}",
                100 + at,
                110 + at,
                axis.feed,
                120 + at,
                axis.acceleration,
                130 + at,
                -axis.low
            )
            .unwrap();
        }
        let folder = TempDir::new().unwrap();
        std::fs::write(folder.path().join("dump.txt"), dump).unwrap();
        let import = tandem(
            folder.path(),
            &["machine", "import", "dump.txt", "--out", "m.toml"],
        );
        let said = text(&import.stderr);
        assert_eq!(import.status.code(), Some(0), "seed {seed}: {said}");
        assert!(
            said.contains("dump.txt:2: not taken over: $11=0.010:"),
            "{said}"
        );
        assert_runs(folder.path(), &mut random, &axes, seed);
    }
}

#[test]
fn what_is_wrong_writes_nothing_and_nothing_is_written_over() {
    let folder = TempDir::new().unwrap();
    let new = |more: &[&str]| {
        let mut arguments = vec!["machine", "new", "m.toml"];
        arguments.extend(more);
        tandem(folder.path(), &arguments)
    };
    for (more, why) in [
        (
            &["--axis", "x=5:-5"][..],
            "--axis x=5:-5: the lowest position, 5, is not below",
        ),
        (&["--axis", "q=0:5"], "\"q\" is no axis"),
        (&["--axis", "x=0:5"], "axis x has no --feed"),
        (
            &["--axis", "x=0:5", "--feed", "-3", "--acceleration", "5"],
            "--feed -3: -3 is not above zero",
        ),
        (
            &[
                "--axis",
                "x=0:5",
                "--feed",
                "3",
                "--acceleration",
                "y=5",
                "--acceleration",
                "1",
            ],
            "--acceleration y=…: there is no --axis y",
        ),
        (
            &[
                "--axis",
                "x=0:5",
                "--axis",
                "x=0:6",
                "--feed",
                "3",
                "--acceleration",
                "1",
            ],
            "there is an axis x already",
        ),
    ] {
        let refused = new(more);
        let said = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(1), "{more:?}: {said}");
        assert!(said.contains(why), "{more:?}: {said}");
        assert!(!folder.path().join("m.toml").exists(), "{more:?}");
    }
    std::fs::write(
        folder.path().join("bad.ini"),
        "[TRAJ]\nLINEAR_UNITS = ell\n",
    )
    .unwrap();
    let refused = tandem(
        folder.path(),
        &["machine", "import", "bad.ini", "--out", "m.toml"],
    );
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("bad.ini:2: error: [TRAJ]LINEAR_UNITS: \"ell\""));
    std::fs::write(folder.path().join("m.toml"), "mine").unwrap();
    let refused = new(&["--axis", "x=0:5", "--feed", "3", "--acceleration", "5"]);
    assert_eq!(refused.status.code(), Some(1));
    assert_eq!(
        std::fs::read(folder.path().join("m.toml")).unwrap(),
        b"mine"
    );
}
