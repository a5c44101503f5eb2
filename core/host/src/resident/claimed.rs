//! Drives that are claimed for a machine that stays, at its beginning and behind a fault that has lost them.

use std::sync::Arc;

use tandem_fine::{FaultKind, FineLoop};
use tandem_machine::Machine;
use tandem_rings::{Controls, Rest, Status};
use tandem_rough::Source;
use tandem_sdk::{Attached, Driver};

use crate::clock::exchange_time::{self, ExchangeTimes};
use crate::drives::Roster;
use crate::error::{HostError, refusal};
use crate::joints::JointSpace;
use crate::plugins::hang::HangWatch;
use crate::plugins::registry::Registry;
use crate::run::begin;
use crate::run::job::JobParts;
use crate::setup::claim::stands;
use crate::setup::ready::{Plugins, Ready};
use crate::switches::{Clock, Switches};

/// What is gone behind a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gone {
    /// The driver does not reach a drive any more: it is stopped and started again, and asked where everything stands.
    Drives,
    /// The driver itself cannot go on: another one is made.
    Driver,
}

/// What is gone behind the fault of this loop. Another one may have come first: drives that cannot be heard of trip inputs by
/// their age.
pub fn gone(fine: &FineLoop) -> Option<Gone> {
    match fine.fault()?.kind {
        FaultKind::Driver => Some(Gone::Driver),
        _ if fine.has_lost_joints() => Some(Gone::Drives),
        _ => None,
    }
}

/// Drives that are claimed, none of them enabled, and the loop at them that has nothing to do.
pub struct Claimed {
    /// It stands where the drives are.
    pub machine: Machine,
    pub roster: Roster,
    pub attached: Attached,
    pub watch: Option<HangWatch>,
    /// Bit per axis of which it is not known where it is.
    pub unknown_axes: u32,
    pub fine: Box<FineLoop>,
}

/// What [`Claimed`] is made for.
pub struct Session<'a> {
    pub registry: &'a Registry,
    pub clock: Clock,
    pub controls: &'a Arc<Controls>,
    pub status: &'a Arc<Status>,
}

impl Claimed {
    fn switches(clock: Clock) -> Switches {
        Switches {
            clock: Some(clock),
            unhomed: true,
            reset: true,
            ..Switches::default()
        }
    }

    /// Drives that new drivers have claimed.
    pub fn of(machine: Machine, session: &Session<'_>) -> Result<Self, HostError> {
        let registry = session.registry;
        let switches = Self::switches(session.clock);
        let mut plugins = Plugins::of(&machine, registry)?;
        plugins.check_staying(&machine, switches)?;
        plugins.add_faults(&machine)?;
        let (machine, plugins) = plugins.attach(machine, registry, switches)?;
        let roster = plugins.claim.roster();
        begin(&machine, &roster, session.clock)?;
        let watch = plugins.watch;
        let Some((driver, attached)) = plugins.claim.into_parts() else {
            return Err(HostError::System("the drives are not claimed".to_string()));
        };
        if let Some(watch) = &watch {
            watch.begin(Arc::clone(session.controls), Arc::clone(session.status));
        }
        // How long exchanges take is measured of runs alone.
        let exchange = Arc::<ExchangeTimes>::default();
        let driver = exchange_time::Timed::new(driver, machine.fine_period_s, exchange);
        let mut this = Self::with(machine, session, roster, Box::new(driver), attached)?;
        this.watch = watch;
        Ok(this)
    }

    /// Drives that a `driver`, which was stopped, has found again: where they stand is what it says now.
    pub fn again(
        mut machine: Machine,
        session: &Session<'_>,
        roster: Roster,
        driver: &mut Option<Box<dyn Driver>>,
    ) -> Result<Self, HostError> {
        let switches = Self::switches(session.clock);
        let gone = || HostError::System("the driver is gone".to_string());
        let started = driver.as_mut().ok_or_else(gone)?;
        let attached = started.start().map_err(|error| {
            // Drivers that each have a part of the machine say by themselves which of them it is.
            let mut drivers = roster.all();
            let (first, second) = (drivers.next(), drivers.next());
            let section = first.filter(|_| second.is_none()).map(|one| &*one.section);
            let cause = match first.filter(|one| one.joints.is_none()) {
                Some(one) => format!("driver {}: {error}", one.title),
                None => format!("driver {error}"),
            };
            refusal(&machine, section.unwrap_or("drivers"), cause)
        })?;
        let joints = JointSpace::of(&machine, session.registry)?;
        let made =
            stands(&machine, &joints, &roster, &**started, &attached, switches).and_then(|at| {
                machine.start = at;
                joints.check_health(&machine)?;
                begin(&machine, &roster, session.clock)
            });
        if let Err(refused) = made {
            // Why it is refused is told; what comes of letting go would hide it.
            let _ = started.stop();
            return Err(refused);
        }
        let driver = driver.take().ok_or_else(gone)?;
        Self::with(machine, session, roster, driver, attached)
    }

    /// The loop at a `driver` that has its drives, on a machine that stands where they do.
    fn with(
        machine: Machine,
        session: &Session<'_>,
        roster: Roster,
        driver: Box<dyn Driver>,
        attached: Attached,
    ) -> Result<Self, HostError> {
        let registry = session.registry;
        let clock = session.clock;
        let ready = Ready::of_source_on(
            &roster,
            machine.clone(),
            registry,
            None,
            |_| Box::new(Nothing),
            Self::switches(clock),
        )?;
        let mut unknown_axes = ready
            .joints
            .axes_moved_by(!(attached.known | attached.homed));
        if machine.require_homing {
            // As for a run: whatever the drives say, the machine file asks for it once each time that they are claimed.
            unknown_axes |= machine
                .homing
                .iter()
                .fold(0, |axes, of| axes | 1 << of.axis);
        }
        let shared = (Arc::clone(session.controls), Arc::clone(session.status));
        let parts = JobParts::of(ready, &attached, clock == Clock::Wall, shared);
        let mut fine = Box::new(FineLoop::new(
            &parts.config,
            parts.end,
            driver,
            parts.kinematics,
        ));
        fine.stay();
        fine.begin_ended();
        Ok(Self {
            machine,
            roster,
            attached,
            watch: None,
            unknown_axes,
            fine,
        })
    }
}

/// The source of the job that enables: nothing but the rest at which all joints hold.
pub struct Nothing;

impl Source for Nothing {
    fn next_items(&mut self, _items: &mut Vec<tandem_gcode::Item>) -> Result<bool, String> {
        Ok(false)
    }

    fn provide_input(&mut self, _value: f64) {}

    fn provide_rest(&mut self, _rest: &Rest) -> bool {
        true
    }
}
