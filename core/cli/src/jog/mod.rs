//! `tandem jog`: single axes by hand.

mod input;
pub mod keys;
pub mod line;
mod shared;

use std::error::Error;
use std::sync::Arc;

use tandem_host::{Clock, Run, RunObserver, Switches, Timed};
use tandem_machine::Machine;
use tandem_recorder::Summary;
use tandem_rings::Sample;
use tandem_session::HOMING;
use tandem_session::jog::{JogController, JogSession};
use tandem_session::operator::OperatorHub;

use crate::operator::{Keyboard, Operator, Presence, Signals, is_on_terminal};
use crate::session_record::SessionRecord;
use crate::{FAULT, REFUSED, args, built_in};

use input::{Inputs, Script};
use keys::{JogKeys, OwnAxes};
use shared::Shared;

/// The word that takes back a fault.
pub const RESET: &str = "!reset";

/// Jogs until the operator ends it.
pub fn jog(options: &args::Jog) -> Result<u8, Box<dyn Error>> {
    let machine = options.place.machine()?;
    let registry = built_in::registry()?;
    let real_time = options.session.clock == args::Clock::Wall;
    let shared = Arc::new(Shared::new(
        real_time && is_on_terminal(),
        machine.axes,
        machine.start,
    ));
    let script = (!shared.keys).then(|| Script::new(Arc::clone(&shared), !real_time));
    let clock = if real_time {
        Clock::Wall
    } else {
        Clock::Virtual
    };
    let switches = Switches {
        home: options.session.home.then_some(HOMING),
        reset: options.session.reset,
        unhomed: true,
        clock: Some(clock),
        ..Switches::default()
    };
    let input = Inputs::new(Arc::clone(&shared), script);
    let mut session = JogSession::new(
        machine.clone(),
        &registry,
        switches,
        Box::new(input.clone()),
    )?;
    let keyboard = shared
        .keys
        .then(|| take_keys(&shared, session.jogs()))
        .transpose()?;
    let mut sinks = Sinks {
        shared: Arc::clone(&shared),
        record: SessionRecord::default(),
    };
    let faulted = loop {
        let run = session.enable()?;
        sinks.begin(options, &machine, session.jogs(), &run)?;
        let outcome = run.drive(clock, &[], &mut sinks)?;
        sinks.record.begin_fault(&outcome.summary);
        for warning in outcome.summary.warnings() {
            shared.say(&format!("warning: {warning}"));
        }
        session.stands_at(outcome.position);
        session.reset_drives();
        let Some(fault) = outcome.summary.fault.clone() else {
            sinks.end(outcome.summary);
            break false;
        };
        shared.say(&format!(
            "fault: {fault}; {} goes on from here",
            if shared.keys { "r" } else { RESET }
        ));
        let goes_on = waits_for_reset(&input, &shared, real_time);
        sinks.end(outcome.summary);
        if !goes_on? {
            break true;
        }
    };
    drop(keyboard);
    let is_broken = sinks.record.finish();
    Ok(if faulted || is_broken {
        FAULT
    } else {
        u8::from(shared.has_refused()) * REFUSED
    })
}

fn take_keys(shared: &Arc<Shared>, jogs: &Arc<JogController>) -> Result<Keyboard, String> {
    let mut panel = JogKeys::new(Box::new(OwnAxes {
        shared: Arc::clone(shared),
        jogs: Arc::clone(jogs),
    }));
    panel.explain();
    Keyboard::begin_with(move |bytes| panel.take(bytes))
}

/// Signals of the run that is over are gone: meanwhile others end the session.
fn waits_for_reset(input: &Inputs, shared: &Shared, real_time: bool) -> Result<bool, String> {
    let hub = shared.hub().filter(|_| real_time && shared.keys);
    let _signals = hub
        .map(|(hub, stops)| Signals::catch_with(hub, stops))
        .transpose()?;
    Ok(input.is_reset())
}

/// What is kept of all runs of a session, and who hears of it.
struct Sinks {
    shared: Arc<Shared>,
    record: SessionRecord,
}

impl Sinks {
    fn begin(
        &mut self,
        options: &args::Jog,
        machine: &Machine,
        jogs: &Arc<JogController>,
        run: &Run,
    ) -> Result<(), String> {
        let trace = options.session.trace.as_deref();
        self.record.begin_trace(trace, machine, "jogging", run)?;
        let hub =
            OperatorHub::new(machine, run.controls(), run.status()).with_jogs(Arc::clone(jogs));
        let presence = Presence {
            real_time: options.session.clock == args::Clock::Wall,
            pause: false,
            keys: false,
        };
        let operator = Operator::at(Arc::new(hub), &options.session.operator, presence)?;
        self.shared.follow(&operator);
        self.record.begin(operator);
        Ok(())
    }

    fn end(&mut self, mut summary: Summary) {
        // A jog that is stopped is the order of the day.
        summary.stopped = None;
        self.record.end(&summary);
    }
}

impl RunObserver for Sinks {
    fn broken_record(&mut self) -> Option<String> {
        self.record.broken_record()
    }

    fn note(&mut self, note: &str) {
        if self.record.is_new(note) {
            self.shared.say(note);
        }
    }

    fn is_attended(&self) -> bool {
        self.record.is_attended()
    }

    fn command(&mut self, command: &Timed) {
        self.record.command(command);
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, signals: &[f64]) {
        let sample = self.record.sample(sample, signals);
        self.shared.sample(&sample);
    }
}
