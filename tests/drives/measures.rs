//! What real drivers measure on their way to a feed strategy: inputs and analog values, each with its age.

use std::sync::{Mutex, PoisonError};

use tandem_host::{Clock, Run, Switches};
use tandem_sdk::{
    Answer, FeedStrategy, FineSample, MAX_SIGNALS, PluginError, RawOptions, Request,
    StrategyContext, Window, local_plugin,
};

use crate::double::{MEASURED_INPUTS, measured};
use crate::{SQUARE, machine, program, registry};

/// What the strategy of the only test here was shown.
static SEEN: Mutex<Vec<FineSample>> = Mutex::new(vec![]);

/// Keeps what it is shown, and asks for nothing.
struct Witness;

impl FeedStrategy for Witness {
    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        SEEN.lock()
            .unwrap_or_else(PoisonError::into_inner)
            .extend_from_slice(window.samples());
        Ok(Answer {
            ratio: 1.0,
            request: Request::None,
            signals: [0.0; MAX_SIGNALS],
        })
    }
}

#[allow(clippy::unnecessary_wraps)] // the form of a constructor
fn open(_options: &RawOptions, _context: &StrategyContext) -> Result<Witness, PluginError> {
    Ok(Witness)
}

/// What a strategy is shown of a machine with these drivers.
fn shown(drivers: &str) -> Vec<FineSample> {
    let text = format!(
        "{drivers}[loops]\nmax_missed_periods = 100000\nmax_missed_share = 1\n[feed_strategy]\nplugin = \"witness\"\n"
    );
    let mut registry = registry();
    registry
        .register(local_plugin!(feed_strategy "witness" = open))
        .unwrap();
    SEEN.lock().unwrap_or_else(PoisonError::into_inner).clear();
    let run = Run::prepare(
        machine(&text),
        &registry,
        program(SQUARE),
        Switches::default(),
    )
    .unwrap();
    assert_eq!(
        run.drive(Clock::Wall, &[], &mut ()).unwrap().summary.fault,
        None
    );
    SEEN.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// They never reached one: a strategy saw positions alone, and took old ones for new.
#[test]
fn inputs_and_analog_values_reach_a_strategy_with_their_ages_by_the_numbers_of_the_machine() {
    let plan = |name: &str, more: &str| {
        format!(
            "plugin = \"double\"\noptions = {{ name = \"measures-{name}\", real = true, {more} }}\n"
        )
    };
    let one = format!("[driver]\n{}", plan("one", "measures = true"));
    let two = format!(
        "[drivers.arm]\n{}joints = [\"a\", \"x\"]\nanalog = [0]\n\
         [drivers.bus]\n{}joints = [\"z\", \"y\"]\ninputs = [40, 41, 3]\nanalog = [2]\n",
        plan("arm", "stands_at = [0.0, 0.0]"),
        plan("bus", "measures = true")
    );
    // The machine's numbers of the inputs, of the analog value, and of the joint.
    for (drivers, lines, analog, joint) in [(one, [0, 1, 2], 0, 0), (two, [40, 41, 3], 2, 2)] {
        let seen = shown(&drivers);
        assert!(seen.len() > 1000, "{} samples", seen.len());
        for sample in &seen {
            let (inputs, ages, value, age) = measured(sample.tick);
            let bits = |of: &dyn Fn(usize) -> bool| {
                (0..MEASURED_INPUTS)
                    .filter(|own| of(*own))
                    .fold(0_u64, |bits, own| bits | 1 << lines[own])
            };
            assert_eq!(
                sample.inputs,
                bits(&|own| inputs >> own & 1 == 1),
                "{sample:?}"
            );
            assert_eq!(sample.old_inputs, bits(&|own| ages[own] > 0), "{sample:?}");
            assert_eq!(
                (sample.analog[analog], sample.analog[1]),
                (value, 0.0),
                "{sample:?}"
            );
            let mut expected = [0; tandem_sdk::MAX_AXES];
            expected[joint] = age;
            assert_eq!(
                (sample.age_periods, sample.is_new()),
                (expected, age == 0),
                "{sample:?}"
            );
        }
    }
}
