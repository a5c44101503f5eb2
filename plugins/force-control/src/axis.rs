//! One axis: what its motor feels of the cut.

use std::f64::consts::TAU;

use tandem_sdk::{FineSample, MAX_DELAY_PERIODS};

use crate::conversion::force_per_torque_per_m;
use crate::friction::FrictionModel;
use crate::learning::Learning;
use crate::mean::RunningMean;
use crate::observer::Observer;
use crate::options::{AxisOptions, LearningOptions};

/// No motor is commanded to turn faster than this, rad/s: it is the place that was given another name.
const FASTEST_RAD_PER_S: f64 = 5000.0;

/// Commands that are kept: those on their way, and the two whose difference is a speed.
const COMMANDS: usize = MAX_DELAY_PERIODS as usize + 2;

/// Change of the commanded speed in a fine period that still is one speed, as a share; fine periods of it after which a drive has
/// settled, and the speed above which it is looked at.
const SAME_SHARE: f64 = 1e-3;
const SETTLED: u32 = 250;
const MIN_LAG_SPEED_RAD_PER_S: f64 = 0.1;
/// Share of what is seen in a fine period that the lag takes, and the longest that is believed, s.
const LAG_SHARE: f64 = 0.01;
const MAX_LAG_S: f64 = 0.2;

/// How long an axis may take to turn round after its command has: lags of its drive, and s.
const TURNING_LAGS: f64 = 6.0;
const TURNING_S: f64 = 0.04;

/// Change of the inertia that the observer is told, as a share.
const INERTIA_STEP: f64 = 0.005;

/// What of an axis is the same for all of them.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Fine period, s.
    pub period_s: f64,
    /// Time constant of the observer, s.
    pub time_constant_s: f64,
    /// Fine periods by which the command is ahead of what is measured.
    pub delay_periods: u32,
    /// Lag of the drives' position loop, s, until it has been seen.
    pub lag_s: f64,
}

/// How a drive follows: its axis turns round later than its command does, and with it its friction.
///
/// A position loop without feed-forward lags by the inverse of its gain, one with it hardly at all: at one speed the lag is the
/// distance between command and position over the speed.
#[derive(Clone, Copy, Debug)]
struct Follower {
    lag_s: f64,
    speed_rad_per_s: f64,
    commanded_rad_per_s: f64,
    steady: u32,
    /// Time since the command turned round or left rest, s, and the way it took then.
    since_turn_s: f64,
    way: f64,
}

impl Follower {
    fn new(lag_s: f64) -> Self {
        Self {
            lag_s,
            speed_rad_per_s: 0.0,
            commanded_rad_per_s: 0.0,
            steady: 0,
            since_turn_s: f64::INFINITY,
            way: 0.0,
        }
    }

    /// Whether the axis may still be turning round: its friction is somewhere between both directions.
    fn is_turning_round(&self) -> bool {
        self.since_turn_s < TURNING_LAGS * self.lag_s + TURNING_S
    }

    /// The speed that the axis has, rad/s, where `commanded` is asked for and its position is `behind_rad` behind.
    fn step(&mut self, commanded: f64, behind_rad: f64, period_s: f64) -> f64 {
        let same = (commanded - self.commanded_rad_per_s).abs() <= SAME_SHARE * commanded.abs();
        self.commanded_rad_per_s = commanded;
        self.steady = if same && commanded.abs() > MIN_LAG_SPEED_RAD_PER_S {
            self.steady.saturating_add(1)
        } else {
            0
        };
        if self.steady > SETTLED {
            let seen_s = (behind_rad / commanded).clamp(0.0, MAX_LAG_S);
            self.lag_s += LAG_SHARE * (seen_s - self.lag_s);
        }
        let way = if commanded == 0.0 {
            0.0
        } else {
            commanded.signum()
        };
        if way != self.way {
            (self.way, self.since_turn_s) = (way, 0.0);
        }
        self.since_turn_s += period_s;
        let kept = (-period_s / self.lag_s.max(1e-9)).exp();
        self.speed_rad_per_s = commanded + kept * (self.speed_rad_per_s - commanded);
        self.speed_rad_per_s
    }
}

/// Observer, compensation and mean of one axis.
#[derive(Clone, Debug)]
pub struct AxisLoad {
    index: usize,
    turns: f64,
    sampling: Sampling,
    torque_constant_nm_per_a: f64,
    inertia_kg_m2: f64,
    friction: FrictionModel,
    observer: Observer,
    learning: Learning,
    /// Friction as the observer sees it, N·m, and the share of a new value that it takes in a fine period.
    friction_seen_nm: f64,
    seen_share: f64,
    air_share: f64,
    /// Commands on their way to what answers them, rad, the newest first, and how many of them follow each other.
    commands: [f64; COMMANDS],
    known: usize,
    commanded_rad_per_s: f64,
    follower: Follower,
    measured_rad_per_s: f64,
    mean: RunningMean,
    /// Sums over the samples of this rough period: speed, friction of the model, torque.
    sums: [f64; 3],
    count: u32,
    /// Torque over the last rough period, with its sign, and the friction of the model in it, N·m.
    period_nm: f64,
    friction_nm: f64,
    /// Cutting torque now, N·m.
    pub torque_nm: f64,
    /// Force per torque, 1/m.
    pub force_per_torque_per_m: f64,
}

impl AxisLoad {
    /// The axis `index` of a machine, from checked options. Allocates; the other methods do not.
    pub fn new(
        index: usize,
        options: &AxisOptions,
        learning: &LearningOptions,
        sampling: Sampling,
    ) -> Self {
        let [inertia_kg_m2, torque_constant, lead_mm] = [
            options.inertia_kg_m2,
            options.torque_constant_nm_per_a,
            options.lead_mm,
        ]
        .map(|v| v.unwrap_or(1.0));
        let Sampling {
            period_s,
            time_constant_s,
            ..
        } = sampling;
        Self {
            index,
            turns: TAU / lead_mm,
            sampling,
            torque_constant_nm_per_a: torque_constant,
            inertia_kg_m2,
            friction: options.friction,
            observer: Observer::new(inertia_kg_m2, torque_constant, period_s, time_constant_s),
            learning: Learning::new(learning, inertia_kg_m2, torque_constant, period_s),
            friction_seen_nm: 0.0,
            seen_share: 1.0 - (-period_s / time_constant_s).exp(),
            air_share: learning.air_share_of_friction,
            commands: [0.0; COMMANDS],
            known: 0,
            commanded_rad_per_s: 0.0,
            follower: Follower::new(sampling.lag_s),
            measured_rad_per_s: 0.0,
            mean: RunningMean::new(),
            sums: [0.0; 3],
            count: 0,
            period_nm: 0.0,
            friction_nm: 0.0,
            torque_nm: 0.0,
            force_per_torque_per_m: force_per_torque_per_m(lead_mm, options.screw_efficiency),
        }
    }

    /// Takes a fine sample; `follows` where it is the one after the last, `in_air` where nothing is cut as far as that is known.
    pub fn step(&mut self, sample: &FineSample, follows: bool, in_air: bool) {
        let speed = sample.speed[self.index] * self.turns;
        self.measured_rad_per_s = speed;
        let commanded = self.command(sample.command[self.index] * self.turns, follows, speed);
        let angle = sample.position[self.index] * self.turns;
        let behind_rad = self.commands[self.sampling.delay_periods as usize] - angle;
        let turning = if follows {
            self.follower
                .step(commanded, behind_rad, self.sampling.period_s)
        } else {
            self.follower.speed_rad_per_s = commanded;
            commanded
        };
        let model_nm = self.friction.torque_nm(turning);
        let free_a = self.learning.friction_ratio() * model_nm / self.torque_constant_nm_per_a;
        if !follows {
            self.observer.restart(speed);
        }
        let cutting_a = sample.current_a[self.index] - free_a;
        let felt_nm = self.observer.step(speed, cutting_a);
        let friction_nm = self.learning.friction_ratio() * model_nm;
        self.friction_seen_nm += self.seen_share * (friction_nm - self.friction_seen_nm);
        self.torque_nm = if commanded == 0.0 || self.follower.is_turning_round() {
            self.beyond_holding(felt_nm + self.friction_seen_nm, friction_nm)
        } else {
            felt_nm
        };
        self.mean.push(self.torque_nm);
        self.learning.sample(follows, in_air, angle, cutting_a);
        for (sum, value) in self.sums.iter_mut().zip([commanded, model_nm, felt_nm]) {
            *sum += value;
        }
        self.count += 1;
    }

    /// The speed that was commanded when what is measured now answered it, rad/s; that measured where it is not known.
    fn command(&mut self, command_rad: f64, follows: bool, speed_rad_per_s: f64) -> f64 {
        self.known = if follows {
            self.known.saturating_add(1)
        } else {
            1
        };
        self.commands.rotate_right(1);
        self.commands[0] = command_rad;
        let ago = self.sampling.delay_periods as usize;
        let commanded = (self.commands[ago] - self.commands[ago + 1]) / self.sampling.period_s;
        self.commanded_rad_per_s = if self.known < ago + 2 || commanded.abs() > FASTEST_RAD_PER_S {
            speed_rad_per_s
        } else {
            commanded
        };
        self.commanded_rad_per_s
    }

    /// Ends a rough period, before [`AxisLoad::is_in_air`] is asked: forms its means.
    pub fn end_period(&mut self) -> [f64; 3] {
        let count = f64::from(self.count.max(1));
        let means = self.sums.map(|sum| sum / count);
        (self.sums, self.count) = ([0.0; 3], 0);
        self.period_nm = means[2];
        self.friction_nm = means[1].abs();
        means
    }

    /// Whether so little is felt in the last rough period that it may all be friction. In a rapid, which nobody cuts in, that
    /// is more.
    pub fn is_in_air(&self, rapid: bool) -> bool {
        let share = if rapid { 1.0 } else { self.air_share };
        self.commanded_rad_per_s == 0.0 || self.period_nm.abs() < share * self.friction_nm
    }

    /// Learns from the rough period whose means are given.
    pub fn learn(&mut self, in_air: bool, [speed, model_nm, felt_nm]: [f64; 3]) {
        self.learning.period(in_air, speed, model_nm, felt_nm);
        let inertia_kg_m2 = self.learning.inertia_kg_m2();
        if (inertia_kg_m2 / self.inertia_kg_m2 - 1.0).abs() > INERTIA_STEP {
            self.inertia_kg_m2 = inertia_kg_m2;
            let Sampling {
                period_s,
                time_constant_s,
                ..
            } = self.sampling;
            self.observer.set_inertia(
                inertia_kg_m2,
                self.torque_constant_nm_per_a,
                (period_s, time_constant_s),
                self.measured_rad_per_s,
            );
        }
    }

    /// The proportion of friction to its model, and the inertia, kg·m², as they are now.
    pub fn learned(&self) -> (f64, f64) {
        (self.learning.friction_ratio(), self.inertia_kg_m2)
    }

    /// What an axis surely takes that stands or turns round, of all that its motor feels: friction, of which the model has
    /// `friction_nm` while it moves, may be a part in either direction.
    fn beyond_holding(&self, all_nm: f64, friction_nm: f64) -> f64 {
        let constant_nm = self.learning.friction_ratio() * self.friction.constant_nm;
        let holding_nm = self.learning.friction_ratio() * self.friction.holding_nm();
        let holding_nm = holding_nm.max((friction_nm - constant_nm).abs());
        let moving_nm = all_nm - constant_nm;
        moving_nm - moving_nm.clamp(-holding_nm, holding_nm)
    }

    /// Mean torque over the last `samples`, N·m.
    pub fn mean_nm(&self, samples: f64) -> f64 {
        self.mean.of(samples)
    }
}
