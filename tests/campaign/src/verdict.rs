//! What was asked of a run, and whether it was kept.

use tandem_host::{Command, Outcome, Timed};
use tandem_machine::Machine;
use tandem_oracle::{Check, Finding, Kind, Options, Trace};
use toml::Table;

use crate::case::Case;
use crate::machine::Planner;
use crate::run::{MAX_SAMPLES, Ran};

/// Memory that a run may take, MB.
const MAX_MEMORY_MB: f64 = 200.0;
/// Distance from the path that rounding and inverse functions are forgiven, mm.
const ON_THE_PATH_MM: f64 = 2e-6;

/// Beyond the end of the travel by less than this, mm, is rounding: of sums in a filter, of a length turned into a place, or of
/// an arc, to which polynomials are fitted as closely; the fine loop's guard forgives as much.
const ROUNDED_MM: f64 = 1.1e-8;
/// A programmed feed exceeded by less than this share is told apart from one that is exceeded for all to see.
const LITTLE_FEED: f64 = 1e-3;

/// The end of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// The planner, with its form where it has several.
    pub planner: String,
    /// `clean`, `refused`, or what failed.
    pub kind: String,
    /// In words.
    pub why: String,
    /// How much it was, relative to the limit; 0 where that means nothing.
    pub size: f64,
    /// Samples that were sent.
    pub samples: u64,
    /// Most memory, MB.
    pub memory_mb: f64,
}

impl Report {
    /// A failure.
    pub fn failed(kind: &str, why: impl Into<String>) -> Self {
        Self {
            kind: kind.to_string(),
            why: why.into(),
            ..Self::default()
        }
    }

    /// Whether it is one: neither clean nor refused with a reason.
    pub fn is_failure(&self) -> bool {
        !["clean", "refused"].contains(&self.kind.as_str())
    }
}

impl Case {
    /// The planner of the machine, with its form where it has several.
    pub fn planner(&self) -> String {
        let Ok(table) = self.machine.text().parse::<Table>() else {
            return "unknown".to_string();
        };
        let Some(planner) = table.get("planner") else {
            return "unknown".to_string();
        };
        let option = |key: &str| {
            planner
                .get("options")
                .and_then(|options| options.get(key)?.as_str())
        };
        let name = planner
            .get("plugin")
            .and_then(toml::Value::as_str)
            .unwrap_or("unknown")
            .to_string();
        match (name.as_str(), option("form"), option("limits")) {
            ("nurbs", form, _) => format!("nurbs {}", form.unwrap_or("scan")),
            ("block-overlap", _, limits) => format!("block-overlap {}", limits.unwrap_or("slow")),
            _ => name,
        }
    }
}

/// What the machine, its planner and the operator ask for.
pub struct Asked {
    /// The planner.
    pub planner: Option<Planner>,
    /// The operator's commands.
    pub commands: Vec<Timed>,
    /// The tick of the last one.
    pub last_tick: u64,
    /// Rough periods for which the rough loop is told to do nothing.
    pub stalled: u64,
    /// The tick of an emergency stop.
    pub emergency: Option<u64>,
    /// The program is aborted.
    pub aborted: bool,
    /// The highest feed ratio that is asked for; at least 1.
    pub max_ratio: f64,
    /// Corners are rounded whatever the tolerance says.
    pub off_the_path: bool,
    /// How long a filter of the planner needs to settle, s.
    pub filter_s: f64,
    /// The widest tolerance in force, mm.
    pub widest_tolerance_mm: f64,
    /// The longest time for which two blocks may overlap, s.
    pub overlap_s: f64,
    fine_period_s: f64,
}

impl Asked {
    /// Reads the commands and the planner's options.
    ///
    /// # Errors
    /// A command that cannot be read, or that `tandem run` refuses.
    pub fn of(case: &Case, machine: &Machine) -> Result<Self, String> {
        let mut commands = vec![];
        for line in case.commands.lines() {
            let timed = Timed::parse(line)?;
            timed.command.check(machine.motion.max_feed_ratio)?;
            commands.push(timed);
        }
        if commands
            .windows(2)
            .any(|pair: &[Timed]| pair[1].tick < pair[0].tick)
        {
            return Err("commands are not in order".to_string());
        }
        let stalled = |timed: &Timed| {
            if let Command::StallRough(periods) = timed.command {
                periods
            } else {
                0
            }
        };
        let ratio = |timed: &Timed| {
            if let Command::FeedOverride(ratio) = timed.command {
                ratio
            } else {
                1.0
            }
        };
        let emergency = commands
            .iter()
            .find(|timed| timed.command == Command::EmergencyStop)
            .map(|timed| timed.tick);
        let options: Table = case
            .machine
            .text()
            .parse()
            .map_err(|e: toml::de::Error| e.to_string())?;
        let option = |key: &str| options.get("planner")?.get("options")?.get(key);
        let constant_ms = option("time_constant_ms")
            .and_then(|v| v.as_float().or(v.as_integer().map(|i| i as f64)));
        let settles = if option("filter").and_then(toml::Value::as_str) == Some("exponential") {
            40.0
        } else {
            1.5
        };
        let planner = Planner::named(&machine.planner.plugin);
        let filter_ms = if planner == Some(Planner::AfterInterpolation) {
            settles * constant_ms.unwrap_or(50.0)
        } else {
            0.0
        };
        let slowest_s = machine
            .limits
            .axes()
            .iter()
            .map(|a| a.feed_mm_per_s.max(a.rapid_mm_per_s) / a.acceleration_mm_per_s2);
        Ok(Self {
            planner,
            last_tick: commands.last().map_or(0, |timed| timed.tick),
            stalled: commands.iter().map(stalled).sum(),
            emergency,
            aborted: commands.iter().any(|timed| timed.command == Command::Abort),
            max_ratio: commands.iter().map(ratio).fold(1.0, f64::max),
            off_the_path: option("corner_control").and_then(toml::Value::as_str) == Some("off"),
            filter_s: filter_ms / 1000.0,
            widest_tolerance_mm: widest_tolerance_mm(case, machine),
            overlap_s: longest_constant_s(case, machine) + slowest_s.fold(0.0, f64::max),
            fine_period_s: machine.fine_period_s,
            commands,
        })
    }

    /// What the oracle is asked.
    fn options(
        &self,
        judging: &tandem_oracle::Machine,
        trace: &Trace,
        longest_step_mm: f64,
    ) -> Options {
        let mut options = Options::for_machine(judging);
        options.max_ratio = self.max_ratio;
        let on_the_path = |options: &mut Options| {
            // Within one period a motion may turn back: what it passes is as far from the samples as it drives.
            let chord_mm = longest_chord(trace).max(longest_step_mm);
            options.sample_tolerance_mm = Some(ON_THE_PATH_MM);
            options.vertex_tolerance_mm = Some((chord_mm / 2.0).max(ON_THE_PATH_MM));
        };
        match self.planner {
            Some(Planner::AfterInterpolation) => {
                options.checks = vec![Check::Period, Check::EndPoint];
                // Its motion is beyond what the limits can brake before the end of the travel; an emergency stop keeps to the limits.
                if self.emergency.is_none() {
                    options.checks.push(Check::Travel);
                }
            }
            Some(Planner::BlockOverlap) => {
                options.feed_window_s = Some(self.overlap_s);
                // Its corners keep the tolerance; the chords between samples lie off the path besides.
                options.vertex_tolerance_mm =
                    Some(self.widest_tolerance_mm + longest_step_mm / 2.0);
                if self.off_the_path {
                    options.checks.retain(|check| {
                        ![Check::Path, Check::Vertices, Check::Feed].contains(check)
                    });
                }
            }
            Some(Planner::Smooth) => {}
            Some(Planner::LookAhead | Planner::Nurbs) | None => on_the_path(&mut options),
        }
        if self.planner.is_some_and(Planner::keeps_jerk) {
            options.feed_window_s = Some(0.0);
            // On the way to rest after an emergency stop acceleration is kept, and jerk is not.
            if self.emergency.is_none() {
                options.checks.push(Check::Jerk);
            }
        }
        options.ends_early = self.aborted || self.emergency.is_some();
        options.path_until_s = self
            .emergency
            .map(|tick| (tick as f64 - 0.5) * self.fine_period_s);
        options
    }
}

/// The greatest number behind `word` in the program, or `or` where that is greater.
fn greatest(case: &Case, word: &str, or: f64) -> f64 {
    let words = case
        .program
        .lines()
        .filter_map(|line| line.split(word).nth(1));
    let number = |rest: &str| {
        rest.split(|c: char| !c.is_ascii_digit() && c != '.')
            .next()?
            .parse::<f64>()
            .ok()
    };
    words.filter_map(number).fold(or, f64::max)
}

fn widest_tolerance_mm(case: &Case, machine: &Machine) -> f64 {
    greatest(case, "G64 P", machine.motion.path_tolerance_mm)
}

fn longest_constant_s(case: &Case, machine: &Machine) -> f64 {
    greatest(case, "TA", 1000.0 * machine.motion.time_constant_s) / 1000.0
}

fn longest_chord(trace: &Trace) -> f64 {
    let chord = |pair: &[tandem_oracle::Row]| {
        let squares = pair[0]
            .command
            .iter()
            .zip(&pair[1].command)
            .map(|(a, b)| (b - a).powi(2));
        squares.sum::<f64>().sqrt()
    };
    trace.rows.windows(2).map(chord).fold(0.0, f64::max)
}

/// Judges a run: first whether it came to its end, then every sample, then what the host counted.
pub fn judge(ran: &Ran, case: &Case, judging: &tandem_oracle::Machine, asked: &Asked) -> Report {
    let (samples, memory_mb) = (ran.rows.len() as u64, ran.memory_mb);
    let report = ended(ran, asked)
        .or_else(|| judged(ran, case, judging, asked))
        .or_else(|| {
            ran.outcome
                .as_ref()
                .and_then(|outcome| counted(outcome, asked))
        })
        .or_else(|| {
            (memory_mb > MAX_MEMORY_MB)
                .then(|| Report::failed("memory", format!("{memory_mb:.0} MB")))
        });
    let clean = || Report {
        kind: "clean".to_string(),
        ..Report::default()
    };
    Report {
        samples,
        memory_mb,
        ..report.unwrap_or_else(clean)
    }
}

/// What is wrong with how it ended.
fn ended(ran: &Ran, asked: &Asked) -> Option<Report> {
    let Some(outcome) = &ran.outcome else {
        let still = ran.stands_still(asked.fine_period_s);
        let time_s = ran.rows.len() as f64 * asked.fine_period_s;
        let line = ran.rows.last().map_or(0, |row| row.line);
        let words = format!(
            "after {time_s:.2} s ({} samples) it is on line {line}",
            ran.max_samples
        );
        let kind = if still {
            "standstill"
        } else if ran.is_cut_off {
            return None;
        } else if ran.max_samples == MAX_SAMPLES {
            "too-long"
        } else {
            "slow"
        };
        return Some(Report::failed(kind, words));
    };
    let summary = &outcome.summary;
    match (&summary.fault, &summary.stopped) {
        (Some(fault), _) if asked.emergency.is_none() || !fault.contains("emergency") => {
            // The words of the host for a run in which program time passes no more.
            let still = fault.contains("nothing has moved")
                || fault.contains("stands still though nothing stops it");
            let kind = if still { "standstill" } else { "fault" };
            Some(Report::failed(
                if summary.guard_stops > 0 {
                    "guard"
                } else {
                    kind
                },
                fault,
            ))
        }
        (None, Some(stopped)) if !asked.aborted => Some(Report::failed("standstill", stopped)),
        _ => None,
    }
}

/// The worst of what the oracle finds.
fn judged(
    ran: &Ran,
    case: &Case,
    judging: &tandem_oracle::Machine,
    asked: &Asked,
) -> Option<Report> {
    let axes = judging.axes.iter().map(|axis| axis.index).collect();
    let degrees = judging
        .axes
        .iter()
        .filter(|axis| axis.rotary)
        .map(|axis| axis.index)
        .collect();
    let trace = Trace {
        axes,
        degrees,
        rows: ran.rows.clone(),
        not_finite: vec![],
    };
    let mut options = asked.options(judging, &trace, ran.longest_step_mm);
    options.ends_early |= ran.is_cut_off;
    let verdict = tandem_oracle::judge(&trace, &case.program, judging, &options);
    let found = |kind: Kind| {
        let rounded = |finding: &Finding| kind == Kind::Travel && size(finding) < ROUNDED_MM;
        // A run that was ended in motion does not stop within a period.
        let last = ran.rows.len().saturating_sub(1);
        let is_end = |finding: &Finding| ran.is_cut_off && finding.sample == last;
        let of_kind = verdict
            .findings
            .iter()
            .filter(move |finding| finding.kind == kind && !rounded(finding) && !is_end(finding));
        let worst = of_kind.clone().max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let count = of_kind.count();
        let words = format!("{count} samples, the worst: {}", words(worst));
        let little = kind == Kind::Feed && size(worst) < LITTLE_FEED;
        Some(Report {
            size: size(worst),
            ..Report::failed(if little { "feed-little" } else { name(kind) }, words)
        })
    };
    let reason = || {
        verdict
            .not_judged
            .clone()
            .map(|reason| Report::failed("not-judged", reason))
    };
    KINDS
        .into_iter()
        .find_map(|(kind, _)| found(kind))
        .or_else(reason)
}

/// The kinds of the oracle, what harms most first.
const KINDS: [(Kind, &str); 13] = [
    (Kind::NotFinite, "not-finite"),
    (Kind::Travel, "travel"),
    (Kind::Velocity, "velocity"),
    (Kind::Acceleration, "acceleration"),
    (Kind::SpeedStep, "speed-step"),
    (Kind::Jerk, "jerk"),
    (Kind::PathDeviation, "path"),
    (Kind::VertexMissed, "vertex"),
    (Kind::NotCovered, "not-covered"),
    (Kind::EndPoint, "end-point"),
    (Kind::StartPoint, "start-point"),
    (Kind::Period, "period"),
    (Kind::Feed, "feed"),
];

fn name(kind: Kind) -> &'static str {
    KINDS
        .into_iter()
        .find(|(of, _)| *of == kind)
        .map_or("other", |(_, name)| name)
}

/// How far beyond its limit: relative, or mm for travel.
fn size(finding: &Finding) -> f64 {
    let beyond = (finding.value - finding.limit).abs();
    match finding.kind {
        Kind::Travel => beyond,
        _ if finding.limit == 0.0 => f64::INFINITY,
        _ => finding.value.abs() / finding.limit.abs() - 1.0,
    }
}

fn words(finding: &Finding) -> String {
    let axis = finding.axis.map_or_else(String::new, |axis| {
        format!(" of {}", tandem_oracle::LETTERS[axis])
    });
    let joint = finding
        .joint
        .as_ref()
        .map_or_else(String::new, |joint| format!(" (joint {joint})"));
    format!(
        "sample {}, line {}: {}{axis}{joint} {:e} for {:e}",
        finding.sample,
        finding.line,
        name(finding.kind),
        finding.value,
        finding.limit
    )
}

/// Counts of the summary that must be zero.
fn counted(outcome: &Outcome, asked: &Asked) -> Option<Report> {
    let summary = &outcome.summary;
    let published = asked.planner == Some(Planner::AfterInterpolation);
    let counts = [
        ("guard", summary.guard_stops, asked.emergency.is_none()),
        ("violations", summary.limit_violations, !published),
        ("governed", summary.governed_samples, !published),
        ("starvation", summary.starvations, asked.stalled == 0),
        ("lost", summary.lost_samples, true),
    ];
    let wrong = counts
        .into_iter()
        .find(|(_, count, judged)| *judged && *count > 0);
    wrong.map(|(kind, count, _)| Report {
        size: count as f64,
        ..Report::failed(kind, format!("{count} of them"))
    })
}
