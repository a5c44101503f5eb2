//! Eight `EtherCAT` drives on one bus, three of them of rotary axes, drive a whole program: a machine of its own for every seed.

#![allow(
    clippy::format_push_string,
    reason = "a machine file in pieces, once a test"
)]

use tandem_host::Switches;
use tandem_rig::Random;

use crate::ethercat::{judge, ran_with, seeds};

const LETTERS: [&str; 8] = ["x", "y", "z", "a", "b", "c", "u", "v"];

fn is_rotary(axis: &str) -> bool {
    "abc".contains(axis)
}

/// A machine file, and what one count of each drive is, mm or rad.
fn machine(random: &mut Random) -> (String, Vec<f64>) {
    let period_ms = random.pick(&[0.25, 0.5, 1.0]);
    let mut text = format!(
        "format = 1\n[planner]\nplugin = \"look-ahead\"\n[loops]\nfine_period_ms = {period_ms}\nrough_period_ms = 8\n"
    );
    for axis in LETTERS {
        let (kind, unit) = if is_rotary(axis) {
            ("rotary", "deg")
        } else {
            ("linear", "mm")
        };
        text += &format!(
            "[axes.{axis}]\nkind = \"{kind}\"\ntravel_{unit} = [-250, 250]\nmax_feed_{unit}_per_min = {}\n\
             max_acceleration_{unit}_per_s2 = {}\n",
            random.between(3000.0, 9000.0),
            random.between(500.0, 2000.0)
        );
    }
    text += &format!(
        "[drivers.bus]\nplugin = \"ethercat\"\njoints = {LETTERS:?}\n[drivers.bus.options]\ninterface = \"emulated\"\n\
         max_lost_frames = 2\nwatchdog_ms = {}\n",
        20.0 * period_ms
    );
    let mut counts = vec![];
    for (position, axis) in LETTERS.into_iter().enumerate() {
        let [per_turn, per_mm] = [random.between(2e4, 1e6).round(), random.between(1e3, 1e4)];
        let (counting, count) = if is_rotary(axis) {
            let count = std::f64::consts::TAU / per_turn;
            (format!("counts_per_turn = {per_turn}"), count)
        } else {
            (format!("counts_per_mm = {per_mm}"), 1.0 / per_mm)
        };
        counts.push(count);
        text += &format!(
            "[[drivers.bus.options.devices]]\nposition = {position}\nproduct = \"0x0e1a:0x0402\"\njoint = \"{axis}\"\n{counting}\n\
             invert = {}\n",
            random.below(2) == 1
        );
    }
    for _ in LETTERS {
        text += &format!(
            "[[drivers.bus.options.emulated.devices]]\nkind = \"drive\"\ndrift_ppm = {:.1}\ndrive = {{ brake_open_ms = {:.1} }}\n",
            random.between(-100.0, 100.0),
            random.between(0.0, 60.0)
        );
    }
    (text, counts)
}

/// Lines that move all axes, and where they end, as they are written.
fn program(random: &mut Random) -> (String, Vec<f64>) {
    let mut text = "G21 G90 G94\n".to_string();
    let mut end = vec![];
    for _ in 0..8 {
        end = LETTERS.map(|_| random.between(-10.0, 10.0)).to_vec();
        text += "G1";
        for (axis, place) in LETTERS.iter().zip(&mut end) {
            *place = (*place * 1e4).round() / 1e4;
            text += &format!(" {}{place:.4}", axis.to_uppercase());
        }
        text += &format!(" F{:.0}\n", random.between(500.0, 6000.0));
    }
    // The drives follow, and settle.
    (text + "G4 P0.5\nM2\n", end)
}

#[test]
fn eight_drives_of_any_machine_drive_a_program_within_their_limits_to_its_end() {
    for seed in 1..=3 * seeds() {
        let mut random = Random::new(seed);
        let (text, counts) = machine(&mut random);
        let (program, end) = program(&mut random);
        let ran = ran_with(&text, &program, Switches::default());
        let case = format!("seed {seed}");
        assert_eq!(ran.fault, None, "{case}\n{text}{program}");
        judge(&case, &text, &ran.samples);
        let last = ran.samples.0.last().unwrap();
        for (index, axis) in LETTERS.into_iter().enumerate() {
            let scale = if is_rotary(axis) {
                1f64.to_radians()
            } else {
                1.0
            };
            let end = end[index] * scale;
            let [command, feedback] = [last.command[index], last.feedback[index]];
            assert!(
                (command - end).abs() < 1e-9,
                "{case}: {axis} {command} {end}"
            );
            // The setpoint is rounded to counts.
            let off_counts = (feedback - end).abs() / counts[index];
            assert!(
                off_counts <= 0.51,
                "{case}: {axis} stands at {feedback}, {off_counts} counts off"
            );
        }
    }
}
