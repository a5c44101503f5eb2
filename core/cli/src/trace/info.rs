//! `tandem trace info`.

use std::error::Error;
use std::io::{self, Write};
use std::path::Path;

use tandem_recorder::TraceCsv;
use tandem_rings::Sample;
use tandem_sdk::{AxisVector, MAX_AXES};
use tandem_trace::Header;

use super::binary::Binary;

/// Prints what a binary trace holds. Status 1 where not every record could be read.
pub fn info(path: &Path) -> Result<u8, Box<dyn Error>> {
    let mut trace = Binary::open(path)?;
    let mut totals = Totals::new(trace.header().fine_period_s);
    while let Some(record) = trace.next()? {
        totals.sample(&record.sample);
    }
    let bytes = std::fs::metadata(path)
        .map_err(|e| format!("{}: {e}", path.display()))?
        .len();
    let mut out = io::stdout().lock();
    // A reader that has gone away (a closed pipe) is no reason to fail.
    let _ = print_header(&mut out, path, &trace)
        .and_then(|()| totals.print(&mut out, trace.header(), bytes))
        .and_then(|()| print_commands(&mut out, &trace.commands))
        .and_then(|()| writeln!(out, "{}", trace.verdict()));
    Ok(u8::from(!trace.is_whole()) * crate::REFUSED)
}

fn print_commands(out: &mut impl Write, commands: &[String]) -> io::Result<()> {
    writeln!(out, "commands     {}", commands.len())?;
    commands
        .iter()
        .try_for_each(|line| writeln!(out, "  {line}"))
}

fn print_header(out: &mut impl Write, path: &Path, trace: &Binary) -> io::Result<()> {
    let Header {
        fine_period_s,
        axes,
        machine,
        program,
        planner,
        dry_run,
        signals,
    } = trace.header();
    let kind = |axis| {
        if axes.is_rotary(axis) {
            "rotary"
        } else {
            "linear"
        }
    };
    let axes: Vec<_> = (0..axes.count())
        .map(|axis| format!("{} {}", axes.letter(axis), kind(axis)))
        .collect();
    let signals = if signals.is_empty() {
        "none".to_string()
    } else {
        signals.join(", ")
    };
    writeln!(out, "{}: trace, format {}", path.display(), trace.format())?;
    let dry = if *dry_run { " (dry run)" } else { "" };
    writeln!(
        out,
        "program      {program}{dry}\nmachine      {machine}\nplanner      {planner}"
    )?;
    writeln!(
        out,
        "axes         {}\nfine period  {} ms\nsignals      {signals}",
        axes.join(", "),
        fine_period_s * 1e3
    )
}

/// What the samples amount to.
struct Totals {
    fine_period_s: f64,
    records: u64,
    first_tick: u64,
    last: Sample,
    /// Velocity over the last period, where the sample before it is there: mm/s or rad/s.
    velocity: Option<AxisVector>,
    /// Highest velocity, acceleration and distance of feedback behind command: mm or rad, s.
    peaks: [AxisVector; 3],
    peak_feed_mm_per_s: f64,
}

impl Totals {
    fn new(fine_period_s: f64) -> Self {
        let (last, peaks) = (Sample::default(), [AxisVector::ZERO; 3]);
        Self {
            fine_period_s,
            records: 0,
            first_tick: 0,
            last,
            velocity: None,
            peaks,
            peak_feed_mm_per_s: 0.0,
        }
    }

    fn sample(&mut self, sample: &Sample) {
        let per_s = 1.0 / self.fine_period_s;
        let follows = self.records > 0 && self.last.tick.checked_add(1) == Some(sample.tick);
        let velocity = follows.then(|| (sample.command - self.last.command) * per_s);
        let acceleration = velocity
            .zip(self.velocity)
            .map(|(now, before)| (now - before) * per_s);
        let distance = Some(sample.command - sample.feedback);
        for (peak, value) in self
            .peaks
            .iter_mut()
            .zip([velocity, acceleration, distance])
        {
            for axis in 0..MAX_AXES {
                peak[axis] = value.map_or(0.0, |value| value[axis].abs()).max(peak[axis]);
            }
        }
        self.peak_feed_mm_per_s = self.peak_feed_mm_per_s.max(sample.feed_mm_per_s);
        if self.records == 0 {
            self.first_tick = sample.tick;
        }
        self.records += 1;
        (self.velocity, self.last) = (velocity, *sample);
    }

    fn print(&self, out: &mut impl Write, header: &Header, bytes: u64) -> io::Result<()> {
        if self.records == 0 {
            return writeln!(out, "records      0 in {bytes} bytes");
        }
        let Sample {
            tick, line, state, ..
        } = self.last;
        let each = bytes as f64 / self.records as f64;
        let duration_s = TraceCsv::t_s(tick.saturating_sub(self.first_tick), self.fine_period_s);
        writeln!(
            out,
            "records      {} in {bytes} bytes ({each:.1} each)",
            self.records
        )?;
        writeln!(
            out,
            "duration     {duration_s} s, ticks {} to {tick}",
            self.first_tick
        )?;
        writeln!(out, "last         {}, line {line}", state.name())?;
        for axis in 0..header.axes.count() {
            let is_rotary = header.axes.is_rotary(axis);
            let shown = self.peaks.map(|peak| {
                if is_rotary {
                    peak[axis].to_degrees()
                } else {
                    peak[axis]
                }
            });
            let [velocity, acceleration, distance] = shown;
            let letter = header.axes.letter(axis);
            let unit = if is_rotary { "deg" } else { "mm" };
            writeln!(
                out,
                "peak {letter}       {velocity:.3} {unit}/s, {acceleration:.1} {unit}/s², feedback off by {distance:.6} {unit}"
            )?;
        }
        writeln!(out, "peak feed    {:.3} mm/s", self.peak_feed_mm_per_s)
    }
}
