//! The operator of a run: keys on the terminal, clients at sockets, signals.

mod enter;
mod keys;
mod panel;
mod signals;
mod terminal;

use std::io::{IsTerminal, stderr};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread;
use std::time::Duration;

use tandem_host::{Run, StopAnswer};
use tandem_machine::Machine;
use tandem_recorder::{PolicySummary, Summary};
use tandem_rings::Sample;
use tandem_session::operator::{Listen, OperatorHub, Server};

use crate::args;

use enter::Enter;
pub use keys::{Keyboard, press};
pub use panel::{Panel, PanelSwitches};
pub use signals::{Signals, Stops};
pub use terminal::{is_on_terminal, keep_terminal, restore_terminal};

/// How often somebody who waits looks at who else may have something to say: at a program stop, at a fault, or for a controller.
pub const LOOK: Duration = Duration::from_millis(5);

/// Who is there, and in which time.
#[derive(Clone, Copy, Debug)]
pub struct Presence {
    /// Machine time is the wall's.
    pub real_time: bool,
    /// `--pause`: stops wait also where nobody is seen to be there.
    pub pause: bool,
    /// Keys are taken from the terminal.
    pub keys: bool,
}

/// Everything through which a run is told what to do. Dropping it gives the terminal back and tells clients that the run
/// is over.
pub struct Operator {
    hub: Arc<OperatorHub>,
    // The order matters: keys and signals go before the clients are told.
    keyboard: Option<Keyboard>,
    signals: Option<Signals>,
    server: Option<Server>,
    enter: Enter,
    /// Machine time passes while the program waits.
    real_time: bool,
    /// `--pause`.
    pause: bool,
}

impl Operator {
    /// Opens what the command line asks for.
    ///
    /// # Errors
    /// The socket, the token file or the terminal with the cause.
    pub fn begin(
        options: &args::Operator,
        machine: &Machine,
        run: &Run,
        presence: Presence,
    ) -> Result<Self, String> {
        Self::at(
            Arc::new(OperatorHub::new(machine, run.controls(), run.status())),
            options,
            presence,
        )
    }

    /// The same at a hub that is there.
    ///
    /// # Errors
    /// As [`Operator::begin`].
    pub fn at(
        hub: Arc<OperatorHub>,
        options: &args::Operator,
        presence: Presence,
    ) -> Result<Self, String> {
        let Presence {
            real_time,
            pause,
            keys,
        } = presence;
        let server = serve(options, &hub)?;
        let signals = real_time.then(|| Signals::catch(hub.clone())).transpose()?;
        let stops = signals.as_ref().map(Signals::stops);
        let keyboard = stops
            .filter(|_| keys)
            .map(|stops| Keyboard::begin(hub.clone(), stops))
            .transpose()?;
        Ok(Self {
            hub,
            keyboard,
            signals,
            server,
            enter: Enter::default(),
            real_time,
            pause,
        })
    }

    /// Standard input carries the program: nobody presses Enter there.
    pub fn without_enter(mut self) -> Self {
        self.enter = Enter::never();
        self
    }

    /// The hub, for keys that come and go.
    pub fn hub(&self) -> &Arc<OperatorHub> {
        &self.hub
    }

    /// How often a stop was asked for by Ctrl-C or a signal; `None` on the virtual clock.
    pub fn stops(&self) -> Option<Stops> {
        self.signals.as_ref().map(Signals::stops)
    }

    /// A sample was sent; `progress` is the share of the path that is driven.
    pub fn sample(&self, sample: &Sample, progress: f64) {
        if self.server.is_some() {
            self.hub.sample(sample, progress);
        }
    }

    /// What the policy script did until now.
    pub fn policy(&self, summary: &PolicySummary) {
        if self.server.is_some() {
            self.hub.policy(summary);
        }
    }

    /// Whether somebody can give commands now.
    pub fn is_attended(&self) -> bool {
        self.keyboard.is_some() || self.hub.clients() > 0
    }

    /// The program waits on `line`: whether it goes on.
    pub fn program_stop(&mut self, line: u32) -> StopAnswer {
        if self.hub.waits_on_line() != Some(line) {
            if !self.is_asked_to_wait() && !self.is_attended() {
                say!("line {line}: no operator is there, the run goes on");
                return StopAnswer::GoOn;
            }
            self.hub.begin_wait(line);
            say!("line {line}: the program waits; Enter goes on");
        }
        let mut answer = self.look();
        while answer == StopAnswer::Wait && !self.real_time {
            thread::sleep(LOOK);
            answer = self.look();
        }
        if answer != StopAnswer::Wait {
            self.hub.end_wait();
        }
        answer
    }

    /// The machine came to a rest that ended what the program waited for.
    pub fn rest(&self) {
        self.hub.end_wait();
    }

    /// The run is over by `fault`, and its session stands in it: clients may take it back.
    pub fn begin_fault(&mut self, fault: &str) {
        self.keyboard = None;
        self.signals = None;
        self.hub.begin_fault(fault);
    }

    /// The run is over: the terminal is as it was, and the clients are told why.
    pub fn end(&mut self, summary: &Summary) {
        self.keyboard = None;
        self.signals = None;
        self.hub
            .end(summary.fault.as_deref(), summary.stopped.as_deref());
        self.server = None;
    }

    /// Whether stops wait also where nobody is seen to be there: somebody has asked for that.
    fn is_asked_to_wait(&self) -> bool {
        self.pause || self.hub.controls().optional_stop.load(Relaxed)
    }

    fn look(&mut self) -> StopAnswer {
        if self.hub.answered() || self.hub.is_stopping() {
            return StopAnswer::GoOn;
        }
        if self.keyboard.is_some() || !self.is_asked_to_wait() {
            return StopAnswer::Wait;
        }
        match self.enter.look() {
            None => StopAnswer::Wait,
            Some(true) => StopAnswer::GoOn,
            Some(false) if self.server.is_some() => StopAnswer::Wait,
            Some(false) => StopAnswer::Nobody,
        }
    }
}

/// A line to standard error, over the progress where that is shown.
pub fn tell(words: &str) {
    let clear = if stderr().is_terminal() {
        "\r\x1b[K"
    } else {
        ""
    };
    say!("{clear}{words}");
}

/// Opens the sockets, and says where clients find them.
fn serve(options: &args::Operator, hub: &Arc<OperatorHub>) -> Result<Option<Server>, String> {
    options.check_tokens(false)?;
    if options.is_nowhere() {
        return Ok(None);
    }
    let listen = Listen {
        unix: options.listen.clone(),
        tcp: options.listen_tcp,
        token_file: options.token_file.clone(),
        role_token_files: options.role_token_files(),
        ..Listen::default()
    };
    let server = Server::start(Arc::clone(hub), &listen)?;
    if let Some(path) = &options.listen {
        say!("operators: {}", path.display());
    }
    if let Some(address) = server.address {
        say!("operators: {address}");
    }
    Ok(Some(server))
}
