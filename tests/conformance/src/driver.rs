//! Drivers: a whole life, twice, and calls out of order.

use tandem_sdk::{AxisVector, Driver, DriverContext, Feedback, JointState, Plugin, PluginError, Setpoint};

use crate::machine::FINE_PERIOD_S;
use crate::report::Report;
use crate::timing::Timing;
use crate::{Setup, heap};

const JOINTS: usize = 3;
/// Fine periods of one life.
const PERIODS: u64 = 3000;
/// Fine periods within which the drives hold once they are enabled.
const PATIENCE: u64 = 1000;

/// Judges a driver.
pub fn judge(plugin: Plugin, setup: &Setup, report: &mut Report) {
    let open = |options: &str| plugin.driver(options);
    let Some(mut driver) = crate::open(setup, report, open) else { return };
    let simulated = driver.describe().simulated != 0;
    if !simulated && !setup.moves_metal {
        report.skip("lifecycle", "it says that it moves metal");
        return;
    }
    judge_order(plugin, setup, report);
    let mut timing = Timing::new("exchange");
    let Some(first) = live(driver.as_mut(), report, &mut timing) else { return };
    report.time([timing]);
    if !simulated {
        report.skip("determinism", "real drives do not repeat themselves");
        return;
    }
    report.judged("determinism");
    let again = open(&setup.options).ok().and_then(|mut d| live(d.as_mut(), report, &mut Timing::new("exchange")));
    if again.is_none_or(|again| again != first) {
        report.find("determinism", "the same setpoints get another feedback".to_string());
    }
}

/// Calls out of order may be refused, and must not panic.
fn judge_order(plugin: Plugin, setup: &Setup, report: &mut Report) {
    const CHECK: &str = "calls out of order";
    report.judged(CHECK);
    let Ok(mut driver) = plugin.driver(&setup.options) else { return };
    driver.quick_stop();
    let mut feedback = Feedback::default();
    let answers = [
        ("exchange before open", driver.exchange(&Setpoint::default(), &mut feedback)),
        ("start before open", driver.start().map(|_| ())),
        ("open", driver.open(&context())),
        ("exchange before start", driver.exchange(&Setpoint::default(), &mut feedback)),
        ("start", driver.start().map(|_| ())),
        ("stop", driver.stop()),
        ("stop once more", driver.stop()),
        ("exchange after stop", driver.exchange(&Setpoint::default(), &mut feedback)),
    ];
    for (what, answer) in answers {
        if let Err(error) = answer
            && error.is_panic()
        {
            report.find(CHECK, format!("{what}: {error}"));
        }
    }
}

fn context() -> DriverContext {
    let mut context = DriverContext::new(JOINTS, FINE_PERIOD_S);
    context.start_position = AxisVector::from_slice(&[1.0, -2.0, 3.0]);
    context
}

/// A whole life; the bits of all positions, none where it fails.
fn live(driver: &mut dyn Driver, report: &mut Report, timing: &mut Timing) -> Option<Vec<u64>> {
    const CHECK: &str = "lifecycle";
    report.judged(CHECK);
    let context = context();
    let mut fail = |method: &str, error: PluginError| {
        let check = if error.is_panic() { "panics" } else { CHECK };
        report.find(check, format!("{method}: {error}"));
    };
    driver.open(&context).map_err(|error| fail("open", error)).ok()?;
    driver.start().map_err(|error| fail("start", error)).ok()?;
    let mut life = Life::new(context.start_position);
    for tick in 0..PERIODS {
        let setpoint = life.setpoint(tick);
        let before = heap::uses();
        let answer = timing.of(|| driver.exchange(&setpoint, &mut life.feedback));
        if tick == QUICK_STOP {
            driver.quick_stop();
        }
        life.heap_uses += heap::uses() - before;
        answer.map_err(|error| fail(&format!("exchange, period {tick}"), error)).ok()?;
        life.look(tick);
    }
    driver.stop().map_err(|error| fail("stop", error)).ok()?;
    life.judge(report);
    Some(life.bits)
}

/// The periods of a quick stop, of letting go after it, and of holding again.
const QUICK_STOP: u64 = 1000;
const LET_GO: u64 = 1200;
const AGAIN: u64 = 1300;

struct Life {
    start: AxisVector,
    feedback: Feedback,
    setpoint: Setpoint,
    bits: Vec<u64>,
    heap_uses: u64,
    wrong: Option<String>,
}

impl Life {
    fn new(start: AxisVector) -> Self {
        let setpoint = Setpoint { position: start, ..Setpoint::default() };
        let bits = Vec::with_capacity(PERIODS as usize * JOINTS);
        Self { start, feedback: Feedback::default(), setpoint, bits, heap_uses: 0, wrong: None }
    }

    /// Rest, a smooth way out and back, a quick stop in the middle, letting go, a reset, and rest again.
    fn setpoint(&mut self, tick: u64) -> Setpoint {
        let moving = (200..QUICK_STOP).contains(&tick);
        let phase = if moving { (tick - 200) as f64 / (QUICK_STOP - 200) as f64 } else { 0.0 };
        let way = 5.0 * (std::f64::consts::PI * phase).sin().powi(2);
        let position = self.start + AxisVector::from_slice(&[way, -way, way / 2.0]);
        let velocity = (position - self.setpoint.position) * (1.0 / FINE_PERIOD_S);
        self.setpoint.acceleration = (velocity - self.setpoint.velocity) * (1.0 / FINE_PERIOD_S);
        (self.setpoint.position, self.setpoint.velocity, self.setpoint.tick) = (position, velocity, tick);
        self.setpoint.enable = u32::from(tick >= 10 && !(LET_GO..AGAIN).contains(&tick));
        self.setpoint.reset = u32::from(tick == AGAIN - 1);
        self.setpoint
    }

    fn look(&mut self, tick: u64) {
        let feedback = &self.feedback;
        self.bits.extend(feedback.position.0[..JOINTS].iter().map(|v| v.to_bits()));
        let numbers = [feedback.position, feedback.speed, feedback.current_a];
        if numbers.iter().any(|v| v.0[..JOINTS].iter().any(|v| !v.is_finite())) {
            self.wrong.get_or_insert(format!("period {tick}: the feedback has a number that is not finite"));
        }
        let holds = feedback.state[..JOINTS].iter().all(|state| *state == JointState::Enabled);
        if !holds && (tick == 190 || tick == AGAIN + PATIENCE) {
            self.wrong.get_or_insert(format!("period {tick}: the drives were enabled and do not hold: {:?}", {
                &feedback.state[..JOINTS]
            }));
        }
    }

    fn judge(&mut self, report: &mut Report) {
        report.judged("feedback");
        if let Some(words) = self.wrong.take() {
            report.find("feedback", words);
        }
        if !heap::counts() {
            report.skip("allocation", heap::NOT_COUNTED);
        } else if self.heap_uses > 0 {
            report.find("allocation", format!("exchange and quick_stop use the heap {} times", self.heap_uses));
        } else {
            report.judged("allocation");
        }
    }
}
