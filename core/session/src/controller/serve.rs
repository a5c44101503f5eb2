//! The loop that drives: orders of the desk become jobs, one after the other.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use serde_json::{Value, json};
use tandem_gcode::{Interpreter, Item, Lasting, Program};
use tandem_host::{
    Clock, HostError, JobOutcome, Memory, PreparedJob, Registry, Resident, RunObserver, StopAnswer,
    Switches, axis_limits, interpreter_config, moves_metal, planner,
};
use tandem_machine::Machine;
use tandem_rings::{Rest, Sample};
use tandem_rough::Source;

use super::desk::{Desk, From, Keeper, Loaded, Mode, Order};
use super::lines::{LineSource, Lines, lock};
use super::talk::{Office, Protocol2};
use crate::HOMING;
use crate::jog::JogController;
use crate::operator::{Lease, Listen, OperatorHub, Server, Talk};
use crate::standing::Standing;

/// What a controller is asked for.
pub struct Options {
    /// The clock.
    pub clock: Clock,
    /// Where its doors are.
    pub listen: Listen,
    /// The folder of the programs that clients may load by their path.
    pub programs: Option<PathBuf>,
    /// Enable the drives at once.
    pub enable: bool,
    /// On the virtual clock: what clients ask, and when.
    pub script: Vec<ScriptLine>,
    /// Fine periods that are counted before the first.
    pub uptime_periods: u64,
    /// What has lasted from the process before; none where the machine file alone says.
    pub lasting: Option<Lasting>,
}

/// A line of a client, before a fine period of the process.
#[derive(Clone, Debug)]
pub struct ScriptLine {
    /// The fine period.
    pub tick: u64,
    /// The client's number.
    pub client: u64,
    /// What it says.
    pub line: String,
}

impl ScriptLine {
    /// Reads `{"tick":120,"client":1,"say":{"id":1,"request":"status"}}`; without a client it is number 1.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let value: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let tick = value["tick"]
            .as_u64()
            .ok_or("it has no \"tick\", the number of a fine period")?;
        let client = value
            .get("client")
            .map_or(Some(1), Value::as_u64)
            .ok_or("\"client\" is a number")?;
        let say = value
            .get("say")
            .ok_or("it has no \"say\", the line of the client")?;
        let line = say.as_str().map_or_else(|| say.to_string(), str::to_string);
        Ok(Self { tick, client, line })
    }
}

/// Who is told what the controller has to say beside its protocol, and on the virtual clock the protocol.
pub type Tell<'a> = &'a mut dyn FnMut(&str);

/// A controller that stays.
pub struct Controller<'r> {
    resident: Resident<'r>,
    desk: Arc<Desk>,
    /// Until the controller ends.
    server: Option<Server>,
    clock: Clock,
    script: Script,
    simulated: bool,
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
        keeper: Box<dyn Keeper>,
    ) -> Result<Self, HostError> {
        let system = |why: String| HostError::System(why);
        let simulated = !moves_metal(machine, registry);
        let mut resident = Resident::attach(machine.clone(), registry, options.clock)?;
        resident.begin_at(options.uptime_periods);
        let machine = resident.machine().clone();
        let mut config = interpreter_config(&machine, simulated, Switches::default());
        if let Some(lasting) = options.lasting {
            config.tools.clone_from(&lasting.tools);
            config.lasting = Some(Arc::new(lasting));
        }
        let lines = Lines::new(
            &machine,
            planner(&machine, registry)?,
            Interpreter::new(config),
        );
        let mut jogged = machine.clone();
        jogged.limits = axis_limits(&machine, registry)?;
        let jogs = Arc::new(JogController::new(&jogged, planner(&machine, registry)?));
        let controls = Arc::clone(resident.controls());
        let status = Arc::clone(resident.status());
        let hub = Arc::new(OperatorHub::new(&machine, controls, Arc::clone(&status)));
        let lines = Arc::new(std::sync::Mutex::new(lines));
        let unknown = not_homed(&machine, resident.unknown_axes());
        let desk = Desk::new(
            &machine,
            hub,
            status,
            lines,
            jogs,
            keeper,
            options.programs,
            unknown,
        )
        .map_err(system)?;
        let desk = Arc::new(desk);
        desk.stands(&machine.start, unknown);
        if options.enable {
            desk.lock().order = Some(Order::Enable {
                from: From { client: 0, id: 0 },
                resets: false,
            });
        }
        let server = if options.listen.is_nowhere() {
            None
        } else {
            Some(Server::of(Arc::new(Office(Arc::clone(&desk))), &options.listen).map_err(system)?)
        };
        let script = Script {
            lines: options.script.into(),
            ..Script::default()
        };
        Ok(Self {
            resident,
            desk,
            server,
            clock: options.clock,
            script,
            simulated,
        })
    }

    /// The TCP address of its door, with the port that the system chose for port 0.
    pub fn address(&self) -> Option<std::net::SocketAddr> {
        self.server.as_ref().and_then(|server| server.address)
    }

    /// What ends the controller, for signals: the machine comes to rest on the path, and its drives let go.
    pub fn ender(&self) -> impl Fn() + Send + Sync + 'static {
        let desk = Arc::clone(&self.desk);
        move || desk.end()
    }

    /// Drives what is ordered, until it is told to end; on the virtual clock, until the script is over.
    ///
    /// # Errors
    /// The computer refuses, or the drives were not let go of.
    pub fn run(mut self, tell: Tell<'_>) -> Result<(), HostError> {
        while !self.desk.is_over() {
            self.desk.tell_state();
            let order = self.desk.lock().order.clone();
            let order =
                order.or_else(|| lock(&self.desk.lines).are_waiting().then_some(Order::Mdi));
            match order {
                Some(order) => self.obey(order, tell)?,
                None if self.clock == Clock::Virtual && self.script.lines.is_empty() => break,
                None => {
                    if let Some(words) = self.idle(tell)? {
                        self.desk.fault(&words);
                    }
                }
            }
        }
        Script::flush(&self.desk, self.resident.uptime_periods(), self.clock, tell);
        self.resident.stop(&mut Notes(tell))?;
        self.desk
            .keeper
            .record(&lock(&self.desk.lines).standing().lasting());
        drop(self.server);
        Ok(())
    }

    /// One rough period in which nothing is driven; the fault that ends the enabled state in it, in words.
    fn idle(&mut self, tell: Tell<'_>) -> Result<Option<String>, HostError> {
        let mut watch = Watch::new(
            &self.desk,
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
                let source = Box::new(LineSource::begin(&self.desk.lines));
                let switches = Switches {
                    pause_at_stops: true,
                    ..self.switches()
                };
                let job = self.resident.source("lines by hand", source, switches);
                self.drive_or_tell(job, None, Mode::Mdi, "lines by hand", tell)?;
            }
            Order::Jog => {
                let source = Box::new(Jogs {
                    desk: Arc::clone(&self.desk),
                    standing: Standing::default(),
                });
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
            Order::Enable { from, resets } => self.enable(from, resets, tell)?,
            Order::Disable { from } => {
                while !self.resident.disable() {
                    self.idle(tell)?;
                }
                let mut inner = self.desk.lock();
                (inner.enabled, inner.order) = (false, None);
                drop(inner);
                self.desk.answer(from, Ok(json!({ "disabled": true })));
            }
        }
        Ok(())
    }

    fn switches(&self) -> Switches {
        Switches {
            block_delete: self.desk.lock().block_delete,
            optional_stop: self.resident.controls().optional_stop.load(Relaxed),
            ..Switches::default()
        }
    }

    fn memory(&self) -> Memory {
        let lines = lock(&self.desk.lines);
        Memory {
            lasting: Arc::new(lines.standing().lasting()),
            ledger: lines.ledger.clone(),
        }
    }

    fn prepare(&self, program: &Loaded) -> Result<PreparedJob, String> {
        let spooled =
            Program::spool(&program.name, &program.text[..]).map_err(|e| e.to_string())?;
        let switches = Switches {
            pause_at_stops: true,
            ..self.switches()
        };
        self.resident
            .program(spooled, switches, &self.memory())
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

    fn check(&mut self, from: From, program: &Loaded, load: bool) {
        let checked = self.prepare(program).map(|job| {
            let report = job.checked();
            json!({
                "program": program.name, "blocks": report.blocks, "length_mm": report.length_mm,
                "warnings": report.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
            })
        });
        let mut inner = self.desk.lock();
        inner.order = None;
        if checked.is_ok() && load {
            inner.loaded = Some(program.clone());
        }
        drop(inner);
        self.desk.answer(from, checked);
    }

    fn start(&mut self, from: From, tell: Tell<'_>) -> Result<(), HostError> {
        let loaded = self.desk.lock().loaded.clone();
        let Some(program) = loaded else { return Ok(()) };
        match self.prepare(&program) {
            Err(why) => {
                self.desk.lock().order = None;
                self.desk.answer(from, Err(why));
                Ok(())
            }
            Ok(job) => self.drive(job, Some(from), Mode::Program, &program.name, tell),
        }
    }

    fn drive_or_tell(
        &mut self,
        job: Result<PreparedJob, HostError>,
        from: Option<From>,
        mode: Mode,
        name: &str,
        tell: Tell<'_>,
    ) -> Result<(), HostError> {
        match job {
            Ok(job) => self.drive(job, from, mode, name, tell),
            Err(why) => {
                self.desk.lock().order = None;
                let dropped = lock(&self.desk.lines).end_job(
                    self.resident.machine().start,
                    false,
                    false,
                    false,
                );
                self.desk.tell_driven(&dropped, false);
                match from {
                    Some(from) => self.desk.answer(from, Err(why.to_string())),
                    None => self.desk.send(
                        None,
                        &json!({ "event": "refused", "job": name, "why": why.to_string() }),
                    ),
                }
                Ok(())
            }
        }
    }

    fn drive(
        &mut self,
        job: PreparedJob,
        from: Option<From>,
        mode: Mode,
        name: &str,
        tell: Tell<'_>,
    ) -> Result<(), HostError> {
        let length_mm = job.checked().length_mm;
        self.desk.begin(mode);
        if let Some(from) = from {
            self.desk.answer(from, Ok(json!({ "begins": name })));
        }
        let mut watch = Watch::new(
            &self.desk,
            &mut self.script,
            tell,
            mode,
            self.clock,
            length_mm,
        );
        let outcome = self.resident.drive(job, &mut watch)?;
        self.finish(mode, name, &outcome);
        Ok(())
    }

    fn finish(&self, mode: Mode, name: &str, outcome: &JobOutcome) {
        let unknown = not_homed(self.resident.machine(), self.resident.unknown_axes());
        self.desk.finish(mode, name, outcome, unknown);
    }

    fn enable(&mut self, from: From, resets: bool, tell: Tell<'_>) -> Result<(), HostError> {
        let mut inner = self.desk.lock();
        inner.fault = None;
        drop(inner);
        self.desk.begin(Mode::Enabling);
        let mut watch = Watch::new(
            &self.desk,
            &mut self.script,
            tell,
            Mode::Enabling,
            self.clock,
            0.0,
        );
        let outcome = self.resident.enable(resets, &mut watch)?;
        self.finish(Mode::Enabling, "enabling", &outcome);
        let answer = match &outcome.summary.fault {
            Some(fault) => Err(fault.clone()),
            None if outcome.aborted => Err("it was aborted".to_string()),
            None => Ok(json!({ "enabled": true })),
        };
        self.desk.answer(from, answer);
        Ok(())
    }

    /// Whether all drives are simulated.
    pub fn is_simulated(&self) -> bool {
        self.simulated
    }
}

/// Axes without which nothing but a jog may be driven: those of which nobody knows where they are.
fn not_homed(machine: &Machine, unknown: u32) -> u32 {
    let all = (1_u32 << machine.axes.count()) - 1;
    unknown & all
}

/// Lines of clients by fine periods, on the virtual clock.
#[derive(Default)]
struct Script {
    lines: std::collections::VecDeque<ScriptLine>,
    clients: BTreeMap<u64, Protocol2>,
    lease: Lease,
}

impl Script {
    fn say_due(&mut self, desk: &Arc<Desk>, tick: u64, tell: Tell<'_>) {
        while self.lines.front().is_some_and(|line| line.tick <= tick) {
            let Some(ScriptLine { client, line, .. }) = self.lines.pop_front() else {
                return;
            };
            let talk = self
                .clients
                .entry(client)
                .or_insert_with(|| Protocol2::known(Arc::clone(desk), client));
            // Subscriptions live in real time, and are not for replays.
            let answer = talk.line(&line, &mut self.lease, Instant::now());
            Self::print(tick, Some(client), &answer.line, tell);
        }
    }

    fn print(tick: u64, client: Option<u64>, line: &str, tell: Tell<'_>) {
        if let Ok(told) = serde_json::from_str::<Value>(line) {
            tell(&json!({ "tick": tick, "client": client, "told": told }).to_string());
        }
    }

    fn flush(desk: &Desk, tick: u64, clock: Clock, tell: Tell<'_>) {
        if clock == Clock::Virtual {
            for (client, line) in desk.take_post() {
                Self::print(tick, client, &line, tell);
            }
        }
    }
}

/// Takes notes only.
struct Notes<'a>(Tell<'a>);

impl RunObserver for Notes<'_> {
    fn note(&mut self, note: &str) {
        (self.0)(note);
    }
}

/// Sees what a job does, for the desk; in lockstep it says what the script says.
struct Watch<'a> {
    desk: &'a Arc<Desk>,
    script: &'a mut Script,
    tell: Tell<'a>,
    mode: Mode,
    clock: Clock,
    length_mm: f64,
    driven_mm: f64,
    block: Option<u64>,
    tick: u64,
    ends: bool,
}

impl<'a> Watch<'a> {
    fn new(
        desk: &'a Arc<Desk>,
        script: &'a mut Script,
        tell: Tell<'a>,
        mode: Mode,
        clock: Clock,
        length_mm: f64,
    ) -> Self {
        Self {
            desk,
            script,
            tell,
            mode,
            clock,
            length_mm,
            driven_mm: 0.0,
            block: None,
            tick: 0,
            ends: false,
        }
    }
}

impl RunObserver for Watch<'_> {
    fn note(&mut self, note: &str) {
        (self.tell)(note);
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        let hub = &self.desk.hub;
        if hub.waits_on_line().is_none() {
            hub.begin_wait(line);
            self.desk
                .send(None, &json!({ "event": "waits", "line": line }));
            return StopAnswer::Wait;
        }
        if hub.answered() {
            StopAnswer::GoOn
        } else {
            StopAnswer::Wait
        }
    }

    fn is_attended(&self) -> bool {
        self.clock == Clock::Wall || !self.script.lines.is_empty()
    }

    fn rest(&mut self, _rest: &Rest) {
        self.desk.hub.end_wait();
    }

    fn sample(&mut self, sample: &Sample, _deviation_mm: f64, _signals: &[f64]) {
        self.driven_mm += sample.feed_mm_per_s * self.desk.machine.fine_period_s;
        let share = if self.length_mm > 0.0 {
            (self.driven_mm / self.length_mm).min(1.0)
        } else {
            0.0
        };
        self.desk.hub.sample(sample, share);
        if self.block != Some(sample.block) && matches!(self.mode, Mode::Program | Mode::Mdi) {
            self.block = Some(sample.block);
            let driven = lock(&self.desk.lines).reach(sample.block);
            self.desk.tell_driven(&driven, true);
        }
    }

    fn period(&mut self) {
        if self.desk.is_over() && !self.ends && self.mode != Mode::Idle {
            self.ends = true;
            self.desk.hub.controls().abort.store(true, Relaxed);
        }
        self.desk.tell_state();
        Script::flush(self.desk, self.tick, self.clock, self.tell);
    }

    fn before_tick(&mut self, uptime_periods: u64) {
        self.tick = uptime_periods;
        self.script.say_due(self.desk, uptime_periods, self.tell);
    }
}

/// The jogs that wait, as the rough loop pulls them, until none does.
struct Jogs {
    desk: Arc<Desk>,
    standing: Standing,
}

impl Source for Jogs {
    fn may_go_on(&mut self, driven: bool) -> bool {
        self.standing.look(driven);
        if self.standing.is_still() {
            let _ = self.desk.jogs.arrived();
        }
        self.standing.is_still()
    }

    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let (_, refused) = self.desk.jogs.next(items);
        for why in refused {
            self.desk.send(
                None,
                &json!({ "event": "refused", "job": "jogging", "why": why }),
            );
        }
        if !items.is_empty() {
            self.standing.moves();
        }
        Ok(!items.is_empty() || !self.desk.jogs.is_still())
    }

    fn provide_input(&mut self, _value: f64) {}

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        self.standing.moves();
        let _ = self.desk.jogs.rests(rest);
        true
    }
}
