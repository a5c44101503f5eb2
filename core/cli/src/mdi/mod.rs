//! `tandem mdi`: manual input.

pub mod conversation;
mod editor;
pub mod input;

use std::error::Error;
use std::sync::Arc;

use tandem_host::{Clock, Run, RunObserver, StopAnswer, Switches, Timed};
use tandem_machine::Machine;
use tandem_rings::{Rest, Sample};
use tandem_session::{HOMING, MdiSession};

use crate::broken::Broken;
use crate::operator::{Keyboard, Operator, Presence, is_on_terminal};
use crate::trace::TraceSink;
use crate::warnings::tell_warnings;
use crate::{FAULT, REFUSED, args, built_in};

use conversation::{Conversation, Shared};

/// The word that takes back a fault.
pub const RESET: &str = "!reset";

/// Says how lines are typed at a terminal.
pub fn explain() {
    say!(
        "a line of G-code is driven when it is complete; help says what there is, Tab completes words; quit, exit or Ctrl-D ends the session"
    );
    Keyboard::explain();
}

/// Takes lines until there are no more.
pub fn mdi(options: &args::Mdi) -> Result<u8, Box<dyn Error>> {
    let machine = options.place.machine()?;
    let registry = built_in::registry()?;
    let real_time = options.session.clock == args::Clock::Wall;
    let keys = real_time && is_on_terminal();
    let attended = keys || (real_time && !options.session.operator.is_nowhere());
    let switches = Switches {
        block_delete: options.block_delete,
        pause_at_stops: attended,
        home: options.session.home.then_some(HOMING),
        reset: options.session.reset,
        clock: Some(if real_time {
            Clock::Wall
        } else {
            Clock::Virtual
        }),
        ..Switches::default()
    };
    let shared = Arc::new(Shared::new(real_time, keys));
    let conversation = Conversation::new(Arc::clone(&shared), machine.axes);
    let mut session =
        MdiSession::new(machine.clone(), &registry, switches, Box::new(conversation))?;
    let clock = if real_time {
        Clock::Wall
    } else {
        Clock::Virtual
    };
    let mut sinks = Sinks {
        trace: None,
        operator: None,
        first_tick: 0,
        next_tick: 0,
        noted: vec![],
        broken: Broken::default(),
    };
    loop {
        let run = session.enable()?;
        sinks.begin(
            options,
            &machine,
            &run,
            Presence {
                real_time,
                pause: false,
                keys: false,
            },
            &shared,
        )?;
        let outcome = run.drive(clock, &[], &mut sinks)?;
        shared.take_keys();
        sinks.begin_fault(&outcome.summary);
        tell_warnings(&outcome.summary);
        session.stands_at(outcome.position, &outcome.left);
        session.reset_drives();
        if let Some(fault) = &outcome.summary.fault {
            say!("fault: {fault}; {RESET} goes on from here");
        }
        let goes_on = outcome.summary.fault.is_some() && shared.is_reset();
        sinks.end(&outcome.summary);
        if !goes_on {
            break;
        }
    }
    let Sinks {
        trace, mut broken, ..
    } = sinks;
    broken.note(trace.map_or(Ok(()), TraceSink::finish));
    broken.tell();
    let status = if shared.ended_in_fault() || broken.is_any() {
        FAULT
    } else {
        u8::from(shared.has_refused()) * REFUSED
    };
    Ok(status)
}

/// What is kept of all runs of a session.
struct Sinks {
    trace: Option<TraceSink>,
    operator: Option<Operator>,
    /// Tick of the session at which the run began: a trace goes on after a reset.
    first_tick: u64,
    next_tick: u64,
    /// What has been said: what the computer does not grant is said once, not in every run.
    noted: Vec<String>,
    /// The trace, where it could not be written to its end.
    broken: Broken,
}

impl Sinks {
    fn begin(
        &mut self,
        options: &args::Mdi,
        machine: &Machine,
        run: &Run,
        presence: Presence,
        shared: &Shared,
    ) -> Result<(), String> {
        if let (None, Some(path)) = (&self.trace, &options.session.trace) {
            self.trace = Some(TraceSink::create(
                path,
                machine,
                "manual input",
                run,
                false,
            )?);
        }
        let operator = Operator::begin(&options.session.operator, machine, run, presence)?;
        shared.follow(&operator);
        self.operator = Some(operator);
        self.first_tick = self.next_tick;
        Ok(())
    }

    /// Behind a run: clients may take its fault back, where it has one.
    fn begin_fault(&mut self, summary: &tandem_recorder::Summary) {
        if let (Some(operator), Some(fault)) = (&mut self.operator, &summary.fault) {
            operator.begin_fault(fault);
        }
    }

    fn end(&mut self, summary: &tandem_recorder::Summary) {
        if let Some(mut operator) = self.operator.take() {
            operator.end(summary);
        }
    }
}

impl RunObserver for Sinks {
    fn broken_record(&mut self) -> Option<String> {
        self.broken.tell()
    }

    fn note(&mut self, note: &str) {
        if !self.noted.iter().any(|said| said == note) {
            self.noted.push(note.to_string());
            say!("{note}");
        }
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        self.operator
            .as_mut()
            .map_or(StopAnswer::GoOn, |operator| operator.program_stop(line))
    }

    fn is_attended(&self) -> bool {
        self.operator.as_ref().is_some_and(Operator::is_attended)
    }

    fn rest(&mut self, _rest: &Rest) {
        if let Some(operator) = &self.operator {
            operator.rest();
        }
    }

    fn command(&mut self, command: &Timed) {
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.command(&Timed {
                tick: self.first_tick + command.tick,
                ..*command
            }));
        }
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, signals: &[f64]) {
        let sample = Sample {
            tick: self.first_tick + sample.tick,
            ..*sample
        };
        self.next_tick = sample.tick + 1;
        if let Some(operator) = &self.operator {
            operator.sample(&sample, 1.0);
        }
        if let Some(trace) = &mut self.trace {
            self.broken.note(trace.sample(&sample, signals));
        }
    }
}
