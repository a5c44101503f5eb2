//! Models as TOML files: written by `tandem calibrate`, read by `tandem estimate`.

use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};
use tandem_sdk::MAX_AXES;
use toml::Spanned;

use crate::choice::Choice;
use crate::junction::Rule;
use crate::overlap::Constants;
use crate::planned::{Planned, PlannerKind};
use crate::regression::{Coefficients, Switch};

/// The format that is written and read.
const FORMAT: u32 = 1;
const MM_PER_MIN: f64 = 60.0;

/// Why a model file is refused: file, line, key and cause.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {cause}")]
pub struct ModelFileError {
    /// `file:line:column`, or the file alone.
    pub place: String,
    /// What is wrong.
    pub cause: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: Spanned<u32>,
    #[allow(dead_code, reason = "for people")]
    calibrated: Option<String>,
    model: Spanned<Kind>,
    rapid_acceleration_mm_per_s2: Option<Spanned<f64>>,
    regression: Option<Spanned<RegressionTable>>,
    overlap: Option<Spanned<OverlapTable>>,
    #[serde(rename = "look-ahead")]
    look_ahead: Option<Spanned<LookAheadTable>>,
    smooth: Option<Spanned<PlannedTable>>,
    #[serde(rename = "block-overlap")]
    block_overlap: Option<Spanned<PlannedTable>>,
}

#[derive(Clone, Copy, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Regression,
    Overlap,
    LookAhead,
    Smooth,
    BlockOverlap,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RegressionTable {
    acceleration_mm_per_s2: Spanned<f64>,
    short_mm_per_min: [Spanned<f64>; 3],
    long_mm_per_min: [Spanned<f64>; 13],
    fixed_switch_mm: Option<Spanned<f64>>,
    block_time_ms: Option<Spanned<f64>>,
    ramp_ms: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OverlapTable {
    time_constant_ms: Spanned<f64>,
    #[serde(default)]
    obeys_program: bool,
    tick_ms: Option<Spanned<f64>>,
}

#[derive(Clone, Copy, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum JunctionKind {
    Tangent,
    Axis,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LookAheadTable {
    junction: Spanned<JunctionKind>,
    acceleration_mm_per_s2: Spanned<PerAxis>,
    allowable_speed_difference_mm_per_min: Spanned<f64>,
    tangent_feed_mm_per_min: Option<Spanned<f64>>,
}

/// Both planners: what belongs to one of them is refused in the other.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlannedTable {
    acceleration_mm_per_s2: Spanned<PerAxis>,
    jerk_mm_per_s3: Option<Spanned<PerAxis>>,
    path_tolerance_mm: Spanned<f64>,
    time_constant_ms: Option<Spanned<f64>>,
}

/// One for all axes, or one for each in the order of the machine file; axes beyond have the least of them.
#[derive(Deserialize)]
#[serde(untagged)]
enum PerAxis {
    All(f64),
    Each(Vec<f64>),
}

impl PerAxis {
    /// As many as a machine may have axes; none where there are none or too many.
    fn each(&self) -> Option<[f64; MAX_AXES]> {
        match self {
            Self::All(one) => Some([*one; MAX_AXES]),
            Self::Each(each) if (1..=MAX_AXES).contains(&each.len()) => {
                let least = each.iter().copied().fold(f64::INFINITY, f64::min);
                let of = |axis: usize| each.get(axis).copied().unwrap_or(least);
                Some(std::array::from_fn(of))
            }
            Self::Each(_) => None,
        }
    }
}

/// A text with the name that refusals give it.
struct Source<'a> {
    name: String,
    text: &'a str,
}

impl Source<'_> {
    fn refuse(&self, span: Option<Range<usize>>, cause: impl Into<String>) -> ModelFileError {
        let place = span.map_or_else(
            || self.name.clone(),
            |span| {
                let before = &self.text[..span.start.min(self.text.len())];
                let line = before.matches('\n').count() + 1;
                let column = before
                    .rsplit('\n')
                    .next()
                    .unwrap_or_default()
                    .chars()
                    .count()
                    + 1;
                format!("{}:{line}:{column}", self.name)
            },
        );
        ModelFileError {
            place,
            cause: cause.into(),
        }
    }

    fn finite(&self, key: &str, value: &Spanned<f64>) -> Result<f64, ModelFileError> {
        let number = *value.get_ref();
        number.is_finite().then_some(number).ok_or_else(|| {
            self.refuse(
                Some(value.span()),
                format!("{key}: {number} is not a number to calculate with"),
            )
        })
    }

    fn positive(&self, key: &str, value: &Spanned<f64>) -> Result<f64, ModelFileError> {
        let number = self.finite(key, value)?;
        let refusal = || {
            self.refuse(
                Some(value.span()),
                format!("{key}: {number} is not above zero"),
            )
        };
        (number > 0.0).then_some(number).ok_or_else(refusal)
    }

    fn optional(
        &self,
        key: &str,
        value: Option<&Spanned<f64>>,
    ) -> Result<Option<f64>, ModelFileError> {
        value.map(|value| self.positive(key, value)).transpose()
    }

    fn per_axis(
        &self,
        key: &str,
        values: &Spanned<PerAxis>,
    ) -> Result<[f64; MAX_AXES], ModelFileError> {
        let each = values.get_ref().each();
        let positive = |each: &[f64; MAX_AXES]| each.iter().all(|a| a.is_finite() && *a > 0.0);
        each.filter(positive).ok_or_else(|| {
            let cause = format!(
                "{key}: must be a number above zero, or an array of 1 to {MAX_AXES} of them, one an axis"
            );
            self.refuse(Some(values.span()), cause)
        })
    }

    fn all<const N: usize>(
        &self,
        key: &str,
        values: &[Spanned<f64>; N],
    ) -> Result<[f64; N], ModelFileError> {
        let mut all = [0.0; N];
        for (to, from) in all.iter_mut().zip(values) {
            *to = self.finite(key, from)?;
        }
        Ok(all)
    }
}

/// Reads the model file at `path`.
///
/// # Errors
/// What cannot be read or is not a model, with file, line and key.
pub fn read(path: &Path) -> Result<Choice, ModelFileError> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| ModelFileError {
        place: name.clone(),
        cause: error.to_string(),
    })?;
    parse(&name, &text)
}

/// Reads a model from `text`; `name` is for refusals.
///
/// # Errors
/// What is not a model, with file, line and key.
pub fn parse(name: &str, text: &str) -> Result<Choice, ModelFileError> {
    let source = Source {
        name: name.to_string(),
        text,
    };
    let file: File = toml::from_str(text)
        .map_err(|error| source.refuse(error.span(), one_line(error.message())))?;
    if *file.format.get_ref() != FORMAT {
        let cause = format!(
            "format: this is format {}, and only format {FORMAT} is known",
            file.format.get_ref()
        );
        return Err(source.refuse(Some(file.format.span()), cause));
    }
    let rapid = source.optional(
        "rapid_acceleration_mm_per_s2",
        file.rapid_acceleration_mm_per_s2.as_ref(),
    )?;
    let kind = *file.model.get_ref();
    let tables = [
        (
            "regression",
            Kind::Regression,
            file.regression.as_ref().map(Spanned::span),
        ),
        (
            "overlap",
            Kind::Overlap,
            file.overlap.as_ref().map(Spanned::span),
        ),
        (
            "look-ahead",
            Kind::LookAhead,
            file.look_ahead.as_ref().map(Spanned::span),
        ),
        (
            "smooth",
            Kind::Smooth,
            file.smooth.as_ref().map(Spanned::span),
        ),
        (
            "block-overlap",
            Kind::BlockOverlap,
            file.block_overlap.as_ref().map(Spanned::span),
        ),
    ];
    for (key, of, span) in tables {
        if let Some(span) = span.filter(|_| of != kind) {
            return Err(source.refuse(Some(span), format!("{key}: model names another form")));
        }
    }
    if let (Some(rapid), Kind::Smooth | Kind::BlockOverlap) =
        (&file.rapid_acceleration_mm_per_s2, kind)
    {
        let cause = "rapid_acceleration_mm_per_s2: a planner has one acceleration for all";
        return Err(source.refuse(Some(rapid.span()), cause));
    }
    let missing = || {
        source.refuse(
            Some(file.model.span()),
            "model: the table of this name is missing",
        )
    };
    match kind {
        Kind::Regression => {
            let table = file.regression.as_ref().ok_or_else(missing)?;
            regression(&source, table.get_ref(), rapid).map(Choice::Regression)
        }
        Kind::Overlap => overlap(
            &source,
            file.overlap.as_ref().ok_or_else(missing)?.get_ref(),
            rapid,
        )
        .map(Choice::Overlap),
        Kind::LookAhead => {
            let table = file.look_ahead.as_ref().ok_or_else(missing)?;
            Ok(Choice::LookAhead(
                look_ahead(&source, table.get_ref())?,
                rapid,
            ))
        }
        Kind::Smooth => {
            let table = file.smooth.as_ref().ok_or_else(missing)?;
            planned(&source, table, PlannerKind::Smooth).map(Choice::Planned)
        }
        Kind::BlockOverlap => {
            let table = file.block_overlap.as_ref().ok_or_else(missing)?;
            planned(&source, table, PlannerKind::BlockOverlap).map(Choice::Planned)
        }
    }
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn regression(
    source: &Source<'_>,
    table: &RegressionTable,
    rapid: Option<f64>,
) -> Result<Coefficients, ModelFileError> {
    let switch = match (&table.fixed_switch_mm, &table.block_time_ms) {
        (Some(mm), None) => Switch::Fixed(source.positive("regression.fixed_switch_mm", mm)?),
        (None, Some(ms)) => Switch::Moving(source.positive("regression.block_time_ms", ms)? / 1e3),
        (first, _) => {
            let cause = "regression: one of fixed_switch_mm and block_time_ms says where the short form ends";
            return Err(source.refuse(first.as_ref().map(Spanned::span), cause));
        }
    };
    Ok(Coefficients {
        short: source.all("regression.short_mm_per_min", &table.short_mm_per_min)?,
        long: source.all("regression.long_mm_per_min", &table.long_mm_per_min)?,
        switch,
        acceleration_mm_per_s2: source.positive(
            "regression.acceleration_mm_per_s2",
            &table.acceleration_mm_per_s2,
        )?,
        ramp_s: source
            .optional("regression.ramp_ms", table.ramp_ms.as_ref())?
            .map(|ms| ms / 1e3),
        rapid_acceleration_mm_per_s2: rapid,
    })
}

fn overlap(
    source: &Source<'_>,
    table: &OverlapTable,
    rapid: Option<f64>,
) -> Result<Constants, ModelFileError> {
    Ok(Constants {
        time_constant_s: source.positive("overlap.time_constant_ms", &table.time_constant_ms)?
            / 1e3,
        obeys_program: table.obeys_program,
        tick_s: source
            .optional("overlap.tick_ms", table.tick_ms.as_ref())?
            .map(|ms| ms / 1e3),
        rapid_acceleration_mm_per_s2: rapid,
    })
}

fn look_ahead(source: &Source<'_>, table: &LookAheadTable) -> Result<Rule, ModelFileError> {
    let key = |name: &str| format!("look-ahead.{name}");
    let stated = &table.acceleration_mm_per_s2;
    let each = source.per_axis(&key("acceleration_mm_per_s2"), stated)?;
    let a = each[0];
    let name = key("allowable_speed_difference_mm_per_min");
    let v = source.positive(&name, &table.allowable_speed_difference_mm_per_min)? / MM_PER_MIN;
    let tangent = source.optional(
        &key("tangent_feed_mm_per_min"),
        table.tangent_feed_mm_per_min.as_ref(),
    )?;
    match (*table.junction.get_ref(), tangent) {
        (JunctionKind::Tangent, Some(_)) if each != [a; MAX_AXES] => Err(source.refuse(
            Some(stated.span()),
            "look-ahead.acceleration_mm_per_s2: \"tangent\" has one acceleration, along the path",
        )),
        (JunctionKind::Tangent, Some(feed)) => Ok(Rule::Tangent {
            acceleration_mm_per_s2: Some(a),
            period_s: feed / MM_PER_MIN / a,
            speed_difference_mm_per_s: v,
        }),
        (JunctionKind::Axis, None) => {
            Ok(Rule::Axis { acceleration_mm_per_s2: each, speed_difference_mm_per_s: [v; MAX_AXES] })
        }
        _ => Err(source.refuse(
            Some(table.junction.span()),
            "look-ahead.junction: tangent_feed_mm_per_min belongs to \"tangent\", and to nothing else",
        )),
    }
}

/// A planner with its constants: of jerk and time constant the one that it knows.
fn planned(
    source: &Source<'_>,
    table: &Spanned<PlannedTable>,
    kind: PlannerKind,
) -> Result<Planned, ModelFileError> {
    let (span, table) = (table.span(), table.get_ref());
    let key = |name: &str| format!("{}.{name}", kind.name());
    let (jerk, constant) = (key("jerk_mm_per_s3"), key("time_constant_ms"));
    let (stated_jerk, stated_constant) = (&table.jerk_mm_per_s3, &table.time_constant_ms);
    let mut made = Planned {
        kind,
        acceleration_mm_per_s2: source.per_axis(
            &key("acceleration_mm_per_s2"),
            &table.acceleration_mm_per_s2,
        )?,
        jerk_mm_per_s3: [f64::INFINITY; MAX_AXES],
        path_tolerance_mm: source.positive(&key("path_tolerance_mm"), &table.path_tolerance_mm)?,
        time_constant_s: 0.05,
    };
    match (kind, stated_jerk, stated_constant) {
        (PlannerKind::Smooth, Some(each), None) => {
            made.jerk_mm_per_s3 = source.per_axis(&jerk, each)?;
        }
        (PlannerKind::BlockOverlap, None, Some(ms)) => {
            made.time_constant_s = source.positive(&constant, ms)? / 1e3;
        }
        (PlannerKind::Smooth, None, _) => {
            return Err(source.refuse(Some(span), format!("{jerk}: missing")));
        }
        (PlannerKind::BlockOverlap, _, None) => {
            return Err(source.refuse(Some(span), format!("{constant}: missing")));
        }
        (PlannerKind::Smooth, _, Some(other)) => {
            let cause = format!("{constant}: smooth knows no time constant");
            return Err(source.refuse(Some(other.span()), cause));
        }
        (PlannerKind::BlockOverlap, Some(other), _) => {
            let cause = format!("{jerk}: block-overlap knows no jerk");
            return Err(source.refuse(Some(other.span()), cause));
        }
    }
    Ok(made)
}

/// The model as a file; `calibrated` says in a line what it was fitted to.
pub fn write(choice: &Choice, calibrated: &str) -> Option<String> {
    let (kind, rapid, table) = match choice {
        Choice::Simulate => return None,
        Choice::Regression(c) => (
            "regression",
            c.rapid_acceleration_mm_per_s2,
            regression_text(c),
        ),
        Choice::Overlap(c) => ("overlap", c.rapid_acceleration_mm_per_s2, overlap_text(c)),
        Choice::LookAhead(rule, rapid) => ("look-ahead", *rapid, look_ahead_text(rule)),
        Choice::Planned(planned) => (planned.kind.name(), None, planned_text(planned)),
    };
    let calibrated = toml::Value::String(calibrated.to_string());
    let rapid = rapid
        .map(|a| format!("rapid_acceleration_mm_per_s2 = {a:?}\n"))
        .unwrap_or_default();
    Some(format!(
        "format = {FORMAT}\ncalibrated = {calibrated}\nmodel = \"{kind}\"\n{rapid}\n[{kind}]\n{table}"
    ))
}

/// Numbers of the axes: one where all are the same.
fn per_axis_text(each: &[f64; MAX_AXES]) -> String {
    if each.iter().all(|value| *value == each[0]) {
        format!("{:?}", each[0])
    } else {
        format!("{:?}", &each[..3])
    }
}

fn planned_text(planned: &Planned) -> String {
    let own = match planned.kind {
        PlannerKind::Smooth => {
            format!(
                "jerk_mm_per_s3 = {}",
                per_axis_text(&planned.jerk_mm_per_s3)
            )
        }
        PlannerKind::BlockOverlap => {
            format!("time_constant_ms = {:?}", planned.time_constant_s * 1e3)
        }
    };
    format!(
        "acceleration_mm_per_s2 = {}\n{own}\npath_tolerance_mm = {:?}\n",
        per_axis_text(&planned.acceleration_mm_per_s2),
        planned.path_tolerance_mm
    )
}

fn regression_text(c: &Coefficients) -> String {
    let switch = match c.switch {
        Switch::Fixed(mm) => format!("fixed_switch_mm = {mm:?}"),
        Switch::Moving(s) => format!("block_time_ms = {:?}", s * 1e3),
    };
    let ramp = c
        .ramp_s
        .map(|s| format!("ramp_ms = {:?}\n", s * 1e3))
        .unwrap_or_default();
    format!(
        "acceleration_mm_per_s2 = {:?}\nshort_mm_per_min = {:?}\nlong_mm_per_min = {:?}\n{switch}\n{ramp}",
        c.acceleration_mm_per_s2, c.short, c.long
    )
}

fn overlap_text(c: &Constants) -> String {
    let tick = c
        .tick_s
        .map(|s| format!("tick_ms = {:?}\n", s * 1e3))
        .unwrap_or_default();
    format!(
        "time_constant_ms = {:?}\nobeys_program = {}\n{tick}",
        c.time_constant_s * 1e3,
        c.obeys_program
    )
}

fn look_ahead_text(rule: &Rule) -> String {
    let (junction, a, v, tangent) = match rule {
        Rule::Tangent {
            acceleration_mm_per_s2,
            period_s,
            speed_difference_mm_per_s: v,
        } => {
            let a = acceleration_mm_per_s2.unwrap_or(f64::INFINITY);
            (
                "tangent",
                format!("{a:?}"),
                *v,
                format!(
                    "tangent_feed_mm_per_min = {:?}\n",
                    a * period_s * MM_PER_MIN
                ),
            )
        }
        Rule::Axis {
            acceleration_mm_per_s2: a,
            speed_difference_mm_per_s: v,
        } => ("axis", accelerations_text(a), v[0], String::new()),
    };
    format!(
        "junction = \"{junction}\"\nacceleration_mm_per_s2 = {a}\n\
         allowable_speed_difference_mm_per_min = {:?}\n{tangent}",
        v * MM_PER_MIN
    )
}

/// One number where all are alike, else an array without what follows from it.
fn accelerations_text(all: &[f64; MAX_AXES]) -> String {
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    let mut count = MAX_AXES;
    while count > 1 && all[count - 1] == least && all[..count - 1].contains(&least) {
        count -= 1;
    }
    if count == 1 {
        format!("{:?}", all[0])
    } else {
        format!("{:?}", &all[..count])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let axis = Rule::Axis {
            acceleration_mm_per_s2: [900.0; MAX_AXES],
            speed_difference_mm_per_s: [2.0; MAX_AXES],
        };
        let constants = Constants {
            time_constant_s: 0.03,
            obeys_program: true,
            tick_s: Some(0.001),
            rapid_acceleration_mm_per_s2: None,
        };
        let moving = Coefficients {
            switch: Switch::Moving(0.03),
            ramp_s: Some(0.03),
            ..Coefficients::default()
        };
        let mut unequal = [300.0; MAX_AXES];
        unequal[1] = 900.0;
        let unequal = Rule::Axis {
            acceleration_mm_per_s2: unequal,
            speed_difference_mm_per_s: [2.0; MAX_AXES],
        };
        let all = [
            Choice::LookAhead(axis, Some(5000.0)),
            Choice::LookAhead(unequal, None),
            Choice::Overlap(constants),
            Choice::Regression(moving),
            Choice::Regression(Coefficients::default()),
        ];
        for choice in all {
            let text = write(&choice, "a \"test\"").unwrap();
            assert_eq!(parse("m.toml", &text).unwrap(), choice, "{text}");
        }
    }

    #[test]
    fn refusals_name_file_line_and_key() {
        let said = |text: &str| parse("m.toml", text).unwrap_err().to_string();
        let head = "format = 1\nmodel = \"overlap\"\n";
        assert!(
            said(&format!("{head}[overlap]\ntime_constant_ms = -3.0\n"))
                .starts_with("m.toml:4:20: overlap.time_constant_ms: -3 is not above zero")
        );
        let unknown = said(&format!("{head}[overlap]\ntime_constant_s = 3.0\n"));
        assert!(
            unknown.starts_with("m.toml:4:1: unknown field `time_constant_s`"),
            "{unknown}"
        );
        assert!(said(head).starts_with("m.toml:2:9: model: the table of this name is missing"));
        assert!(
            said("format = 2\nmodel = \"overlap\"\n")
                .starts_with("m.toml:1:10: format: this is format 2")
        );
        assert!(
            said("format = 1\nmodel = \"look\"\n")
                .starts_with("m.toml:2:9: unknown variant `look`")
        );
        let look_ahead = |junction: &str, a: &str| {
            said(&format!(
                "format = 1\nmodel = \"look-ahead\"\n[look-ahead]\n{junction}\nacceleration_mm_per_s2 = {a}\n\
                 allowable_speed_difference_mm_per_min = 1.0\n"
            ))
        };
        for wrong in ["[]", "[300.0, -1.0]", "0.0"] {
            let said = look_ahead("junction = \"axis\"", wrong);
            assert!(
                said.starts_with("m.toml:5:26: look-ahead.acceleration_mm_per_s2: must be"),
                "{said}"
            );
        }
        let tangent = "junction = \"tangent\"\ntangent_feed_mm_per_min = 5.0";
        let said_of_tangent = look_ahead(tangent, "[300.0, 900.0]");
        assert!(
            said_of_tangent.contains("has one acceleration, along the path"),
            "{said_of_tangent}"
        );
        let other = said(&format!(
            "{head}[look-ahead]\njunction = \"axis\"\nacceleration_mm_per_s2 = 1.0\n\
            allowable_speed_difference_mm_per_min = 1.0\n"
        ));
        assert!(
            other.contains("look-ahead: model names another form"),
            "{other}"
        );
    }
}
