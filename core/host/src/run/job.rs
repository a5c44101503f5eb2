//! One job: a program, lines by hand, a jog or a homing, with everything that it owns: its tick 0, its planner, its strategy
//! and policy, what it counts. The drives it only borrows.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;

use tandem_fine::{Fault, FineConfig, FineLoop};
use tandem_gcode::CheckReport;
use tandem_machine::{Analog, Machine};
use tandem_recorder::{Monitor, Summary};
use tandem_rings::{Controls, Counters, FineEnd, HostEnd, Sizes, Status, bridge_with};
use tandem_rough::{RoughConfig, RoughLoop};
use tandem_sdk::{Attached, Kinematics, MAX_AXES};

use crate::drives::Roster;
use crate::joints::JointSpace;
use crate::messages::fault_text::{Known, describe};
use crate::policy::{PolicyHost, Reloader};
use crate::setup::parts;
use crate::setup::ready::Ready;
use crate::soft::soft_loop::{RunObserver, SoftLoop};
use crate::soft::strategy::FeedRunner;
use crate::soft::waits::Waits;
use crate::switches::{Clock, Switches};

use super::summarise::summarise;

/// A job that is ready: its program is checked and its plugins are made.
pub struct Job {
    pub machine: Machine,
    pub program: String,
    rough: RoughLoop,
    pub host: HostEnd,
    feed: Option<FeedRunner>,
    policy: Option<PolicyHost>,
    /// Steps of the velocity that the planner makes use of where blocks meet, per axis, mm/s.
    pub speed_difference_mm_per_s: [f64; MAX_AXES],
    leaves_path: bool,
    pub uses_time_constants: bool,
    pub joints: Arc<JointSpace>,
    pub switches: Switches,
    /// Who is who among the drivers.
    pub roster: Roster,
    /// What the first pass found: totals.
    pub checked: CheckReport,
}

/// A job, and what its fine loop is made of.
pub struct JobParts {
    pub job: Job,
    pub config: FineConfig,
    pub end: FineEnd,
    /// The map of the joints for the fine loop to own, where they are not the axes.
    pub kinematics: Option<Box<dyn Kinematics>>,
}

impl JobParts {
    /// The job of `ready` on drives that stand as `attached` says. In `real_time` samples have room for a recorder that looks
    /// away. The operator's atomics and the fine loop's status are `shared` with the jobs before and after. Allocates.
    pub fn of(
        ready: Ready,
        attached: &Attached,
        real_time: bool,
        shared: (Arc<Controls>, Arc<Status>),
    ) -> Self {
        let Ready {
            machine,
            program,
            source,
            policy,
            planner,
            claim,
            feed,
            joints,
            checked,
            switches,
            ..
        } = ready;
        let roster = claim.roster();
        let drives = roster.describe();
        let description = planner.describe();
        let depth_s = parts::queue_depth_s(&machine, &joints, description.order);
        let cuts = 2.0 * depth_s / machine.rough_period_s;
        let segments = Sizes::segments_for(ready.entries as f64 + cuts);
        // As lockstep needs it: the samples of each rough period are taken behind it.
        let lockstep = machine.fine_periods_per_rough as usize;
        let samples = if real_time {
            Sizes::default().samples
        } else {
            lockstep
        };
        let (rough_end, end, host) = bridge_with(Sizes { samples, segments }, shared.0, shared.1);
        let mut config = parts::fine_config(
            &machine,
            &joints,
            &description,
            (&drives, attached),
            switches,
        );
        config.record_drives = ready.records_drives;
        config.strategy_takes_override = feed.as_ref().is_some_and(FeedRunner::takes_override);
        host.status
            .hexadecimal_codes
            .store(drives.hexadecimal_codes != 0, Relaxed);
        host.controls
            .optional_stop
            .store(switches.optional_stop, Relaxed);
        let mut rough_config = RoughConfig::new(machine.rough_period_s, machine.fine_period_s);
        rough_config.advance_s = parts::advance_s(machine.rough_period_s, depth_s, segments);
        rough_config.awaits_drives = true;
        rough_config.lanes = config.lane_count();
        for (axis, limits) in config.limits.axes().iter().enumerate() {
            rough_config.easing.count(axis, limits.jerk_mm_per_s3);
            rough_config.count_steps_of(limits.acceleration_mm_per_s2, limits.jerk_mm_per_s3);
            if !machine.axes.is_rotary(axis) {
                rough_config.gather_for(limits);
            }
        }
        let job = Job {
            rough: RoughLoop::new(rough_config, source, planner, rough_end),
            machine,
            program,
            host,
            feed,
            policy,
            speed_difference_mm_per_s: description.speed_difference_mm_per_s,
            leaves_path: description.leaves_path != 0,
            uses_time_constants: description.uses_time_constants != 0,
            joints,
            switches,
            roster,
            checked,
        };
        Self {
            job,
            config,
            end,
            kinematics: ready.kinematics,
        }
    }
}

impl Job {
    /// Names of the feed strategy's signals, and after them those of the analog inputs.
    pub fn signals(&self) -> Vec<String> {
        let own = self.feed.as_ref().map_or(&[][..], FeedRunner::signals);
        own.iter()
            .map(|name| (*name).to_string())
            .chain(self.machine.analog.iter().map(Analog::signal))
            .collect()
    }

    /// Whether the planner makes use of velocity steps where blocks meet.
    pub fn allows_steps(&self) -> bool {
        self.speed_difference_mm_per_s
            .iter()
            .any(|step| *step > 0.0)
    }

    /// The soft side of the job, and who puts it into words when it is over.
    pub fn begin(self, clock: Clock, observer: &mut dyn RunObserver) -> (SoftLoop<'_>, Conclusion) {
        let machine = self.machine;
        let mut monitor = Monitor::new(&machine, self.leaves_path);
        monitor.worst.allow_steps(&self.speed_difference_mm_per_s);
        monitor.joints = self.joints.watch(machine.fine_period_s);
        let mut reloader = self.policy.clone().map(Reloader::new);
        if let (Clock::Wall, Some(reloader)) = (clock, &mut reloader)
            && let Err(note) = reloader.watch()
        {
            observer.note(&note);
        }
        let mut soft_loop = SoftLoop::new(
            self.rough, self.host, self.feed, reloader, monitor, observer,
        );
        soft_loop.waits = Some(Waits::new(&machine));
        soft_loop.skips_homing = self.switches.home.is_some();
        soft_loop.analog = machine
            .analog
            .iter()
            .map(|analog| analog.input as usize)
            .collect();
        soft_loop.on_record_error = machine.on_record_error;
        soft_loop.planner.clone_from(&machine.planner.plugin);
        let conclusion = Conclusion {
            machine,
            program: self.program,
            policy: self.policy,
            joints: self.joints,
            switches: self.switches,
            roster: self.roster,
            clock,
        };
        (soft_loop, conclusion)
    }
}

/// Puts into words and numbers what a job did.
pub struct Conclusion {
    pub machine: Machine,
    program: String,
    policy: Option<PolicyHost>,
    joints: Arc<JointSpace>,
    pub switches: Switches,
    pub roster: Roster,
    clock: Clock,
}

impl Conclusion {
    /// What `soft_loop` saw and the fine loop counted; what only the clock knows is added to it.
    pub fn summary(&self, soft_loop: &mut SoftLoop<'_>, counters: &Counters) -> Summary {
        soft_loop.tell_policy_notes();
        soft_loop.tell_plugin_log();
        let mut summary = summarise(
            &self.machine,
            &self.program,
            self.clock,
            soft_loop,
            counters,
        );
        summary.dry_run = self.switches.dry_run;
        summary.policy = self.policy.as_ref().map(PolicyHost::summary);
        summary.stopped = soft_loop.aborted.map(|rest| stopped(rest.line));
        summary
    }

    /// The fault of `fine` in words; `soft` is the cause of one on the soft side, `late` what made the loop late.
    pub fn words(
        &self,
        fault: &Fault,
        fine: &FineLoop,
        soft: Option<&str>,
        late: Option<&str>,
    ) -> String {
        let known = Known {
            soft,
            driver: fine.plugin_error(),
            drives: fine.driver(),
            roster: &self.roster,
            late,
        };
        describe(&self.machine, &self.joints, fault, known)
    }
}

/// Where the operator's abort has stopped the program.
fn stopped(line: u32) -> String {
    match line {
        0 => "stopped by the operator before the first line".to_string(),
        line => format!("stopped by the operator at line {line}"),
    }
}
