//! `tandem run`.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use tandem_host::{
    Clock, HostError, Left, Outcome, Run, RunObserver, StopAnswer, Switches, Timed, parse_commands,
};
use tandem_machine::Machine;
use tandem_recorder::{
    BlocksCsv, EventsCsv, OfLimits, Output, PolicySummary, RecordError, RoughCsv, Stop, Summary,
    worst_of_judged, worst_of_reported,
};
use tandem_rings::{Rest, Sample};
use tandem_sdk::{Block, BlockReport, Curve, Event, EventKind};
use tandem_session::HOMING;

use crate::broken::Broken;
use crate::home::Corrections;
use crate::operator::{Keyboard, Operator, Presence, tell};
use crate::progress::Progress;
use crate::report::Collector;
use crate::trace::TraceSink;
use crate::warnings::tell_warnings;
use crate::{FAULT, REFUSED, args, built_in, clock, hang, operator, piped, program, refusal};

/// Runs a program.
pub fn run(options: &args::Run) -> Result<u8, Box<dyn Error>> {
    let machine = options.place.machine()?;
    let registry = built_in::registry()?;
    let clock = clock::of(options.clock, &machine, &registry);
    let switches = switches(options, clock);
    let (run, name, follow) = if streams(options) {
        if machine.policy.is_some() {
            return Err("a policy script tunes programs that are checked as a whole: name a file, or /dev/stdin".into());
        }
        let (run, follow) = piped::prepare(&machine, &registry, switches, clock == Clock::Wall)?;
        (run, "standard input".to_string(), Some(follow))
    } else {
        let program = program::open(&options.program)?;
        let name = program.name().to_string();
        match Run::prepare(machine.clone(), &registry, program, switches) {
            Err(HostError::Check(report)) => {
                program::print_errors(&report);
                if let Some(path) = &options.report {
                    refusal::write(path, &name, &report)?;
                }
                return Ok(REFUSED);
            }
            other => (other?, name, None),
        }
    };
    program::print_warnings(&run.checked);
    let commands = options
        .commands
        .as_ref()
        .map_or(Ok(vec![]), |path| commands(path, clock, &machine))?;
    distinct_files(options)?;
    let mut sinks = Sinks::create(options, &machine, &name, &run, clock)?;
    if let Some(follow) = follow {
        // Only this one is ever set.
        let _ = follow.set(Arc::clone(sinks.operator.hub()));
    }
    let clock_name = if clock == Clock::Wall {
        "wall"
    } else {
        "virtual"
    };
    hang::summarise_in(options.summary.as_ref(), &name, &machine, clock_name, &run);
    let mut outcome = run.drive(clock, &commands, &mut sinks)?;
    if let Some(reference_time_s) = options.reference_time_s {
        outcome.summary.compare(reference_time_s);
    }
    sinks.operator.end(&outcome.summary);
    sinks.finish(options, &outcome.left, &mut outcome.summary);
    Ok(conclude(options, &outcome))
}

/// Whether lines are driven as they come, out of standard input.
fn streams(options: &args::Run) -> bool {
    options.program.as_os_str() == "-"
}

/// Whether keys are to be taken: in real time, on a terminal that gives no lines.
fn keys_at_hand(options: &args::Run, clock: Clock) -> bool {
    clock == Clock::Wall && operator::is_on_terminal() && !streams(options)
}

/// The operator's switches as the command line sets them. Where somebody can answer in real time, stops wait.
fn switches(options: &args::Run, clock: Clock) -> Switches {
    let attended =
        keys_at_hand(options, clock) || (clock == Clock::Wall && !options.operator.is_nowhere());
    Switches {
        block_delete: options.block_delete,
        pause_at_stops: options.pause || (attended && !options.dry),
        optional_stop: options.pause || options.optional_stop,
        dry_run: options.dry,
        home: options.home.then_some(HOMING),
        reset: options.reset,
        clock: Some(clock),
        ..Switches::default()
    }
}

/// Refuses to write a file twice, or over what the run reads.
fn distinct_files(options: &args::Run) -> Result<(), String> {
    let mut taken = vec![resolved(options.place.path())];
    // Standard input and standard output are both called -.
    taken.extend(
        Some(&options.program)
            .filter(|path| path.as_os_str() != "-")
            .map(|path| resolved(path)),
    );
    taken.extend(options.commands.iter().map(|path| resolved(path)));
    for (_, path) in written(options) {
        let file = resolved(path);
        let regular = path.as_os_str() == "-" || !file.exists() || file.is_file();
        if regular && taken.contains(&file) {
            return Err(format!(
                "{}: the run reads this file, or writes it already",
                path.display()
            ));
        }
        taken.push(file);
    }
    Ok(())
}

/// Where a path leads, also where its last part does not exist yet.
fn resolved(path: &Path) -> PathBuf {
    let in_folder = || {
        let folder = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize()
        .ok()
        .or_else(in_folder)
        .unwrap_or_else(|| path.to_owned())
}

/// Reads a command file; lines that are empty or begin with # are left out.
fn commands(path: &Path, clock: Clock, machine: &Machine) -> Result<Vec<Timed>, String> {
    if clock == Clock::Wall {
        return Err(
            "--commands goes with --clock virtual: on the wall clock ticks have no place in the operator's time"
                .to_string(),
        );
    }
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    parse_commands(
        &path.display().to_string(),
        &text,
        machine.motion.max_feed_ratio,
    )
}

/// Everything that a run is written to.
struct Sinks {
    /// The planner, where it takes no time constants and that has not been said.
    without_time_constants: Option<String>,
    switches: Switches,
    operator: Operator,
    homed: Corrections,
    progress: Progress,
    trace: Option<TraceSink>,
    blocks: Option<BlocksCsv>,
    rough: Option<RoughCsv>,
    events: Option<EventsCsv>,
    report: Option<Collector>,
    summary: Option<Output>,
    broken: Broken,
}

/// Room that the summary takes before anything moves, bytes: a summary of about a hundred stops. So it can be written when
/// the trace has filled the disk.
const SUMMARY_ROOM_BYTES: u64 = 16 * 1024;

impl Sinks {
    fn create(
        options: &args::Run,
        machine: &Machine,
        name: &str,
        run: &Run,
        clock: Clock,
    ) -> Result<Self, String> {
        let signals = run.signals();
        let signals: Vec<&str> = signals.iter().map(String::as_str).collect();
        let trace = options
            .trace
            .as_ref()
            .map(|path| TraceSink::create(path, machine, name, run, options.dry));
        let blocks = options
            .blocks
            .as_ref()
            .map(|path| BlocksCsv::create(path, machine));
        let rough = options
            .rough
            .as_ref()
            .map(|path| RoughCsv::create(path, machine));
        let events = options
            .events
            .as_ref()
            .map(|path| EventsCsv::create(path, machine.fine_period_s));
        let report = options
            .report
            .as_ref()
            .map(|_| Collector::new(machine, name, &signals, run.allows_steps()));
        let keys = keys_at_hand(options, clock);
        let presence = Presence {
            real_time: clock == Clock::Wall,
            pause: options.pause,
            keys,
        };
        if keys {
            Keyboard::explain();
        }
        let mut operator = Operator::begin(&options.operator, machine, run, presence)?;
        if streams(options) {
            operator = operator.without_enter();
        }
        Ok(Self {
            without_time_constants: (!run.uses_time_constants())
                .then(|| machine.planner.plugin.clone()),
            switches: switches(options, clock),
            operator,
            homed: Corrections::new(run.homed()),
            progress: Progress::new(run.checked.length_mm, machine.fine_period_s),
            trace: trace.transpose()?,
            blocks: blocks.transpose()?,
            rough: rough.transpose()?,
            events: events.transpose()?,
            report,
            summary: options.summary.as_deref().map(summary_file).transpose()?,
            broken: Broken::default(),
        })
    }

    /// Ends every file. What cannot be written is said, and told by the summary.
    fn finish(self, options: &args::Run, left: &Left, summary: &mut Summary) {
        self.progress.finish();
        let mut broken = self.broken;
        broken.note(self.trace.map_or(Ok(()), TraceSink::finish));
        broken.note(self.blocks.map_or(Ok(()), BlocksCsv::finish));
        broken.note(self.rough.map_or(Ok(()), RoughCsv::finish));
        let completed = summary.fault.is_none() && summary.stopped.is_none();
        broken.note(
            self.events
                .map_or(Ok(()), |events| events.finish(left, completed)),
        );
        summary.record_errors = broken.errors().to_vec();
        if let (Some(report), Some(path)) = (self.report, &options.report) {
            broken.note(report.write(path, summary));
        }
        summary.record_errors = broken.errors().to_vec();
        if let (Some(out), Some(path)) = (self.summary, &options.summary) {
            let written = write_summary(out, summary);
            broken.note(written.map_err(|cause| RecordError::lost("summary", path, cause)));
        }
        broken.tell();
        summary.record_errors = broken.errors().to_vec();
    }
}

impl RunObserver for Sinks {
    fn broken_record(&mut self) -> Option<String> {
        self.broken.tell()
    }

    fn note(&mut self, note: &str) {
        say!("{note}");
    }

    fn block(&mut self, block: &Block, curve: Option<Curve<'_>>, report: &BlockReport) {
        self.tell_of_time_constant(block);
        if let Some(blocks) = &mut self.blocks {
            blocks.block(block, report);
        }
        if let Some(collector) = &mut self.report {
            collector.block(block, curve, report);
        }
    }

    fn event(&mut self, event: &Event) {
        self.homed.event(event);
        if let Some(events) = &mut self.events {
            events.event(event);
        }
        let Some(word) = stop_word(event) else {
            return;
        };
        let (line, switches) = (event.line, &self.switches);
        let waits = if event.kind == EventKind::OptionalStop {
            switches.optional_stop
        } else {
            switches.pause_at_stops
        };
        if switches.dry_run {
            say!("line {line}: {word}: a dry run, it goes on");
        } else if !waits {
            say!("line {line}: {word}: no operator is asked, the run goes on");
        }
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        self.operator.program_stop(line)
    }

    fn is_attended(&self) -> bool {
        self.operator.is_attended()
    }

    fn rest(&mut self, _rest: &Rest) {
        self.operator.rest();
    }

    fn command(&mut self, command: &Timed) {
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.command(command));
        }
    }

    fn policy(&mut self, summary: &PolicySummary) {
        self.operator.policy(summary);
    }

    fn needs_each_deviation(&self) -> bool {
        self.report.is_some()
    }

    fn sample(&mut self, sample: &Sample, deviation_mm: f64, signals: &[f64]) {
        self.progress.sample(sample);
        self.operator.sample(sample, self.progress.share());
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.sample(sample, signals));
        }
        if let Some(blocks) = &mut self.blocks {
            self.broken.note(blocks.sample(sample));
        }
        if let Some(rough) = &mut self.rough {
            self.broken.note(rough.sample(sample));
        }
        if let Some(events) = &mut self.events {
            self.broken.note(events.sample(sample));
        }
        if let Some(report) = &mut self.report {
            report.sample(sample, deviation_mm, signals);
        }
    }
}

impl Sinks {
    /// A time constant that the planner does not use is worth a line, once.
    fn tell_of_time_constant(&mut self, block: &Block) {
        if block.time_constant_s.is_nan() || block.length_mm == 0.0 {
            return;
        }
        if let Some(planner) = self.without_time_constants.take() {
            say!(
                "line {}: TA has no effect: planner {planner} takes no time constants from programs or policies",
                block.line
            );
        }
    }
}

/// The word of an event that waits for the operator.
fn stop_word(event: &Event) -> Option<&'static str> {
    match event.kind {
        EventKind::ProgramStop if event.index == 60 => Some("M60, change of pallets"),
        EventKind::ProgramStop => Some("M0, program stop"),
        EventKind::OptionalStop => Some("M1, optional stop"),
        EventKind::ToolChange => Some("M6, tool change"),
        _ => None,
    }
}

/// The file of the summary, with room for it.
fn summary_file(path: &Path) -> Result<Output, String> {
    let mut out = Output::create(path)?;
    out.reserve(SUMMARY_ROOM_BYTES)?;
    Ok(out)
}

/// Writes the summary, on a full disk without the list of stops.
fn write_summary(mut out: Output, summary: &mut Summary) -> Result<(), String> {
    let write = |out: &mut Output, summary: &Summary| {
        let text = serde_json::to_string_pretty(summary).map_err(io::Error::other)?;
        writeln!(out, "{text}").and_then(|()| out.close())
    };
    if let Err(error) = write(&mut out, summary) {
        if summary.stops.is_empty() {
            return Err(error.to_string());
        }
        tell(&format!(
            "error: summary: {error}; it is written without its list of {} stops",
            summary.stops.len()
        ));
        summary.stops.clear();
        out.begin_again()
            .and_then(|()| write(&mut out, summary))
            .map_err(|e| e.to_string())?;
    }
    out.finish()
}

fn conclude(options: &args::Run, outcome: &Outcome) -> u8 {
    // A reader that has gone away (a closed pipe) is no reason to fail: the run is done. Standard output may carry a file.
    let _ = if written(options)
        .iter()
        .any(|(_, path)| path.as_os_str() == "-")
    {
        print_outcome(&mut io::stderr().lock(), options, &outcome.summary)
    } else {
        print_outcome(&mut io::stdout().lock(), options, &outcome.summary)
    };
    let Summary { fault, stopped, .. } = &outcome.summary;
    if let Some(fault) = fault {
        say!("fault: {fault}");
    }
    if let Some(stopped) = stopped {
        say!("{stopped}");
    }
    tell_warnings(&outcome.summary);
    let whole = fault.is_none() && stopped.is_none() && outcome.summary.record_errors.is_empty();
    if whole { 0 } else { FAULT }
}

/// The stop that took longest to come to rest.
fn longest(stops: &[Stop]) -> Option<&Stop> {
    stops
        .iter()
        .max_by(|a, b| a.time_s.total_cmp(&b.time_s).then(b.tick.cmp(&a.tick)))
}

fn print_stop(out: &mut impl Write, summary: &Summary, stop: &Stop) -> io::Result<()> {
    let Stop {
        tick,
        line,
        cause,
        time_s,
        distance_mm,
        ..
    } = stop;
    let reaction = match stop.reaction_periods {
        Some(1) => "slower from the first sample".to_string(),
        Some(periods) => format!("slower from sample {periods}"),
        None => "nothing to slow down".to_string(),
    };
    let count = summary.stop_count;
    writeln!(
        out,
        "stops {count}, the longest: {cause} at tick {tick}, line {line}: {reaction}, {time_s:.3} s, {distance_mm:.3} mm"
    )
}

/// What is said of every run, wherever it was driven: keys of a summary.
#[derive(Deserialize)]
pub struct Driven {
    program: String,
    machine: String,
    planner: String,
    dry_run: bool,
    blocks: u64,
    length_mm: f64,
    motion_time_s: f64,
    nominal_time_s: f64,
    time_ratio: Option<f64>,
    limit_violations: u64,
    guard_stops: u64,
    governed_samples: u64,
    starvations: u64,
    max_path_deviation_mm: f64,
    limited_by_s: BTreeMap<String, f64>,
    jerk: String,
    worst_of_limits: BTreeMap<String, OfLimits<String>>,
}

impl Driven {
    fn of(summary: &Summary) -> Self {
        Self {
            program: summary.program.clone(),
            machine: summary.machine.clone(),
            planner: summary.planner.clone(),
            dry_run: summary.dry_run,
            blocks: summary.blocks,
            length_mm: summary.length_mm,
            motion_time_s: summary.motion_time_s,
            nominal_time_s: summary.nominal_time_s,
            time_ratio: summary.time_ratio,
            limit_violations: summary.limit_violations,
            guard_stops: summary.guard_stops,
            governed_samples: summary.governed_samples,
            starvations: summary.starvations,
            max_path_deviation_mm: summary.max_path_deviation_mm,
            limited_by_s: summary.limited_by_s.clone(),
            jerk: summary.jerk.clone(),
            worst_of_limits: summary
                .worst_of_limits
                .iter()
                .map(|(axis, of)| (axis.clone(), of.owned()))
                .collect(),
        }
    }
}

/// What the time of a motion went to, in whole percent of it, the greatest part first. Parts are rounded down but for those that
/// lose most by it, which make up the 100; what is left with 0 % is not named. Empty where nothing took time.
fn percent_of_time(time_s: &BTreeMap<String, f64>) -> Vec<(&str, u32)> {
    let total_s: f64 = time_s.values().sum();
    let mut parts: Vec<(&str, f64)> = time_s
        .iter()
        .map(|(name, part_s)| (name.as_str(), 100.0 * part_s / total_s))
        .filter(|(_, percent)| percent.is_finite())
        .collect();
    parts.sort_by(|(_, a), (_, b)| b.fract().total_cmp(&a.fract()));
    let whole: u32 = parts.iter().map(|(_, percent)| *percent as u32).sum();
    let missing = 100_u32.saturating_sub(whole) as usize;
    let mut shares: Vec<(&str, u32)> = parts
        .iter()
        .enumerate()
        .map(|(place, (name, percent))| (*name, *percent as u32 + u32::from(place < missing)))
        .filter(|(_, percent)| *percent > 0)
        .collect();
    shares.sort_by_key(|(name, percent)| (Reverse(*percent), *name));
    shares
}

impl fmt::Display for Driven {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dry = if self.dry_run { "dry run of " } else { "" };
        let ratio = self
            .time_ratio
            .map_or_else(String::new, |ratio| format!(", T/T_ref {ratio:.4}"));
        writeln!(
            f,
            "{dry}{}: {} blocks, {:.3} mm in {:.3} s (nominal {:.3} s{ratio}) with {} on {}",
            self.program,
            self.blocks,
            self.length_mm,
            self.motion_time_s,
            self.nominal_time_s,
            self.planner,
            self.machine
        )?;
        writeln!(
            f,
            "limit violations {}, guard stops {}, governed samples {}, starvations {}, path deviation {:.3} µm",
            self.limit_violations,
            self.guard_stops,
            self.governed_samples,
            self.starvations,
            self.max_path_deviation_mm * 1e3
        )?;
        let parts: Vec<String> = percent_of_time(&self.limited_by_s)
            .iter()
            .map(|(name, percent)| format!("{name} {percent} %"))
            .collect();
        if !parts.is_empty() {
            writeln!(f, "time: {}", parts.join(", "))?;
        }
        if let Some(worst) = worst_of_judged(&self.jerk, &self.worst_of_limits) {
            writeln!(f, "largest share of a limit: {worst}")?;
        }
        if let Some(worst) = worst_of_reported(&self.jerk, &self.worst_of_limits) {
            writeln!(f, "largest jerk, which is only reported: {worst}")?;
        }
        Ok(())
    }
}

fn print_outcome(out: &mut impl Write, options: &args::Run, summary: &Summary) -> io::Result<()> {
    write!(out, "{}", Driven::of(summary))?;
    if let Some(timing) = summary.timing() {
        writeln!(out, "{timing}")?;
    }
    if let Some(stop) = longest(&summary.stops) {
        print_stop(out, summary, stop)?;
    }
    for (what, path) in written(options) {
        match summary
            .record_errors
            .iter()
            .find(|error| error.what == what)
            .map(|error| &error.kept_as)
        {
            None => writeln!(out, "{what}: {}", path.display())?,
            Some(Some(part)) => writeln!(out, "{what}: {part}, not complete")?,
            Some(None) => writeln!(out, "{what}: not complete")?,
        }
    }
    Ok(())
}

/// The files that the command line asks for, and what they are.
fn written(options: &args::Run) -> Vec<(&'static str, &Path)> {
    let files = [
        ("trace", &options.trace),
        ("blocks", &options.blocks),
        ("rough", &options.rough),
        ("events", &options.events),
        ("summary", &options.summary),
        ("report", &options.report),
    ];
    files
        .into_iter()
        .filter_map(|(what, path)| Some((what, path.as_deref()?)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parts_of_the_time_are_whole_percent_that_sum_to_a_hundred(
            parts_s in proptest::collection::vec((-6.0..0.0f64).prop_map(|power| 10f64.powf(power)), 1..12),
        ) {
            let time_s: BTreeMap<String, f64> = parts_s
                .iter()
                .enumerate()
                .map(|(n, part_s)| (format!("part-{n}"), *part_s))
                .collect();
            let total_s: f64 = parts_s.iter().sum();
            let parts = percent_of_time(&time_s);
            prop_assert_eq!(parts.iter().map(|(_, percent)| percent).sum::<u32>(), 100);
            prop_assert!(parts.is_sorted_by_key(|(_, percent)| Reverse(*percent)));
            for (name, part_s) in &time_s {
                let shown = parts.iter().find(|(shown, _)| shown == name);
                let percent = shown.map_or(0.0, |(_, percent)| f64::from(*percent));
                prop_assert!((percent - 100.0 * part_s / total_s).abs() < 1.0, "{name}: {percent}");
            }
        }
    }

    #[test]
    fn parts_of_no_time_are_none() {
        assert_eq!(percent_of_time(&BTreeMap::new()), []);
        assert_eq!(percent_of_time(&[("rest".to_owned(), 0.0)].into()), []);
    }
}
