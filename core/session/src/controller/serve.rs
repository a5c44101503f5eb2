//! The loop that drives: orders of the dispatcher become jobs, one after the other.

use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use serde_json::{Value, json};
use tandem_gcode::{Interpreter, PersistentData, Program};
use tandem_host::{
    Clock, HostError, JobOutcome, Memory, PolicyParameter, PreparedJob, Registry, Resident,
    RunObserver, Switches, axis_limits, interpreter_config, moves_metal, planner,
};
use tandem_machine::Machine;
use tandem_state::Change;

use super::arrivals::Arrivals;
use super::ask::STOPPED;
use super::disk_work;
use super::dispatcher::{Dispatcher, Loaded, Mode, Order, RequestId};
use super::lines::{LineSource, Lines, lock};
use super::path::DrawnPath;
use super::persistence::Persistence;
use super::protocol::ControllerService;
use super::record::{Raise, Recording, Records};
use super::script::{Script, ScriptLine, Tell, VirtualSender};
use super::watch::{Notes, Refusals, Watch};
use crate::HOMING;
use crate::jog::{JogController, Jogging};
use crate::operator::{Listen, OperatorHub, Server};

/// What a controller is asked for.
pub struct Options {
    /// The clock.
    pub clock: Clock,
    /// Where its doors are.
    pub listen: Listen,
    /// The folder of the programs that clients may load by their path.
    pub programs: Option<PathBuf>,
    /// The folder in which every job leaves its files; none where none is kept.
    pub record: Option<PathBuf>,
    /// The file to which what clients say is written, by fine periods; none where it is not.
    pub arrivals: Option<PathBuf>,
    /// Enable the drives at once.
    pub enable: bool,
    /// On the virtual clock: what clients ask, and when.
    pub script: Vec<ScriptLine>,
    /// Fine periods that are counted before the first.
    pub uptime_periods: u64,
    /// What has lasted from the process before; none where the machine file alone says.
    pub persistent: Option<PersistentData>,
}

impl Options {
    /// What clients say by `script`, on the virtual clock: drives that are enabled at once, no doors, and no files.
    pub fn of_script(script: Vec<ScriptLine>) -> Self {
        Self {
            clock: Clock::Virtual,
            listen: Listen::default(),
            programs: None,
            record: None,
            arrivals: None,
            enable: true,
            script,
            uptime_periods: 0,
            persistent: None,
        }
    }
}

/// A controller that stays.
pub struct Controller<'r> {
    resident: Resident<'r>,
    dispatcher: Arc<Dispatcher>,
    /// Until the controller ends.
    server: Option<Server>,
    clock: Clock,
    script: Script,
    simulated: bool,
    records: Option<Records>,
}

impl<'r> Controller<'r> {
    /// Claims the drives of `machine` and opens the doors. Host; allocates.
    ///
    /// # Errors
    /// What refuses a run too; a door cannot be opened.
    pub fn open(
        machine: &Machine,
        registry: &'r Registry,
        options: Options,
        persistence: Box<dyn Persistence>,
    ) -> Result<Self, HostError> {
        let simulated = !moves_metal(machine, registry);
        let mut resident = Resident::attach(machine.clone(), registry, options.clock)?;
        resident.begin_at(options.uptime_periods);
        let machine = resident.machine().clone();
        let interpreter = interpreter_of(&machine, simulated, options.persistent);
        let mut dispatcher = dispatcher_of(
            &resident,
            registry,
            interpreter,
            persistence,
            options.programs,
        )?;
        let arrivals = options.arrivals.as_deref();
        let arrivals = arrivals.map(|path| Arrivals::create(path, machine.fine_period_s));
        dispatcher.arrivals = arrivals.transpose().map_err(HostError::System)?;
        let dispatcher = Arc::new(dispatcher);
        if options.clock == Clock::Virtual {
            dispatcher.set_replay_time(0.0);
        }
        restore_policy_parameters(&mut resident, &dispatcher)?;
        dispatcher.stands(&machine.start, not_homed(&machine, resident.unknown_axes()));
        if options.enable {
            dispatcher.lock().order = Some(Order::Enable {
                from: RequestId { client: 0, id: 0 },
                resets: false,
                emergency_stops: 0,
            });
        }
        let server = server_of(&dispatcher, &options.listen)?;
        let script = Script::new(options.script);
        let records = options.record.map(|root| {
            let dispatcher = Arc::clone(&dispatcher);
            let raise: Raise = Arc::new(move |why: &str| dispatcher.raise("record", why));
            Records::new(root, options.clock, machine.rough_period_s, raise)
        });
        Ok(Self {
            resident,
            dispatcher,
            server,
            clock: options.clock,
            script,
            simulated,
            records,
        })
    }

    /// The TCP address of its door, with the port that the system chose for port 0.
    pub fn address(&self) -> Option<std::net::SocketAddr> {
        self.server.as_ref().and_then(|server| server.address)
    }

    /// The TCP address of its door for senders of grbl's protocol, likewise.
    pub fn grbl_address(&self) -> Option<std::net::SocketAddr> {
        self.server.as_ref().and_then(|server| server.grbl_address)
    }

    /// On the virtual clock, somebody sends lines as grbl is sent them, until it hangs up. Before the run.
    pub fn add_sender(&mut self, sender: Box<dyn VirtualSender>) {
        self.script.add_sender(&self.dispatcher, sender);
    }

    /// What ends the controller, for signals: the machine comes to rest on the path, and its drives let go.
    pub fn ender(&self) -> impl Fn() + Send + Sync + 'static {
        let dispatcher = Arc::clone(&self.dispatcher);
        move || dispatcher.end()
    }

    /// Drives what is ordered, until it is told to end; on the virtual clock, until the script is over.
    ///
    /// # Errors
    /// The computer refuses, or the drives were not let go of.
    pub fn run(mut self, tell: Tell<'_>) -> Result<(), HostError> {
        while !self.dispatcher.is_over() {
            self.dispatcher.tell_state();
            let order = self.dispatcher.lock().order.clone();
            let order = order.or_else(|| lock(&self.dispatcher.lines).next_order());
            match order {
                Some(order) => self.obey(order, tell)?,
                None if self.clock == Clock::Virtual && self.script.is_over() => break,
                None => {
                    if let Some(words) = self.idle(tell)? {
                        self.dispatcher.fault(&words);
                    }
                }
            }
        }
        // Lines that came at the end, behind the last job.
        self.dispatcher.give_up_order(self.resident.machine().start);
        self.script.flush(
            &self.dispatcher,
            self.resident.uptime_periods(),
            self.clock,
            tell,
        );
        self.resident.stop(&mut Notes(tell))?;
        let persistent = lock(&self.dispatcher.lines).standing().persistent_data();
        self.dispatcher.keep(persistent);
        drop(self.server);
        disk_work::wait_for_all(&self.dispatcher);
        if let Some(records) = &self.records {
            records.wait_for_all();
        }
        // Nobody is acknowledged by it: what could not be written was told meanwhile, and is tried once more.
        let _ = self.dispatcher.persistence.commit(vec![]);
        Ok(())
    }

    /// One rough period in which nothing is driven; the fault that ends the enabled state in it, in words.
    fn idle(&mut self, tell: Tell<'_>) -> Result<Option<String>, HostError> {
        let mut watch = Watch::new(
            &self.dispatcher,
            &mut self.script,
            tell,
            Mode::Idle,
            self.clock,
            0.0,
        );
        let fault = self.resident.idle(&mut watch)?;
        watch.period();
        Ok(fault)
    }

    fn obey(&mut self, order: Order, tell: Tell<'_>) -> Result<(), HostError> {
        match order {
            Order::Check {
                from,
                program,
                load,
            } => self.check(from, &program, load),
            Order::Start { from } => self.start(from, tell)?,
            Order::Mdi => {
                let source = Box::new(LineSource::begin(&self.dispatcher.lines));
                let switches = Switches {
                    pause_at_stops: true,
                    ..self.switches()
                };
                let job = self.resident.source("lines by hand", source, switches);
                self.drive_or_tell(job, None, Mode::Mdi, "lines by hand", tell)?;
            }
            Order::JogLines => {
                // What let go of the one before is over.
                self.resident.controls().jog.let_go.store(false, Relaxed);
                let source = Box::new(LineSource::begin(&self.dispatcher.lines));
                let switches = Switches {
                    unhomed: true,
                    ..self.switches()
                };
                let job = self.resident.source("jogging", source, switches);
                self.drive_or_tell(job, None, Mode::Jog, "jogging", tell)?;
            }
            Order::Jog => {
                let refusals = Refusals(Arc::clone(&self.dispatcher));
                let source = Jogging::until_still(&self.dispatcher.jogs, Box::new(refusals));
                let source = Box::new(source);
                let switches = Switches {
                    unhomed: true,
                    ..self.switches()
                };
                let job = self.resident.source("jogging", source, switches);
                self.drive_or_tell(job, None, Mode::Jog, "jogging", tell)?;
            }
            Order::Home { from, axis } => {
                let job = self.resident.homing(HOMING, axis);
                self.drive_or_tell(job, Some(from), Mode::Homing, "homing", tell)?;
            }
            Order::Enable {
                from,
                resets,
                emergency_stops,
            } => self.enable(from, resets, emergency_stops, tell),
            Order::Disable { from } => {
                while !self.resident.disable() {
                    if let Some(words) = self.idle(tell)? {
                        // Whoever asked is answered with it.
                        self.dispatcher.fault(&words);
                        return Ok(());
                    }
                }
                let mut inner = self.dispatcher.lock();
                inner.enabled = false;
                inner.order = None;
                drop(inner);
                self.dispatcher
                    .answer(from, Ok(json!({ "disabled": true })));
            }
            Order::SetPolicyParameter { from, name, value } => {
                self.set_policy_parameter(from, &name, value);
            }
        }
        Ok(())
    }

    fn switches(&self) -> Switches {
        Switches {
            block_delete: self.dispatcher.lock().block_delete,
            optional_stop: self.resident.controls().optional_stop.load(Relaxed),
            ..Switches::default()
        }
    }

    fn memory(&self) -> Memory {
        let lines = lock(&self.dispatcher.lines);
        Memory {
            persistent: Arc::new(lines.standing().persistent_data()),
            state_tags: lines.state_tags.clone(),
            on: lines.standing().switched_on(),
        }
    }

    fn set_policy_parameter(&mut self, from: RequestId, name: &str, value: f64) {
        let before = self.resident.policy_parameters();
        let set = self.resident.set_policy_parameter(name, value);
        let kept = set.map_err(|e| e.to_string()).and_then(|()| {
            let name = name.to_string();
            self.dispatcher
                .persistence
                .commit(vec![Change::PolicyParameter { name, value }])
        });
        if let (Err(_), Some(before)) = (&kept, before.get(name)) {
            // It was fit before.
            let _ = self.resident.set_policy_parameter(name, *before);
        }
        let parameters = self.resident.policy_parameters();
        let mut inner = self.dispatcher.lock();
        inner.order = None;
        inner.policy_parameters.clone_from(&parameters);
        drop(inner);
        self.dispatcher
            .answer(from, kept.map(|()| json!({ "parameters": parameters })));
    }

    /// Checks a program and makes the job that drives it; the path is that which is drawn from now on.
    fn prepare(&self, program: &Loaded, drawn: &mut DrawnPath) -> Result<PreparedJob, String> {
        let spooled =
            Program::spool(&program.name, &program.text[..]).map_err(|e| e.to_string())?;
        let switches = Switches {
            pause_at_stops: true,
            ..self.switches()
        };
        self.resident
            .program(spooled, switches, &self.memory(), &mut |block, curve| {
                drawn.block(block, curve);
            })
            .map_err(|e| match e {
                HostError::Check(report) => {
                    let all: Vec<String> =
                        report.diagnostics.iter().map(ToString::to_string).collect();
                    format!(
                        "{} errors in the program: {}",
                        all.len() as u64 + report.unlisted,
                        all.join("; ")
                    )
                }
                other => other.to_string(),
            })
    }

    fn check(&mut self, from: RequestId, program: &Loaded, load: bool) {
        let mut drawn = DrawnPath::new(self.resident.machine().axes);
        let checked = self.prepare(program, &mut drawn).map(|job| {
            let report = job.checked();
            json!({
                "program": program.name, "hash": program.hash, "blocks": report.blocks, "length_mm": report.length_mm,
                "warnings": report.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
            })
        });
        let mut inner = self.dispatcher.lock();
        inner.order = None;
        if checked.is_ok() && load {
            inner.loaded = Some(program.clone());
            self.dispatcher.path().become_that_of(drawn, &program.name);
        }
        drop(inner);
        self.dispatcher.answer(from, checked);
    }

    fn start(&mut self, from: RequestId, tell: Tell<'_>) -> Result<(), HostError> {
        let loaded = self.dispatcher.lock().loaded.clone();
        let Some(program) = loaded else { return Ok(()) };
        let mut drawn = DrawnPath::new(self.resident.machine().axes);
        match self.prepare(&program, &mut drawn) {
            Err(why) => {
                self.dispatcher.give_up_order(self.resident.machine().start);
                self.dispatcher.answer(from, Err(why));
                Ok(())
            }
            Ok(job) => {
                // As it is driven: offsets may be others than when it was loaded.
                self.dispatcher.path().become_that_of(drawn, &program.name);
                self.drive(job, Some(from), Mode::Program, &program.name, tell)
            }
        }
    }

    fn drive_or_tell(
        &mut self,
        job: Result<PreparedJob, HostError>,
        from: Option<RequestId>,
        mode: Mode,
        name: &str,
        tell: Tell<'_>,
    ) -> Result<(), HostError> {
        match job {
            Ok(job) => self.drive(job, from, mode, name, tell),
            Err(why) => {
                self.dispatcher.give_up_order(self.resident.machine().start);
                match from {
                    Some(from) => self.dispatcher.answer(from, Err(why.to_string())),
                    None => self.dispatcher.tell_refused(name, &why.to_string()),
                }
                Ok(())
            }
        }
    }

    fn drive(
        &mut self,
        job: PreparedJob,
        from: Option<RequestId>,
        mode: Mode,
        name: &str,
        tell: Tell<'_>,
    ) -> Result<(), HostError> {
        let length_mm = job.checked().length_mm;
        if !self.dispatcher.begin(mode) {
            self.dispatcher.give_up_order(self.resident.machine().start);
            if let Some(from) = from {
                self.dispatcher.answer(from, Err(STOPPED.to_string()));
            }
            return Ok(());
        }
        if mode != Mode::Program {
            self.dispatcher.path().begin(name, true);
        }
        self.dispatcher.scope().begin_job(&job.signals());
        self.dispatcher.begin_history(mode, name);
        let recording = self.recording(mode, job.signals());
        if let Some(from) = from {
            self.dispatcher.answer(from, Ok(json!({ "begins": name })));
        }
        let mut watch = Watch::new(
            &self.dispatcher,
            &mut self.script,
            &mut *tell,
            mode,
            self.clock,
            length_mm,
        );
        watch.recording = recording;
        let mut outcome = self.resident.drive(job, &mut watch)?;
        let recording = watch.recording.take();
        self.dispatcher.settle(mode, &outcome);
        while !self
            .dispatcher
            .close(mode, name, &outcome, self.unknown_axes())
        {
            self.abort_late(&mut outcome, tell)?;
        }
        if let Some(recording) = recording {
            recording.finish(&outcome);
        }
        Ok(())
    }

    /// The files that a job leaves, where they are kept.
    fn recording(&self, mode: Mode, signals: Vec<String>) -> Option<Recording> {
        let records = self.records.as_ref()?;
        let number = self.dispatcher.lock().history.open()?;
        Some(records.begin((number, mode.name()), self.resident.machine(), signals))
    }

    /// An abort came when the path had come to its end and nobody had been told: what is on goes off all the same, and the job is
    /// aborted.
    fn abort_late(&mut self, outcome: &mut JobOutcome, tell: Tell<'_>) -> Result<(), HostError> {
        let dispatcher = &self.dispatcher;
        let script = &mut self.script;
        let mut watch = Watch::new(dispatcher, script, tell, Mode::Idle, self.clock, 0.0);
        let stopped = self.resident.switch_off(&mut watch)?;
        outcome.aborted = true;
        outcome.left = stopped.left;
        outcome.fault = stopped.fault;
        outcome.summary.fault = stopped.summary.fault;
        outcome.summary.stopped = stopped.summary.stopped;
        self.dispatcher.settle_late_abort(outcome);
        Ok(())
    }

    fn unknown_axes(&self) -> u32 {
        not_homed(self.resident.machine(), self.resident.unknown_axes())
    }

    fn enable(&mut self, from: RequestId, resets: bool, emergency_stops: u64, tell: Tell<'_>) {
        if !self.dispatcher.begin_enabling(emergency_stops) {
            self.dispatcher.answer(from, Err(STOPPED.to_string()));
            self.dispatcher.tell_state();
            return;
        }
        let mut watch = Watch::new(
            &self.dispatcher,
            &mut self.script,
            tell,
            Mode::Enabling,
            self.clock,
            0.0,
        );
        let outcome = match self.resident.enable(resets, &mut watch) {
            Ok(outcome) => outcome,
            Err(why) => {
                // The machine stays where it was; who can, resets once more.
                self.dispatcher.fault(&why.to_string());
                self.dispatcher.answer(from, Err(why.to_string()));
                return;
            }
        };
        self.dispatcher.settle(Mode::Enabling, &outcome);
        // An abort that comes when the drives hold finds nothing that moves.
        let _ = self
            .dispatcher
            .close(Mode::Enabling, "enabling", &outcome, self.unknown_axes());
        let answer = match &outcome.summary.fault {
            Some(fault) => Err(fault.clone()),
            None if outcome.aborted => Err("it was aborted".to_string()),
            None => Ok(json!({ "enabled": true })),
        };
        self.dispatcher.answer(from, answer);
    }

    /// Whether all drives are simulated.
    pub fn is_simulated(&self) -> bool {
        self.simulated
    }
}

/// The interpreter of lines by hand, with what has lasted from the process before.
fn interpreter_of(
    machine: &Machine,
    simulated: bool,
    persistent: Option<PersistentData>,
) -> Interpreter {
    let mut config = interpreter_config(machine, simulated, Switches::default());
    if let Some(persistent) = persistent {
        config.tools.clone_from(&persistent.tools);
        config.persistent = Some(Arc::new(persistent));
    }
    Interpreter::new(config)
}

/// The dispatcher for the drives of `resident`. Lines by hand are judged and planned by planners of their own, and so are jogs.
fn dispatcher_of(
    resident: &Resident<'_>,
    registry: &Registry,
    interpreter: Interpreter,
    persistence: Box<dyn Persistence>,
    programs: Option<PathBuf>,
) -> Result<Dispatcher, HostError> {
    let machine = resident.machine();
    let planners = [planner(machine, registry)?, planner(machine, registry)?];
    let lines = Arc::new(Mutex::new(Lines::new(machine, planners, interpreter)));
    let mut jogged = machine.clone();
    jogged.limits = axis_limits(machine, registry)?;
    let jogs = Arc::new(JogController::new(&jogged, planner(machine, registry)?));
    let controls = Arc::clone(resident.controls());
    let status = Arc::clone(resident.status());
    let hub = Arc::new(OperatorHub::new(machine, controls, Arc::clone(&status)));
    let mut dispatcher = Dispatcher::new(
        machine,
        hub,
        status,
        lines,
        jogs,
        persistence,
        programs,
        not_homed(machine, resident.unknown_axes()),
    )
    .map_err(HostError::System)?;
    dispatcher.has_bus = resident.has_bus();
    Ok(dispatcher)
}

/// The policy script has the parameters of the process before, and clients are told what it declares. A script that has changed may
/// know one no longer: then the machine file counts, and somebody is told.
fn restore_policy_parameters(
    resident: &mut Resident<'_>,
    dispatcher: &Dispatcher,
) -> Result<(), HostError> {
    for (name, value) in dispatcher.persistence.remembered().policy_parameters {
        if let Err(why) = resident.set_policy_parameter(&name, value) {
            dispatcher.raise(
                "policy-parameter",
                &format!("{name} = {value} of the state: {why}"),
            );
        }
    }
    dispatcher.lock().policy_parameters = resident.policy_parameters();
    dispatcher.lock().declared_parameters = declared(resident.declared_parameters()?);
    Ok(())
}

/// The doors for clients, where there are any.
fn server_of(dispatcher: &Arc<Dispatcher>, listen: &Listen) -> Result<Option<Server>, HostError> {
    if listen.is_nowhere() {
        return Ok(None);
    }
    let service = ControllerService {
        dispatcher: Arc::clone(dispatcher),
        settings: Arc::default(),
    };
    let server = Server::of(Arc::new(service), listen).map_err(HostError::System)?;
    Ok(Some(server))
}

/// Parameters of the policy script as clients are told them.
fn declared(all: Vec<PolicyParameter>) -> Vec<Value> {
    let shown = |of: PolicyParameter| {
        json!({
            "name": of.name, "description": of.description,
            "lowest": of.lowest, "highest": of.highest, "default": of.default,
        })
    };
    all.into_iter().map(shown).collect()
}

/// Axes without which nothing but a jog may be driven: those of which nobody knows where they are.
fn not_homed(machine: &Machine, unknown: u32) -> u32 {
    let all = (1_u32 << machine.axes.count()) - 1;
    unknown & all
}
