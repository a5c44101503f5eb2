//! Both loops in lockstep on one thread, as fast as the processor allows.

use tandem_fine::FineLoop;

use crate::command::{Command, Timed};
use crate::pump::Pump;

/// Drives the run to its end. `commands` are in order of their ticks.
pub fn drive(pump: &mut Pump<'_>, fine: &mut FineLoop, fine_per_rough: u32, commands: &[Timed]) {
    let mut commands = commands.iter().peekable();
    let mut tick = 0;
    let mut stalled = 0;
    while !fine.is_over() {
        if stalled == 0 {
            pump.step();
        }
        stalled = u64::saturating_sub(stalled, 1);
        for _ in 0..fine_per_rough {
            while let Some(timed) = commands.next_if(|timed| timed.tick <= tick) {
                timed.command.give(&pump.host.controls);
                if let Command::StallRough(periods) = timed.command {
                    stalled += periods;
                }
            }
            fine.tick();
            tick += 1;
        }
        pump.drain();
    }
}
