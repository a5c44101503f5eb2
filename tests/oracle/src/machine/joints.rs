//! The joints of a machine: what the drives move, as formulas of the judge's own.

use crate::{
    Axis, Error, LETTERS, Position,
    axis::{axis_index, axis_of_name},
    machine::keys::Keys,
};

/// What is known of the joints.
#[derive(Clone, Debug, PartialEq)]
pub enum Joints {
    /// All of them; none where each is an axis.
    Known(Vec<Joint>),
    /// The kinematics are none that the judge knows.
    Unknown(String),
}

/// A joint that has limits of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name in the file.
    pub name: String,
    /// How it follows from the axes.
    pub map: Map,
    /// Its limits; where it stands does not count.
    pub limits: Axis,
}

/// How a joint follows from the axes, mm or deg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Map {
    /// A unit of each axis moves it by so much.
    Sum(Position),
    /// An arm of two links: axes of its plane, lengths, shoulder, sign of the elbow's angle, and whether this is the elbow.
    Arm {
        /// The axes of the plane.
        axes: [usize; 2],
        /// Upper arm and forearm, mm.
        links_mm: [f64; 2],
        /// Where the shoulder is, mm.
        shoulder_mm: [f64; 2],
        /// Sign of the elbow's angle.
        bend: f64,
        /// This joint is the elbow.
        is_elbow: bool,
    },
    /// A carriage with a rod to a platform: the three axes, length of the rod, and where the column is.
    Carriage {
        /// The axes of the plane, and the one along the column.
        axes: [usize; 3],
        /// The rod, mm.
        rod_mm: f64,
        /// The column, mm.
        column_mm: [f64; 2],
    },
}

impl Joint {
    /// Where it is, mm or deg.
    pub fn position(&self, at: &Position) -> f64 {
        match self.map {
            Map::Sum(weights) => weights.iter().zip(at).map(|(w, axis)| w * axis).sum(),
            Map::Arm {
                axes: [x, y],
                links_mm: [upper, fore],
                shoulder_mm,
                bend,
                is_elbow,
            } => {
                let (x, y) = (at[x] - shoulder_mm[0], at[y] - shoulder_mm[1]);
                // By the law of cosines in the triangle of shoulder, elbow and tool.
                let far = x.hypot(y);
                let angle = |a: f64, b: f64, opposite: f64| {
                    ((a * a + b * b - opposite * opposite) / (2.0 * a * b)).acos()
                };
                if is_elbow {
                    bend * (180.0 - angle(upper, fore, far).to_degrees())
                } else {
                    y.atan2(x).to_degrees() - bend * angle(upper, far, fore).to_degrees()
                }
            }
            Map::Carriage {
                axes: [x, y, z],
                rod_mm,
                column_mm,
            } => {
                let across = (at[x] - column_mm[0]).hypot(at[y] - column_mm[1]);
                at[z] + ((rod_mm - across) * (rod_mm + across)).sqrt()
            }
        }
    }

    /// The size of the numbers that it is computed from: it is as rounded as they are.
    pub fn magnitude(&self, at: &Position) -> f64 {
        match self.map {
            Map::Sum(weights) => weights
                .iter()
                .zip(at)
                .map(|(w, axis)| (w * axis).abs())
                .sum(),
            // An angle is as rounded as the place by the radius; near the ends of the reach by its root.
            Map::Arm { .. } => 3600.0,
            Map::Carriage { rod_mm, .. } => 10.0 * rod_mm,
        }
    }
}

impl Joints {
    pub(super) fn read(keys: &Keys, axes: &[Axis]) -> Result<Self, Error> {
        let plugin = keys
            .text("kinematics.plugin")
            .unwrap_or_else(|| "identity".into());
        let names = keys.names("joints");
        let order: Vec<usize> = keys
            .names("axes")
            .iter()
            .filter_map(|name| axis_of_name(name))
            .collect();
        let sums = |weights: Vec<Position>| weights.into_iter().map(Map::Sum).collect();
        let maps: Vec<Map> = match plugin.as_str() {
            "identity" => sums(
                names
                    .iter()
                    .map(|name| own_axis(keys, name))
                    .collect::<Result<_, _>>()?,
            ),
            "corexy" => sums(corexy(keys, &order)?),
            "wrapped-rotary" => sums(wrapped(keys, &order)?),
            "scara" => arm(keys, &order)?,
            "delta" => carriages(keys, &order)?,
            _ => {
                return Ok(Self::Unknown(format!(
                    "the kinematics {plugin} are not known"
                )));
            }
        };
        if maps.len() != names.len() {
            return Err(keys.error(
                "joints",
                &format!("{} of the {} joints of {plugin}", names.len(), maps.len()),
            ));
        }
        let joint = |(name, map): (&String, Map)| {
            Ok(Joint {
                name: name.clone(),
                map,
                limits: limits(keys, name, axes)?,
            })
        };
        Ok(Self::Known(
            names
                .iter()
                .zip(maps)
                .map(joint)
                .collect::<Result<_, _>>()?,
        ))
    }
}

fn unit(axis: usize) -> Position {
    std::array::from_fn(|i| if i == axis { 1.0 } else { 0.0 })
}

fn stated_axis(keys: &Keys, name: &str) -> Result<Option<usize>, Error> {
    let key = format!("joints.{name}.axis");
    let Some(letter) = keys.text(&key) else {
        return Ok(None);
    };
    axis_of_name(&letter)
        .map(Some)
        .ok_or_else(|| keys.error(&key, "no axis letter"))
}

fn own_axis(keys: &Keys, name: &str) -> Result<Position, Error> {
    let axis = stated_axis(keys, name)?;
    axis.map(unit)
        .ok_or_else(|| keys.error(&format!("joints.{name}.axis"), "missing"))
}

fn letter(keys: &Keys, value: Option<&str>) -> Result<usize, Error> {
    let mut letters = value.unwrap_or_default().chars();
    let index = letters
        .next()
        .and_then(axis_index)
        .filter(|_| letters.next().is_none());
    index.ok_or_else(|| keys.error("kinematics.options", "no axis letter"))
}

/// The sum of two axes in the place of the first, their difference in the place of the second.
fn corexy(keys: &Keys, order: &[usize]) -> Result<Vec<Position>, Error> {
    let stated = keys
        .texts("kinematics.options.axes")
        .unwrap_or_else(|| vec!["x".into(), "y".into()]);
    let [x, y] = [stated.first(), stated.get(1)].map(|name| letter(keys, name.map(String::as_str)));
    let (x, y) = (x?, y?);
    let pulled = |sign: f64| {
        std::array::from_fn(|i| {
            if i == x {
                1.0
            } else {
                f64::from(u8::from(i == y)) * sign
            }
        })
    };
    let row = |axis: &usize| match *axis {
        axis if axis == x => pulled(1.0),
        axis if axis == y => pulled(-1.0),
        axis => unit(axis),
    };
    Ok(order.iter().map(row).collect())
}

/// One axis by the radius of its cylinder, in degrees.
fn wrapped(keys: &Keys, order: &[usize]) -> Result<Vec<Position>, Error> {
    let axis = letter(keys, keys.text("kinematics.options.axis").as_deref())?;
    let radius_mm = keys.need("kinematics.options.radius_mm")?;
    let turn = unit(axis).map(|weight| weight * 180.0 / (std::f64::consts::PI * radius_mm));
    Ok(order
        .iter()
        .map(|of| if *of == axis { turn } else { unit(*of) })
        .collect())
}

/// The axes that the options name, or these.
fn letters<const N: usize>(keys: &Keys, unless: [&str; N]) -> Result<[usize; N], Error> {
    let stated = keys
        .texts("kinematics.options.axes")
        .unwrap_or_else(|| unless.map(String::from).to_vec());
    let mut axes = [0; N];
    for (axis, name) in axes.iter_mut().zip(&stated) {
        *axis = letter(keys, Some(name))?;
    }
    Ok(axes)
}

/// Shoulder and elbow in the places of the two axes of the plane.
fn arm(keys: &Keys, order: &[usize]) -> Result<Vec<Map>, Error> {
    let axes = letters(keys, ["x", "y"])?;
    let links_mm = [
        keys.need("kinematics.options.upper_arm_mm")?,
        keys.need("kinematics.options.forearm_mm")?,
    ];
    let shoulder = "kinematics.options.shoulder_mm";
    let shoulder_mm = if keys.has(shoulder) {
        keys.pair(shoulder)?
    } else {
        [0.0; 2]
    };
    let elbow = keys.text("kinematics.options.elbow");
    let bend = if elbow.is_some_and(|side| side == "right") {
        1.0
    } else {
        -1.0
    };
    let of = |axis: &usize| {
        let is_elbow = *axis == axes[1];
        if axes.contains(axis) {
            Map::Arm {
                axes,
                links_mm,
                shoulder_mm,
                bend,
                is_elbow,
            }
        } else {
            Map::Sum(unit(*axis))
        }
    };
    Ok(order.iter().map(of).collect())
}

/// Three carriages in the places of the three axes.
fn carriages(keys: &Keys, order: &[usize]) -> Result<Vec<Map>, Error> {
    let axes = letters(keys, ["x", "y", "z"])?;
    let rod_mm = keys.need("kinematics.options.rod_mm")?;
    let radius_mm = keys.need("kinematics.options.radius_mm")?;
    let of = |axis: &usize| match axes.iter().position(|own| own == axis) {
        Some(number) => {
            let angle = std::f64::consts::TAU * number as f64 / 3.0;
            let column_mm = [radius_mm * angle.cos(), radius_mm * angle.sin()];
            Map::Carriage {
                axes,
                rod_mm,
                column_mm,
            }
        }
        None => Map::Sum(unit(*axis)),
    };
    Ok(order.iter().map(of).collect())
}

/// What a joint does not state it takes from the axis that it states.
fn limits(keys: &Keys, name: &str, axes: &[Axis]) -> Result<Axis, Error> {
    let table = format!("joints.{name}");
    let stated = stated_axis(keys, name)?;
    let base = stated.and_then(|index| axes.iter().find(|axis| axis.index == index));
    if let Some(index) = stated.filter(|_| base.is_none()) {
        return Err(keys.error(
            &format!("{table}.axis"),
            &format!("the machine has no axis {}", LETTERS[index]),
        ));
    }
    let kind = keys.text(&format!("{table}.kind"));
    let rotary = base.map_or(kind.is_some_and(|kind| kind == "rotary"), |axis| {
        axis.rotary
    });
    let unit = if rotary { "deg" } else { "mm" };
    let key = |quantity: &str, per: &str| format!("{table}.{quantity}_{unit}{per}");
    let or_base = |key: &str, base: Option<f64>| match (keys.number(key)?, base) {
        (None, None) => keys.need(key),
        (stated, base) => Ok(stated.or(base).unwrap_or_default()),
    };
    let travel = key("travel", "");
    let max_feed = or_base(
        &key("max_feed", "_per_min"),
        base.map(|axis| 60.0 * axis.max_feed_mm_per_s),
    )?;
    let rapid = base.map_or(max_feed, |axis| 60.0 * axis.max_rapid_mm_per_s);
    Ok(Axis {
        index: base.map_or(0, |axis| axis.index),
        rotary,
        travel_mm: match base {
            _ if keys.has(&travel) => keys.range(&travel)?,
            Some(axis) => axis.travel_mm,
            None => [f64::NEG_INFINITY, f64::INFINITY],
        },
        start_mm: 0.0,
        max_feed_mm_per_s: max_feed / 60.0,
        max_rapid_mm_per_s: or_base(&key("max_rapid", "_per_min"), Some(rapid))? / 60.0,
        max_acceleration_mm_per_s2: or_base(
            &key("max_acceleration", "_per_s2"),
            base.map(|axis| axis.max_acceleration_mm_per_s2),
        )?,
        max_jerk_mm_per_s3: keys
            .number(&key("max_jerk", "_per_s3"))?
            .or(base.and_then(|axis| axis.max_jerk_mm_per_s3)),
    })
}
