//! `[faults]` read strictly: whatever is unknown, contradictory or without sense is refused by name.

use tandem_sdk::{AxisVector, MAX_AXES};
use toml::{Table, Value};

use crate::entry::{Entry, Refusal};
use crate::kind::{Corruption, Kind, MAX_DELAY, Mask};
use crate::nearest::unknown;
use crate::schedule::{Rate, When};
use crate::wrapper::Plan;

/// Keys of every kind but `delay`.
const COMMON: &[&str] = &[
    "kind",
    "from_tick",
    "until_tick",
    "probability",
    "every",
    "at_call",
    "periods",
];
/// Keys of `delay`: it holds for its whole window.
const DELAY: &[&str] = &["kind", "from_tick", "until_tick", "periods"];
/// Kinds, with the keys that they have besides the common ones.
const KINDS: &[(&str, &[&str])] = &[
    ("drop", &[]),
    ("delay", &[]),
    ("freeze", &["joint"]),
    ("duplicate", &[]),
    (
        "corrupt",
        &["joint", "magnitude_mm", "magnitude_deg", "value"],
    ),
    ("fail", &[]),
];

/// The joints of the machine.
#[derive(Debug)]
pub struct Joints {
    /// Which of them turn.
    pub rotary: [bool; MAX_AXES],
    /// How many there are.
    pub count: usize,
}

/// The whole table.
#[derive(Debug, PartialEq)]
pub struct Faults {
    /// Seed of all wrappers.
    pub(crate) seed: u64,
    /// The wrappers, the one next to the drives first.
    pub(crate) wrap: Vec<Plan>,
}

impl Faults {
    /// Reads the table. Host; allocates.
    ///
    /// # Errors
    /// The first key that makes no sense on a machine with these `joints`, and why.
    pub fn read(table: &Table, joints: &Joints) -> Result<Self, Refusal> {
        let whole = Entry {
            table,
            path: "faults".to_string(),
        };
        whole.permit(&["seed", "wrap"], |_| false)?;
        let seed = whole.count("seed", 0)?.unwrap_or(0);
        let wrap = match table.get("wrap") {
            None => return whole.refuse("", "has no [[faults.wrap]]: nothing is to go wrong"),
            Some(Value::Array(wrap)) => wrap,
            Some(_) => {
                return whole.refuse(
                    "wrap",
                    "must be an array of tables, written as [[faults.wrap]]",
                );
            }
        };
        let entries = wrap.iter().enumerate().map(|(index, value)| match value {
            Value::Table(table) => Entry {
                table,
                path: format!("faults.wrap[{index}]"),
            }
            .plan(joints),
            _ => whole.refuse(&format!("wrap[{index}]"), "must be a table"),
        });
        Ok(Self {
            seed,
            wrap: entries.collect::<Result<_, _>>()?,
        })
    }
}

impl Entry<'_> {
    fn plan(&self, joints: &Joints) -> Result<Plan, Refusal> {
        let Some(name) = self.text("kind")? else {
            return self.refuse("", "has no kind");
        };
        let names: Vec<&str> = KINDS.iter().map(|(name, _)| *name).collect();
        let Some((_, own)) = KINDS.iter().find(|(known, _)| *known == name) else {
            return self.refuse("kind", &unknown("kind", name, &names));
        };
        let common = if name == "delay" { DELAY } else { COMMON };
        self.permit(&[common, own].concat(), is_known)?;
        let periods = self.count("periods", 1)?;
        let kind = match name {
            "drop" => Kind::Drop,
            "delay" => return self.delay(periods),
            "freeze" => Kind::Freeze(self.joint(joints)?.map_or([true; MAX_AXES], only)),
            "duplicate" => Kind::Duplicate,
            "corrupt" => self.corrupt(joints)?,
            _ => Kind::Fail,
        };
        Ok(Plan {
            kind,
            when: self.when(periods.unwrap_or(1))?,
        })
    }

    fn delay(&self, periods: Option<u64>) -> Result<Plan, Refusal> {
        let Some(periods) = periods else {
            return self.refuse("", "has no periods: how late do setpoints come?");
        };
        if periods > MAX_DELAY {
            return self.refuse(
                "periods",
                &format!("{periods} are too many: at most {MAX_DELAY}"),
            );
        }
        let (from_tick, until_tick) = self.window()?;
        let when = When {
            from_tick,
            until_tick,
            rate: Rate::Always,
            periods: 1,
        };
        Ok(Plan {
            kind: Kind::Delay(periods),
            when,
        })
    }

    fn corrupt(&self, joints: &Joints) -> Result<Kind, Refusal> {
        let joint = self.joint(joints)?;
        let mask: Mask =
            std::array::from_fn(|i| i < joints.count && joint.is_none_or(|joint| joint == i));
        let (mm, deg) = (self.number("magnitude_mm")?, self.number("magnitude_deg")?);
        let value = match (self.text("value")?, mm.or(deg)) {
            (None, Some(_)) => None,
            (Some("nan"), None) => Some(f64::NAN),
            (Some("inf"), None) => Some(f64::INFINITY),
            (Some(other), None) => {
                return self.refuse("value", &unknown("value", other, &["nan", "inf"]));
            }
            (Some(_), Some(_)) => {
                return self.refuse(
                    "value",
                    "contradicts the magnitude: either the one or the other",
                );
            }
            (None, None) => {
                return self.refuse("", "has neither magnitude_mm, magnitude_deg nor value");
            }
        };
        if let Some(value) = value {
            return Ok(Kind::Corrupt(Corruption::Value(value), mask));
        }
        let units = [("magnitude_mm", mm, false), ("magnitude_deg", deg, true)];
        for (key, _, turns) in units.iter().filter(|(_, stated, _)| stated.is_some()) {
            if !(0..MAX_AXES).any(|i| mask[i] && joints.rotary[i] == *turns) {
                let kind = if *turns { "linear" } else { "rotary" };
                return self.refuse(
                    key,
                    &format!("has the wrong unit: what it concerns is {kind}"),
                );
            }
        }
        let (mm, rad) = (mm.unwrap_or(0.0), deg.unwrap_or(0.0).to_radians());
        let off = AxisVector(std::array::from_fn(
            |i| if joints.rotary[i] { rad } else { mm },
        ));
        Ok(Kind::Corrupt(Corruption::Off(off), mask))
    }

    fn when(&self, periods: u64) -> Result<When, Refusal> {
        let stated = ["probability", "every", "at_call"]
            .map(|key| self.table.contains_key(key).then_some(key));
        let mut stated = stated.into_iter().flatten();
        let (first, second) = (stated.next(), stated.next());
        if let (Some(first), Some(second)) = (first, second) {
            return self.refuse(
                second,
                &format!("contradicts {first}: only one of them says how often"),
            );
        }
        let windowed = ["from_tick", "until_tick"]
            .into_iter()
            .find(|key| self.table.contains_key(*key));
        let (from_tick, until_tick) = self.window()?;
        let rate = match (first, windowed) {
            (Some("at_call"), Some(key)) => {
                return self.refuse(
                    key,
                    "contradicts at_call, which counts from the first exchange",
                );
            }
            (Some("at_call"), None) => Rate::AtCall(self.count("at_call", 1)?.unwrap_or(1)),
            (Some("every"), _) => self.every(periods)?,
            (Some(_), _) => self.probability()?,
            (None, Some(_)) => Rate::Always,
            (None, None) => {
                return self.refuse(
                    "",
                    "says not when: probability, every, at_call, from_tick, until_tick",
                );
            }
        };
        Ok(When {
            from_tick,
            until_tick,
            rate,
            periods,
        })
    }

    fn every(&self, periods: u64) -> Result<Rate, Refusal> {
        let every = self.count("every", 1)?.unwrap_or(1);
        if periods > 1 && periods >= every {
            return self.refuse(
                "periods",
                &format!("{periods} periods every {every} never end: leave `every` out"),
            );
        }
        Ok(Rate::Every(every))
    }

    fn probability(&self) -> Result<Rate, Refusal> {
        let probability = self.number("probability")?.unwrap_or(0.0);
        if !(0.0..=1.0).contains(&probability) {
            return self.refuse("probability", &format!("{probability} is not 0 to 1"));
        }
        Ok(Rate::Probability(probability))
    }

    fn window(&self) -> Result<(u64, u64), Refusal> {
        let from = self.count("from_tick", 0)?.unwrap_or(0);
        let until = self.count("until_tick", 0)?.unwrap_or(u64::MAX);
        if from >= until {
            return self.refuse(
                "until_tick",
                &format!("the window from {from} until {until} is empty"),
            );
        }
        Ok((from, until))
    }

    fn joint(&self, joints: &Joints) -> Result<Option<usize>, Refusal> {
        let Some(joint) = self.count("joint", 0)? else {
            return Ok(None);
        };
        if joint >= joints.count as u64 {
            let last = joints.count.saturating_sub(1);
            return self.refuse(
                "joint",
                &format!("the machine has joints 0 to {last}, not {joint}"),
            );
        }
        Ok(Some(joint as usize))
    }
}

fn only(joint: usize) -> Mask {
    std::array::from_fn(|i| i == joint)
}

/// Whether some kind has this key.
fn is_known(key: &str) -> bool {
    COMMON.contains(&key) || KINDS.iter().any(|(_, own)| own.contains(&key))
}
