//! A bus with a clock of its own: every one of its pulses has to find a new setpoint.
//!
//! Both clocks are simulated: the computer's, which wakes late by a jitter and stalls, and the bus's, which drifts. All is drawn
//! from a seed.

use std::cell::Cell;
use std::rc::Rc;

use tandem_rig::Random;

use super::{Body, PeriodClock, PhaseSteering, Timing, run, steered};

/// Pulses of 120 s at 1 ms.
const PULSES: i64 = 120_000;
/// How long the loop takes into step, s: drives are not enabled by then, so pulses before that may stay empty.
const LOCK_S: f64 = 0.25;

/// From 0 up to `below`.
fn up_to(random: &mut Random, below: i64) -> i64 {
    random.below(below.unsigned_abs()).cast_signed()
}

/// What the computer does to the loop.
#[derive(Clone, Debug, Default)]
struct Computer {
    period_ns: i64,
    /// How late a wake-up is at most.
    jitter_ns: i64,
    /// How long the work until the exchange takes at most.
    work_ns: i64,
    /// In which wake-up, and in which work, it is away for so many periods.
    asleep: Vec<(i64, i64)>,
    at_work: Vec<(i64, i64)>,
}

impl Computer {
    fn stall_ns(&self, stalls: &[(i64, i64)], number: i64) -> i64 {
        stalls
            .iter()
            .filter(|(at, _)| *at == number)
            .map(|(_, periods)| periods * self.period_ns)
            .sum()
    }
}

struct Clock {
    now: Rc<Cell<i64>>,
    random: Random,
    computer: Computer,
    sleeps: i64,
    latest_ns: Rc<Cell<i64>>,
}

impl PeriodClock for Clock {
    fn now_ns(&mut self) -> i64 {
        self.now.get()
    }

    fn sleep_until(&mut self, deadline_ns: i64) {
        self.sleeps += 1;
        let woken_ns = self.now.get().max(deadline_ns)
            + up_to(&mut self.random, self.computer.jitter_ns + 1)
            + self.computer.stall_ns(&self.computer.asleep, self.sleeps);
        self.latest_ns
            .set(self.latest_ns.get().max(woken_ns - deadline_ns));
        self.now.set(woken_ns);
    }
}

/// A driver behind the bus: an exchange a period, which is best half a bus period before the next pulse.
struct Bus {
    now: Rc<Cell<i64>>,
    random: Random,
    computer: Computer,
    /// A bus period by the computer's clock, and the first pulse.
    period_ns: f64,
    first_ns: f64,
    /// Every so many exchanges tell the phase; none where this is 0.
    tells_every: i64,
    /// How long the loop takes into step, s.
    lock_s: f64,
    exchanges: i64,
    until_pulse: i64,
    pulse: i64,
    phase_ns: i64,
    /// Pulses that found no new setpoint, in all and when it is in step.
    empty: i64,
    empty_in_step: i64,
    /// How far an exchange was from where the bus wants it, at most, in step.
    furthest_ns: i64,
}

impl Body for Bus {
    fn is_over(&self) -> bool {
        self.pulse >= self.until_pulse
    }

    fn period(&mut self) {
        self.exchanges += 1;
        let worked_ns = up_to(&mut self.random, self.computer.work_ns + 1)
            + self
                .computer
                .stall_ns(&self.computer.at_work, self.exchanges);
        self.now.set(self.now.get() + worked_ns);
        let passed = (self.now.get() as f64 - self.first_ns) / self.period_ns;
        let pulse = passed.floor() as i64;
        let in_step = passed * self.period_ns > self.lock_s * 1e9;
        self.phase_ns = ((passed - passed.floor() - 0.5) * self.period_ns).round() as i64;
        if self.exchanges > 1 {
            let empty = (pulse - self.pulse - 1).max(0);
            self.empty += empty;
            self.empty_in_step += if in_step { empty } else { 0 };
        }
        if in_step {
            self.furthest_ns = self.furthest_ns.max(self.phase_ns.abs());
        }
        self.pulse = pulse;
    }

    fn phase_ns(&self) -> Option<i64> {
        (self.tells_every > 0 && self.exchanges % self.tells_every == 0).then_some(self.phase_ns)
    }

    fn missed(&mut self, _periods: u64, _in_a_row: u64) {}
}

/// A bus and the loop's clock, and the latest wake-up.
struct Rig {
    clock: Clock,
    bus: Bus,
    latest_ns: Rc<Cell<i64>>,
}

impl Rig {
    /// A bus that drifts by `ppm` against the computer, its first pulse anywhere in a period.
    fn new(computer: &Computer, ppm: f64, seed: u64) -> Self {
        let (now, latest_ns) = (Rc::new(Cell::new(0)), Rc::default());
        let mut random = Random::new(seed);
        let first_ns = up_to(&mut random, computer.period_ns) as f64;
        let clock = Clock {
            now: Rc::clone(&now),
            random: Random::new(seed + 1000),
            computer: computer.clone(),
            sleeps: 0,
            latest_ns: Rc::clone(&latest_ns),
        };
        let bus = Bus {
            now,
            random,
            computer: computer.clone(),
            period_ns: computer.period_ns as f64 * (1.0 + ppm * 1e-6),
            first_ns,
            tells_every: 1,
            lock_s: LOCK_S,
            exchanges: 0,
            until_pulse: PULSES * 1_000_000 / computer.period_ns,
            pulse: 0,
            phase_ns: 0,
            empty: 0,
            empty_in_step: 0,
            furthest_ns: 0,
        };
        Self {
            clock,
            bus,
            latest_ns,
        }
    }

    fn run(mut self) -> (Bus, Timing, i64) {
        let mut timing = Timing::default();
        run(
            &mut self.clock,
            self.bus.computer.period_ns,
            &mut self.bus,
            &mut timing,
        );
        (self.bus, timing, self.latest_ns.get())
    }
}

/// 1 ms, and up to 100 µs late.
fn jittering() -> Computer {
    Computer {
        period_ns: 1_000_000,
        jitter_ns: 100_000,
        ..Computer::default()
    }
}

#[test]
fn a_loop_that_runs_free_leaves_pulses_without_a_setpoint() {
    let mut rig = Rig::new(&jittering(), 70.0, 1);
    rig.bus.tells_every = 0;
    let (bus, timing, _) = rig.run();
    assert!(
        (1000..4000).contains(&bus.empty),
        "{} of {PULSES}",
        bus.empty
    );
    assert_eq!(timing.missed_periods, 0, "the computer kept every period");
}

#[test]
fn a_loop_that_is_steered_leaves_none() {
    for ppm in [-100.0, -70.0, 0.0, 70.0, 100.0] {
        for seed in 0..4 {
            let (bus, timing, _) = Rig::new(&jittering(), ppm, seed).run();
            let said = format!("{ppm} ppm, seed {seed}: furthest {} ns", bus.furthest_ns);
            assert_eq!((bus.empty_in_step, timing.missed_periods), (0, 0), "{said}");
            // The wake-ups' own jitter, and next to nothing beside it.
            assert!(bus.furthest_ns < 110_000, "{said}");
        }
    }
}

#[test]
fn where_the_exchange_jitters_behind_the_wake_up_too() {
    let computer = Computer {
        work_ns: 100_000,
        ..jittering()
    };
    for ppm in [-100.0, 100.0] {
        let (bus, timing, _) = Rig::new(&computer, ppm, 5).run();
        assert_eq!(
            (bus.empty_in_step, timing.missed_periods),
            (0, 0),
            "{ppm} ppm: furthest {} ns",
            bus.furthest_ns
        );
        assert!(
            bus.furthest_ns < 200_000,
            "{ppm} ppm: furthest {} ns",
            bus.furthest_ns
        );
    }
}

#[test]
fn with_other_periods_and_a_phase_that_is_seldom_told() {
    for (period_ns, jitter_ns, tells_every) in [
        (500_000, 100_000, 1),
        (4_000_000, 100_000, 1),
        (125_000, 20_000, 1),
        (1_000_000, 100_000, 7),
    ] {
        let computer = Computer {
            period_ns,
            jitter_ns,
            work_ns: jitter_ns,
            ..Computer::default()
        };
        for ppm in [-100.0, 100.0] {
            let mut rig = Rig::new(&computer, ppm, 9);
            rig.bus.tells_every = tells_every;
            // Seven times as little is said, and it takes seven times as long into step.
            rig.bus.lock_s *= tells_every as f64;
            let (bus, timing, _) = rig.run();
            let said = format!("{period_ns} ns, {ppm} ppm, furthest {} ns", bus.furthest_ns);
            assert_eq!((bus.empty_in_step, timing.missed_periods), (0, 0), "{said}");
        }
    }
}

#[test]
fn half_and_twice_the_gains_hold_it_as_well() {
    let computer = Computer {
        work_ns: 100_000,
        ..jittering()
    };
    for (times, ppm) in [(0.5, 100.0), (0.5, -100.0), (2.0, 100.0), (2.0, -100.0)] {
        let Rig {
            mut clock, mut bus, ..
        } = Rig::new(&computer, ppm, 3);
        let steering = PhaseSteering::new(computer.period_ns).with_gains(times);
        steered(
            &mut clock,
            computer.period_ns,
            &mut bus,
            &mut Timing::default(),
            steering,
        );
        assert_eq!(
            bus.empty_in_step, 0,
            "{times} times the gains: furthest {} ns",
            bus.furthest_ns
        );
        assert!(
            bus.furthest_ns < 220_000,
            "{times} times the gains: furthest {} ns",
            bus.furthest_ns
        );
    }
}

/// Whole periods are missed: as many pulses are without a setpoint as the loop counts, and the latest wake-up is the latest.
#[test]
fn what_stalls_is_counted_exactly_while_steered() {
    for seed in 0..8 {
        let mut random = Random::new(seed + 77);
        let mut stalls = |count: i64| -> Vec<(i64, i64)> {
            (1..=count)
                .map(|stall| {
                    (
                        1000 * stall + up_to(&mut random, 400),
                        1 + up_to(&mut random, 20),
                    )
                })
                .collect()
        };
        let computer = Computer {
            asleep: stalls(100),
            ..jittering()
        };
        // Those at work come in other periods than those asleep.
        let at_work = stalls(100)
            .into_iter()
            .map(|(at, periods)| (at + 500, periods))
            .collect();
        let computer = Computer {
            at_work,
            ..computer
        };
        let ppm = up_to(&mut random, 201) as f64 - 100.0;
        let injected: i64 = computer
            .asleep
            .iter()
            .chain(&computer.at_work)
            .map(|(_, periods)| periods)
            .sum();
        let (bus, timing, latest_ns) = Rig::new(&computer, ppm, seed).run();
        assert_eq!(
            timing.missed_periods,
            injected.unsigned_abs(),
            "seed {seed}, {ppm} ppm"
        );
        assert_eq!(
            bus.empty_in_step, injected,
            "seed {seed}, {ppm} ppm: furthest {} ns",
            bus.furthest_ns
        );
        assert_eq!(timing.overruns, computer.at_work.len() as u64);
        assert_eq!(
            (timing.lateness.count(), timing.lateness.max_ns()),
            (bus.exchanges as u64, latest_ns as u64)
        );
    }
}
