//! The blocks as they were driven.

use std::collections::VecDeque;
use std::io::Write;
use std::path::Path;

use tandem_machine::Machine;
use tandem_rings::Sample;
use tandem_sdk::{Axes, Block, BlockKind, BlockReport};

use super::output::{Output, RecordError};
use crate::block_times::{BlockTimes, limited_by};

/// Writes a blocks CSV.
pub struct BlocksCsv {
    out: Output,
    axes: Axes,
    rapid_mm_per_s: Vec<f64>,
    /// Blocks that have not been driven to their end: their time is not known yet.
    open: VecDeque<Open>,
    times: BlockTimes,
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
            let unit = if machine.axes.is_rotary(axis) {
                "deg"
            } else {
                "mm"
            };
            head.push(format!(
                "{}_end_{unit}",
                machine.axes.letter(axis).to_ascii_lowercase()
            ));
        }
        head.push("planned_time_s".to_string());
        writeln!(out, "{}", head.join(",")).map_err(|e| format!("{}: {e}", path.display()))?;
        let rapid_mm_per_s = machine
            .limits
            .axes()
            .iter()
            .map(|a| a.rapid_mm_per_s)
            .collect();
        let times = BlockTimes::new(machine.fine_period_s, machine.motion.max_feed_ratio);
        Ok(Self {
            out,
            axes: machine.axes,
            rapid_mm_per_s,
            open: VecDeque::new(),
            times,
            failed: false,
        })
    }

    /// A block is planned for good: its row is written when it has been driven.
    pub fn block(&mut self, block: &Block, report: &BlockReport) {
        if !self.failed {
            self.open.push_back(Open {
                index: block.index,
                line: block.line,
                row: self.row(block, report),
            });
            self.times.block(block, report);
        }
    }

    /// No further row comes: what is written stays beside the file that it does not become.
    pub fn give_up(mut self) {
        self.out.keep();
        // What cannot be written is not tried once more.
        let _ = self.out.close();
    }

    /// A sample was sent: rows of blocks that it has left behind are written. After an error all further ones are left out.
    ///
    /// # Errors
    /// Once: no further row can be written.
    pub fn sample(&mut self, sample: &Sample) -> Result<(), RecordError> {
        if self.failed {
            return Ok(());
        }
        let mut written = Ok(());
        let Self {
            times, open, out, ..
        } = self;
        times.sample(
            sample,
            |_, _| {},
            |index, time_s| write(out, open, &mut written, index, time_s),
        );
        self.failed = written.is_err();
        written
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The last rows cannot be written, or the file cannot take its name. What [`BlocksCsv::sample`] has told is not told
    /// again.
    pub fn finish(mut self) -> Result<(), RecordError> {
        if self.failed {
            return Ok(());
        }
        let mut written = Ok(());
        let Self {
            times, open, out, ..
        } = &mut self;
        times.finish(|index, time_s| write(out, open, &mut written, index, time_s));
        written.and_then(|()| self.out.finish_record("blocks"))
    }

    fn row(&self, block: &Block, report: &BlockReport) -> Vec<String> {
        let feed = if block.kind == BlockKind::Rapid {
            self.rapid_feed(block)
        } else {
            block.command_feed_mm_per_s()
        };
        let time_constant_ms = report.time_constant_s * 1e3;
        let mut row = vec![
            block.index.to_string(),
            block.line.to_string(),
            kind(block).to_string(),
        ];
        let feed = if block.kind == BlockKind::Dwell {
            0.0
        } else {
            feed
        };
        let numbers = [
            block.length_mm,
            feed,
            report.start_feed_mm_per_s,
            report.peak_feed_mm_per_s,
            report.end_feed_mm_per_s,
        ];
        row.extend(numbers.iter().map(f64::to_string));
        debug_assert_eq!(row.len(), TIME);
        row.push(String::new());
        row.push(if time_constant_ms.is_nan() {
            String::new()
        } else {
            time_constant_ms.to_string()
        });
        row.push(limited_by(report.limited_by).to_string());
        for axis in 0..self.axes.count() {
            let end = block.end[axis];
            row.push(
                if self.axes.is_rotary(axis) {
                    end.to_degrees()
                } else {
                    end
                }
                .to_string(),
            );
        }
        row.push(report.time_s.to_string());
        row
    }

    /// The feed that the axes' rapid speeds give along the block.
    fn rapid_feed(&self, block: &Block) -> f64 {
        let each = self
            .rapid_mm_per_s
            .iter()
            .enumerate()
            .filter(|(i, _)| block.end[*i] != block.start[*i]);
        each.map(|(i, v)| v * block.length_mm / (block.end[i] - block.start[i]).abs())
            .fold(f64::INFINITY, f64::min)
    }
}

/// A block whose row waits for its time.
struct Open {
    index: u64,
    line: u32,
    row: Vec<String>,
}

/// The column of the time.
const TIME: usize = 8;

/// Writes the row of the block `index`, which has taken `time_s`, unless one before could not be written.
fn write(
    out: &mut Output,
    open: &mut VecDeque<Open>,
    written: &mut Result<(), RecordError>,
    index: u64,
    time_s: f64,
) {
    let Some(mut block) = open
        .pop_front_if(|front| front.index == index)
        .filter(|_| written.is_ok())
    else {
        return;
    };
    block.row[TIME] = time_s.to_string();
    // Names and numbers: nothing that a CSV would have to quote.
    if let Err(error) = writeln!(out, "{}", block.row.join(",")) {
        *written = Err(RecordError {
            line: Some(block.line),
            ..RecordError::of("blocks", out, error)
        });
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
    (0..block.end.0.len())
        .any(|axis| !plane.contains(&axis) && block.end[axis] != block.start[axis])
}
