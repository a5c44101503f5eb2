//! Homing as machine builders need it, on random machines: gantries square themselves, axes of one number home together, an index
//! pulse counts instead of a switch. Named inputs say where the joints really stand.

use std::fmt::Write as _;
use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use serde_json::{Value, json};
use tandem_gcode::Program;
use tandem_host::{Clock, Run, RunObserver, Switches};
use tandem_machine::Machine;
use tandem_rig::Random;
use tandem_rings::{Controls, Sample};
use tandem_sdk::{Event, EventKind};
use tandem_session::HOMING;
use tandem_session::controller::NoPersistence;

use crate::support::{Says, Told, registry};

/// How a joint is homed, mm and mm/s.
#[derive(Clone, Debug)]
struct Joint {
    name: &'static str,
    /// Its number among the drives.
    drive: usize,
    input: u32,
    inverted: bool,
    bounce_periods: u64,
    search: f64,
    latch: f64,
    back_off: f64,
    switch_mm: f64,
    sequence: u32,
    /// An index pulse behind the switch, and how far.
    index_mm: Option<f64>,
}

/// A portal with a joint at each foot of Y.
#[derive(Debug)]
struct Portal {
    period_ms: f64,
    acceleration: f64,
    seed: u64,
    unknown_mm: f64,
    max_skew_mm: f64,
    joints: Vec<Joint>,
    /// Where the axes go home.
    home: [f64; 3],
}

impl Portal {
    fn draw(random: &mut Random) -> Self {
        let acceleration = random.length(200.0, 5000.0);
        let unknown_mm = random.between(0.2, 6.0);
        let mut joint = |name, drive, sequence| {
            let back = random.below(2) == 0;
            let (search, latch) = (random.between(5.0, 40.0), random.between(0.3, 2.0));
            Joint {
                name,
                drive,
                input: 10 + drive as u32,
                inverted: random.below(2) == 0,
                bounce_periods: random.below(6),
                search: if back { -search } else { search },
                latch,
                // Further than the search runs on.
                back_off: search * search / acceleration + random.between(0.5, 3.0),
                switch_mm: if back { -110.0 } else { 110.0 } + random.between(-3.0, 3.0),
                sequence,
                index_mm: None,
            }
        };
        let (x, mut y1, mut y2, z) = (
            joint("x", 0, 2),
            joint("y1", 1, 2),
            joint("y2", 2, 2),
            joint("z", 3, 1),
        );
        // The feet move alike; their switches do not stand alike.
        (y2.search, y2.latch, y2.back_off) = (y1.search, y1.latch, y1.back_off);
        let between = random.between(-2.0, 2.0);
        y2.switch_mm = y1.switch_mm + between;
        if random.below(2) == 0 {
            // Nothing of it depends on which foot is ahead.
            std::mem::swap(&mut y1.switch_mm, &mut y2.switch_mm);
        }
        Self {
            period_ms: random.pick(&[0.5, 1.0, 2.0]),
            acceleration,
            seed: random.below(1_000_000),
            unknown_mm,
            max_skew_mm: 2.0 * unknown_mm + between.abs() + 0.5,
            joints: vec![x, y1, y2, z],
            home: std::array::from_fn(|_| random.between(-50.0, 50.0)),
        }
    }

    fn home_of(&self, joint: &Joint) -> f64 {
        self.home[["x", "y", "z"]
            .iter()
            .position(|axis| joint.name.starts_with(axis))
            .unwrap()]
    }

    /// How far from its place a joint may stand: it is taken where it was fed back, a joint that trips while another comes to
    /// rest where it was when that one did, and while a switch bounces it may say that it is off.
    fn tolerance_mm(&self, joint: &Joint) -> f64 {
        let periods = 4.0 + joint.bounce_periods as f64;
        joint.latch * joint.latch / self.acceleration
            + periods * joint.latch * self.period_ms * 1e-3
            + 1e-6
            + 4.0 * joint.latch * self.period_ms * 1e-3
            + 1e-6
    }

    fn text(&self) -> String {
        let mut text = format!(
            "format = 1\n[machine]\nname = \"portal\"\nrequire_homing = true\n\
             [loops]\nrough_period_ms = 8\nfine_period_ms = {}\n[motion]\npath_tolerance_mm = 0.01\n",
            self.period_ms
        );
        for (axis, home) in ["x", "y", "z"].iter().zip(self.home) {
            let skew = if *axis == "y" {
                format!("max_skew_mm = {}\n", self.max_skew_mm)
            } else {
                String::new()
            };
            write!(
                text,
                "[axes.{axis}]\ntravel_mm = [-100, 100]\nhome_mm = {home}\nmax_feed_mm_per_min = 6000\n\
                 max_acceleration_mm_per_s2 = {}\n{skew}",
                self.acceleration
            )
            .unwrap();
        }
        text += "[joints.y1]\naxis = \"y\"\n[joints.y2]\naxis = \"y\"\n";
        text += "[planner]\nplugin = \"look-ahead\"\n[driver]\nplugin = \"sim\"\n";
        write!(
            text,
            "[driver.options]\nunknown_start_mm = {}\nseed = {}\n",
            self.unknown_mm, self.seed
        )
        .unwrap();
        for joint in &self.joints {
            let back = joint.search < 0.0;
            // An inverted switch is closed until the joint stands on it.
            let side = if back == joint.inverted {
                "above_mm"
            } else {
                "below_mm"
            };
            write!(
                text,
                "[[driver.options.switches]]\ninput = {}\njoint = {}\n{side} = {}\nbounce_periods = {}\n",
                joint.input, joint.drive, joint.switch_mm, joint.bounce_periods
            )
            .unwrap();
            let (home, near) = (self.home_of(joint), self.tolerance_mm(joint));
            for (which, side, at) in [(20, "above_mm", home - near), (30, "below_mm", home + near)]
            {
                write!(
                    text,
                    "[[driver.options.switches]]\ninput = {}\njoint = {}\n{side} = {at}\n",
                    which + joint.drive,
                    joint.drive
                )
                .unwrap();
            }
        }
        for joint in &self.joints {
            write!(
                text,
                "[homing.{}]\nsequence = {}\ninput = {}\ninvert = {}\nsearch_mm_per_min = {}\nlatch_mm_per_min = {}\n\
                 back_off_mm = {}\n",
                joint.name,
                joint.sequence,
                joint.input,
                joint.inverted,
                joint.search * 60.0,
                joint.latch * 60.0,
                joint.back_off
            )
            .unwrap();
            match joint.index_mm {
                Some(index_mm) => writeln!(
                    text,
                    "index_input = 40\nindex_mm = {index_mm}\nindex_within_mm = 6"
                ),
                None => writeln!(text, "switch_mm = {}", joint.switch_mm),
            }
            .unwrap();
            for (which, word) in [(20, "above"), (30, "below")] {
                let name = format!("{}_{word}", joint.name);
                write!(text, "[inputs.{name}]\ninput = {}\n", which + joint.drive).unwrap();
            }
        }
        text
    }

    fn machine(&self) -> Machine {
        machine(&self.text())
    }
}

fn machine(text: &str) -> Machine {
    let mut file = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
    file.write_all(text.as_bytes()).unwrap();
    Machine::read(file.path(), &[]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The status once the machine of `text` has had time to home.
fn status_after_homing(portal: &Portal, text: &str) -> Value {
    let ticks = |seconds: f64| (seconds * 1e3 / portal.period_ms) as u64;
    let mut says = Says::new();
    says.ask(ticks(2.0), "home", json!({}));
    let after = says.ask(ticks(200.0), "status", json!({}));
    Told::by(&machine(text), says, |_| (), Box::new(NoPersistence))
        .ok(after)
        .clone()
}

/// Homes, and asks; homes again from a place away from home, and asks.
fn homed(portal: &Portal) -> (Told, [u64; 4]) {
    let ticks = |seconds: f64| (seconds * 1e3 / portal.period_ms) as u64;
    let mut says = Says::new();
    let home = says.ask(ticks(2.0), "home", json!({}));
    let first = says.ask(ticks(150.0), "status", json!({}));
    let line = says.ask(10, "mdi", json!({ "line": "G1 X20 Y-30 Z5 F3000" }));
    says.ask(ticks(10.0), "home", json!({}));
    let again = says.ask(ticks(150.0), "status", json!({}));
    let told = Told::by(&portal.machine(), says, |_| (), Box::new(NoPersistence));
    (told, [home, first, line, again])
}

/// Every joint stands at home within what the feed at which its switch is taken allows: the gantry is square to that.
#[test]
fn random_gantries_square_themselves_and_axes_of_one_number_home_together() {
    let mut random = Random::from_the_clock();
    for _ in 0..12 {
        let portal = Portal::draw(&mut random);
        let (told, [home, first, line, again]) = homed(&portal);
        for id in [home, line] {
            told.ok(id);
        }
        for id in [first, again] {
            let status = told.ok(id);
            assert_eq!(
                (status["state"].as_str(), &status["not_homed"]),
                (Some("ready"), &json!([])),
                "{portal:?} {status}"
            );
            let inputs = status["inputs"].as_object().unwrap();
            assert!(
                inputs.len() == 8 && inputs.values().all(|near| near == true),
                "{portal:?} {inputs:?}"
            );
            for (axis, home) in ["x_mm", "y_mm", "z_mm"].iter().zip(portal.home) {
                assert_eq!(status["position"][axis], json!(home), "{portal:?}");
            }
        }
        // Z alone comes first; X and both feet of Y are found in one go.
        let driven = told.events("job");
        assert!(
            driven.iter().all(|job| job["job"]["outcome"] == "done"),
            "{portal:?}"
        );
    }
}

/// A foot whose switch is dead goes on alone no further than the gantry may be askew, and is named.
#[test]
fn a_dead_switch_of_a_gantry_racks_it_no_further_than_it_may_be() {
    let mut random = Random::from_the_clock();
    for dead in ["y1", "y2", "y1", "y2"] {
        let mut portal = Portal::draw(&mut random);
        let broken = portal
            .joints
            .iter_mut()
            .find(|joint| joint.name == dead)
            .unwrap();
        let input = broken.input;
        let text = portal.text();
        // Its switch lies where nothing comes.
        let joint = portal
            .joints
            .iter()
            .find(|joint| joint.name == dead)
            .unwrap();
        let lies = format!("_mm = {}\nbounce_periods", joint.switch_mm);
        let far = if joint.search < 0.0 { -1e5 } else { 1e5 };
        let text = text.replacen(&lies, &format!("_mm = {far}\nbounce_periods"), 1);
        let status = status_after_homing(&portal, &text);
        let fault = status["fault"]
            .as_str()
            .unwrap_or_else(|| panic!("{portal:?} {status}"));
        let expected = format!("homing {dead}: the switch on input {input} did not trip within");
        assert!(fault.contains(&expected), "{portal:?}: {fault}");
        assert!(
            fault.contains("another joint of the gantry"),
            "{portal:?}: {fault}"
        );
        assert_eq!(status["not_homed"], json!(["x", "y", "z"]));
    }
}

/// An abort while the gantry is askew leaves both feet where they are, and the next homing squares it.
#[test]
fn an_abort_while_it_squares_itself_moves_nothing_and_the_next_homing_does_it() {
    let mut random = Random::from_the_clock();
    for _ in 0..4 {
        let portal = Portal::draw(&mut random);
        let ticks = |seconds: f64| (seconds * 1e3 / portal.period_ms) as u64;
        let mut says = Says::new();
        says.ask(ticks(2.0), "home", json!({}));
        let abort = says.ask(ticks(random.between(1.0, 40.0)), "abort", json!({}));
        let rests = says.ask(ticks(2.0), "status", json!({}));
        says.ask(10, "home", json!({}));
        let after = says.ask(ticks(200.0), "status", json!({}));
        let told = Told::by(&portal.machine(), says, |_| (), Box::new(NoPersistence));
        _ = told.answer(abort);
        let (rests, status) = (told.ok(rests), told.ok(after));
        assert_ne!(rests["state"], "fault", "{portal:?} {rests}");
        assert_eq!(status["state"], "ready", "{portal:?} {status}");
        let inputs = status["inputs"].as_object().unwrap();
        assert!(
            inputs.values().all(|near| near == true),
            "{portal:?} {inputs:?}"
        );
    }
}

/// An input that comes behind the switch: the drive catches its edge between two periods.
#[test]
fn an_index_pulse_counts_instead_of_the_switch_before_it() {
    let mut random = Random::from_the_clock();
    for there in [true, true, true, false] {
        let mut portal = Portal::draw(&mut random);
        let z = portal.joints.last_mut().unwrap();
        let way = z.search.signum();
        let pulse_mm = z.switch_mm + way * random.between(0.5, 5.0);
        z.index_mm = Some(pulse_mm);
        let at_mm = pulse_mm + if there { 0.0 } else { way * 40.0 };
        let side = if way < 0.0 { "below_mm" } else { "above_mm" };
        let mut text = portal.text();
        write!(
            text,
            "[[driver.options.switches]]\ninput = 40\njoint = 3\n{side} = {at_mm}\n"
        )
        .unwrap();
        let status = status_after_homing(&portal, &text);
        if there {
            assert_eq!(status["state"], "ready", "{portal:?} {status}");
            let near = ["z_above", "z_below"].map(|name| status["inputs"][name] == true);
            assert_eq!(near, [true, true], "{portal:?} {status}");
        } else {
            let fault = status["fault"].as_str().unwrap();
            assert!(
                fault.contains("homing z: no index pulse came on input 40 within 6.000 mm"),
                "{fault}"
            );
        }
    }
}

/// What a run in front of which a gantry squares itself was seen to do.
#[derive(Default)]
struct Seen {
    first: Option<Sample>,
    last: Option<Sample>,
    found: usize,
    /// Lines whose blocks were driven.
    driven: Vec<u32>,
    stops_at: Option<Arc<Controls>>,
}

impl RunObserver for Seen {
    fn event(&mut self, event: &Event) {
        self.found += usize::from(event.kind == EventKind::Correct);
        if let Some(controls) = self.stops_at.as_ref().filter(|_| self.found > 1) {
            controls.abort.store(true, Relaxed);
        }
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.first.get_or_insert(*sample);
        self.last = Some(*sample);
        if sample.feed_mm_per_s > 0.0 && self.driven.last() != Some(&sample.line) {
            self.driven.push(sample.line);
        }
    }
}

/// Whether every joint is at home, as the switches there say.
fn is_at_home(sample: &Sample) -> bool {
    let all = [20, 30].map(|first: u64| 0b1111 << first);
    let all = all[0] | all[1];
    sample.inputs & all == all
}

/// The program that is run behind homing: it goes elsewhere, and home again.
fn away_and_home(portal: &Portal) -> String {
    let [x, y, z] = portal.home;
    format!("G21 G90 F6000\nG1 X60 Y-40 Z20\nG1 Y45 X-30\nG1 X{x:.9} Y{y:.9} Z{z:.9}\nM2\n")
}

fn run_of(portal: &Portal, text: &str) -> (Run, Machine) {
    let machine = machine(text);
    let program = Program::spool("away.ngc", away_and_home(portal).as_bytes()).unwrap();
    let switches = Switches {
        home: Some(HOMING),
        ..Switches::default()
    };
    let run = Run::prepare(machine.clone(), &registry(), program, switches);
    (run.unwrap_or_else(|e| panic!("{portal:?} {e}")), machine)
}

/// A run of its own homes first: each foot of the gantry stands at home when the program begins, and again at its end.
#[test]
fn random_gantries_square_themselves_in_front_of_a_program() {
    let mut random = Random::from_the_clock();
    for _ in 0..4 {
        let portal = Portal::draw(&mut random);
        let (run, machine) = run_of(&portal, &portal.text());
        let mut seen = Seen::default();
        let outcome = run.drive(Clock::Virtual, &[], &mut seen).unwrap();
        assert_eq!(outcome.summary.fault, None, "{portal:?}");
        assert_eq!(
            (seen.found, &*seen.driven),
            (4, &[2, 3, 4][..]),
            "{portal:?}"
        );
        assert_eq!(outcome.summary.program, "away.ngc");
        let (first, last) = (seen.first.unwrap(), seen.last.unwrap());
        assert!(is_at_home(&first) && is_at_home(&last), "{portal:?}");
        assert_eq!(first.tick, 0, "the record begins with the program");
        for at in [&first, &last] {
            for axis in 0..3 {
                let off = (at.command[axis] - machine.home[axis]).abs();
                assert!(off <= 1e-8, "{portal:?}: {off}");
            }
        }
    }
}

/// What ends the homing ends the run: nothing of the program is driven.
#[test]
fn a_program_is_not_driven_behind_a_gantry_that_could_not_square_itself() {
    let mut random = Random::from_the_clock();
    for aborts in [true, false] {
        let portal = Portal::draw(&mut random);
        let foot = &portal.joints[1];
        let far = if foot.search < 0.0 { -1e5 } else { 1e5 };
        let lies = format!("_mm = {}\nbounce_periods", foot.switch_mm);
        let dead = portal
            .text()
            .replacen(&lies, &format!("_mm = {far}\nbounce_periods"), 1);
        let text = if aborts { portal.text() } else { dead };
        let (run, _) = run_of(&portal, &text);
        let mut seen = Seen {
            stops_at: aborts.then(|| run.controls()),
            ..Seen::default()
        };
        let outcome = run.drive(Clock::Virtual, &[], &mut seen).unwrap();
        let told = [&outcome.summary.fault, &outcome.summary.stopped];
        let expected = [
            (!aborts).then_some("homing y1: the switch on input"),
            aborts.then_some("stopped by the operator before the first line"),
        ];
        for (told, expected) in told.into_iter().zip(expected) {
            let words = told.as_deref();
            let fits = expected.is_none_or(|part| words.is_some_and(|words| words.contains(part)));
            assert!(
                fits && words.is_some() == expected.is_some(),
                "{portal:?} {told:?}"
            );
        }
        assert!(seen.driven.is_empty(), "{portal:?} {:?}", seen.driven);
    }
}

/// In real time the program takes over between two periods: no drive that watches its master is left alone meanwhile.
#[test]
fn a_gantry_squares_itself_in_front_of_a_program_in_real_time() {
    let mut random = Random::from_the_clock();
    let mut portal = Portal::draw(&mut random);
    (portal.period_ms, portal.acceleration, portal.unknown_mm) = (1.0, 2000.0, 0.3);
    (portal.max_skew_mm, portal.home) = (2.0, [0.0; 3]);
    for joint in &mut portal.joints {
        (joint.search, joint.latch, joint.back_off) = (40.0_f64.copysign(joint.search), 2.0, 1.4);
        joint.switch_mm = 2.0_f64.copysign(joint.search);
    }
    // How late a busy computer wakes the loop is asked by other tests.
    let text = portal.text().replace(
        "fine_period_ms = 1\n",
        "fine_period_ms = 1\nmax_missed_periods = 1000000\nmax_missed_share = 1\n",
    );
    let (run, _) = run_of(&portal, &text);
    let mut seen = Seen::default();
    let outcome = run.drive(Clock::Wall, &[], &mut seen).unwrap();
    assert_eq!(outcome.summary.fault, None, "{portal:?}");
    assert_eq!(
        (seen.found, &*seen.driven),
        (4, &[2, 3, 4][..]),
        "{portal:?}"
    );
    let (first, last) = (seen.first.unwrap(), seen.last.unwrap());
    assert!(is_at_home(&first) && is_at_home(&last), "{portal:?}");
}
