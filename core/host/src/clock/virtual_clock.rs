//! Both loops in lockstep on one thread, as fast as the processor allows.

use std::iter::Peekable;
use std::slice::Iter;
use std::sync::atomic::Ordering::Relaxed;
use std::thread;
use std::time::Duration;

use tandem_fine::FineLoop;
use tandem_sdk::abi::{Method, beat, calling};

use crate::soft::command::{Command, Timed};
use crate::soft::soft_loop::SoftLoop;

/// Machine time, s, without any passing of program time after which a run without further commands is given up.
const PATIENCE_S: f64 = 60.0;

/// Drives the run to its end; one that stays at its drives then, until another takes over. `commands` are in order of their ticks.
pub fn drive(
    soft_loop: &mut SoftLoop<'_>,
    fine: &mut FineLoop,
    fine_per_rough: u32,
    commands: &[Timed],
) {
    let patience = (PATIENCE_S / soft_loop.period_s()).round() as u64;
    let mut progress = Progress::default();
    let mut commands = Commands {
        all: commands.iter().peekable(),
        stalled: 0,
    };
    let mut tick = 0;
    while fine.is_attaching() {
        // The operator's stops act before the joints hold too.
        commands.give(soft_loop, fine);
        calling(Method::FinePeriod, || fine.tick());
        beat();
    }
    // A fault on the way has its samples too, and an abort its rest.
    soft_loop.drain();
    if fine.is_done() {
        soft_loop.take_rests();
    }
    while !fine.is_done() {
        if commands.stalled == 0 {
            soft_loop.step();
        }
        commands.stalled = commands.stalled.saturating_sub(1);
        for _ in 0..fine_per_rough {
            // As on the wall clock, no sample follows the last.
            if fine.is_done() {
                break;
            }
            commands.give(soft_loop, fine);
            calling(Method::FinePeriod, || fine.tick());
            beat();
            tick += 1;
        }
        soft_loop.drain();
        soft_loop.serve_stop();
        // What waits for the spindle ends by itself, after the machine's own time.
        if soft_loop.is_waiting() || soft_loop.host.status.spindle.waits.load(Relaxed) {
            progress.tick = tick;
        }
        let stuck_ticks = progress.ticks_without(soft_loop.host.status.program_time_s.load(), tick);
        if stuck_ticks > 0 && soft_loop.is_attended() {
            // Somebody at a keyboard lives in real time.
            thread::sleep(Duration::from_secs_f64(
                soft_loop.period_s() * f64::from(fine_per_rough),
            ));
        } else if commands.all.peek().is_none() && stuck_ticks > patience {
            soft_loop.give_up();
        }
    }
}

/// The commands that are left of a command file.
struct Commands<'a> {
    all: Peekable<Iter<'a, Timed>>,
    /// Rough periods in which the rough loop is to do nothing.
    stalled: u64,
}

impl Commands<'_> {
    /// Before a fine period: gives what acts in it.
    fn give(&mut self, soft_loop: &mut SoftLoop<'_>, fine: &FineLoop) {
        while let Some(timed) = self.all.next_if(|timed| timed.tick <= fine.next_tick()) {
            soft_loop.give(timed);
            if let Command::StallRough(periods) = timed.command {
                self.stalled += periods;
            }
        }
    }
}

/// When program time last passed.
#[derive(Default)]
struct Progress {
    program_time_s: f64,
    tick: u64,
}

impl Progress {
    /// Fine periods since program time last passed.
    fn ticks_without(&mut self, program_time_s: f64, tick: u64) -> u64 {
        if program_time_s != self.program_time_s {
            self.program_time_s = program_time_s;
            self.tick = tick;
        }
        tick - self.tick
    }
}
