//! A machine that is jogged, through faults, and its jogs as the rough loop pulls them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tandem_gcode::Item;
use tandem_host::{HostError, Registry, Run, Switches, axis_limits, planner};
use tandem_machine::Machine;
use tandem_rings::Rest;
use tandem_rough::Source;
use tandem_sdk::AxisVector;

use super::controller::JogController;
use super::message::JogRest;
use crate::standstill::Standstill;

/// The operator's side of a session. Called on the soft side.
pub trait JogInput: Send {
    /// A rough period begins: what is due is asked of `jogs`. On the virtual clock it may wait for words, and machine time
    /// stands still meanwhile.
    fn period(&mut self, jogs: &JogController);

    /// Whether time has to pass before more is asked.
    fn is_waiting(&self) -> bool;

    /// A jog is over and the machine rests.
    fn rested(&mut self, jogs: &JogController, rest: &JogRest);

    /// A jog that was taken could not begin, in words.
    fn refused(&mut self, why: &str);
}

type SharedInput = Arc<Mutex<Box<dyn JogInput>>>;

/// Jogging on one machine.
pub struct JogSession<'a> {
    machine: Machine,
    registry: &'a Registry,
    switches: Switches,
    jogs: Arc<JogController>,
    input: SharedInput,
}

impl<'a> JogSession<'a> {
    /// A session in which nothing has moved. Host.
    ///
    /// # Errors
    /// The planner refuses.
    pub fn new(
        machine: Machine,
        registry: &'a Registry,
        switches: Switches,
        input: Box<dyn JogInput>,
    ) -> Result<Self, HostError> {
        let mut machine = machine;
        let judge = planner(&machine, registry)?;
        machine.limits = axis_limits(&machine, registry)?;
        let jogs = Arc::new(JogController::new(&machine, judge));
        Ok(Self {
            machine,
            registry,
            switches,
            jogs,
            input: Arc::new(Mutex::new(input)),
        })
    }

    /// Where jogs are asked for.
    pub fn jogs(&self) -> &Arc<JogController> {
        &self.jogs
    }

    /// Enables the machine where it stands: a run that jogs until the session ends, or a fault ends it.
    ///
    /// # Errors
    /// The plugins refuse, or do not go together.
    pub fn enable(&self) -> Result<Run, HostError> {
        let source = Jogging {
            jogs: Arc::clone(&self.jogs),
            input: Arc::clone(&self.input),
            standing: Standstill::default(),
            stays: true,
        };
        let machine = self.machine.clone();
        let name = "jogging".to_string();
        let run = Run::of_source(
            machine,
            self.registry,
            name,
            Box::new(source),
            self.switches,
        )?;
        let homed = if self.switches.home.is_some() {
            self.machine
                .homing
                .iter()
                .fold(0, |axes, of| axes | 1 << of.axis)
        } else {
            0
        };
        self.jogs.enable(
            run.controls(),
            self.switches.home.is_none(),
            run.unknown_axes() & !homed,
        );
        Ok(run)
    }

    /// The operator acknowledges the fault that ended the last run: the next one resets its drives.
    pub fn reset_drives(&mut self) {
        self.switches.reset = true;
    }

    /// The run is over and the machine rests at `position`: the next one starts there.
    pub fn stands_at(&mut self, position: AxisVector) {
        self.machine.start = position;
        self.jogs.disable(position);
    }
}

/// Jogs as the rough loop pulls them.
pub struct Jogging {
    jogs: Arc<JogController>,
    input: SharedInput,
    standing: Standstill,
    /// It waits for jogs to come; else it is over when none moves.
    stays: bool,
}

impl Jogging {
    /// Those that wait, until none does and the machine stands.
    pub fn until_still(jogs: &Arc<JogController>, input: Box<dyn JogInput>) -> Self {
        Self {
            jogs: Arc::clone(jogs),
            input: Arc::new(Mutex::new(input)),
            standing: Standstill::default(),
            stays: false,
        }
    }

    fn input(&self) -> MutexGuard<'_, Box<dyn JogInput>> {
        // A panic of the input leaves the jogs as they were.
        self.input.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Source for Jogging {
    fn period(&mut self) {
        self.input().period(&self.jogs);
    }

    fn is_waiting(&self) -> bool {
        self.input().is_waiting()
    }

    fn may_go_on(&mut self, driven: bool) -> bool {
        self.standing.look(driven);
        if !self.standing.is_still() {
            return false;
        }
        if let Some(rest) = self.jogs.arrived() {
            self.input().rested(&self.jogs, &rest);
        }
        true
    }

    fn next_items(&mut self, items: &mut Vec<Item>) -> Result<bool, String> {
        let (more, refused) = self.jogs.next(items);
        for why in refused {
            self.input().refused(&why);
        }
        if !items.is_empty() {
            self.standing.moves();
        }
        Ok(if self.stays {
            more
        } else {
            !items.is_empty() || !self.jogs.is_still()
        })
    }

    fn provide_input(&mut self, _value: f64) {}

    fn provide_rest(&mut self, rest: &Rest) -> bool {
        self.standing.moves();
        if let Some(rest) = self.jogs.rests(rest) {
            self.input().rested(&self.jogs, &rest);
        }
        true
    }
}
