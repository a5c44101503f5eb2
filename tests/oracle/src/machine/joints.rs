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
    /// What a unit of each axis moves it by: mm or deg.
    pub weights: Position,
    /// Its limits; where it stands does not count.
    pub limits: Axis,
}

impl Joint {
    /// Where it is, mm or deg.
    pub fn position(&self, axes: &Position) -> f64 {
        self.weights
            .iter()
            .zip(axes)
            .map(|(weight, axis)| weight * axis)
            .sum()
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
        let weights = match plugin.as_str() {
            "identity" => names
                .iter()
                .map(|name| own_axis(keys, name))
                .collect::<Result<_, _>>()?,
            "corexy" => corexy(keys, &order)?,
            "wrapped-rotary" => wrapped(keys, &order)?,
            _ => {
                return Ok(Self::Unknown(format!(
                    "the kinematics {plugin} are not known"
                )));
            }
        };
        if weights.len() != names.len() {
            return Err(keys.error(
                "joints",
                &format!(
                    "{} of the {} joints of {plugin}",
                    names.len(),
                    weights.len()
                ),
            ));
        }
        let joint = |(name, weights): (&String, Position)| {
            Ok(Joint {
                name: name.clone(),
                weights,
                limits: limits(keys, name, axes)?,
            })
        };
        Ok(Self::Known(
            names
                .iter()
                .zip(weights)
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
