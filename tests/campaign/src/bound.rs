//! How long a run may take at most: crude, but of its own, so that a machine that stands still or crawls is found.

use std::collections::BTreeMap;

use tandem_host::{Switches, each_block};
use tandem_machine::Machine;
use tandem_oracle::{Axis, Joints, Map, axis_index};
use tandem_sdk::{Block, BlockKind, Curve};

/// A program may take this many times as long as it would with a rest at the end of each block.
///
/// A planner that keeps limits by dividing them (axis by axis, or between turning and speeding up) may need more than a
/// rest at each block would; what is looked for is a machine that needs a hundred times as long, or never arrives.
const SLACK: f64 = 4.0;
/// Added to that, s: filters that settle, the first and the last period.
const MORE_S: f64 = 0.5;
/// Places of a curve at which it may rest, for each control point: a curve may turn as sharply as a corner anywhere.
const RESTS_PER_POINT: f64 = 24.0;

/// What one coordinate (an axis or a joint) may do, units and s.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// Highest speed in feed.
    pub feed: f64,
    /// Highest speed in rapids.
    pub rapid: f64,
    /// Highest acceleration.
    pub acceleration: f64,
    /// Highest jerk; infinite where there is none.
    pub jerk: f64,
}

/// The longest that a motion of `length` from rest to rest needs below these limits: each of them alone, one after the
/// other. The best motion is never longer.
pub fn rest_to_rest_s(length: f64, speed: f64, acceleration: f64, jerk: f64) -> f64 {
    length / speed + 2.0 * (length / acceleration).sqrt() + (32.0 * length / jerk).cbrt()
}

/// Adds up the time of a program, block by block.
pub struct Bound<'a> {
    machine: &'a tandem_oracle::Machine,
    /// Index in the judge's letters, and whether it turns, for each axis of a block.
    axes: Vec<(usize, bool)>,
    filter_s: f64,
    time_constant_s: f64,
    total_s: f64,
    least_s: f64,
    dwell_s: f64,
    sways: Sways,
}

/// What a program asks for as a whole.
#[derive(Clone, Debug, Default)]
pub struct Asks {
    /// The longest time that it may take, s, without what an operator does.
    pub time_s: f64,
    /// A time that its lines need at the speeds of axes and joints, s, whoever drives them.
    pub least_s: f64,
    /// How much its rotary axes turn beside the linear ones.
    pub sways: Sways,
}

/// How much the rotary axes of a program turn.
#[derive(Clone, Debug, Default)]
pub struct Sways {
    /// For each line whose rotary axes turn beside linear ones, how many times as long its way is with them, a degree counted as
    /// a millimetre, as the way that its feed counts.
    beside: BTreeMap<u32, f64>,
    /// Lines with blocks in which rotary axes alone turn: their feed counts radians.
    alone: BTreeMap<u32, TurnedAlone>,
}

/// What rotary axes turn alone on a line.
#[derive(Clone, Copy, Debug, Default)]
struct TurnedAlone {
    /// How far in all, deg.
    way_deg: f64,
    /// At most how fast, deg/s, without an override.
    max_speed_deg_per_s: f64,
}

impl Sways {
    /// The most of the lines from `first` to `last`; at least 1.
    pub fn most(&self, first: u32, last: u32) -> f64 {
        let lines = first.min(last)..=first.max(last);
        self.beside
            .range(lines)
            .fold(1.0, |most, (_, times)| most.max(*times))
    }

    /// Whether a line has blocks in which rotary axes alone turn.
    pub fn turns_alone(&self, line: u32) -> bool {
        self.alone.contains_key(&line)
    }

    /// How far the lines from `first` to `last` turn rotary axes alone at most within `time_s`, deg.
    pub fn max_turned_alone_deg(&self, first: u32, last: u32, time_s: f64) -> f64 {
        let lines = first.min(last)..=first.max(last);
        let (way_deg, max_speed_deg_per_s) =
            self.alone
                .range(lines)
                .fold((0.0, 0.0_f64), |(way_deg, speed), (_, turned)| {
                    (
                        way_deg + turned.way_deg,
                        speed.max(turned.max_speed_deg_per_s),
                    )
                });
        f64::min(way_deg, max_speed_deg_per_s * time_s)
    }

    fn add(
        &mut self,
        block: &Block,
        moved: &[(usize, f64)],
        rotary: impl Fn(usize) -> bool,
        max_speed_deg_per_s: f64,
    ) {
        let turned = moved.iter().filter(|(axis, _)| rotary(*axis));
        let squares: f64 = turned.map(|(_, by)| by * by).sum();
        let moves_linear = moved.iter().any(|(axis, by)| !rotary(*axis) && *by > 0.0);
        if squares > 0.0 && !moves_linear {
            let turned = self.alone.entry(block.line).or_default();
            turned.way_deg += squares.sqrt();
            let fed_deg_per_s = block.feed_mm_per_s.to_degrees();
            turned.max_speed_deg_per_s = turned
                .max_speed_deg_per_s
                .max(fed_deg_per_s.min(max_speed_deg_per_s));
        } else if squares > 0.0 {
            let times = (1.0 + squares / (block.length_mm * block.length_mm)).sqrt();
            let most = self.beside.entry(block.line).or_insert(1.0);
            *most = most.max(times);
        }
    }
}

impl<'a> Bound<'a> {
    /// What `program` asks for.
    ///
    /// # Errors
    /// The program cannot be read.
    pub fn of(
        program: &std::path::Path,
        machine: &Machine,
        judging: &'a tandem_oracle::Machine,
        filter_s: f64,
    ) -> Result<Asks, String> {
        let axes = (0..machine.axes.count()).map(|axis| {
            (
                axis_index(machine.axes.letter(axis)).unwrap_or_default(),
                machine.axes.is_rotary(axis),
            )
        });
        let mut bound = Self {
            machine: judging,
            axes: axes.collect(),
            filter_s,
            time_constant_s: machine.motion.time_constant_s,
            total_s: 0.0,
            least_s: 0.0,
            dwell_s: 0.0,
            sways: Sways::default(),
        };
        let mut program = tandem_gcode::Program::open(program).map_err(|e| e.to_string())?;
        each_block(
            machine,
            &mut program,
            Switches::default(),
            &mut |block, curve| {
                bound.add(block, curve);
            },
        )
        .map_err(|e| e.to_string())?;
        let time_s = SLACK * bound.total_s
            + bound.dwell_s
            + bound.settling_s()
            + MORE_S
            + 20.0 * machine.rough_period_s;
        Ok(Asks {
            time_s,
            least_s: bound.least_s,
            sways: bound.sways,
        })
    }

    /// Time for slowing down and speeding up once more, s: what an operator may ask for last.
    fn settling_s(&self) -> f64 {
        let one = |axis: &Axis| {
            let build_up_s = axis
                .max_jerk_mm_per_s3
                .map_or(0.0, |jerk| axis.max_acceleration_mm_per_s2 / jerk);
            axis.max_speed_mm_per_s() / axis.max_acceleration_mm_per_s2 + 4.0 * build_up_s
        };
        4.0 * self.machine.axes.iter().map(one).fold(0.0, f64::max)
    }

    fn add(&mut self, block: &Block, curve: Option<Curve<'_>>) {
        if !block.time_constant_s.is_nan() {
            self.time_constant_s = block.time_constant_s;
        }
        if block.kind == BlockKind::Dwell {
            self.dwell_s += block.dwell_s + self.filter_s + 4.0 * self.machine.fine_period_s;
            return;
        }
        let moved: Vec<(usize, f64)> = self
            .axes
            .iter()
            .enumerate()
            .map(|(axis, &(index, rotary))| {
                let by = (block.end[axis] - block.start[axis]).abs();
                (index, if rotary { by.to_degrees() } else { by })
            })
            .collect();
        let axes = &self.axes;
        let rotary = |index| axes.iter().any(|(axis, rotary)| *axis == index && *rotary);
        self.sways
            .add(block, &moved, rotary, self.max_speed_together(&moved));
        let overhead_s =
            self.filter_s + 2.0 * self.time_constant_s / SLACK + 4.0 * self.machine.fine_period_s;
        let moving_s = match block.kind {
            BlockKind::Arc => self.arc_s(block, &moved),
            BlockKind::Nurbs => {
                self.curve_s(block, curve.map_or(0, |curve| curve.control_points.len()))
            }
            _ => {
                self.least_s += self.least_s(&moved);
                self.straight_s(block, &moved)
            }
        };
        self.total_s += moving_s + overhead_s;
    }

    /// The time that a line needs at the speed of its slowest axis or joint, s.
    fn least_s(&self, moved: &[(usize, f64)]) -> f64 {
        let by = |index: usize| {
            let of_axis = moved.iter().find(|(axis, _)| *axis == index);
            of_axis.map_or(0.0, |(_, by)| *by)
        };
        let axes = self.machine.axes.iter();
        let of_axes = axes.map(|axis| by(axis.index) / axis.max_speed_mm_per_s());
        let least_s = of_axes.fold(0.0, f64::max);
        let Joints::Known(joints) = &self.machine.joints else {
            return least_s;
        };
        let of_joints = joints.iter().filter_map(|joint| {
            let Map::Sum(weights) = &joint.map else {
                return None;
            };
            let parts = moved.iter().map(|(axis, by)| weights[*axis].abs() * by);
            let (most, sum) = parts.fold((0.0, 0.0), |(most, sum), part| {
                (f64::max(most, part), sum + part)
            });
            // The others may move it the other way.
            Some((2.0 * most - sum) / joint.limits.max_speed_mm_per_s())
        });
        of_joints.fold(least_s, f64::max)
    }

    /// The speed of the axes that are moved, each at its highest, mm/s, or deg/s of rotary ones.
    fn max_speed_together(&self, moved: &[(usize, f64)]) -> f64 {
        let moves = |axis: &&Axis| {
            moved
                .iter()
                .any(|&(index, by)| index == axis.index && by > 0.0)
        };
        let axes = self.machine.axes.iter().filter(moves);
        axes.map(|axis| axis.max_speed_mm_per_s().powi(2))
            .sum::<f64>()
            .sqrt()
    }

    /// The axes and the joints, each with how far a block that moves the axes by `moved` moves it at most.
    fn lanes(&self, moved: &[(usize, f64)]) -> Vec<(Rates, f64)> {
        let by = |index: usize| {
            moved
                .iter()
                .find(|(axis, _)| *axis == index)
                .map_or(0.0, |(_, by)| *by)
        };
        let mut lanes: Vec<_> = self
            .machine
            .axes
            .iter()
            .map(|axis| (rates(axis), by(axis.index)))
            .collect();
        if let Joints::Known(joints) = &self.machine.joints {
            for joint in joints {
                // No arm and no delta is drawn.
                let Map::Sum(weights) = &joint.map else {
                    continue;
                };
                // A planner that looks at one axis at a time divides a joint's limits between its axes.
                let reach: f64 = moved
                    .iter()
                    .map(|(axis, by)| weights[*axis].abs() * by)
                    .sum();
                let pulled = weights.iter().filter(|weight| **weight != 0.0).count() as f64;
                lanes.push((rates(&joint.limits), reach * pulled));
            }
        }
        lanes
    }

    fn straight_s(&self, block: &Block, moved: &[(usize, f64)]) -> f64 {
        let rapid = block.kind == BlockKind::Rapid;
        let length = block.length_mm;
        let mut limits = Along::of(if rapid { f64::INFINITY } else { feed(block) });
        for (rates, by) in self.lanes(moved) {
            limits.lane(&rates, rapid, by / length);
        }
        limits.rest_to_rest_s(length)
    }

    /// Half of each limit is for turning.
    fn arc_s(&self, block: &Block, moved: &[(usize, f64)]) -> f64 {
        let mut reach = moved.to_vec();
        let (radius_mm, length) = (block.arc.radius_mm, block.length_mm);
        for axis in block.arc.plane {
            let index = self.axes[axis as usize].0;
            reach
                .iter_mut()
                .filter(|(axis, _)| *axis == index)
                .for_each(|(_, by)| *by = length);
        }
        let mut limits = Along::of(feed(block));
        for (rates, by) in self.lanes(&reach) {
            limits.lane(&rates, false, by / length);
        }
        let turning = (0.5 * limits.acceleration * radius_mm).sqrt();
        let jerking = (0.25 * limits.jerk * radius_mm * radius_mm).cbrt();
        limits.speed = limits.speed.min(turning).min(jerking);
        limits.acceleration /= 2.0;
        limits.jerk /= 4.0;
        limits.rest_to_rest_s(length)
    }

    fn curve_s(&self, block: &Block, points: usize) -> f64 {
        let length = block.length_mm;
        let mut limits = Along::of(feed(block));
        let every: Vec<(usize, f64)> = self
            .axes
            .iter()
            .map(|(index, _)| (*index, length))
            .collect();
        for (rates, by) in self.lanes(&every) {
            limits.lane(&rates, false, by / length);
        }
        let rests = RESTS_PER_POINT * points as f64;
        rests * limits.rest_to_rest_s(length / rests)
    }
}

/// The limits along a block.
struct Along {
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

impl Along {
    fn of(speed: f64) -> Self {
        Self {
            speed,
            acceleration: f64::INFINITY,
            jerk: f64::INFINITY,
        }
    }

    /// A coordinate that moves by `share` for each unit along the block.
    fn lane(&mut self, rates: &Rates, rapid: bool, share: f64) {
        if share > 0.0 {
            self.speed = self
                .speed
                .min(if rapid { rates.rapid } else { rates.feed } / share);
            self.acceleration = self.acceleration.min(rates.acceleration / share);
            self.jerk = self.jerk.min(rates.jerk / share);
        }
    }

    fn rest_to_rest_s(&self, length: f64) -> f64 {
        rest_to_rest_s(length, self.speed, self.acceleration, self.jerk)
    }
}

fn rates(axis: &Axis) -> Rates {
    Rates {
        feed: axis.max_feed_mm_per_s,
        rapid: axis.max_rapid_mm_per_s,
        acceleration: axis.max_acceleration_mm_per_s2,
        jerk: axis.max_jerk_mm_per_s3.unwrap_or(f64::INFINITY),
    }
}

/// The feed in what the length is counted in: mm, or rad where only rotary axes move.
fn feed(block: &Block) -> f64 {
    block.feed_mm_per_s.min(block.feed_cap_mm_per_s)
}
