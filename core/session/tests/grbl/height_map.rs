//! What probing wizards and height maps send: jogs to a place, a fast and a slow touch, the place from `[PRB:…]`, and the
//! program bent over what was found.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::sync::{Arc, Mutex};

use tandem_machine::Machine;
use tandem_rig::Random;
use tandem_session::controller::VirtualSender;

use crate::speak::{ENABLED_BY, field, lines_when_enabled, serve, state};

/// Places a side, and their distance, mm.
const SIDE: usize = 5;
const STEP_MM: f64 = 15.0;

/// The surface of a part that lies askew.
#[derive(Clone, Copy)]
struct Plane {
    z_mm: f64,
    slope: [f64; 2],
}

impl Plane {
    fn height(self, [x, y]: [f64; 2]) -> f64 {
        self.z_mm + self.slope[0] * x + self.slope[1] * y
    }
}

fn places() -> Vec<[f64; 2]> {
    let place = |nth: usize| [(nth % SIDE) as f64 * STEP_MM, (nth / SIDE) as f64 * STEP_MM];
    (0..SIDE * SIDE).map(place).collect()
}

/// A mill with a probe over that surface: a pillar of its height under each place.
fn machine(plane: Plane, latches: bool) -> Machine {
    let folder = tempfile::tempdir().unwrap();
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines");
    let base = examples.canonicalize().unwrap().join("mill-3axis.toml");
    let mut text = format!(
        "format = 1\ninclude = [\"{}\"]\n[probe]\ninput = 3\n[driver.options]\nlatches = {latches}\n",
        base.display()
    );
    for [x, y] in places() {
        let high = plane.height([x, y]);
        // A string takes whatever is written to it.
        let _ = write!(
            text,
            "[[driver.options.switches]]\ninput = 3\nlow_mm = [{:.3}, {:.3}, -90]\nhigh_mm = [{:.3}, {:.3}, {high:.9}]\nbounce_periods = 3\n",
            x - 1.0,
            y - 1.0,
            x + 1.0,
            y + 1.0
        );
    }
    let path = folder.path().join("plate.toml");
    std::fs::write(&path, text).unwrap();
    Machine::read(&path, &[]).unwrap()
}

/// What is to be done next, when the one before is over.
enum Step {
    /// A line, and its answer.
    Line(String),
    /// A touch, whose place is kept.
    Touch(String),
    /// What moves comes to its end: reports are asked for until one says so.
    Stand,
}

/// What has to come before the next step.
#[derive(PartialEq)]
enum Waits {
    Nothing,
    Answer,
    Standstill,
}

#[derive(Default)]
struct Found {
    /// Machine coordinates, mm.
    places: Vec<[f64; 3]>,
    errors: Vec<String>,
    end: Option<String>,
}

struct Wizard {
    steps: VecDeque<Step>,
    waits: Waits,
    /// Millimetres of the unit of lines and reports.
    unit_mm: f64,
    /// The next place to be told counts.
    keeps: bool,
    /// The program has been bent over the surface.
    has_followed: bool,
    partial: String,
    found: Arc<Mutex<Found>>,
}

impl Wizard {
    fn new(inches: bool) -> (Box<Self>, Arc<Mutex<Found>>) {
        let (units, unit_mm) = if inches { ("G20", 25.4) } else { ("G21", 1.0) };
        let mm = |value: f64| format!("{:.5}", value / unit_mm);
        let line = |text: String| Step::Line(text);
        let mut steps = VecDeque::from([line(format!("$13={}", u8::from(inches)))]);
        for [x, y] in places() {
            let feed = mm(3000.0);
            steps.extend([
                line(format!("$J=G90{units}Z{}F{feed}", mm(3.0))),
                Step::Stand,
                line(format!("$J=G90{units}X{}Y{}F{feed}", mm(x), mm(y))),
                Step::Stand,
                // Fast to find it, back, and slowly to measure it.
                line(format!("{units}G91G38.2Z{}F{}", mm(-25.0), mm(300.0))),
                line(format!("G0Z{}", mm(1.5))),
                Step::Touch(format!("G38.2Z{}F{}", mm(-3.0), mm(60.0))),
                line(format!("G0Z{}", mm(2.0))),
                line("G90".into()),
                Step::Stand,
            ]);
        }
        let found = Arc::<Mutex<Found>>::default();
        let wizard = Self {
            steps,
            waits: Waits::Nothing,
            unit_mm,
            keeps: false,
            has_followed: false,
            partial: String::new(),
            found: Arc::clone(&found),
        };
        (Box::new(wizard), found)
    }

    /// The lines of a program that stays half a millimetre over the surface.
    fn follow(&mut self) {
        let mm = |value: f64| format!("{:.5}", value / self.unit_mm);
        let line = |[x, y, z]: &[f64; 3]| {
            let (x, y, z) = (mm(*x), mm(*y), mm(*z + 0.5));
            Step::Line(format!("G1X{x}Y{y}Z{z}F{}", mm(2000.0)))
        };
        let places = &self.found.lock().unwrap().places;
        self.steps.extend(places.iter().map(line));
        self.steps.push_back(Step::Stand);
        self.has_followed = true;
    }

    fn hear(&mut self, line: &str) {
        let mut found = self.found.lock().unwrap();
        if let Some(place) = line.strip_prefix("[PRB:").filter(|_| self.keeps) {
            let (place, touched) = place.trim_end_matches(']').rsplit_once(':').unwrap();
            assert_eq!(touched, "1");
            let numbers = place
                .split(',')
                .map(|n| n.parse::<f64>().unwrap() * self.unit_mm);
            found
                .places
                .push(numbers.collect::<Vec<_>>().try_into().unwrap());
            self.keeps = false;
        } else if line.starts_with("error") || line.starts_with("ALARM") {
            found.errors.push(line.to_string());
        } else if line.starts_with('<') {
            found.end = field(line, "MPos").map(str::to_string);
        }
        let is_over = match self.waits {
            Waits::Nothing => false,
            Waits::Answer => line == "ok",
            Waits::Standstill => line.starts_with('<') && state(line) == "Idle",
        };
        if is_over {
            self.waits = Waits::Nothing;
        }
    }
}

impl VirtualSender for Wizard {
    fn period(&mut self, tick: u64, heard: &str, say: &mut Vec<u8>) -> bool {
        for line in lines_when_enabled(&mut self.partial, tick, heard) {
            self.hear(&line);
        }
        if tick < ENABLED_BY {
            return true;
        }
        if !self.found.lock().unwrap().errors.is_empty() {
            return false;
        }
        if self.waits != Waits::Nothing {
            if tick.is_multiple_of(25) && self.waits == Waits::Standstill {
                say.push(b'?');
            }
            return true;
        }
        if self.steps.is_empty() && !self.has_followed {
            self.follow();
        }
        self.waits = Waits::Answer;
        match self.steps.pop_front() {
            Some(Step::Line(line)) => say.extend(format!("{line}\n").into_bytes()),
            Some(Step::Touch(line)) => {
                self.keeps = true;
                say.extend(format!("{line}\n").into_bytes());
            }
            Some(Step::Stand) => self.waits = Waits::Standstill,
            None => return false,
        }
        true
    }
}

#[test]
fn a_height_map_of_an_askew_surface_is_what_the_surface_is() {
    let first = std::env::var("TANDEM_SEED").map_or(0, |seed| seed.parse().unwrap());
    let count = if std::env::var_os("TANDEM_SEED").is_some() {
        1
    } else {
        3
    };
    for seed in first..first + count {
        println!("TANDEM_SEED={seed}");
        let mut random = Random::new(seed);
        let plane = Plane {
            z_mm: random.between(-12.0, -4.0),
            slope: [0; 2].map(|_| random.between(-0.05, 0.05)),
        };
        let machine = machine(plane, seed % 2 == 0);
        let (wizard, found) = Wizard::new(seed % 3 == 2);
        let unit_mm = wizard.unit_mm;
        serve(&machine, vec![wizard], vec![]);
        let found = found.lock().unwrap();
        assert_eq!(found.errors, [""; 0]);
        assert_eq!(found.places.len(), SIDE * SIDE);
        let mut worst_mm = 0.0_f64;
        for ([x, y, z], place) in found.places.iter().zip(places()) {
            assert!(
                (x - place[0]).abs() < 0.003 && (y - place[1]).abs() < 0.003,
                "{x} {y} {place:?}"
            );
            worst_mm = worst_mm.max((z - plane.height(place)).abs());
        }
        println!("the worst of {} places: {worst_mm:.4} mm", SIDE * SIDE);
        assert!(worst_mm < 0.005, "{worst_mm} mm");
        let end = found.end.as_ref().unwrap().split(',').nth(2).unwrap();
        let over_mm =
            end.parse::<f64>().unwrap() * unit_mm - plane.height(places()[SIDE * SIDE - 1]);
        assert!(
            (over_mm - 0.5).abs() < 0.006,
            "it ends {over_mm} mm over the surface"
        );
    }
}
