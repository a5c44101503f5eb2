//! What was switched, and by whom.

use std::collections::VecDeque;
use std::io::Write;
use std::path::Path;

use tandem_fine::Left;
use tandem_rings::{FLOOD, MIST, Sample, StopCause, Switched, SwitchedBy};
use tandem_sdk::{Event, EventKind};

use super::output::{Output, RecordError};
use super::trace_csv::{RoundIfClose, TraceCsv, rpm};

/// Writes an events CSV: a row for each switch of spindle, coolant and outputs.
pub struct EventsCsv {
    out: Output,
    period_s: f64,
    /// What was sent last: everything is off when a run begins.
    last: Switched,
    /// Words of the program that have not been seen to switch.
    ahead: VecDeque<Word>,
    /// Words that no sample shows: they are written when the path comes to them.
    told: VecDeque<Word>,
    /// A cut waits for the spindle.
    waits: bool,
    /// It has been told that no further row can be written.
    failed: bool,
}

/// What a word or a row switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Spindle,
    /// Coolant too.
    Output(u32),
    /// Made ready, and changed in.
    ToolSelect(u32),
    ToolChange(u32),
    Analog(u32),
    Orient,
    Command(u32),
}

impl What {
    /// As the list calls it.
    fn shown(self) -> String {
        match self {
            Self::Spindle => "spindle".to_string(),
            Self::Output(MIST) => "mist".to_string(),
            Self::Output(FLOOD) => "flood".to_string(),
            Self::Output(output) => format!("output {output}"),
            Self::ToolSelect(_) => "tool made ready".to_string(),
            Self::ToolChange(_) => "tool change".to_string(),
            Self::Analog(output) => format!("analog output {output}"),
            Self::Orient => "spindle angle".to_string(),
            Self::Command(number) => format!("M{number}"),
        }
    }

    /// Whether a sample shows it.
    fn is_sampled(self) -> bool {
        matches!(self, Self::Spindle | Self::Output(_))
    }
}

/// A word of the program that switches.
#[derive(Clone, Copy, Debug)]
struct Word {
    what: What,
    /// rad/s, or 1 and 0.
    value: f64,
    line: u32,
    before_block: u64,
}

impl Word {
    fn of(event: &Event) -> Option<Self> {
        let what = match event.kind {
            EventKind::Spindle => What::Spindle,
            EventKind::Mist => What::Output(MIST),
            EventKind::Flood => What::Output(FLOOD),
            EventKind::DigitalOutput => What::Output(event.index.unsigned_abs()),
            EventKind::ToolSelect => What::ToolSelect(event.index.unsigned_abs()),
            EventKind::ToolChange => What::ToolChange(event.index.unsigned_abs()),
            EventKind::AnalogOutput => What::Analog(event.index.unsigned_abs()),
            EventKind::OrientSpindle => What::Orient,
            EventKind::UserCommand => What::Command(event.index.unsigned_abs()),
            _ => return None,
        };
        let is_on = f64::from(u8::from(event.value != 0.0));
        let value = match what {
            What::Output(_) => is_on,
            What::ToolSelect(number) | What::ToolChange(number) => f64::from(number),
            What::Orient => event.value.to_degrees(),
            What::Spindle | What::Analog(_) | What::Command(_) => event.value,
        };
        Some(Self {
            what,
            value,
            line: event.line,
            before_block: event.before_block,
        })
    }
}

/// A period in which something may have switched.
struct Period {
    tick: u64,
    /// Block and program line that moved.
    block: u64,
    line: u32,
    switched: Switched,
    /// A cut waits for the spindle.
    waits: bool,
}

impl EventsCsv {
    /// Starts the file with its head line.
    ///
    /// # Errors
    /// The path with the system's words.
    pub fn create(path: &Path, fine_period_s: f64) -> Result<Self, String> {
        let mut out = Output::create(path)?;
        writeln!(out, "time_s,tick,line,word,value,by")
            .map_err(|e| format!("{}: {e}", path.display()))?;
        let (last, ahead, told) = (Switched::default(), VecDeque::new(), VecDeque::new());
        Ok(Self {
            out,
            period_s: fine_period_s,
            last,
            ahead,
            told,
            waits: false,
            failed: false,
        })
    }

    /// An event of the program is on its way to the drives.
    pub fn event(&mut self, event: &Event) {
        let Some(word) = Word::of(event).filter(|_| !self.failed) else {
            return;
        };
        let queue = if word.what.is_sampled() {
            &mut self.ahead
        } else {
            &mut self.told
        };
        queue.push_back(word);
    }

    /// No further row comes: what is written stays beside the file that it does not become.
    pub fn give_up(mut self) {
        self.out.keep();
        // What cannot be written is not tried once more.
        let _ = self.out.close();
    }

    /// A sample was sent: what it switches is written. After an error all further ones are left out.
    ///
    /// # Errors
    /// Once: no further row can be written.
    pub fn sample(&mut self, sample: &Sample) -> Result<(), RecordError> {
        let Sample {
            tick,
            block,
            line,
            switched,
            ..
        } = *sample;
        let waits = sample.cause == StopCause::Spindle;
        let written = self
            .period(&Period {
                tick,
                block,
                line,
                switched,
                waits,
            })
            .map_err(|error| error.at(sample));
        // What stands before a block that is over has switched, or was so already.
        while self
            .ahead
            .pop_front_if(|word| word.before_block < block)
            .is_some()
        {}
        written
    }

    /// Ends the file of a run, which has `completed` its program or not. The period that ends a program switches too, and has no sample: that is what is `left`.
    ///
    /// # Errors
    /// The last rows cannot be written, or the file cannot take its name. What [`EventsCsv::sample`] has told is not told
    /// again.
    pub fn finish(mut self, left: &Left, completed: bool) -> Result<(), RecordError> {
        if self.failed {
            return Ok(());
        }
        let Left {
            tick,
            block,
            line,
            switched,
        } = *left;
        self.period(&Period {
            tick,
            block,
            line,
            switched,
            waits: false,
        })?;
        if completed {
            // Words behind the last motion have been reached too.
            self.period(&Period {
                tick,
                block: u64::MAX - 1,
                line,
                switched,
                waits: false,
            })?;
        }
        self.out.finish_record("events")
    }

    fn period(&mut self, period: &Period) -> Result<(), RecordError> {
        let comes = self
            .told
            .front()
            .is_some_and(|word| word.before_block <= period.block);
        if self.failed || (period.switched == self.last && period.waits == self.waits && !comes) {
            return Ok(());
        }
        self.rows(period).map_err(|error| {
            self.failed = true;
            self.ahead.clear();
            self.told.clear();
            RecordError::of("events", &mut self.out, error)
        })
    }

    fn rows(&mut self, period: &Period) -> std::io::Result<()> {
        let now = period.switched;
        let last = std::mem::replace(&mut self.last, period.switched);
        while let Some(word) = self
            .told
            .pop_front_if(|word| word.before_block <= period.block)
        {
            self.told_row(period, &word)?;
        }
        if now.spindle_rad_per_s != last.spindle_rad_per_s {
            self.row(period, What::Spindle, now.spindle_rad_per_s)?;
        }
        if std::mem::replace(&mut self.waits, period.waits) != period.waits {
            let time_s = TraceCsv::t_s(period.tick, self.period_s);
            let waits = u8::from(period.waits);
            writeln!(
                self.out,
                "{time_s},{},{},waits for spindle,{waits},spindle",
                period.tick, period.line
            )?;
        }
        for output in (0..u64::BITS).filter(|output| now.is_on(*output) != last.is_on(*output)) {
            self.row(
                period,
                What::Output(output),
                f64::from(u8::from(now.is_on(output))),
            )?;
        }
        Ok(())
    }

    fn told_row(&mut self, period: &Period, word: &Word) -> std::io::Result<()> {
        let (time_s, tick) = (TraceCsv::t_s(period.tick, self.period_s), period.tick);
        writeln!(
            self.out,
            "{time_s},{tick},{},{},{},program",
            word.line,
            word.what.shown(),
            word.value
        )
    }

    fn row(&mut self, period: &Period, what: What, value: f64) -> std::io::Result<()> {
        let Period {
            tick,
            block,
            line,
            switched,
            ..
        } = period;
        let by_word = (switched.by == SwitchedBy::Program)
            .then(|| self.line_of(what, value, *block))
            .flatten();
        let time_s = TraceCsv::t_s(*tick, self.period_s);
        let line = by_word.unwrap_or(*line);
        let word = what.shown();
        let shown = if what == What::Spindle {
            rpm(value).round_if_close()
        } else {
            value
        };
        // Names and numbers: nothing that a CSV would have to quote.
        writeln!(
            self.out,
            "{time_s},{tick},{line},{word},{shown},{}",
            switched.by.name()
        )
    }

    /// The line of the word that has switched `what` to `value` by the time `block` moves, or stands before the next. Of words
    /// at one place the last counts. It, and those for the same before it, are used up.
    fn line_of(&mut self, what: What, value: f64, block: u64) -> Option<u32> {
        let is_it = |word: &Word| {
            word.what == what && word.value == value && word.before_block <= block + 1
        };
        let place = self.ahead.iter().find(|word| is_it(word))?.before_block;
        let found = self
            .ahead
            .iter()
            .rposition(|word| is_it(word) && word.before_block == place)?;
        let line = self.ahead[found].line;
        let mut index = 0;
        self.ahead.retain(|word| {
            index += 1;
            word.what != what || index > found + 1
        });
        Some(line)
    }
}
