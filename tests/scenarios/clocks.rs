//! The same samples on both clocks, and on every run.

use crate::harness::{Done, Scenario, root};

/// The command samples as they stand in the trace, byte for byte.
fn commands(done: &Done) -> Vec<[String; 4]> {
    let columns = ["t_s", "x_cmd_mm", "y_cmd_mm", "z_cmd_mm"].map(|name| done.cells(name));
    (0..columns[0].len())
        .map(|row| columns.each_ref().map(|column| column[row].clone()))
        .collect()
}

const PROGRAMS: [&str; 2] = [
    "examples/programs/square.ngc",
    "tests/fixtures/programs/every-tick.ngc",
];

fn run(program: &str, clock: &str) -> Done {
    // On a computer without a real-time kernel periods are missed; that shifts the samples in time, not in value.
    let lenient = [
        "--set",
        "loops.max_missed_periods=1000000",
        "--set",
        "loops.max_missed_share=1",
        "--clock",
        clock,
    ];
    let done = Scenario::of(&root().join(program)).with(&lenient).run();
    assert_eq!(done.status(), 0, "{}", done.errors());
    done
}

#[test]
fn wall_and_virtual_clock_send_the_same_samples() {
    for program in PROGRAMS {
        let expected = commands(&run(program, "virtual"));
        // The promise holds where the queue never ran low; on a busy computer that may take more than one run.
        let wall = (0..10)
            .map(|_| run(program, "wall"))
            .find(|wall| wall.number("starvations") == 0.0);
        match wall {
            Some(wall) => assert!(commands(&wall) == expected, "{program}"),
            None => println!(
                "skipped: the queue ran low in each of ten runs of {program}; this computer is too busy"
            ),
        }
    }
}

#[test]
fn one_changed_bit_is_noticed() {
    let first = commands(&run(PROGRAMS[0], "virtual"));
    let mut second = commands(&run(PROGRAMS[0], "virtual"));
    assert!(first == second);
    let value: f64 = second[500][1].parse().unwrap();
    second[500][1] = format!("{:.16e}", f64::from_bits(value.to_bits() ^ 1));
    assert!(first != second);
}

mod with_a_strategy {
    use tandem_host::{Clock, Registry, Run, RunObserver};
    use tandem_machine::Machine;
    use tandem_rings::Sample;
    use tandem_sdk::{
        Answer, FeedStrategy, NoOptions, PluginError, Request, StrategyContext, Window,
    };

    use crate::harness::{mill, root};

    /// Asks for less feed the further X has come, as measured.
    struct Fading;

    impl FeedStrategy for Fading {
        fn signals(&self) -> &'static [&'static str] {
            &["measured_x_mm"]
        }

        fn update(&mut self, window: &Window) -> Result<Answer, PluginError> {
            let samples = window.samples();
            let x_mm = samples.iter().map(|s| s.position[0]).sum::<f64>() / samples.len() as f64;
            let mut signals = [0.0; 8];
            signals[0] = x_mm;
            Ok(Answer {
                ratio: 1.0 - x_mm / 40.0,
                request: Request::None,
                signals,
            })
        }
    }

    #[allow(clippy::unnecessary_wraps)] // the form of a constructor
    fn open(_options: &NoOptions, _context: &StrategyContext) -> Result<Fading, PluginError> {
        Ok(Fading)
    }

    #[derive(Default)]
    struct Kept(Vec<[u64; 4]>);

    impl RunObserver for Kept {
        fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
            let c = sample.command;
            self.0.push([
                sample.tick,
                c[0].to_bits(),
                c[1].to_bits(),
                sample.ratio.to_bits(),
            ]);
        }
    }

    fn run(clock: Clock) -> (Kept, bool) {
        let overrides = [
            ("feed_strategy.plugin", "fading"),
            ("loops.max_missed_periods", "1000000"),
            ("loops.max_missed_share", "1"),
        ];
        let machine = Machine::read(
            &mill(),
            &overrides.map(|(k, v)| (k.to_string(), v.to_string())),
        )
        .unwrap();
        let mut registry = Registry::default();
        registry.register(tandem_look_ahead::PLUGIN).unwrap();
        registry.register(tandem_sim::PLUGIN).unwrap();
        registry
            .register(tandem_sdk::local_plugin!(feed_strategy "fading" = open))
            .unwrap();
        let program =
            tandem_gcode::Program::open(&root().join("examples/programs/square.ngc")).unwrap();
        let mut kept = Kept::default();
        let outcome = Run::prepare(
            machine,
            &registry,
            program,
            tandem_host::Switches::default(),
        )
        .unwrap()
        .drive(clock, &[], &mut kept)
        .unwrap();
        let summary = outcome.summary;
        let in_time =
            summary.late_ratios == 0 && summary.starvations == 0 && summary.lost_samples == 0;
        (kept, in_time && summary.fault.is_none())
    }

    #[test]
    fn ratios_carry_their_tick_on_both_clocks() {
        let (expected, in_time) = run(Clock::Virtual);
        assert!(in_time);
        assert!(
            expected.0.iter().any(|s| f64::from_bits(s[3]) < 0.6),
            "the strategy had its way"
        );
        // The promise holds where no ratio was late; on a busy computer that may take more than one run.
        for _ in 0..10 {
            let (kept, in_time) = run(Clock::Wall);
            if in_time {
                assert!(kept.0 == expected.0);
                return;
            }
        }
        println!(
            "skipped: in ten runs on the wall clock a ratio was late each time; this computer is too busy"
        );
    }
}
