//! What may vary: keys of the machine file, and the values that each may take.

use std::fmt;

/// Values of a range that are told apart: a thousand are finer than any machine file is read by people.
const STEPS: u32 = 1000;
/// From this ratio of its ends on a range is walked by ratios: 1, 10, 100 are equally far from each other.
const LOGARITHMIC_FROM: f64 = 20.0;

/// One thing that varies: keys that always have the same value, and what it may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The keys, as in `axes.x.max_jerk_mm_per_s3`.
    pub keys: Vec<String>,
    /// The values.
    pub values: Values,
}

/// The values of a [`Parameter`].
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// These, in this order.
    List(Vec<String>),
    /// Numbers from the first to the second, whole ones where both were written so.
    Range {
        /// The lowest.
        low: f64,
        /// The highest.
        high: f64,
        /// Only whole numbers.
        whole: bool,
        /// How many, where that is stated; the ends are among them.
        count: Option<u32>,
    },
}

impl Parameter {
    /// Reads `key=2,3`, `key=5..50`, `key=5..50:10` or `key+key=…`, as on the command line.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn read(text: &str) -> Result<Self, String> {
        let (keys, values) = text
            .split_once('=')
            .ok_or_else(|| format!("{text}: it has the form key=values"))?;
        let keys: Vec<String> = keys.split('+').map(|key| key.trim().to_string()).collect();
        if keys.iter().any(String::is_empty) {
            return Err(format!("{text}: a key is empty"));
        }
        let values = Values::read(values.trim()).map_err(|cause| format!("{text}: {cause}"))?;
        Ok(Self { keys, values })
    }

    /// What it is called.
    pub fn name(&self) -> String {
        self.keys.join("+")
    }

    /// The keys with `value`.
    pub fn set(&self, value: &str) -> impl Iterator<Item = (String, String)> {
        self.keys
            .iter()
            .map(move |key| (key.clone(), value.to_string()))
    }
}

impl Values {
    fn read(text: &str) -> Result<Self, String> {
        let Some((low, high)) = text.split_once("..") else {
            let list: Vec<String> = split_list(text).into_iter().map(str::to_string).collect();
            return match list.iter().find(|value| value.is_empty()) {
                Some(_) => Err("a value is empty".to_string()),
                None => Ok(Self::List(list)),
            };
        };
        let (high, count) = match high.split_once(':') {
            Some((high, count)) => (high, Some(count)),
            None => (high, None),
        };
        let count = count.map(|count| {
            let count = count
                .trim()
                .parse()
                .ok()
                .filter(|count| (2..=STEPS).contains(count));
            count.ok_or_else(|| format!("a range has from 2 to {STEPS} values"))
        });
        let number = |text: &str| {
            let number = text
                .trim()
                .parse()
                .ok()
                .filter(|number: &f64| number.is_finite());
            number.ok_or_else(|| format!("{} is no number", text.trim()))
        };
        let whole = [low, high]
            .iter()
            .all(|end| end.trim().parse::<i64>().is_ok());
        let (low, high) = (number(low)?, number(high)?);
        if low >= high {
            return Err(format!("{low} is not below {high}"));
        }
        let count = count.transpose()?;
        Ok(Self::Range {
            low,
            high,
            whole,
            count,
        })
    }

    /// How many values there are to choose from.
    pub fn count(&self) -> u32 {
        match self {
            Self::List(list) => list.len() as u32,
            Self::Range {
                count: Some(count), ..
            } => *count,
            Self::Range {
                low,
                high,
                whole: true,
                ..
            } => ((high - low) as u32).saturating_add(1).min(STEPS + 1),
            Self::Range { .. } => STEPS + 1,
        }
    }

    /// The value at `share` of the way through them, 0 to 1.
    pub fn at(&self, share: f64) -> String {
        let last = self.count() - 1;
        let place = (share.clamp(0.0, 1.0) * f64::from(last)).round();
        match self {
            Self::List(list) => list[place as usize].clone(),
            Self::Range {
                low, high, whole, ..
            } => {
                let share = if last == 0 {
                    0.0
                } else {
                    place / f64::from(last)
                };
                let value = if is_logarithmic(*low, *high) {
                    low * (high / low).powf(share)
                } else {
                    low + share * (high - low)
                };
                number_text(value.clamp(*low, *high), *whole, (*low, *high))
            }
        }
    }

    /// How far through them `value` is, 0 to 1: the nearest where it is a number, else the first.
    pub fn share_of(&self, value: &str) -> f64 {
        match self {
            Self::List(list) => {
                let same = |one: &String| {
                    one == value
                        || one
                            .parse::<f64>()
                            .ok()
                            .is_some_and(|one| Some(one) == value.parse().ok())
                };
                let place = list.iter().position(same).unwrap_or(0);
                place as f64 / f64::from(self.count() - 1).max(1.0)
            }
            Self::Range { low, high, .. } => {
                let value = value.parse().unwrap_or(*low).clamp(*low, *high);
                if is_logarithmic(*low, *high) {
                    (value / low).ln() / (high / low).ln()
                } else {
                    (value - low) / (high - low)
                }
            }
        }
    }

    /// All of them, at most `most`, evenly.
    pub fn spread(&self, most: u32) -> Vec<String> {
        let count = self.count().min(most.max(2));
        if count == 1 {
            return vec![self.at(0.0)];
        }
        let mut all: Vec<String> = (0..count)
            .map(|i| self.at(f64::from(i) / f64::from(count - 1)))
            .collect();
        all.dedup();
        all
    }

    /// Whether they are numbers on a scale of ratios.
    pub fn is_logarithmic(&self) -> bool {
        matches!(self, Self::Range { low, high, .. } if is_logarithmic(*low, *high))
    }
}

impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::List(list) => write!(f, "{}", list.join(", ")),
            Self::Range { low, high, .. } => write!(f, "{low} to {high}"),
        }
    }
}

fn is_logarithmic(low: f64, high: f64) -> bool {
    low > 0.0 && high / low >= LOGARITHMIC_FROM
}

/// A value as people would write it: as many digits as the steps of its range need.
fn number_text(value: f64, whole: bool, (low, high): (f64, f64)) -> String {
    if whole {
        return format!("{}", value.round());
    }
    // The ends are what was asked for, to the last digit.
    if value == low || value == high {
        return format!("{value:?}");
    }
    let step = if is_logarithmic(low, high) {
        value / 500.0
    } else {
        (high - low) / f64::from(STEPS)
    };
    let decimals = (-step.log10().floor()).clamp(1.0, 17.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = text.trim_end_matches('0');
    if text.ends_with('.') {
        format!("{text}0")
    } else {
        text.to_string()
    }
}

/// Splits a list at the commas outside of brackets and quotes: `[-5, 5],[-9, 9]` has two values.
fn split_list(text: &str) -> Vec<&str> {
    let (mut depth, mut quoted, mut from, mut parts) = (0_u32, false, 0, vec![]);
    for (place, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth = depth.saturating_sub(1),
            ',' if !quoted && depth == 0 => {
                parts.push(text[from..place].trim());
                from = place + 1;
            }
            _ => {}
        }
    }
    parts.push(text[from..].trim());
    parts
}

/// Every combination of the values of `parameters`, the last one changing first.
///
/// # Errors
/// A range says not how many values of it are meant.
pub fn grid(parameters: &[Parameter]) -> Result<Vec<Vec<(String, String)>>, String> {
    let mut all = vec![vec![]];
    for parameter in parameters {
        if let Values::Range { count: None, .. } = parameter.values {
            let name = parameter.name();
            return Err(format!(
                "{name}: how many values of the range? As in {name}=1..5:9"
            ));
        }
        let values = parameter.values.spread(parameter.values.count());
        let with = |set: &Vec<(String, String)>, value: &String| {
            set.iter().cloned().chain(parameter.set(value)).collect()
        };
        all = all
            .iter()
            .flat_map(|set| values.iter().map(move |value| with(set, value)))
            .collect();
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Values {
        Parameter::read(&format!("key={text}")).unwrap().values
    }

    #[test]
    fn what_is_written_is_what_varies() {
        let two = Parameter::read("axes.x.a + axes.y.a=2.5,3").unwrap();
        assert_eq!(two.name(), "axes.x.a+axes.y.a");
        assert_eq!(two.values.spread(9), ["2.5", "3"]);
        assert_eq!(two.set("3").count(), 2);
        assert_eq!(values("1..4").spread(99), ["1", "2", "3", "4"]);
        assert_eq!(
            values("0.0..1.0:5").spread(99),
            ["0.0", "0.25", "0.5", "0.75", "1.0"]
        );
        assert_eq!(values("[-5, 5],[-9, 9]").spread(9), ["[-5, 5]", "[-9, 9]"]);
        assert_eq!(values("\"a,b\",c").count(), 2);
        assert_eq!(values("true,false").at(1.0), "false");
        assert_eq!(values("1..1000:4").spread(9), ["1", "10", "100", "1000"]);
        assert_eq!(values("0.001..0.1").at(0.5), "0.01");
        assert_eq!(values("5..50").at(0.333), "20");
    }

    #[test]
    fn a_value_finds_its_place_again() {
        for text in [
            "5..50",
            "0.001..0.1",
            "-1.5..2.5",
            "2,3,5",
            "1..20000",
            "0.01..0.02",
        ] {
            let values = values(text);
            for i in 0..=20 {
                let value = values.at(f64::from(i) / 20.0);
                assert_eq!(values.at(values.share_of(&value)), value, "{text}");
            }
        }
    }

    #[test]
    fn what_cannot_be_varied_is_said() {
        for (text, words) in [
            ("key", "the form"),
            ("=1", "a key is empty"),
            ("a+=1", "a key is empty"),
            ("a=", "a value is empty"),
            ("a=1,,2", "a value is empty"),
            ("a=5..1", "not below"),
            ("a=x..1", "x is no number"),
            ("a=1..inf", "no number"),
            ("a=1..5:1", "from 2 to"),
        ] {
            let refusal = Parameter::read(text).unwrap_err();
            assert!(refusal.contains(words), "{text}: {refusal}");
        }
        assert!(
            grid(&[Parameter::read("a=1..5").unwrap()])
                .unwrap_err()
                .contains("how many")
        );
    }

    #[test]
    fn a_grid_has_every_combination_once() {
        let parameters = ["a=1,2", "b=0.0..1.0:3"].map(|text| Parameter::read(text).unwrap());
        let grid = grid(&parameters).unwrap();
        let shown: Vec<String> = grid.iter().map(|set| crate::job::shown(set)).collect();
        assert_eq!(shown.len(), 6);
        assert_eq!(shown[0], "a=1 b=0.0");
        assert_eq!(shown[1], "a=1 b=0.5");
        assert_eq!(shown[5], "a=2 b=1.0");
        assert_eq!(super::grid(&[]).unwrap(), [vec![]]);
    }
}
