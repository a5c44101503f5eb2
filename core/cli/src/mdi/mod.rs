//! `tandem mdi`: manual input.

pub mod conversation;
mod editor;
pub mod input;

use std::error::Error;
use std::sync::Arc;

use tandem_host::{Clock, Run, RunObserver, StopAnswer, Switches, Timed};
use tandem_machine::Machine;
use tandem_rings::{Rest, Sample};
use tandem_session::{HOMING, MdiSession, Pace};

use crate::operator::{Keyboard, Operator, Presence, is_on_terminal};
use crate::session_record::SessionRecord;
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
    let input = Box::new(conversation);
    let mut session = MdiSession::new(machine.clone(), &registry, switches, Pace::AtRest, input)?;
    let clock = if real_time {
        Clock::Wall
    } else {
        Clock::Virtual
    };
    let mut sinks = Sinks::default();
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
        sinks.record.begin_fault(&outcome.summary);
        tell_warnings(&outcome.summary);
        session.stands_at(outcome.position, &outcome.left);
        session.reset_drives();
        if let Some(fault) = &outcome.summary.fault {
            say!("fault: {fault}; {RESET} goes on from here");
        }
        let goes_on = outcome.summary.fault.is_some() && shared.is_reset();
        sinks.record.end(&outcome.summary);
        if !goes_on {
            break;
        }
    }
    let is_broken = sinks.record.finish();
    let status = if shared.ended_in_fault() || is_broken {
        FAULT
    } else {
        u8::from(shared.has_refused()) * REFUSED
    };
    Ok(status)
}

/// What is kept of all runs of a session.
#[derive(Default)]
struct Sinks {
    record: SessionRecord,
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
        let trace = options.session.trace.as_deref();
        self.record
            .begin_trace(trace, machine, "manual input", run)?;
        let operator = Operator::begin(&options.session.operator, machine, run, presence)?;
        shared.follow(&operator);
        self.record.begin(operator);
        Ok(())
    }
}

impl RunObserver for Sinks {
    fn broken_record(&mut self) -> Option<String> {
        self.record.broken_record()
    }

    fn note(&mut self, note: &str) {
        if self.record.is_new(note) {
            say!("{note}");
        }
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        self.record
            .operator
            .as_mut()
            .map_or(StopAnswer::GoOn, |operator| operator.program_stop(line))
    }

    fn is_attended(&self) -> bool {
        self.record.is_attended()
    }

    fn rest(&mut self, _rest: &Rest) {
        if let Some(operator) = &self.record.operator {
            operator.rest();
        }
    }

    fn command(&mut self, command: &Timed) {
        self.record.command(command);
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, signals: &[f64]) {
        self.record.sample(sample, signals);
    }
}
