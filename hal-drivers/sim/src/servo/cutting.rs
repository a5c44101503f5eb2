//! The force that the workpiece puts on the cutter.

use std::f64::consts::TAU;

use super::options::CuttingOptions;
use super::workpiece::{Over, Profile};

/// Plant steps that are remembered: the longest tooth period. A spindle that stands cuts what was driven meanwhile.
const REMEMBERED: usize = 1 << 14;

/// The cutting process: force = specific force × depth × chip, the chip being what was driven within one tooth period.
#[derive(Clone, Debug)]
pub struct Cutting {
    options: CuttingOptions,
    /// N/mm².
    force_per_area: f64,
    profile: Profile,
    /// Path driven, after each of the last plant steps, mm.
    driven_mm: Vec<f64>,
    at: usize,
    tooth_angle_rad: f64,
    last_mm: Option<[f64; 3]>,
    /// Depth of cut now, mm.
    pub depth_mm: f64,
}

impl Cutting {
    /// A cutter that has not driven yet; random depths come from `seed`. Allocates; the other methods do not.
    pub fn new(options: &CuttingOptions, seed: u64) -> Self {
        Self {
            profile: options.workpiece.drawn(seed),
            force_per_area: options.force_per_area(),
            options: options.clone(),
            driven_mm: vec![0.0; REMEMBERED],
            at: 0,
            tooth_angle_rad: 0.0,
            last_mm: None,
            depth_mm: 0.0,
        }
    }

    /// One plant step of `step_s`: the cutter stands at `position_mm`, is driven in the unit direction `direction` and
    /// turns at `spindle_rad_per_s`. Gives the cutting force against that direction, N.
    pub fn step(
        &mut self,
        position_mm: [f64; 3],
        direction: [f64; 3],
        spindle_rad_per_s: f64,
        step_s: f64,
    ) -> f64 {
        let last_mm = self.last_mm.replace(position_mm).unwrap_or(position_mm);
        let in_workpiece = self
            .options
            .workpiece
            .top_mm
            .is_none_or(|top| position_mm[2] <= top);
        let begun = self.driven_mm[self.at] > 0.0 || (spindle_rad_per_s != 0.0 && in_workpiece);
        let mut driven_mm = self.driven_mm[self.at];
        if begun && in_workpiece {
            driven_mm += (0..3)
                .map(|i| (position_mm[i] - last_mm[i]) * direction[i])
                .sum::<f64>();
        }
        self.at = (self.at + 1) % REMEMBERED;
        self.driven_mm[self.at] = driven_mm;
        self.depth_mm = if in_workpiece {
            self.profile.depth_mm(self.length_mm(position_mm))
        } else {
            0.0
        };
        let teeth = f64::from(self.options.teeth);
        self.tooth_angle_rad =
            (self.tooth_angle_rad + teeth * spindle_rad_per_s * step_s).rem_euclid(TAU);
        let tooth_steps = TAU / (teeth * spindle_rad_per_s.abs() * step_s);
        let chip_mm = (driven_mm - self.driven_ago_mm(tooth_steps)).max(0.0);
        let ripple = 1.0 + self.options.tooth_ripple * self.tooth_angle_rad.sin();
        self.force_per_area * self.depth_mm * chip_mm * ripple
    }

    fn length_mm(&self, [x, y, _]: [f64; 3]) -> f64 {
        let workpiece = &self.options.workpiece;
        match workpiece.over {
            Over::Path => self.driven_mm[self.at],
            Over::Xy => {
                let (sin, cos) = workpiece.direction_deg.to_radians().sin_cos();
                (x - workpiece.origin_mm[0]) * cos + (y - workpiece.origin_mm[1]) * sin
            }
        }
    }

    /// The path driven so many plant steps ago, mm; at most as many as are remembered.
    fn driven_ago_mm(&self, steps: f64) -> f64 {
        let steps = steps.min((REMEMBERED - 2) as f64);
        let whole = steps.floor();
        let ago = |steps: usize| self.driven_mm[(self.at + REMEMBERED - steps) % REMEMBERED];
        let (newer, older) = (ago(whole as usize), ago(whole as usize + 1));
        newer + (older - newer) * (steps - whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(text: &str) -> CuttingOptions {
        tandem_sdk::parse_options(text).unwrap()
    }

    /// Force at the end of a drive along x at `feed` mm/min for a second.
    fn force(cutting: &mut Cutting, feed: f64, rpm: f64) -> f64 {
        let spindle = rpm * TAU / 60.0;
        let at = |step: i32| [f64::from(step) * 1e-4 * feed / 60.0, 0.0, 0.0];
        (0..10_000)
            .map(|step| cutting.step(at(step), [1.0, 0.0, 0.0], spindle, 1e-4))
            .last()
            .unwrap()
    }

    #[test]
    fn force_is_depth_times_feed_per_tooth() {
        let mut cutting = Cutting::new(&options("[workpiece]\nsteps = [[0.1, 3.0]]"), 1);
        let newtons = force(&mut cutting, 150.0, 900.0);
        assert!(
            (newtons - 31.415_926_5).abs() < 1e-6,
            "0.1 N·m on a 20 mm screw, not {newtons} N"
        );
        let mut faster = Cutting::new(&options("teeth = 4\n[workpiece]\nsteps = [[0.1, 3.0]]"), 1);
        let newtons = force(&mut faster, 150.0, 900.0);
        assert!(
            (newtons - 31.415_926_5 / 2.0).abs() < 1e-6,
            "half the feed per tooth, not {newtons} N"
        );
    }

    #[test]
    fn the_force_follows_from_the_shear_of_the_chip() {
        let text = |angle: &str| {
            format!(
                "[merchant]\nshear_stress_n_per_mm2 = 40\nfriction_angle_deg = 35\nrake_angle_deg = 5\n{angle}\n\
                 [workpiece]\nsteps = [[0.1, 3.0]]"
            )
        };
        // 40 / (sin 25° cos 55°), by hand; 3 mm deep, 150 mm/min, 30 teeth a second.
        let stated = options(&text("shear_angle_deg = 25"));
        assert!((stated.force_per_area() - 165.01).abs() < 0.01);
        let newtons = force(&mut Cutting::new(&stated, 1), 150.0, 900.0);
        assert!((newtons - 165.01 * 3.0 / 12.0).abs() < 0.01, "{newtons} N");
        // Left out, it is the angle of least force: 30°.
        let least = options(&text("")).force_per_area();
        assert_eq!(
            least,
            options(&text("shear_angle_deg = 30")).force_per_area()
        );
        for other in ["28", "32"] {
            let angle = format!("shear_angle_deg = {other}");
            assert!(options(&text(&angle)).force_per_area() > least);
        }
        let never = "shear_angle_deg = 89";
        assert!(
            options(&text(never)).check().is_err(),
            "the chip is never sheared"
        );
    }

    #[test]
    fn nothing_is_cut_above_the_workpiece_or_before_the_spindle_turns() {
        let mut cutting = Cutting::new(
            &options("[workpiece]\ntop_mm = -1\nsteps = [[0.1, 3.0]]"),
            1,
        );
        assert_eq!(
            (force(&mut cutting, 150.0, 900.0), cutting.depth_mm),
            (0.0, 0.0)
        );
        let mut cutting = Cutting::new(&options("[workpiece]\nsteps = [[0.1, 3.0]]"), 1);
        assert_eq!(force(&mut cutting, 150.0, 0.0), 0.0, "no path counts yet");
    }

    #[test]
    fn no_path_counts_above_the_workpiece() {
        let mut cutting = Cutting::new(&options("[workpiece]\ntop_mm = -1\nsteps = [[2, 3.0]]"), 1);
        let mut drive = |z: f64, from: f64| {
            (0..10_000).for_each(|k| {
                cutting.step(
                    [from + f64::from(k) * 1e-4, 0.0, z],
                    [1.0, 0.0, 0.0],
                    15.0 * TAU,
                    1e-4,
                );
            });
            cutting.depth_mm
        };
        let depths = [
            drive(-1.0, 0.0),
            drive(5.0, 1.0),
            drive(-0.99, 2.0),
            drive(-2.0, 3.0),
            drive(-2.0, 4.0),
        ];
        assert_eq!(
            depths,
            [0.0, 0.0, 0.0, 0.0, 3.0],
            "only 2 mm of the first 4 were below the top"
        );
    }

    #[test]
    fn a_workpiece_over_xy_lies_where_it_is_whatever_the_path() {
        let text = "[workpiece]\nover = \"xy\"\norigin_mm = [10, 20]\ndirection_deg = 90\nsteps = [[5, 3.0], [8, 0]]";
        let mut cutting = Cutting::new(&options(text), 1);
        let mut depth_at = |x: f64, y: f64| {
            cutting.step([x, y, 0.0], [1.0, 0.0, 0.0], 15.0 * TAU, 1e-4);
            cutting.depth_mm
        };
        let places = [
            (0.0, 24.9),
            (0.0, 25.1),
            (99.0, 25.1),
            (10.0, 28.1),
            (15.0, 20.0),
            (-3.0, 27.9),
        ];
        assert_eq!(
            places.map(|(x, y)| depth_at(x, y)),
            [0.0, 3.0, 3.0, 0.0, 0.0, 3.0]
        );
    }

    #[test]
    fn ripple_has_the_tooth_frequency_and_keeps_the_mean() {
        let mut cutting = Cutting::new(
            &options("tooth_ripple = 0.5\n[workpiece]\nsteps = [[0.0, 3.0]]"),
            1,
        );
        force(&mut cutting, 150.0, 900.0);
        let at = |step: i32| [2.5 + f64::from(step) * 1e-4 * 2.5, 0.0, 0.0];
        let forces: Vec<f64> = (0..10_000)
            .map(|step| cutting.step(at(step), [1.0, 0.0, 0.0], 15.0 * TAU, 1e-4))
            .collect();
        let mean = forces.iter().sum::<f64>() / 1e4;
        let crossings = forces
            .windows(2)
            .filter(|two| (two[0] < mean) != (two[1] < mean))
            .count();
        assert!(
            (mean - 31.4159).abs() < 0.05 && (58..=61).contains(&crossings),
            "{mean} N, {crossings}"
        );
    }
}
