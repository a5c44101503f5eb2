//! Drivers: a whole life as the host leads it, and calls out of order.

mod host;
mod pace;
mod watch;

use tandem_sdk::{
    AxisVector, Driver, DriverContext, DriverDescription, Feedback, MAX_ENABLE_S, Plugin,
    PluginError, Setpoint,
};

use crate::machine::FINE_PERIOD_S;
use crate::report::Report;
use crate::timing::Timing;
use crate::{Setup, heap};
use host::Host;
use pace::Pace;

const JOINTS: usize = 3;

/// Judges a driver.
pub fn judge(plugin: Plugin, setup: &Setup, report: &mut Report) {
    let open = |options: &str| plugin.driver(options);
    let Some(driver) = crate::open(setup, report, open) else {
        return;
    };
    let described = driver.describe();
    judge_description(&described, report);
    let simulated = described.simulated != 0;
    if !simulated && !setup.moves_metal {
        report.skip("lifecycle", "it says that it moves metal");
        return;
    }
    judge_order(plugin, setup, report);
    let mut timing = Timing::new("exchange");
    let Some(first) = live(driver, report, &mut timing) else {
        return;
    };
    report.time([timing]);
    if !simulated {
        report.skip("determinism", "real drives do not repeat themselves");
        return;
    }
    report.judged("determinism");
    let again = open(&setup.options)
        .ok()
        .and_then(|driver| live(driver, report, &mut Timing::new("exchange")));
    if again.is_none_or(|again| again != first) {
        report.find(
            "determinism",
            "the same setpoints get another feedback".to_string(),
        );
    }
}

/// Times that a host can wait for.
fn judge_description(described: &DriverDescription, report: &mut Report) {
    const CHECK: &str = "times for enabling and disabling";
    report.judged(CHECK);
    for (key, seconds) in [
        ("enable_s", described.enable_s),
        ("disable_s", described.disable_s),
    ] {
        if !(seconds > 0.0 && seconds <= MAX_ENABLE_S) {
            report.find(
                CHECK,
                format!("{key} is {seconds}: no time in which it could be done"),
            );
        }
    }
}

/// Calls out of order may be refused, and must not panic.
fn judge_order(plugin: Plugin, setup: &Setup, report: &mut Report) {
    const CHECK: &str = "calls out of order";
    report.judged(CHECK);
    let Ok(mut driver) = plugin.driver(&setup.options) else {
        return;
    };
    driver.quick_stop();
    let mut feedback = Feedback::default();
    let context = context(driver.describe().simulated == 0);
    let mut answers = vec![("check", driver.check(&context))];
    answers.push((
        "exchange before open",
        driver.exchange(&Setpoint::default(), &mut feedback),
    ));
    answers.push(("start before open", driver.start().map(|_| ())));
    answers.push(("open", driver.open(&context)));
    answers.push((
        "exchange before start",
        driver.exchange(&Setpoint::default(), &mut feedback),
    ));
    answers.push(("start", driver.start().map(|_| ())));
    driver.send(&Setpoint::default());
    answers.push(("stop", driver.stop()));
    answers.push(("stop once more", driver.stop()));
    answers.push((
        "exchange after stop",
        driver.exchange(&Setpoint::default(), &mut feedback),
    ));
    for (what, answer) in answers {
        if let Err(error) = answer
            && error.is_panic()
        {
            report.find(CHECK, format!("{what}: {error}"));
        }
    }
}

fn context(real_time: bool) -> DriverContext {
    let mut context = DriverContext::new(JOINTS, FINE_PERIOD_S);
    context.real_time = u32::from(real_time);
    context.start_position = AxisVector::from_slice(&[1.0, -2.0, 3.0]);
    context
}

/// A whole life; the bits of all positions, none where it fails.
fn live(mut driver: Box<dyn Driver>, report: &mut Report, timing: &mut Timing) -> Option<Vec<u64>> {
    const CHECK: &str = "lifecycle";
    report.judged(CHECK);
    let moves_metal = driver.describe().simulated == 0;
    let mut host = Host::new(driver.as_mut(), report, timing);
    if moves_metal {
        host.keep_to_the_clock(Pace::new());
    }
    let answer = host
        .open()
        .and_then(|()| first_day(&mut host))
        .and_then(|()| days_after(&mut host));
    let (bits, heap_uses) = host.leave();
    if let Err((method, error)) = answer {
        let check = if error.is_panic() { "panics" } else { CHECK };
        report.find(check, format!("{method}: {error}"));
        return None;
    }
    judge_words(driver.as_ref(), moves_metal, report);
    if !heap::counts() {
        report.skip("allocation", heap::NOT_COUNTED);
    } else if heap_uses > 0 {
        report.find(
            "allocation",
            format!("exchange and quick_stop use the heap {heap_uses} times"),
        );
    } else {
        report.judged("allocation");
    }
    Some(bits)
}

/// What a method has failed with.
type Failed = (String, PluginError);

/// Rest, a way out and back, a quick stop, letting go, holding again, silence, and the end.
fn first_day(host: &mut Host<'_>) -> Result<(), Failed> {
    host.start()?;
    host.wait(10)?;
    host.enable()?;
    host.hold(200)?;
    host.go()?;
    host.hold(100)?;
    host.quick_stop()?;
    host.disable()?;
    host.enable()?;
    host.hold(500)?;
    host.fall_silent()?;
    host.hold(400)?;
    host.disable()?;
    host.stop()
}

/// The driver is started again, as when the operator runs the next program.
fn days_after(host: &mut Host<'_>) -> Result<(), Failed> {
    for _ in 0..3 {
        host.start()?;
        host.wait(10)?;
        host.enable()?;
        host.hold(50)?;
        host.disable()?;
        host.stop()?;
    }
    Ok(())
}

/// Any code may be asked for.
fn judge_words(driver: &dyn Driver, real_time: bool, report: &mut Report) {
    const CHECK: &str = "words for codes";
    report.judged(CHECK);
    for code in [0, 1, 0x7210, 0xDEAD_BEEF, u32::MAX] {
        let _words = driver.explain(0, code);
    }
    // What has panicked is not asked again, and says so.
    if let Err(error) = driver.check(&context(real_time))
        && error.is_panic()
    {
        report.find(CHECK, error.to_string());
    }
}
