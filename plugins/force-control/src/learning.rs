//! What is learned of an axis while it runs in air: how its friction has changed, and its inertia.
//!
//! Friction changes with temperature and lubrication, and with it the estimate of the cut. In air all torque that remains is
//! friction: recursive least squares with forgetting find its proportion to the model's. What is felt just before a cut
//! may be the first of it, so a sample counts only when air has gone on for a while behind it.

use crate::inertia::{Differences, Rls};
use crate::options::LearningOptions;

/// Rough periods in a row at one speed before friction is looked at, and for which a sample waits.
const SETTLED: u32 = 12;
const WAITING: usize = 25;
/// Change of the commanded speed in a rough period that still is one speed, as a share.
const STEADY_SHARE: f64 = 0.02;
/// Rough periods that the model of the machine file is worth at the start.
const PRIOR_PERIODS: f64 = 60.0;
/// Proportions of the friction to the model that are believed.
const MIN_FRICTION_RATIO: f64 = 0.5;
const MAX_FRICTION_RATIO: f64 = 2.0;

/// Fine periods over which accelerations are differences.
const SPAN: usize = 20;
/// Speed below which Coulomb friction may change its sign, rad/s.
const MIN_SPEED_RAD_PER_S: f64 = 5.0;
/// Least change of the acceleration that says something of the inertia, rad/s².
const MIN_CHANGE_RAD_PER_S2: f64 = 100.0;
/// Samples of it before an inertia is believed, and how sure it must be.
const MIN_SAMPLES: u32 = 100;
const MAX_DEVIATION_SHARE: f64 = 0.02;
/// Proportions of the inertia to the stated one that are believed.
const MIN_INERTIA_RATIO: f64 = 0.5;
const MAX_INERTIA_RATIO: f64 = 2.0;

/// The proportion of an axis' friction to its model. Allocates when made, not after.
#[derive(Clone, Debug)]
pub struct FrictionRatio {
    forgetting: f64,
    rls: Option<Rls>,
    ratio: f64,
    steady: u32,
    last_rad_per_s: f64,
    /// Friction of the model and torque felt, N·m, of the last rough periods in air, the newest first.
    waiting: Vec<Option<(f64, f64)>>,
}

impl FrictionRatio {
    /// Friction as the model says, until something else is learned; `forgetting` is that of a rough period.
    pub fn new(forgetting: f64) -> Self {
        Self {
            forgetting,
            rls: None,
            ratio: 1.0,
            steady: 0,
            last_rad_per_s: 0.0,
            waiting: vec![None; WAITING],
        }
    }

    /// The proportion.
    pub fn ratio(&self) -> f64 {
        self.ratio
    }

    /// Takes a rough period in air or not: its mean commanded speed, the friction of the model there, and the torque beyond
    /// that friction × [`FrictionRatio::ratio`].
    pub fn update(&mut self, in_air: bool, speed_rad_per_s: f64, model_nm: f64, beyond_nm: f64) {
        let change = (speed_rad_per_s - self.last_rad_per_s).abs();
        self.last_rad_per_s = speed_rad_per_s;
        if speed_rad_per_s == 0.0 || change > STEADY_SHARE * speed_rad_per_s.abs() {
            self.steady = 0;
        }
        self.steady = self.steady.saturating_add(1);
        if !in_air {
            self.waiting.fill(None);
            return;
        }
        let settled = self.steady > SETTLED && model_nm != 0.0;
        let felt_nm = beyond_nm + self.ratio * model_nm;
        self.waiting.rotate_right(1);
        let oldest =
            std::mem::replace(&mut self.waiting[0], settled.then_some((model_nm, felt_nm)));
        if let Some((model_nm, felt_nm)) = oldest {
            self.learn(model_nm, felt_nm);
        }
    }

    fn learn(&mut self, model_nm: f64, felt_nm: f64) {
        let prior = 1.0 / (PRIOR_PERIODS * model_nm * model_nm);
        let rls = self
            .rls
            .get_or_insert_with(|| Rls::new(1.0, prior, self.forgetting));
        rls.update(model_nm, felt_nm);
        self.ratio = rls.value().clamp(MIN_FRICTION_RATIO, MAX_FRICTION_RATIO);
    }
}

/// The inertia of an axis from its accelerations in air. Allocates when made, not after.
#[derive(Clone, Debug)]
pub struct Inertia {
    differences: Differences,
    rls: Rls,
    torque_constant_nm_per_a: f64,
    stated_kg_m2: f64,
    believed_kg_m2: f64,
    samples: u32,
}

impl Inertia {
    /// Begins with the inertia of the machine file; `forgetting` is that of a sample.
    pub fn new(
        stated_kg_m2: f64,
        torque_constant_nm_per_a: f64,
        period_s: f64,
        forgetting: f64,
    ) -> Self {
        // What is stated is worth a sample of the least change, as good as its 10 %.
        let covariance = 1.0 / (MIN_CHANGE_RAD_PER_S2 * MIN_CHANGE_RAD_PER_S2);
        Self {
            differences: Differences::new(SPAN, period_s, MIN_SPEED_RAD_PER_S),
            rls: Rls::new(stated_kg_m2, covariance, forgetting),
            torque_constant_nm_per_a,
            stated_kg_m2,
            believed_kg_m2: stated_kg_m2,
            samples: 0,
        }
    }

    /// Takes a fine sample: the angle, and the current without that of friction. `follows` where it is the one after the last.
    pub fn sample(&mut self, follows: bool, in_air: bool, angle_rad: f64, current_a: f64) {
        if !follows {
            self.differences.restart();
        }
        let Some((change, current_a)) = self.differences.push(angle_rad, current_a) else {
            return;
        };
        if in_air && change.abs() >= MIN_CHANGE_RAD_PER_S2 {
            self.rls
                .update(change, self.torque_constant_nm_per_a * current_a);
            self.samples = self.samples.saturating_add(1);
            self.believe();
        }
    }

    fn believe(&mut self) {
        let (found, stated) = (self.rls.value(), self.stated_kg_m2);
        if self.samples >= MIN_SAMPLES && self.rls.deviation() <= MAX_DEVIATION_SHARE * found {
            self.believed_kg_m2 =
                found.clamp(MIN_INERTIA_RATIO * stated, MAX_INERTIA_RATIO * stated);
        }
    }

    /// The inertia, kg·m²: the stated one until another is sure.
    pub fn value_kg_m2(&self) -> f64 {
        self.believed_kg_m2
    }
}

/// What is learned of an axis.
#[derive(Clone, Debug)]
pub struct Learning {
    friction: Option<FrictionRatio>,
    inertia: Option<Inertia>,
    stated_kg_m2: f64,
}

impl Learning {
    /// As the options say, for an axis of `inertia_kg_m2`.
    pub fn new(
        options: &LearningOptions,
        inertia_kg_m2: f64,
        torque_constant_nm_per_a: f64,
        period_s: f64,
    ) -> Self {
        let inertia = || {
            Inertia::new(
                inertia_kg_m2,
                torque_constant_nm_per_a,
                period_s,
                options.inertia_forgetting,
            )
        };
        Self {
            friction: options
                .friction
                .then(|| FrictionRatio::new(options.friction_forgetting)),
            inertia: options.inertia.then(inertia),
            stated_kg_m2: inertia_kg_m2,
        }
    }

    /// The proportion of friction to its model.
    pub fn friction_ratio(&self) -> f64 {
        self.friction.as_ref().map_or(1.0, FrictionRatio::ratio)
    }

    /// The inertia, kg·m².
    pub fn inertia_kg_m2(&self) -> f64 {
        self.inertia
            .as_ref()
            .map_or(self.stated_kg_m2, Inertia::value_kg_m2)
    }

    /// See [`Inertia::sample`].
    pub fn sample(&mut self, follows: bool, in_air: bool, angle_rad: f64, current_a: f64) {
        if let Some(inertia) = &mut self.inertia {
            inertia.sample(follows, in_air, angle_rad, current_a);
        }
    }

    /// See [`FrictionRatio::update`].
    pub fn period(&mut self, in_air: bool, speed_rad_per_s: f64, model_nm: f64, beyond_nm: f64) {
        if let Some(friction) = &mut self.friction {
            friction.update(in_air, speed_rad_per_s, model_nm, beyond_nm);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rough periods at 10 rad/s with friction `ratio` times a model of 0.06 N·m.
    fn run(friction: &mut FrictionRatio, periods: usize, ratio: f64, in_air: bool, cut_nm: f64) {
        for _ in 0..periods {
            let beyond_nm = (ratio - friction.ratio()) * 0.06 + cut_nm;
            friction.update(in_air, 10.0, 0.06, beyond_nm);
        }
    }

    #[test]
    fn friction_is_found_in_air_kept_in_the_cut_and_found_again() {
        let mut friction = FrictionRatio::new(0.998);
        run(&mut friction, 2500, 1.3, true, 0.0);
        assert!(
            (friction.ratio() - 1.3).abs() < 2e-3,
            "{}",
            friction.ratio()
        );
        let before = friction.ratio();
        // The first of a cut is felt before it is known to be one.
        run(&mut friction, 20, 1.3, true, 0.02);
        run(&mut friction, 5000, 1.3, false, 0.1);
        assert!(
            (friction.ratio() - before).abs() < 1e-4,
            "{}",
            friction.ratio()
        );
        run(&mut friction, 2500, 0.7, true, 0.0);
        assert!(
            (friction.ratio() - 0.7).abs() < 6e-3,
            "{}",
            friction.ratio()
        );
        run(&mut friction, 9000, 5.0, true, 0.0);
        assert_eq!(friction.ratio(), MAX_FRICTION_RATIO);
    }

    #[test]
    fn speeds_that_change_say_nothing() {
        let mut friction = FrictionRatio::new(0.998);
        for period in 0..2000 {
            friction.update(true, 10.0 * 1.03_f64.powi(period % 10), 0.06, 0.05);
        }
        assert_eq!(friction.ratio(), 1.0);
    }

    #[test]
    fn inertia_follows_a_step_where_it_is_forgotten() {
        // 1.842e-4, and behind 4 s 2.5e-4 kg·m²: strokes of 3 Hz around 40 rad/s, 8192 counts, in air.
        let run = |forgetting: f64| {
            let mut inertia = Inertia::new(1.5e-4, 0.378, 1e-3, forgetting);
            let angle = |t_s: f64| 40.0 * t_s + (1.0 - (19.0 * t_s).cos()) * 30.0 / 19.0;
            let mut found = vec![];
            for tick in 1..8000 {
                let t_s = f64::from(tick) * 1e-3;
                let truth = if tick < 4000 { 1.842e-4 } else { 2.5e-4 };
                let mean = angle(t_s + 0.5e-3) - 2.0 * angle(t_s - 0.5e-3) + angle(t_s - 1.5e-3);
                let counts = 8192.0 / std::f64::consts::TAU;
                let seen = (angle(t_s) * counts).floor() / counts;
                inertia.sample(true, true, seen, truth * mean * 1e6 / 0.378);
                found.push(inertia.value_kg_m2());
            }
            (found[20], found[3900], *found.last().unwrap())
        };
        let (first, before, after) = run(0.999);
        assert_eq!(first, 1.5e-4, "what is stated counts until another is sure");
        assert!((before / 1.842e-4 - 1.0).abs() < 0.01, "{before}");
        assert!((after / 2.5e-4 - 1.0).abs() < 0.03, "{after}");
        let (_, _, kept) = run(1.0);
        assert!(
            kept < 2.3e-4,
            "without forgetting the past counts as much: {kept}"
        );
    }
}
