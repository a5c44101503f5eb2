//! The tables of a machine file.

use tandem_rig::Random;

use super::{Axis, Drawn, Planner, Surface, rounded};

/// How many of its time constants an exponential filter takes to settle to the last digit.
const SETTLING_CONSTANTS: f64 = 28.0;

impl Drawn {
    pub(super) fn loops_and_motion(&mut self, random: &mut Random) {
        let text = &mut self.text;
        text.table("[loops]");
        text.key("rough_period_ms", self.rough_ms);
        text.key("fine_period_ms", self.fine_ms);
        text.table("[motion]");
        let min_mm = if self.planner == Planner::Smooth {
            2e-4
        } else {
            1e-4
        };
        text.key("path_tolerance_mm", rounded(random.length(min_mm, 1.0)));
        let difference = if random.below(2) == 0 {
            0.0
        } else {
            rounded(random.length(0.5, 2000.0))
        };
        text.key("allowable_speed_difference_mm_per_min", difference);
        if random.below(4) == 0 {
            text.key(
                "allowable_speed_difference_deg_per_min",
                rounded(random.length(0.5, 2000.0)),
            );
        }
        text.key("max_feed_ratio", self.max_feed_ratio);
        if random.below(2) == 0 {
            self.constant_ms = rounded(random.length(self.fine_ms.max(1.0), 300.0));
            text.key("time_constant_ms", self.constant_ms);
        }
        if !self.planner.keeps_jerk() {
            text.key("jerk", "\"report\"");
        }
    }

    /// Writes kinematics and joints; whether each joint is the axis of its place.
    pub(super) fn kinematics(&mut self, random: &mut Random, jerk: bool) -> bool {
        let index = |letter: char| {
            self.axes
                .iter()
                .position(|axis| axis.letter == letter && !axis.rotary)
        };
        let (x, y) = (index('X'), index('Y'));
        match (random.below(10), x, y) {
            (0 | 1, Some(x), Some(y)) if self.axes.len() <= 6 => self.corexy(random, jerk, x, y),
            (2 | 3, _, Some(y)) => self.wrapped(random, jerk, y),
            (4, _, Some(y)) if self.axes.len() < 8 => self.gantry(random, jerk, y),
            _ => return true,
        }
        false
    }

    /// The limits of a joint that moves by `weight` for a unit of `axis`.
    fn joint_limits(
        &mut self,
        random: &mut Random,
        jerk: bool,
        axis: usize,
        unit: &str,
        weight: f64,
    ) {
        let axis = self.axes[axis];
        let mut of = |value: f64| rounded(value * weight.abs() * random.length(0.3, 4.0));
        let limits = [of(axis.feed), of(axis.acceleration), of(axis.jerk)];
        self.text
            .key(&format!("max_feed_{unit}_per_min"), limits[0]);
        self.text
            .key(&format!("max_acceleration_{unit}_per_s2"), limits[1]);
        if jerk {
            self.text.key(&format!("max_jerk_{unit}_per_s3"), limits[2]);
        }
    }

    fn corexy(&mut self, random: &mut Random, jerk: bool, x: usize, y: usize) {
        self.text.table("[kinematics]");
        self.text.key("plugin", "\"corexy\"");
        let (of_x, of_y) = (self.axes[x], self.axes[y]);
        for index in 0..self.axes.len() {
            let letter = self.axes[index].letter.to_ascii_lowercase();
            if index != x && index != y {
                self.text.table(&format!("[joints.{letter}]"));
                self.text.key("axis", format!("\"{letter}\""));
                continue;
            }
            self.text.table(if index == x {
                "[joints.belt1]"
            } else {
                "[joints.belt2]"
            });
            if random.below(2) == 0 {
                let (low, high) = if index == x {
                    (of_x.low + of_y.low, of_x.high + of_y.high)
                } else {
                    (of_x.low - of_y.high, of_x.high - of_y.low)
                };
                self.text.key("travel_mm", format!("[{low}, {high}]"));
            }
            self.joint_limits(random, jerk, index, "mm", 1.0);
        }
    }

    fn wrapped(&mut self, random: &mut Random, jerk: bool, wrapped: usize) {
        let radius_mm =
            rounded(random.length(0.5, 500.0)) * if random.below(4) == 0 { -1.0 } else { 1.0 };
        self.text.table("[kinematics]");
        self.text.key("plugin", "\"wrapped-rotary\"");
        self.text.table("[kinematics.options]");
        self.text.key(
            "axis",
            format!("\"{}\"", self.axes[wrapped].letter.to_ascii_lowercase()),
        );
        self.text.key("radius_mm", radius_mm);
        for index in 0..self.axes.len() {
            let letter = self.axes[index].letter.to_ascii_lowercase();
            if index != wrapped {
                self.text.table(&format!("[joints.{letter}]"));
                self.text.key("axis", format!("\"{letter}\""));
                continue;
            }
            self.text.table("[joints.table]");
            self.text.key("kind", "\"rotary\"");
            self.joint_limits(random, jerk, index, "deg", (1.0 / radius_mm).to_degrees());
        }
    }

    fn gantry(&mut self, random: &mut Random, jerk: bool, axis: usize) {
        let letter = self.axes[axis].letter.to_ascii_lowercase();
        for foot in ["left", "right"] {
            self.text.table(&format!("[joints.{foot}]"));
            self.text.key("axis", format!("\"{letter}\""));
            if random.below(2) == 0 {
                self.joint_limits(random, jerk, axis, "mm", 1.0);
            }
        }
    }

    pub(super) fn planner(&mut self, random: &mut Random) {
        self.text.table("[planner]");
        self.text
            .key("plugin", format!("\"{}\"", self.planner.name()));
        let mut options: Vec<(&str, String)> = vec![];
        match self.planner {
            Planner::LookAhead if random.below(4) == 0 => {
                options.push((
                    "buffer_blocks",
                    (random.length(2.0, 1000.0) as u64).to_string(),
                ));
            }
            Planner::BlockOverlap => {
                options.push((
                    "limits",
                    random.pick(&["\"slow\"", "\"stretch\""]).to_string(),
                ));
                if random.below(4) == 0 {
                    options.push((
                        "buffer_blocks",
                        (random.length(4.0, 512.0) as u64).to_string(),
                    ));
                }
                if random.below(6) == 0 {
                    options.push(("corner_control", "\"off\"".to_string()));
                    self.keeps_constant = true;
                }
            }
            Planner::AfterInterpolation => {
                let filter = random.pick(&["\"linear\"", "\"bell\"", "\"exponential\""]);
                let constant_ms = rounded(random.length(1.0, 200.0));
                if filter == "\"exponential\"" {
                    self.settling_ms = SETTLING_CONSTANTS * constant_ms;
                }
                options.push(("filter", filter.to_string()));
                options.push(("time_constant_ms", constant_ms.to_string()));
            }
            Planner::Nurbs => {
                options.push((
                    "form",
                    random.pick(&["\"scan\"", "\"windowed\""]).to_string(),
                ));
                if random.below(3) == 0 {
                    options.push((
                        "chord_error_um",
                        rounded(random.length(0.05, 100.0)).to_string(),
                    ));
                }
            }
            Planner::Smooth if random.below(3) == 0 => {
                options.push(("grid_ms", rounded(random.between(2.0, 20.0)).to_string()));
                options.push((
                    "window_ms",
                    rounded(random.between(100.0, 2000.0)).to_string(),
                ));
                options.push((
                    "tolerance_share",
                    rounded(random.between(0.5, 1.0)).to_string(),
                ));
                options.push(("rounds", (1 + random.below(4)).to_string()));
            }
            _ => {}
        }
        if !options.is_empty() {
            self.text.table("[planner.options]");
            for (key, value) in &options {
                self.text.key(key, value);
            }
        }
        if self.planner == Planner::AfterInterpolation {
            self.text.table("[guard]");
            self.text.key("mode", "\"count\"");
        }
    }

    pub(super) fn driver(&mut self, random: &mut Random, plain: bool) {
        let servo = random.below(8) == 0;
        let linear: Vec<usize> = (0..self.axes.len())
            .filter(|axis| !self.axes[*axis].rotary)
            .collect();
        if plain
            && !servo
            && random.below(5) == 0
            && !linear.is_empty()
            && self.planner != Planner::AfterInterpolation
        {
            let axis = random.pick(&linear);
            let Axis { low, high, .. } = self.axes[axis];
            let (above, at_mm) = (random.below(2) == 0, rounded(random.between(low, high)));
            self.text.table("[probe]");
            self.text.key("input", 3);
            self.text.table("[driver]");
            self.text.key("plugin", "\"sim\"");
            self.text.table("[[driver.options.switches]]");
            self.text.key("input", 3);
            self.text.key("joint", axis);
            self.text
                .key(if above { "above_mm" } else { "below_mm" }, at_mm);
            self.probe = Some(Surface { axis, at_mm, above });
            return;
        }
        self.text.table("[driver]");
        self.text.key("plugin", "\"sim\"");
        if servo {
            self.text.table("[driver.options]");
            self.text.key("model", "\"second-order\"");
            self.text
                .key("natural_frequency_hz", rounded(random.length(2.0, 200.0)));
        }
        if plain && random.below(12) == 0 {
            // What is lost or late on the way to the drives must not change what is sent.
            self.text.table("[[faults.wrap]]");
            self.text.key(
                "kind",
                random.pick(&["\"drop\"", "\"freeze\"", "\"duplicate\""]),
            );
            self.text.key("every", 2 + random.below(60));
        }
    }
}
