//! Parameters: what a module declares, and the values that the machine file gives.

use crate::error::Refusal;
use crate::nearest::nearest;

/// A parameter as the module declares it.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name, with its unit.
    pub name: String,
    /// What it means.
    pub description: String,
    /// Lowest value.
    pub lowest: f64,
    /// Highest value.
    pub highest: f64,
    /// Value where the machine file states none.
    pub default: f64,
}

/// Values by name, as the machine file states them.
pub type Values = Vec<(String, f64)>;

/// The value of each declared parameter.
///
/// # Errors
/// Each name that is not declared, with the nearest, and each value out of range.
pub fn resolve(declared: &[Parameter], stated: &[(String, f64)]) -> Result<Vec<f64>, Refusal> {
    let wrong: Vec<String> = stated
        .iter()
        .filter_map(|(name, value)| complaint(declared, name, *value))
        .collect();
    if !wrong.is_empty() {
        return Err(Refusal::Parameters(wrong));
    }
    let value = |parameter: &Parameter| {
        let found = stated.iter().find(|(name, _)| *name == parameter.name);
        found.map_or(parameter.default, |(_, value)| *value)
    };
    Ok(declared.iter().map(value).collect())
}

fn complaint(declared: &[Parameter], name: &str, value: f64) -> Option<String> {
    let Some(parameter) = declared.iter().find(|p| p.name == name) else {
        let names = declared.iter().map(|p| p.name.as_str());
        let hint = nearest(name, names, "it declares none");
        return Some(format!("it has no parameter {name:?}; {hint}"));
    };
    let Parameter {
        lowest, highest, ..
    } = parameter;
    let inside = value >= *lowest && value <= *highest;
    (!inside).then(|| format!("{name} is {value}; it must be from {lowest} to {highest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declared() -> Vec<Parameter> {
        let new = |name: &str| Parameter {
            name: name.to_string(),
            description: String::new(),
            lowest: 1.0,
            highest: 100.0,
            default: 20.0,
        };
        vec![new("corner_error_um"), new("floor_mm_per_min")]
    }

    #[test]
    fn stated_values_take_the_place_of_defaults() {
        let values = resolve(&declared(), &[("floor_mm_per_min".to_string(), 7.0)]);
        assert_eq!(values, Ok(vec![20.0, 7.0]));
    }

    #[test]
    fn slips_are_refused_with_the_nearest_name_and_the_range() {
        let stated = [
            ("corner_eror_um".to_string(), 5.0),
            ("floor_mm_per_min".to_string(), 200.0),
        ];
        let refusal = resolve(&declared(), &stated).unwrap_err().to_string();
        assert!(
            refusal.contains("no parameter \"corner_eror_um\"; the nearest is corner_error_um"),
            "{refusal}"
        );
        assert!(
            refusal.contains("floor_mm_per_min is 200; it must be from 1 to 100"),
            "{refusal}"
        );
        assert!(resolve(&declared(), &[("floor_mm_per_min".to_string(), f64::NAN)]).is_err());
    }
}
