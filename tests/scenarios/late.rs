//! Periods that are not kept: what is said of them.

use std::path::Path;
use std::thread;
use std::time::Duration;

use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Run, Switches};
use tandem_machine::Machine;
use tandem_recorder::Summary;
use tandem_sdk::{
    Attached, AxisVector, Driver, DriverContext, DriverDescription, Feedback, PluginError,
    RawOptions, Setpoint, local_plugin,
};

use crate::harness::{Scenario, mill};

/// Drives whose exchange takes longer than the fine period.
struct Sleeper(usize, AxisVector);

impl Sleeper {
    #[allow(clippy::unnecessary_wraps)] // the form of a constructor
    fn made(_options: &RawOptions) -> Result<Self, PluginError> {
        Ok(Self(0, AxisVector::ZERO))
    }
}

impl Driver for Sleeper {
    fn describe(&self) -> DriverDescription {
        DriverDescription::simulated()
    }
    fn open(&mut self, context: &DriverContext) -> Result<(), PluginError> {
        (self.0, self.1) = (context.joint_count as usize, context.start_position);
        Ok(())
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        Ok(Attached::at(self.1))
    }
    fn exchange(
        &mut self,
        setpoint: &Setpoint,
        feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        thread::sleep(Duration::from_micros(1500));
        feedback.follow(setpoint, self.0);
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

fn driven(driver: &str, share: &str, clock: Clock) -> Summary {
    let mut registry = Registry::default();
    let sleeper = local_plugin!(driver "sleeper" = Sleeper::made);
    for plugin in [tandem_sim::PLUGIN, tandem_look_ahead::PLUGIN, sleeper] {
        registry.register(plugin).unwrap();
    }
    let settings = [
        ("driver.plugin", driver),
        ("loops.max_missed_periods", "100000"),
        ("loops.max_missed_share", share),
    ];
    let settings = settings.map(|(key, value)| (key.to_string(), value.to_string()));
    let machine = Machine::read(Path::new(&mill()), &settings).unwrap();
    let program = Program::spool("p.ngc", &b"G21 G90\nF6000\nG1 X10\nM2\n"[..]).unwrap();
    let run = Run::prepare(machine, &registry, program, Switches::default()).unwrap();
    run.drive(clock, &[], &mut ()).unwrap().summary
}

/// Thousands of periods went by without a sample: exit status 0, and nothing said outside of the summary.
#[test]
fn periods_that_go_by_without_a_sample_are_a_warning_that_names_the_cause() {
    let late = driven("sleeper", "1", Clock::Wall);
    assert_eq!(late.fault, None);
    // Every exchange takes a period and a half: each ends in a later period than the one it began in.
    assert!(
        late.missed_periods >= late.samples / 2,
        "{} of {}",
        late.missed_periods,
        late.samples
    );
    let exchange = late.exchange_us.unwrap();
    assert!(
        exchange.max >= 1500.0 && exchange.longer_than_period >= late.samples,
        "{exchange:?}"
    );
    let warnings = late.warnings();
    let (missed, words) = (late.missed_periods, &warnings[0]);
    assert!(
        words.starts_with(&format!("{missed} fine periods went by without a sample")),
        "{words}"
    );
    assert!(
        words.contains("the driver's exchange took longer than the period of 1 ms"),
        "{words}"
    );
    let timing = late.timing().unwrap();
    assert!(
        timing.contains(&format!(
            "missed periods {missed}, in motion {}",
            late.missed_in_motion
        )),
        "{timing}"
    );
    assert!(
        late.missed_in_motion > 20 && late.missed_in_motion <= missed,
        "{}",
        late.missed_in_motion
    );
}

/// Never so many in a row as would be a fault: the run went on as if the computer were fit for it.
#[test]
fn too_many_of_a_second_are_a_fault_that_names_the_cause_the_key_and_the_measurement() {
    let late = driven("sleeper", "0.02", Clock::Wall);
    let fault = late.fault.unwrap();
    assert!(
        fault.starts_with("the driver's exchange took longer than the period of 1 ms "),
        "{fault}"
    );
    assert!(
        fault.contains(
            "21 of the last 1000 fine periods went by without a sample while the machine moved"
        ),
        "{fault}"
    );
    assert!(
        fault.contains("loops.max_missed_share allows 20; `tandem latency` shows"),
        "{fault}"
    );
    assert!(late.missed_in_motion >= 21, "{}", late.missed_in_motion);
}

#[test]
fn where_every_period_is_kept_there_is_nothing_to_warn_of() {
    let kept = driven("sim", "0.01", Clock::Virtual);
    assert_eq!(
        (kept.warnings(), kept.timing(), kept.exchange_us),
        (vec![], None, None)
    );
}

/// The command prints both: the line of the periods always, the warning where there is something to warn of.
#[test]
fn the_outcome_of_a_run_in_real_time_says_how_periods_were_kept() {
    let wall = [
        "--clock",
        "wall",
        "--set",
        "loops.max_missed_periods=100000",
        "--set",
        "loops.max_missed_share=1",
    ];
    let done = Scenario::text("G21 G90\nF6000\nG1 X5\nM2\n")
        .with(&wall)
        .run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    let said = String::from_utf8_lossy(&done.output.stdout).into_owned();
    let (overruns, missed) = (done.number("overruns"), done.number("missed_periods"));
    assert!(
        said.contains(&format!(
            "overruns {overruns}, missed periods {missed}, in motion "
        )),
        "{said}"
    );
    let warned = done.errors().contains("warning: ");
    assert_eq!(warned, overruns + missed > 0.0, "{said}{}", done.errors());
}
