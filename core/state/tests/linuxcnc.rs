//! What is exported for `LinuxCNC`: read back it is the same, and `LinuxCNC`'s own interpreter, rs274, agrees with ours on it.
//!
//! The judge is the command `rs274` of Debian's package linuxcnc-uspace, on the path or named by `RS274`; where it is not
//! installed nothing is judged, which the test prints. `JUDGE_SEED=17` judges one state.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use common::{any_state, machine_of};
use tandem_gcode::{Config, Interpreter, Item};
use tandem_rig::Random;
use tandem_sdk::{Axes, AxisVector};
use tandem_state::{LinearUnit, LinuxCnc, PersistentState};

/// What `LinuxCNC`'s files keep of a value: nine decimals, in degrees or the unit.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-7
}

fn is_near_vector(a: &AxisVector, b: &AxisVector) -> bool {
    a.0.iter().zip(&b.0).all(|(a, b)| is_near(*a, *b))
}

/// A state as a shop may have it: nothing is far away, nor so near to zero that `LinuxCNC` takes it for that.
fn shop(random: &mut Random, axes: &Axes) -> PersistentState {
    let mut state = any_state(random, axes);
    let near = |vector: AxisVector| {
        vector.map(|value| {
            if value == 0.0 {
                0.0
            } else {
                0.1 + value.rem_euclid(3.0)
            }
        })
    };
    state.offsets.origins = state.offsets.origins.map(near);
    state.offsets.g92_stored = near(state.offsets.g92_stored);
    let in_force = random.unit() < 0.5;
    state.offsets.g92 = if in_force {
        state.offsets.g92_stored
    } else {
        AxisVector::ZERO
    };
    state.reference = state.reference.map(|place| place.map(near));
    state
        .parameters
        .values_mut()
        .for_each(|value| *value = value.rem_euclid(1000.0));
    for tool in state.tools.values_mut() {
        (tool.offset, tool.wear) = (near(tool.offset), near(tool.wear));
    }
    state
}

#[test]
fn what_is_exported_is_read_again() {
    for seed in 0..50 {
        let mut random = Random::new(seed);
        let axes = machine_of(&mut random);
        let state = shop(&mut random, &axes);
        let unit = random.pick(&[LinearUnit::Mm, LinearUnit::Inch]);
        let files = LinuxCnc { axes: &axes, unit };
        let home = AxisVector::ZERO.map(|_| random.unit());
        let mut again = PersistentState::default();
        let left = files
            .read_variables(&files.variables(&state, &home), &mut again)
            .unwrap();
        assert_eq!(left, [], "seed {seed}");
        assert_eq!(
            files.read_tools(&files.tools(&state), &mut again).unwrap(),
            [],
            "seed {seed}"
        );
        let (mine, theirs) = (state.to_program(&home), again.to_program(&home));
        let vectors = [
            (&mine.g92, &theirs.g92),
            (&mine.g92_stored, &theirs.g92_stored),
        ];
        let places = mine.reference.iter().zip(&theirs.reference);
        let vectors = vectors
            .into_iter()
            .chain(places)
            .chain(mine.origins.iter().zip(&theirs.origins));
        for (a, b) in vectors {
            let mut a = *a;
            a.0[axes.count()..].fill(0.0);
            assert!(is_near_vector(&a, b), "seed {seed}: {a:?} is read as {b:?}");
        }
        assert!(
            mine.rotations_rad
                .iter()
                .zip(&theirs.rotations_rad)
                .all(|(a, b)| is_near(*a, *b)),
            "seed {seed}"
        );
        assert_eq!(mine.active_system, theirs.active_system);
        assert_eq!(mine.parameters.len(), theirs.parameters.len());
        assert!(
            mine.parameters
                .iter()
                .zip(&theirs.parameters)
                .all(|(a, b)| a.0 == b.0 && is_near(*a.1, *b.1))
        );
        for (a, b) in mine.tools.iter().zip(&theirs.tools) {
            let same = a.number == b.number
                && is_near_vector(&a.offset, &b.offset)
                && is_near(a.diameter_mm, b.diameter_mm);
            assert!(same, "seed {seed}: {a:?} is read as {b:?}");
        }
        assert_eq!(mine.tools.len(), theirs.tools.len());
        assert!(
            state
                .tools
                .values()
                .zip(again.tools.values())
                .all(|(a, b)| a.orientation == b.orientation)
        );
    }
}

fn judge() -> Option<PathBuf> {
    if let Some(path) = std::env::var_os("RS274") {
        return Some(path.into());
    }
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .map(|folder| folder.join("rs274"))
        .find(|file| file.is_file())
}

/// What the judge says that parameters are, in its messages.
fn judged(
    judge: &Path,
    folder: &Path,
    files: &LinuxCnc<'_>,
    state: &PersistentState,
    program: &str,
) -> Vec<f64> {
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let (var, tools) = (
        write("state.var", &files.variables(state, &AxisVector::ZERO)),
        write("tool.tbl", &files.tools(state)),
    );
    let program = write("program.ngc", program);
    let mut command = Command::new(judge);
    command
        .arg("-t")
        .arg(tools)
        .arg("-v")
        .arg(var)
        .arg("-g")
        .arg(program);
    // Its tool table is a file in the home folder, which runs side by side would share.
    let run = command
        .env("HOME", folder)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&run.stdout);
    let values: Vec<_> = text
        .lines()
        .filter_map(|line| {
            line.split_once("MESSAGE(\"")?
                .1
                .split('"')
                .next()?
                .trim()
                .parse()
                .ok()
        })
        .collect();
    assert!(
        !values.is_empty(),
        "{text}\n{}",
        String::from_utf8_lossy(&run.stderr)
    );
    values
}

/// What our interpreter says that parameter `number` is.
fn ours(interpreter: &mut Interpreter, number: usize) -> f64 {
    let mut items = Vec::new();
    // Coming from somewhere else, so that every value is a move.
    interpreter.set_position(AxisVector::from_slice(&[1e6]));
    interpreter
        .line(1, format!("G21 G53 G0 X#{number}").as_bytes(), &mut items)
        .unwrap();
    let Some(Item::Block(block, _)) = items.last() else {
        panic!("#{number} moves nothing")
    };
    block.end[0]
}

#[test]
fn linuxcnc_agrees_on_what_it_is_given() {
    let Some(judge) = judge() else {
        println!(
            "skipped: rs274 (Debian's linuxcnc-uspace) is not installed, and RS274 names none"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let seed = std::env::var("JUDGE_SEED")
        .ok()
        .and_then(|text| text.parse().ok());
    let seeds = seed.map_or(0..8, |seed| seed..seed + 1);
    println!("seeds {seeds:?}");
    let numbers = (5161..=5169)
        .chain(5181..=5189)
        .chain(5210..=5390)
        .filter(|n| *n < 5221 || (n - 5221) % 20 < 10);
    let numbers: Vec<usize> = numbers.collect();
    for seed in seeds {
        let mut random = Random::new(seed);
        let axes = Axes::new(&[
            ('X', false),
            ('Y', false),
            ('Z', false),
            ('A', true),
            ('C', true),
            ('W', false),
        ])
        .unwrap();
        let mut state = shop(&mut random, &axes);
        state.tools.retain(|number, _| *number < 1000);
        // Without a configuration the judge's machine is in inches.
        let files = LinuxCnc {
            axes: &axes,
            unit: LinearUnit::Inch,
        };
        let asked: Vec<usize> = numbers
            .iter()
            .chain(state.parameters.keys())
            .copied()
            .collect();
        let program = asked.iter().fold(String::new(), |program, number| {
            program + &format!("(DEBUG,%.9f#{number})\n")
        });
        let theirs = judged(
            &judge,
            folder.path(),
            &files,
            &state,
            &format!("{program}M2\n"),
        );
        assert_eq!(theirs.len(), asked.len(), "seed {seed}");
        let config = Config {
            persistent: Some(Arc::new(state.to_program(&AxisVector::ZERO))),
            ..Config::new(axes)
        };
        let mut interpreter = Interpreter::new(config);
        for (number, theirs) in asked.iter().zip(&theirs) {
            let mine = ours(&mut interpreter, *number);
            // Lengths read in mm here and in the unit of the machine there.
            let mine = if is_length(*number) {
                mine / 25.4
            } else {
                mine
            };
            assert!(
                (mine - theirs).abs() < 1e-8,
                "seed {seed}: #{number} is {mine} here and {theirs} there"
            );
        }
        let Some(tool) = state.tools.values().next() else {
            continue;
        };
        let program = format!(
            "T{0} M6\nG43 H{0}\n(DEBUG,%.9f#5400)\n(DEBUG,%.9f#5403)\n(DEBUG,%.9f#5410)\nM2\n",
            tool.number
        );
        let theirs = judged(&judge, folder.path(), &files, &state, &program);
        let seen = tool.to_program();
        let mine = [
            f64::from(tool.number),
            seen.offset[2] / 25.4,
            seen.diameter_mm / 25.4,
        ];
        assert!(
            mine.iter().zip(&theirs).all(|(a, b)| (a - b).abs() < 1e-8),
            "seed {seed}: {mine:?}, judge {theirs:?}"
        );
    }
}

/// Whether a parameter holds a length.
fn is_length(number: usize) -> bool {
    let nth = match number {
        5161..=5169 => number - 5161,
        5181..=5189 => number - 5181,
        5211..=5219 => number - 5211,
        5221.. => (number - 5221) % 20,
        _ => return false,
    };
    b"XYZABCUVW"
        .get(nth)
        .is_some_and(|letter| b"XYZUVW".contains(letter))
}
