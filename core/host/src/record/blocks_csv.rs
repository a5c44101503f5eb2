//! The blocks as they were driven.

use std::io::Write;
use std::path::Path;

use tandem_machine::Machine;
use tandem_sdk::{Axes, Block, BlockKind, BlockReport, LimitedBy};

use super::failure::RecordError;
use super::output::Output;

/// Writes a blocks CSV.
pub struct BlocksCsv {
    out: Output,
    axes: Axes,
    rapid_mm_per_s: Vec<f64>,
    /// It has been told that no further row can be written.
    failed: bool,
}

impl BlocksCsv {
    /// Starts the file with its head line.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path, machine: &Machine) -> Result<Self, String> {
        let mut out = Output::create(path)?;
        let columns = "index,line,kind,length_mm,feed_mm_s,start_feed_mm_s,peak_feed_mm_s,end_feed_mm_s,time_s,time_constant_ms,limited_by";
        let mut head: Vec<String> = columns.split(',').map(str::to_string).collect();
        for axis in 0..machine.axes.count() {
            let unit = if machine.axes.is_rotary(axis) { "deg" } else { "mm" };
            head.push(format!("{}_end_{unit}", machine.axes.letter(axis).to_ascii_lowercase()));
        }
        writeln!(out, "{}", head.join(",")).map_err(|e| format!("{}: {e}", path.display()))?;
        let rapid_mm_per_s = machine.limits.axes().iter().map(|a| a.rapid_mm_per_s).collect();
        Ok(Self { out, axes: machine.axes, rapid_mm_per_s, failed: false })
    }

    /// Adds a block. After an error all further ones are left out.
    ///
    /// # Errors
    /// Once: no further row can be written.
    pub fn block(&mut self, block: &Block, report: &BlockReport) -> Result<(), RecordError> {
        if self.failed {
            return Ok(());
        }
        // Names and numbers: nothing that a CSV would have to quote.
        let row = self.row(block, report).join(",");
        writeln!(self.out, "{row}").map_err(|error| {
            self.failed = true;
            RecordError { line: Some(block.line), ..RecordError::of("blocks", &mut self.out, error) }
        })
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The last rows cannot be written, or the file cannot take its name. What [`BlocksCsv::block`] has told is not told
    /// again.
    pub fn finish(self) -> Result<(), RecordError> {
        if self.failed { Ok(()) } else { self.out.finish_record("blocks") }
    }

    fn row(&self, block: &Block, report: &BlockReport) -> Vec<String> {
        let feed = if block.kind == BlockKind::Rapid { self.rapid_feed(block) } else { block.command_feed_mm_per_s() };
        let time_constant_ms = report.time_constant_s * 1e3;
        let mut row = vec![block.index.to_string(), block.line.to_string(), kind(block).to_string()];
        let feed = if block.kind == BlockKind::Dwell { 0.0 } else { feed };
        let numbers = [
            block.length_mm,
            feed,
            report.start_feed_mm_per_s,
            report.peak_feed_mm_per_s,
            report.end_feed_mm_per_s,
            report.time_s,
        ];
        row.extend(numbers.iter().map(f64::to_string));
        row.push(if time_constant_ms.is_nan() { String::new() } else { time_constant_ms.to_string() });
        row.push(limited_by(report.limited_by).to_string());
        for axis in 0..self.axes.count() {
            let end = block.end[axis];
            row.push(if self.axes.is_rotary(axis) { end.to_degrees() } else { end }.to_string());
        }
        row
    }

    /// The feed that the axes' rapid speeds give along the block.
    fn rapid_feed(&self, block: &Block) -> f64 {
        let each = self.rapid_mm_per_s.iter().enumerate().filter(|(i, _)| block.end[*i] != block.start[*i]);
        each.map(|(i, v)| v * block.length_mm / (block.end[i] - block.start[i]).abs()).fold(f64::INFINITY, f64::min)
    }
}

fn kind(block: &Block) -> &'static str {
    match block.kind {
        BlockKind::Rapid => "rapid",
        BlockKind::Line => "line",
        BlockKind::Nurbs => "nurbs",
        BlockKind::Dwell => "dwell",
        BlockKind::Arc if is_helix(block) => "helix",
        BlockKind::Arc => "arc",
    }
}

fn is_helix(block: &Block) -> bool {
    let plane = block.arc.plane.map(|axis| axis as usize);
    (0..block.end.0.len()).any(|axis| !plane.contains(&axis) && block.end[axis] != block.start[axis])
}

/// What held the feed down, as it is written.
pub(crate) fn limited_by(reason: LimitedBy) -> &'static str {
    match reason {
        LimitedBy::Feed => "feed",
        LimitedBy::Acceleration => "acceleration",
        LimitedBy::Curvature => "curvature",
        LimitedBy::Junction => "junction",
        LimitedBy::Velocity => "velocity",
        LimitedBy::Buffer => "buffer",
        LimitedBy::TimeConstant => "time-constant",
        LimitedBy::Tolerance => "tolerance",
        LimitedBy::Jerk => "jerk",
        LimitedBy::Policy => "policy",
    }
}
