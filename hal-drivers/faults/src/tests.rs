//! Each kind of wrapper around a driver that writes down what it gets, and everything that is refused.

use std::sync::{Arc, Mutex};

use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, JointState, MAX_AXES,
    PluginError, Setpoint,
};

use crate::entry::Refusal;
use crate::options::{Faults, Joints};
use crate::wrapper::Wrapper;

/// The ticks that the drives got, shared with the test.
pub type Ticks = Arc<Mutex<Vec<u64>>>;

struct Scribe(Ticks);

impl Driver for Scribe {
    fn describe(&self) -> DriverDescription {
        DriverDescription::real()
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::default())
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        self.0.lock().unwrap().push(setpoint.tick);
        feedback.position = AxisVector([setpoint.tick as f64; MAX_AXES]);
        feedback.state = [JointState::Enabled; MAX_AXES];
        Ok(())
    }
    fn quick_stop(&mut self) {
        self.0.lock().unwrap().push(1000);
    }
    fn stop(&mut self) -> Result<(), PluginError> {
        self.0.lock().unwrap().push(2000);
        Err(PluginError::fixed("the brake is not on"))
    }
}

fn joints() -> Joints {
    let mut rotary = [false; MAX_AXES];
    rotary[2] = true;
    Joints { rotary, count: 3 }
}

fn read(text: &str) -> Result<Faults, Refusal> {
    Faults::read(&text.parse().unwrap(), &joints())
}

pub fn wrapped(text: &str) -> (Box<dyn Driver>, Ticks) {
    let ticks = Ticks::default();
    let faults = read(text).unwrap();
    let scribe: Box<dyn Driver> = Box::new(Scribe(Arc::clone(&ticks)));
    let mut driver = (0..).zip(faults.wrap).fold(scribe, |inner, (i, plan)| {
        Box::new(Wrapper::new(inner, plan, faults.seed, i))
    });
    driver.open(&DriverContext::new(3, 0.001)).unwrap();
    driver.start().unwrap();
    (driver, ticks)
}

/// What the drives got in ten exchanges, and what the first joint answered; -1 where the exchange failed.
fn ten(text: &str) -> (Vec<u64>, Vec<f64>) {
    let (mut driver, ticks) = wrapped(text);
    let answers = (0..10).map(|tick| {
        // A buffer of its own for each exchange: what it holds is the driver's doing.
        let mut feedback = Feedback::default();
        let setpoint = Setpoint {
            tick,
            ..Setpoint::default()
        };
        driver
            .exchange(&setpoint, &mut feedback)
            .map_or(-1.0, |()| feedback.position[0])
    });
    let answers = answers.collect();
    let got = ticks.lock().unwrap().clone();
    (got, answers)
}

#[test]
fn each_kind_does_what_it_says() {
    let cases: [(&str, &[u64], &[f64]); 6] = [
        (
            "kind = \"drop\"",
            &[0, 1, 2, 5, 6, 7, 8, 9],
            &[0., 1., 2., 2., 2., 5., 6., 7., 8., 9.],
        ),
        (
            "kind = \"duplicate\"",
            &[0, 1, 2, 2, 2, 5, 6, 7, 8, 9],
            &[0., 1., 2., 2., 2., 5., 6., 7., 8., 9.],
        ),
        (
            "kind = \"freeze\"",
            &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
            &[0., 1., 2., 2., 2., 5., 6., 7., 8., 9.],
        ),
        (
            "kind = \"freeze\"\njoint = 1",
            &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
            &[0., 1., 2., 3., 4., 5., 6., 7., 8., 9.],
        ),
        (
            "kind = \"corrupt\"\nmagnitude_mm = 0.5",
            &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
            &[0., 1., 2., 3.5, 4.5, 5., 6., 7., 8., 9.],
        ),
        (
            "kind = \"fail\"",
            &[0, 1, 2, 5, 6, 7, 8, 9],
            &[0., 1., 2., -1., -1., 5., 6., 7., 8., 9.],
        ),
    ];
    for (kind, got, answers) in cases {
        let at_call = format!("[[wrap]]\nat_call = 4\nperiods = 2\n{kind}\n");
        let window = format!("[[wrap]]\nfrom_tick = 3\nuntil_tick = 5\n{kind}\n");
        for text in [at_call, window] {
            assert_eq!(ten(&text), (got.to_vec(), answers.to_vec()), "{text}");
        }
    }
}

/// A frame that is lost is told as what it is; a value that is frozen goes on lying.
#[test]
fn what_is_dropped_is_old_and_what_is_frozen_says_that_it_is_new() {
    let ages = |kind: &str| {
        let (mut driver, _) = wrapped(&format!(
            "[[wrap]]\nkind = \"{kind}\"\nfrom_tick = 3\nuntil_tick = 6\n"
        ));
        let mut feedback = Feedback::default();
        let mut age = |tick| {
            driver
                .exchange(
                    &Setpoint {
                        tick,
                        ..Setpoint::default()
                    },
                    &mut feedback,
                )
                .unwrap();
            assert_eq!(
                u32::from(feedback.input_age_periods[63]),
                feedback.age_periods[0]
            );
            feedback.age_periods[2]
        };
        (1..8).map(&mut age).collect::<Vec<_>>()
    };
    assert_eq!(ages("drop"), [0, 0, 1, 2, 3, 0, 0]);
    assert_eq!(ages("freeze"), [0; 7]);
}

#[test]
fn a_delay_shifts_its_window_and_loses_what_it_holds_in_the_end() {
    let (got, answers) =
        ten("[[wrap]]\nkind = \"delay\"\nperiods = 2\nfrom_tick = 3\nuntil_tick = 8\n");
    assert_eq!(got, [0, 1, 2, 2, 2, 3, 4, 5, 8, 9]);
    assert_eq!(answers, [0., 1., 2., 2., 2., 3., 4., 5., 8., 9.]);
}

#[test]
fn wrappers_nest_and_the_first_is_next_to_the_drives() {
    let text = "[[wrap]]\nkind = \"duplicate\"\nat_call = 4\n[[wrap]]\nkind = \"corrupt\"\nat_call = 4\nmagnitude_mm = 9\n";
    assert_eq!(ten(text).1[3], 11.0, "the answer to tick 2, and 9");
}

#[test]
fn corruption_is_of_the_joint_named_and_in_its_unit() {
    let answer = |keys: &str| {
        let (mut driver, _) = wrapped(&format!(
            "[[wrap]]\nkind = \"corrupt\"\nat_call = 1\n{keys}\n"
        ));
        let mut feedback = Feedback::default();
        driver
            .exchange(&Setpoint::default(), &mut feedback)
            .unwrap();
        feedback.position.0
    };
    assert_eq!(
        answer("joint = 1\nmagnitude_mm = -0.5")[..4],
        [0.0, -0.5, 0.0, 0.0]
    );
    assert_eq!(
        answer("joint = 2\nmagnitude_deg = 180")[..3],
        [0.0, 0.0, std::f64::consts::PI]
    );
    assert_eq!(
        answer("value = \"nan\"").map(f64::is_nan)[..4],
        [true, true, true, false]
    );
    assert_eq!(
        answer("joint = 0\nvalue = \"inf\"")[..2],
        [f64::INFINITY, 0.0]
    );
}

#[test]
fn the_rest_passes_through_and_starting_again_starts_again() {
    let (mut driver, ticks) = wrapped("[[wrap]]\nkind = \"fail\"\nat_call = 1\n");
    assert_eq!(driver.describe(), DriverDescription::real());
    driver.quick_stop();
    assert_eq!(
        driver.stop().unwrap_err().to_string(),
        "the brake is not on"
    );
    assert_eq!(*ticks.lock().unwrap(), [1000, 2000]);
    for _ in 0..2 {
        driver.start().unwrap();
        assert!(
            driver
                .exchange(&Setpoint::default(), &mut Feedback::default())
                .is_err()
        );
        assert!(
            driver
                .exchange(&Setpoint::default(), &mut Feedback::default())
                .is_ok()
        );
    }
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let cases = [
        ("", "faults", "nothing is to go wrong"),
        ("sed = 7", "faults.sed", "did you mean `seed`?"),
        ("seed = -1", "faults.seed", "whole number"),
        ("wrap = 3", "faults.wrap", "[[faults.wrap]]"),
        ("wrap = [3]", "faults.wrap[0]", "table"),
        ("[[wrap]]", "faults.wrap[0]", "no kind"),
        (
            "[[wrap]]\nkind = \"frieze\"",
            "faults.wrap[0].kind",
            "did you mean `freeze`?",
        ),
        (
            "[[wrap]]\nkind = \"explode\"",
            "faults.wrap[0].kind",
            "there is drop, delay",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nevry = 3",
            "faults.wrap[0].evry",
            "did you mean `every`?",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\njoint = 0",
            "faults.wrap[0].joint",
            "does not go with kind = \"drop\"",
        ),
        (
            "[[wrap]]\nkind = \"drop\"",
            "faults.wrap[0]",
            "says not when",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nevery = 0",
            "faults.wrap[0].every",
            "from 1",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nevery = 2.5",
            "faults.wrap[0].every",
            "2.5",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nevery = 2\nat_call = 3",
            "faults.wrap[0].at_call",
            "contradicts every",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nat_call = 2\nfrom_tick = 3",
            "faults.wrap[0].from_tick",
            "contradicts at_call",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nevery = 2\nperiods = 2",
            "faults.wrap[0].periods",
            "never end",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nprobability = 1.5",
            "faults.wrap[0].probability",
            "0 to 1",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nprobability = nan",
            "faults.wrap[0].probability",
            "a number",
        ),
        (
            "[[wrap]]\nkind = \"drop\"\nfrom_tick = 5\nuntil_tick = 5",
            "faults.wrap[0].until_tick",
            "empty",
        ),
        ("[[wrap]]\nkind = \"delay\"", "faults.wrap[0]", "how late"),
        (
            "[[wrap]]\nkind = \"delay\"\nperiods = 1001",
            "faults.wrap[0].periods",
            "at most 1000",
        ),
        (
            "[[wrap]]\nkind = \"delay\"\nperiods = 2\nevery = 9",
            "faults.wrap[0].every",
            "does not go with",
        ),
        (
            "[[wrap]]\nkind = \"freeze\"\nat_call = 1\njoint = 3",
            "faults.wrap[0].joint",
            "0 to 2",
        ),
        (
            "[[wrap]]\nkind = \"corrupt\"\nat_call = 1",
            "faults.wrap[0]",
            "neither",
        ),
        (
            "[[wrap]]\nkind = \"corrupt\"\nat_call = 1\nvalue = \"NaN\"",
            "faults.wrap[0].value",
            "nan",
        ),
        (
            "[[wrap]]\nkind = \"corrupt\"\nat_call = 1\njoint = 2\nmagnitude_mm = 1",
            "faults.wrap[0].magnitude_mm",
            "rotary",
        ),
    ];
    for (text, key, words) in cases {
        let refused = read(text).unwrap_err();
        assert_eq!(refused.key, key, "{text}: {}", refused.cause);
        assert!(refused.cause.contains(words), "{text}: {}", refused.cause);
    }
}

/// What an entry may say, known and unknown, in any combination: an answer, never a panic.
#[test]
fn any_combination_of_keys_is_answered() {
    let values = [
        "0",
        "1",
        "-1",
        "9223372036854775807",
        "0.5",
        "nan",
        "\"nan\"",
        "[]",
        "{}",
        "true",
    ];
    let keys = [
        "every",
        "at_call",
        "probability",
        "periods",
        "joint",
        "from_tick",
        "until_tick",
        "magnitude_mm",
        "value",
    ];
    for kind in ["drop", "delay", "freeze", "duplicate", "corrupt", "fail"] {
        for (first, second) in keys
            .iter()
            .flat_map(|a| keys.iter().filter(move |b| *b != a).map(move |b| (a, b)))
        {
            for value in values {
                let _ = read(&format!(
                    "[[wrap]]\nkind = \"{kind}\"\n{first} = {value}\n{second} = 1\n"
                ));
            }
        }
    }
}
