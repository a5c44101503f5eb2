//! A gantry squares itself in front of a run: its joints are axes of their own meanwhile, so that this is a job of its own. The
//! run takes the drives over while they hold, as one job of a machine that stays does from the one before.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use tandem_fine::FineLoop;
use tandem_machine::Machine;
use tandem_rings::{Controls, Rest, Status};
use tandem_sdk::{Attached, Driver, Event};

use super::job::{Job, JobParts};
use crate::clock::periods::Body;
use crate::clock::virtual_clock;
use crate::clock::wall_clock::{Ended, FineBody, Periods, TimedThread, give_room};
use crate::drives::Roster;
use crate::error::HostError;
use crate::joints::apart::Apart;
use crate::plugins::hang::{FineRuns, FineWatch};
use crate::plugins::registry::Registry;
use crate::setup::ready::Ready;
use crate::soft::command::Timed;
use crate::soft::soft_loop::{RunObserver, SoftLoop, StopAnswer};
use crate::switches::{Clock, Lead, Switches};

/// Homing that is ready, and the loop that has the drives.
pub struct Squaring {
    job: Job,
    pub fine: FineLoop,
}

/// Whose loop is called next.
pub enum Squared {
    /// That of the run, which has the drives; also where nothing was to be squared.
    Here(Box<FineLoop>),
    /// The same, by this thread.
    Thread(TimedThread<Relay>),
    /// Homing has ended in a fault, in these words.
    Failed(Box<FineLoop>, String),
}

impl Squaring {
    /// The job that `homing` does on `machine`, which stands where the drives are, if any gantry of it squares itself. `shared` are
    /// those of the run. Host; allocates.
    ///
    /// # Errors
    /// What plugins or joints refuse; the driver is stopped then.
    pub fn of(
        machine: &Machine,
        registry: &Registry,
        (homing, switches): (Lead, Switches),
        drives: (Box<dyn Driver>, &Attached, &Roster),
        shared: (Arc<Controls>, Arc<Status>),
    ) -> Result<Self, HostError> {
        let (mut driver, attached, roster) = drives;
        let switches = Switches {
            unhomed: true,
            pause_at_stops: false,
            ..switches
        };
        let ready = Apart::of(machine, registry).and_then(|apart| {
            let mut apart = apart.map_or_else(|| machine.clone(), |apart| apart.machine);
            // Each joint where its own drive is.
            for joint in 0..apart.axes.count() {
                apart.start[joint] = attached.position[joint];
            }
            let name = Some("homing".to_string());
            let make = |machine: &Machine| homing(machine, None);
            Ready::of_source_on(roster, apart, registry, name, make, switches)
        });
        let ready = match ready {
            Ok(ready) => ready,
            Err(refused) => {
                let _ = driver.stop();
                return Err(refused);
            }
        };
        let parts = JobParts::of(ready, attached, false, shared);
        let mut fine = FineLoop::new(&parts.config, parts.end, driver, parts.kinematics);
        fine.stay();
        fine.reset();
        Ok(Self {
            job: parts.job,
            fine,
        })
    }

    /// The machine, whose joints are axes.
    pub fn machine(&self) -> &Machine {
        &self.job.machine
    }

    /// Homes in lockstep, then has `next` take over.
    pub fn in_lockstep(self, mut next: Box<FineLoop>, observer: &mut dyn RunObserver) -> Squared {
        let mut fine = Box::new(self.fine);
        let periods = self.job.machine.fine_periods_per_rough;
        let mut homing = Homing(observer);
        let (mut soft_loop, conclusion) = self.job.begin(Clock::Virtual, &mut homing);
        virtual_clock::drive(&mut soft_loop, &mut fine, periods, &[]);
        soft_loop.take_rests();
        if let Some(fault) = fine.fault() {
            let words = conclusion.words(&fault, &fine, soft_loop.soft_cause(), None);
            return Squared::Failed(fine, words);
        }
        tell_abort(&soft_loop);
        next.succeed(&mut fine, false);
        Squared::Here(next)
    }

    /// Homes in real time, then has `next` take over in the same thread, between two periods.
    ///
    /// # Errors
    /// The computer refuses.
    pub fn in_real_time(
        self,
        next: Box<FineLoop>,
        periods: Periods,
        watch: Option<FineWatch>,
        observer: &mut dyn RunObserver,
    ) -> Result<Squared, HostError> {
        let mut fine = Box::new(self.fine);
        let mut homing = Homing(observer);
        let (mut soft_loop, conclusion) = self.job.begin(Clock::Wall, &mut homing);
        give_room(&mut soft_loop.host, &mut fine);
        soft_loop.step();
        let has_ended = Arc::<AtomicBool>::default();
        let body = Relay {
            running: FineBody { fine, watch },
            next: Some(next),
            has_ended: Arc::clone(&has_ended),
        };
        let thread = TimedThread::start(body, periods.fine_ns, periods.fine_thread)?;
        for note in &thread.notes {
            soft_loop.note(note);
        }
        while !thread.is_over() && !has_ended.load(Ordering::Acquire) {
            soft_loop.step();
            soft_loop.drain();
            soft_loop.serve_stop();
            thread::sleep(Duration::from_nanos(periods.rough_ns.unsigned_abs()));
        }
        soft_loop.drain();
        soft_loop.take_rests();
        if has_ended.load(Ordering::Acquire) {
            tell_abort(&soft_loop);
            return Ok(Squared::Thread(thread));
        }
        let fine = thread.join()?.body.running.fine;
        let words = fine.fault().map_or_else(String::new, |fault| {
            conclusion.words(&fault, &fine, soft_loop.soft_cause(), None)
        });
        Ok(Squared::Failed(fine, words))
    }
}

/// An abort of homing is one of the run behind it: nothing of that is driven.
fn tell_abort(soft_loop: &SoftLoop<'_>) {
    if soft_loop.aborted.is_some() {
        let abort = &soft_loop.host.controls.abort;
        abort.store(true, Ordering::Relaxed);
    }
}

/// Drives the run behind homing in real time, to its end.
///
/// # Errors
/// The fine loop panicked.
pub fn follow(
    soft_loop: &mut SoftLoop<'_>,
    thread: TimedThread<Relay>,
    periods: Periods,
) -> Result<Ended<Relay>, HostError> {
    while !thread.is_over() {
        soft_loop.step();
        soft_loop.drain();
        soft_loop.serve_stop();
        thread::sleep(Duration::from_nanos(periods.rough_ns.unsigned_abs()));
    }
    let ended = thread.join()?;
    soft_loop.drain();
    soft_loop.take_rests();
    Ok(ended)
}

/// One loop, and behind its end the other, in one thread: the drives miss no period in between.
pub struct Relay {
    pub running: FineBody,
    /// Until it has taken over; then the one before, which the host drops.
    next: Option<Box<FineLoop>>,
    has_ended: Arc<AtomicBool>,
}

impl Body for Relay {
    fn is_over(&self) -> bool {
        self.running.is_over()
    }

    fn begin(&self) -> Option<FineRuns> {
        self.running.begin()
    }

    fn period(&mut self) {
        let fine = &mut self.running.fine;
        if !self.has_ended.load(Ordering::Relaxed)
            && fine.has_ended()
            && let Some(next) = &mut self.next
        {
            next.succeed(fine, false);
            std::mem::swap(next, fine);
            self.has_ended.store(true, Ordering::Release);
        }
        self.running.period();
    }

    fn phase_ns(&self) -> Option<i64> {
        self.running.phase_ns()
    }

    fn missed(&mut self, periods: u64, in_a_row: u64) {
        self.running.missed(periods, in_a_row);
    }
}

/// What the observer of a run is told of the homing in front of it, none of which is recorded.
struct Homing<'a>(&'a mut dyn RunObserver);

impl RunObserver for Homing<'_> {
    fn note(&mut self, note: &str) {
        self.0.note(note);
    }

    fn event(&mut self, event: &Event) {
        self.0.event(event);
    }

    fn program_stop(&mut self, line: u32) -> StopAnswer {
        self.0.program_stop(line)
    }

    fn is_attended(&self) -> bool {
        self.0.is_attended()
    }

    fn rest(&mut self, rest: &Rest) {
        self.0.rest(rest);
    }

    fn command(&mut self, command: &Timed) {
        self.0.command(command);
    }
}
