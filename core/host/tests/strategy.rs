//! What a feed strategy asks for acts in its tick: the first of the rough period after the next. The lesser of its ratio and
//! that of the policy script acts, times the override.

use std::path::Path;

use tandem_gcode::Program;
use tandem_host::{Clock, Registry, Run, RunObserver, Switches, Timed};
use tandem_machine::Machine;
use tandem_recorder::Summary;
use tandem_rings::Sample;
use tandem_sdk::{
    Answer, FeedStrategy, MAX_SIGNALS, PluginError, RawOptions, Request, StrategyContext, Window,
};

/// Rough period in whose samples the strategy finds what it acts on, and the tick in which that acts.
const PERIOD: u64 = 20;
const TICK: u64 = (PERIOD + 2) * 8;

/// Asks once for what its options say.
struct Once(String);

impl FeedStrategy for Once {
    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        let request = match (window.period == PERIOD, self.0.as_str()) {
            (true, "hold") => Request::Hold,
            // For as long as its cause lasts.
            _ if self.0 == "long hold" && (PERIOD..PERIOD + 40).contains(&window.period) => {
                Request::Hold
            }
            _ if self.0 == "long hold" && window.period == PERIOD + 60 => Request::Hold,
            (true, "fault") => Request::Fault(7),
            (true, "defect") => return Err(PluginError::fixed("it has lost its way")),
            _ => Request::None,
        };
        Ok(Answer {
            ratio: 1.0,
            request,
            signals: [0.0; MAX_SIGNALS],
        })
    }
}

#[allow(clippy::unnecessary_wraps)] // the form of a constructor
fn open(options: &RawOptions, _context: &StrategyContext) -> Result<Once, PluginError> {
    Ok(Once(options.0.split('"').nth(1).unwrap_or("").to_string()))
}

/// A ratio of its own, and from period 60 on a torque of twice the reference.
struct Loaded;

impl FeedStrategy for Loaded {
    fn signals(&self) -> &'static [&'static str] {
        &["reference_torque_nm", "cutting_torque_nm"]
    }

    fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
        let mut signals = [0.0; MAX_SIGNALS];
        (signals[0], signals[1]) = (3.0, if window.period < 60 { 3.0 } else { 6.0 });
        let ratio = if window.period < 120 { 0.8 } else { 0.2 };
        Ok(Answer {
            ratio,
            request: Request::None,
            signals,
        })
    }
}

#[allow(clippy::unnecessary_wraps)] // the form of a constructor
fn open_loaded(_options: &RawOptions, _context: &StrategyContext) -> Result<Loaded, PluginError> {
    Ok(Loaded)
}

#[derive(Default)]
struct Samples(Vec<Sample>, Vec<String>, Vec<String>);

impl RunObserver for Samples {
    fn note(&mut self, note: &str) {
        self.2.push(note.to_string());
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.0.push(*sample);
    }

    fn command(&mut self, command: &Timed) {
        self.1.push(command.to_string());
    }
}

fn driven(asks: &str, clock: Clock) -> (Summary, Samples) {
    let mut registry = Registry::default();
    let once = tandem_sdk::local_plugin!(feed_strategy "once" = open);
    for plugin in [tandem_look_ahead::PLUGIN, tandem_sim::PLUGIN, once] {
        registry.register(plugin).unwrap();
    }
    let settings = [
        ("feed_strategy.plugin", "once".to_string()),
        ("feed_strategy.options.asks", format!("\"{asks}\"")),
        ("loops.max_missed_periods", "100000".to_string()),
        ("loops.max_missed_share", "1".to_string()),
    ];
    let settings = settings.map(|(key, value)| (key.to_string(), value));
    let mill =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/mill-3axis.toml");
    let machine = Machine::read(&mill, &settings).unwrap();
    let program = Program::spool("line", &b"G21 G90\nF5000\nG1 X60\nM2\n"[..]).unwrap();
    let run = Run::prepare(machine, &registry, program, Switches::default()).unwrap();
    let mut samples = Samples::default();
    let commands = match asks {
        "hold" => vec!["400,resume"],
        "long hold" => vec!["560,resume", "700,resume"],
        _ => vec![],
    };
    let commands: Vec<_> = commands
        .into_iter()
        .map(|line| Timed::parse(line).unwrap())
        .collect();
    let commands = if clock == Clock::Virtual {
        commands
    } else {
        vec![]
    };
    let outcome = run.drive(clock, &commands, &mut samples).unwrap();
    (outcome.summary, samples)
}

#[test]
fn a_hold_acts_in_its_tick_and_is_resumed_like_any() {
    let (summary, samples) = driven("hold", Clock::Virtual);
    assert_eq!(
        (summary.fault, summary.late_ratios, summary.stop_count),
        (None, 0, 1)
    );
    let stop = &summary.stops[0];
    assert_eq!(
        (stop.tick, stop.cause, stop.reaction_periods),
        (TICK, "hold", Some(1))
    );
    assert_eq!(
        samples.1,
        [format!("{TICK},hold"), "400,resume".to_string()]
    );
    assert_eq!(summary.end_position_mm["x"], 60.0);
}

/// A strategy that asks in every period was told of in every period: thousands of lines a minute, without a reason.
#[test]
fn a_hold_that_is_asked_for_in_every_period_is_told_once() {
    let (summary, samples) = driven("long hold", Clock::Virtual);
    assert_eq!(summary.fault, None);
    let line =
        |tick: u64| format!("line 3: the feed strategy once asks for a hold, at tick {tick}");
    assert_eq!(samples.2, [line(TICK), line(TICK + 60 * 8)]);
}

#[test]
fn the_lesser_of_strategy_and_script_acts_times_the_override() {
    let mut registry = Registry::default();
    let loaded = tandem_sdk::local_plugin!(feed_strategy "loaded" = open_loaded);
    for plugin in [tandem_look_ahead::PLUGIN, tandem_sim::PLUGIN, loaded] {
        registry.register(plugin).unwrap();
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let script = root
        .join("scripts/policies/load-feed.wasm")
        .display()
        .to_string();
    let settings = [
        ("feed_strategy.plugin", "loaded".to_string()),
        ("policy.script", script),
    ];
    let settings = settings.map(|(key, value)| (key.to_string(), value));
    let machine =
        Machine::read(&root.join("examples/machines/mill-3axis.toml"), &settings).unwrap();
    let program = Program::spool("line", &b"G21 G90\nF1200\nG1 X14\nM2\n"[..]).unwrap();
    let run = Run::prepare(machine, &registry, program, Switches::default()).unwrap();
    let mut samples = Samples::default();
    let commands = [Timed::parse("1300,feed-override,0.5").unwrap()];
    let summary = run
        .drive(Clock::Virtual, &commands, &mut samples)
        .unwrap()
        .summary;
    let feed_mm_per_s = |tick: usize| samples.0[tick].feed_mm_per_s;
    // 20 mm/s are programmed. The script asks for 1, and from period 60 on, where torque is twice the reference, for 0.3.
    for (tick, expected) in [
        (440, 0.8 * 20.0),
        (920, 0.3 * 20.0),
        (1250, 0.2 * 20.0),
        (1500, 0.5 * 0.2 * 20.0),
    ] {
        assert!(
            (feed_mm_per_s(tick) - expected).abs() < 1e-9,
            "tick {tick}: {} mm/s",
            feed_mm_per_s(tick)
        );
    }
    let policy = summary.policy.unwrap();
    assert_eq!(
        (summary.fault, summary.late_ratios, policy.traps),
        (None, 0, 0)
    );
    assert!(
        policy.ratios_changed > 100 && policy.periods > policy.ratios_changed,
        "{policy:?}"
    );
}

#[test]
fn a_fault_and_a_defect_stop_on_the_path_in_their_tick() {
    for (asks, words) in [
        ("fault", "feed strategy once: fault 7"),
        ("defect", "feed strategy once: it has lost its way"),
    ] {
        let (summary, samples) = driven(asks, Clock::Virtual);
        assert!(
            summary
                .fault
                .as_ref()
                .is_some_and(|fault| fault.starts_with(words)),
            "{:?}",
            summary.fault
        );
        let stop = &summary.stops[0];
        assert_eq!(
            (stop.tick, stop.cause, stop.reaction_periods),
            (TICK, "soft fault", Some(1))
        );
        let last = samples.0.last().unwrap().command;
        assert!(last[1] == 0.0 && last[0] > 0.0 && last[0] < 60.0);
    }
}

#[test]
fn both_clocks_send_the_same_samples_up_to_the_fault() {
    let (_, expected) = driven("fault", Clock::Virtual);
    let (summary, samples) = driven("fault", Clock::Wall);
    let disturbed = summary.missed_periods + summary.starvations + summary.late_ratios;
    if disturbed > 0 {
        println!("not compared: this computer was late {disturbed} times");
        return;
    }
    let commands = |samples: &Samples| {
        samples
            .0
            .iter()
            .map(|s| (s.tick, s.command))
            .collect::<Vec<_>>()
    };
    assert!(commands(&samples) == commands(&expected));
}

/// Refuses, and says what it was told of the machine.
#[allow(clippy::unnecessary_wraps)] // the form of a constructor
fn tell(_options: &RawOptions, context: &StrategyContext) -> Result<Loaded, PluginError> {
    let joints = context.joints[..context.joint_count as usize].iter();
    let joints: Vec<String> = joints
        .map(|joint| {
            format!(
                "{} {}",
                joint.name.as_str(),
                joint.limits.acceleration_mm_per_s2
            )
        })
        .collect();
    Err(PluginError::new(format!(
        "{}; x {} mm/s; coolant {:?}, door {:?}, nothing {:?}",
        joints.join(", "),
        context.limits.axes()[0].feed_mm_per_s,
        context.analog_input("coolant_c"),
        context.digital_input("door"),
        context.digital_input("")
    )))
}

#[test]
fn a_strategy_is_told_joints_limits_and_the_names_of_inputs() {
    let mut registry = Registry::default();
    let told = tandem_sdk::local_plugin!(feed_strategy "told" = tell);
    for plugin in [tandem_look_ahead::PLUGIN, tandem_sim::PLUGIN, told] {
        registry.register(plugin).unwrap();
    }
    let settings = [
        ("feed_strategy.plugin", "told"),
        ("driver.analog", "[\"load\", \"coolant_c\"]"),
        ("inputs.door.input", "5"),
    ];
    let settings = settings.map(|(key, value)| (key.to_string(), value.to_string()));
    let gantry = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/machines/gantry.toml");
    let machine = Machine::read(&gantry, &settings).unwrap();
    let feed_mm_per_s = machine.limits.axes()[0].feed_mm_per_s;
    let program = Program::spool("line", &b"G21 G90\nF5000\nG1 X60\nM2\n"[..]).unwrap();
    let refused = Run::prepare(machine, &registry, program, Switches::default())
        .err()
        .unwrap()
        .to_string();
    let expected = format!("x {feed_mm_per_s} mm/s; coolant Some(1), door Some(5), nothing None");
    assert!(refused.contains(&expected), "{refused}");
    assert!(
        refused.contains("y1 ") && refused.contains(", y2 800"),
        "{refused}"
    );
}
