//! What `check` passes is what `run` prepares: both look at the same machine, program and plugins.

use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tandem_gcode::Program;
use tandem_host::{HostError, Registry, Run, Switches, check_program};
use tandem_machine::Machine;
use tandem_sdk::{
    Attached, Driver, DriverContext, DriverDescription, Feedback, PluginError, RawOptions,
    Setpoint, local_plugin,
};
use tempfile::TempDir;

use crate::harness::{mill, root};
use crate::random::Random;
use crate::replay::for_each_seed;

const PROGRAM: &str = "G21 G90 G94\nF600\nG1 X1\nM2\n";

fn registry() -> Registry {
    let mut registry = Registry::default();
    let real = local_plugin!(driver "real" = Untouched::made);
    for plugin in [
        tandem_sim::PLUGIN,
        tandem_look_ahead::PLUGIN,
        tandem_smooth::PLUGIN,
        tandem_block_overlap::PLUGIN,
        tandem_nurbs::PLUGIN,
        tandem_after_interpolation::PLUGIN,
        tandem_force_control::PLUGIN,
        tandem_corexy::PLUGIN,
        tandem_delta::PLUGIN,
        tandem_scara::PLUGIN,
        tandem_wrapped_rotary::PLUGIN,
        real,
    ] {
        registry.register(plugin).unwrap();
    }
    registry
}

/// Why a machine is refused, or the errors of the program on it; nothing where it is taken.
fn refusal<T>(answer: Result<T, HostError>, errors: impl Fn(&T) -> String) -> String {
    match answer {
        Ok(taken) => errors(&taken),
        Err(HostError::Check(report)) => listed(&report),
        Err(refused) => refused.to_string(),
    }
}

fn listed(report: &tandem_gcode::CheckReport) -> String {
    report.diagnostics.iter().map(ToString::to_string).collect()
}

fn by_check(machine: &Machine) -> String {
    let program = Program::spool("p.ngc", PROGRAM.as_bytes()).unwrap();
    refusal(
        check_program(machine.clone(), &registry(), program, switches(machine)),
        listed,
    )
}

fn by_run(machine: &Machine) -> String {
    let program = Program::spool("p.ngc", PROGRAM.as_bytes()).unwrap();
    refusal(
        Run::prepare(machine.clone(), &registry(), program, switches(machine)),
        |_| String::new(),
    )
}

fn switches(machine: &Machine) -> Switches {
    Switches {
        home: machine.require_homing.then_some(tandem_session::HOMING),
        ..Switches::default()
    }
}

/// The machine files of the examples, each with a few lines changed, dropped or added: what `check` takes the run takes,
/// and what one refuses the other refuses in the same words.
#[test]
fn a_machine_file_that_the_check_takes_the_run_takes_too() {
    let folder = TempDir::new().unwrap();
    let mut names = vec![];
    for file in std::fs::read_dir(root().join("examples/machines")).unwrap() {
        let path = file.unwrap().path();
        std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
        names.push(path.file_name().unwrap().to_owned());
    }
    names.sort();
    let (mut taken, mut refused, mut unread, mut by_driver) = (0, 0, 0, 0);
    for_each_seed(
        "a_machine_file_that_the_check_takes_the_run_takes_too",
        600,
        |seed| {
            let mut random = Random::new(seed);
            let name = &names[random.below(names.len() as u64) as usize];
            let text = mutated(
                &std::fs::read_to_string(folder.path().join(name)).unwrap(),
                &mut random,
            );
            let path = folder.path().join("mutated.toml");
            std::fs::write(&path, &text).unwrap();
            let Ok(machine) = Machine::read(&path, &[]) else {
                unread += 1;
                return Ok(());
            };
            let (check, run) = (by_check(&machine), by_run(&machine));
            if check != run {
                return Err(format!("{name:?}\n{text}\ncheck: {check:?}\nrun: {run:?}"));
            }
            taken += u32::from(run.is_empty());
            refused += u32::from(!run.is_empty());
            by_driver += u32::from(run.contains("driver"));
            Ok(())
        },
    );
    println!(
        "{taken} taken, {refused} refused, {by_driver} of them for the driver, {unread} not read"
    );
    let all = std::env::var("TANDEM_SEED").is_err() && std::env::var("TANDEM_SEEDS").is_err();
    assert!(
        !all || taken > 20 && refused > 20 && by_driver > 5,
        "the mutations are not those that were meant"
    );
}

/// One to three changes.
fn mutated(text: &str, random: &mut Random) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
    let mut behind = String::new();
    for _ in 0..=random.below(3) {
        let at = random.below(lines.len() as u64) as usize;
        match random.below(4) {
            0 => drop(lines.remove(at)),
            1 | 2 => change(&mut lines[at], random),
            _ => add(&mut behind, random),
        }
    }
    lines.join("\n") + "\n" + &behind
}

/// Another value for the key of a line, if there is one on it.
fn change(line: &mut String, random: &mut Random) {
    const VALUES: [&str; 14] = [
        "0",
        "-1",
        "1e9",
        "1e-9",
        "nan",
        "inf",
        "7",
        "0.37",
        "\"x\"",
        "true",
        "[]",
        "[1, 2]",
        "\"sim\"",
        "\"smooth\"",
    ];
    let value = VALUES[random.below(VALUES.len() as u64) as usize];
    if let Some((key, _)) = line.clone().split_once('=') {
        *line = format!("{key}= {value}");
    }
}

/// A table of its own behind everything: what goes together with some machines and not with others.
fn add(behind: &mut String, random: &mut Random) {
    let number = random.below(9);
    let table = match random.below(9) {
        0 | 1 => {
            format!("[[driver.options.switches]]\ninput = {number}\njoint = {number}\nabove_mm = 1")
        }
        2 => format!("[driver.options]\nmodel = \"second-order\"\nnatural_frequency_hz = {number}"),
        3 => format!("[driver.options]\nmodel = \"servo\"\nwatchdog_periods = {number}"),
        4 => format!("[[faults.wrap]]\nkind = \"freeze\"\njoints = [{number}]\nat_call = 5"),
        5 => "[feed_strategy]\nplugin = \"force-control\"".to_string(),
        6 => "[policy]\nscript = \"nowhere.wasm\"".to_string(),
        7 => "[kinematics]\nplugin = \"corexy\"".to_string(),
        _ => format!("[planner.options]\nwindow = {number}"),
    };
    writeln!(behind, "{table}").unwrap();
}

/// Drives that move metal: made, asked what they are and whether they go with the machine, but never claimed.
struct Untouched;

static CLAIMED: AtomicU32 = AtomicU32::new(0);

impl Untouched {
    #[allow(clippy::unnecessary_wraps)] // the form of a constructor
    fn made(_options: &RawOptions) -> Result<Self, PluginError> {
        Ok(Self)
    }
}

impl Driver for Untouched {
    fn describe(&self) -> DriverDescription {
        DriverDescription {
            watches_following: 1,
            ..DriverDescription::real()
        }
    }
    fn check(&self, context: &DriverContext) -> Result<(), PluginError> {
        let fits = context.joint_count == 3;
        fits.then_some(())
            .ok_or_else(|| PluginError::of_option("joints", "it has three amplifiers"))
    }
    fn open(&mut self, _context: &DriverContext) -> Result<(), PluginError> {
        CLAIMED.fetch_add(1, Relaxed);
        Err(PluginError::fixed("the drives are claimed"))
    }
    fn start(&mut self) -> Result<Attached, PluginError> {
        CLAIMED.fetch_add(1, Relaxed);
        Ok(Attached::default())
    }
    fn exchange(
        &mut self,
        _setpoint: &Setpoint,
        _feedback: &mut Feedback,
    ) -> Result<(), PluginError> {
        CLAIMED.fetch_add(1, Relaxed);
        Ok(())
    }
    fn quick_stop(&mut self) {}
    fn stop(&mut self) -> Result<(), PluginError> {
        Ok(())
    }
}

#[test]
fn a_check_claims_no_drives_and_asks_whether_they_go_with_the_machine() {
    let on = |machine: &Path| {
        let settings = [("driver.plugin".to_string(), "real".to_string())];
        Machine::read(machine, &settings).unwrap()
    };
    assert_eq!(by_check(&on(&mill())), "");
    let four = by_check(&on(&root().join("examples/machines/mill-4axis.toml")));
    assert!(
        four.contains("driver.options.joints: driver real: it has three amplifiers"),
        "{four}"
    );
    assert_eq!(CLAIMED.load(Relaxed), 0);
    assert!(by_run(&on(&mill())).contains("the drives are claimed"));
}
