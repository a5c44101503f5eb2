//! The smaller tables: plugins, guard, policy, spindle.

use std::f64::consts::PI;
use std::path::PathBuf;

use tandem_sdk::MAX_ANALOG;

use crate::node::{Node, Table, plain};
use crate::paths::is_library;
use crate::section::Section;
use crate::signals::is_name;

/// A plugin that the machine asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct PluginChoice {
    /// A built-in's name, or the path of a shared library (absolute where a file states it).
    pub plugin: String,
    /// The path of the shared library, where `plugin` is one: it holds a `/` or ends in `.so`, `.dylib` or `.dll`.
    pub library: Option<PathBuf>,
    /// The `options` table as TOML text; empty where there is none.
    pub options: String,
}

impl PluginChoice {
    /// The plugin called `name`, without options.
    pub fn named(name: &str) -> Self {
        let library = is_library(name).then(|| PathBuf::from(name));
        Self {
            plugin: name.to_owned(),
            library,
            options: String::new(),
        }
    }

    /// Reads a table with `plugin` and `options`; `None` where it is wrong, which is reported.
    pub(crate) fn read(section: &Section<'_>) -> Option<Self> {
        let choice = section.required("plugin", Section::text).map(Self::named)?;
        let options = section
            .section("options")
            .table()
            .map(|table| text(section, "options", table));
        Some(Self {
            options: options.unwrap_or_default(),
            ..choice
        })
    }
}

/// Reads the names of analog inputs; none where they are wrong, which is reported.
pub(crate) fn analog_names(driver: &Section<'_>) -> Vec<String> {
    let Some(node) = driver.right("analog") else {
        return vec![];
    };
    let names: Option<Vec<&str>> = node
        .array()
        .and_then(|names| names.iter().map(Node::text).collect());
    let Some(names) = names.filter(|names| names.len() <= MAX_ANALOG) else {
        driver.refuse(
            "analog",
            format!("must be an array of at most {MAX_ANALOG} names"),
        );
        return vec![];
    };
    let twice = |name: &&&str| names.iter().filter(|other| other == name).count() > 1;
    let wrong = names
        .iter()
        .find(|name| !is_name(name))
        .or_else(|| names.iter().find(twice));
    if let Some(wrong) = wrong {
        driver.refuse(
            "analog",
            format!("{wrong:?}: a name is lower case with underscores, and stands once"),
        );
        return vec![];
    }
    names.into_iter().map(str::to_owned).collect()
}

/// A table as TOML text.
pub(crate) fn text(section: &Section<'_>, key: &str, table: &Table) -> String {
    toml::to_string(&plain(table)).unwrap_or_else(|error| {
        section.refuse(key, format!("cannot be written as TOML: {error}"));
        String::new()
    })
}

/// What the guard does with a sample beyond a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GuardMode {
    /// Does not send it, and brings the machine to rest.
    #[default]
    Stop,
    /// Sends and counts it; simulated drives only.
    Count,
}

impl GuardMode {
    /// Reads `[guard]`.
    pub(crate) fn read(guard: &Section<'_>) -> Self {
        guard
            .choice("mode", &[("stop", Self::Stop), ("count", Self::Count)])
            .unwrap_or_default()
    }
}

/// What the motion does where a file that the run writes cannot be written any further: a full disk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RecordErrorMode {
    /// It goes on without that file: a workpiece is worth more than its record.
    #[default]
    Continue,
    /// It comes to rest on the path. Where somebody is there who can resume it waits for that, else the run ends.
    Hold,
}

impl RecordErrorMode {
    /// Reads `[recorder]`.
    pub(crate) fn read(recorder: &Section<'_>) -> Self {
        recorder
            .choice(
                "on_error",
                &[("continue", Self::Continue), ("hold", Self::Hold)],
            )
            .unwrap_or_default()
    }
}

/// The policy script of the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Policy {
    /// The WASM module; absolute where a file states it.
    pub script: PathBuf,
    /// Instructions that one call may use.
    pub fuel_per_call: u32,
    /// Instructions for each block of a window, on top.
    pub fuel_per_block: u32,
    /// Pages of memory, 64 KiB each, that it may use.
    pub memory_pages: u32,
    /// Shortest and longest time constant that it may ask for, s.
    pub time_constant_s: (f64, f64),
    /// Smallest and largest path tolerance that it may ask for, mm; none: up to the one in force.
    pub path_tolerance_mm: Option<(f64, f64)>,
    /// Least share of the programmed feed that it may ask for.
    pub lowest_feed_ratio: f64,
    /// How fast it may change the feed ratio, 1/s; 10 where the machine states no limit: from all to nothing in 0.1 s.
    pub ratio_change_per_s: f64,
    /// Its parameters, by name.
    pub parameters: toml::Table,
}

impl Policy {
    /// Its parameters that are numbers, or true and false as 1 and 0.
    pub fn numbers(&self) -> impl Iterator<Item = (String, f64)> {
        let number = |value: &toml::Value| match value {
            toml::Value::Boolean(truth) => Some(f64::from(u8::from(*truth))),
            toml::Value::Integer(number) => Some(*number as f64),
            other => other.as_float(),
        };
        let stated = self.parameters.iter();
        stated.filter_map(move |(name, value)| Some((name.clone(), number(value)?)))
    }

    /// States the parameter `name` anew.
    pub fn set_number(&mut self, name: &str, value: f64) {
        self.parameters.insert(name.to_string(), value.into());
    }

    /// Reads `[policy]`; `None` where it is wrong, which is reported.
    pub(crate) fn read(policy: &Section<'_>) -> Option<Self> {
        let script = policy.required("script", Section::text)?.into();
        let parameters = policy
            .section("parameters")
            .table()
            .map(plain)
            .unwrap_or_default();
        let time_constant_ms = policy
            .range("time_constant_ms")
            .filter(|range| above_zero(policy, "time_constant_ms", range));
        let tolerance_mm = policy
            .range("path_tolerance_mm")
            .filter(|range| above_zero(policy, "path_tolerance_mm", range));
        let ratio = policy.positive("lowest_feed_ratio").unwrap_or(0.05);
        if ratio > 1.0 {
            policy.refuse(
                "lowest_feed_ratio",
                format!("must be at most 1, not {ratio}"),
            );
        }
        Some(Self {
            script,
            fuel_per_call: policy
                .whole("fuel_per_call", 100, 1_000_000_000)
                .unwrap_or(20_000),
            fuel_per_block: policy
                .whole("fuel_per_block", 0, 10_000_000)
                .unwrap_or(1_000),
            memory_pages: policy.whole("memory_pages", 1, 1024).unwrap_or(32),
            time_constant_s: time_constant_ms
                .map_or((0.001, 1.0), |(low, high)| (low / 1e3, high / 1e3)),
            path_tolerance_mm: tolerance_mm,
            lowest_feed_ratio: ratio,
            ratio_change_per_s: policy.positive("ratio_change_per_s").unwrap_or(10.0),
            parameters,
        })
    }
}

/// Whether a range begins above zero; where not, that is reported.
fn above_zero(section: &Section<'_>, key: &str, range: &(f64, f64)) -> bool {
    if range.0 <= 0.0 {
        section.refuse(key, format!("must begin above 0, not at {}", range.0));
    }
    range.0 > 0.0
}

/// Time without a keep-alive after which a jog stops where the machine states none, ms: key repeats come every 30 to 50 ms.
const JOG_KEEP_ALIVE_MS: f64 = 200.0;

/// What the operator's switches and keys mean on this machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operator {
    /// Feed of all feed motion in a dry run, mm/s; none: the programmed feed.
    pub dry_run_feed_mm_per_s: Option<f64>,
    /// Time without a keep-alive after which a jog stops, s.
    pub jog_keep_alive_s: f64,
}

impl Operator {
    /// Reads `[operator]`.
    pub(crate) fn read(operator: &Section<'_>) -> Self {
        Self {
            dry_run_feed_mm_per_s: operator
                .positive("dry_run_feed_mm_per_min")
                .map(|feed| feed / 60.0),
            jog_keep_alive_s: operator
                .positive("jog_keep_alive_ms")
                .unwrap_or(JOG_KEEP_ALIVE_MS)
                / 1e3,
        }
    }
}

/// What the spindle may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spindle {
    /// Lowest speed that turns, rad/s.
    pub min_rad_per_s: f64,
    /// Highest speed, rad/s; infinite where the machine states none.
    pub max_rad_per_s: f64,
    /// Time that it has to come to the speed that it is told while a cut waits for it, s.
    pub at_speed_within_s: f64,
}

/// Time to come to speed where the file states none, s. Heavy spindles need ten; one that needs more than three times that has
/// failed, and nobody is to stand before a machine that will cut some time.
const AT_SPEED_WITHIN_S: f64 = 30.0;

/// What can be stated for it, s. In less no drive has answered, let alone turned; the largest vertical lathes need minutes.
const AT_SPEED_RANGE_S: [f64; 2] = [0.1, 600.0];

impl Spindle {
    /// Reads `[spindle]`.
    pub(crate) fn read(spindle: &Section<'_>) -> Self {
        let min = spindle.at_least("min_rpm", 0.0).unwrap_or(0.0);
        let max = spindle.positive("max_rpm");
        if let Some(max) = max.filter(|max| *max < min) {
            spindle.refuse(
                "min_rpm",
                format!("the lowest speed, {min}, is above the highest, {max}"),
            );
        }
        let within_s = spindle
            .positive("at_speed_within_s")
            .unwrap_or(AT_SPEED_WITHIN_S);
        let [least, most] = AT_SPEED_RANGE_S;
        if !(least..=most).contains(&within_s) {
            spindle.refuse(
                "at_speed_within_s",
                format!("must be from {least} to {most}, not {within_s}"),
            );
        }
        let rad_per_s = |rpm: f64| rpm * 2.0 * PI / 60.0;
        Self {
            min_rad_per_s: rad_per_s(min),
            max_rad_per_s: max.map_or(f64::INFINITY, rad_per_s),
            at_speed_within_s: within_s,
        }
    }
}
