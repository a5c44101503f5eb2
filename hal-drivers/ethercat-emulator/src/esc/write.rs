//! What follows from a master's write.

use super::{Esc, MEMORY, registers as at};
use crate::bytes::{u16_at, u32_at, u64_at};

impl Esc {
    /// A master writes; answers whether the working counter counts it.
    pub(crate) fn write(&mut self, at_ns: u64, address: usize, data: &[u8]) -> bool {
        let end = (address + data.len()).min(MEMORY);
        if data.is_empty() || address >= MEMORY {
            return false;
        }
        if address >= at::PROCESS_MEMORY {
            let granted = self.pass_sync_managers(at_ns, address, end, true);
            if granted {
                self.memory[address..end].copy_from_slice(&data[..end - address]);
            }
            return granted;
        }
        let mut any = false;
        for (register, new) in (address..end.min(at::PROCESS_MEMORY)).zip(data) {
            if self.extent.writable(register) {
                self.memory[register] = *new;
                any = true;
            }
        }
        if any {
            self.follow(at_ns, address, end, data);
        }
        any
    }

    fn follow(&mut self, at_ns: u64, start: usize, end: usize, data: &[u8]) {
        let touches = |first: usize, bytes: usize| start < first + bytes && end > first;
        if touches(at::AL_CONTROL, 2) {
            self.events.al_control = true;
            self.memory[at::AL_EVENT_REQUEST] |= 1;
        }
        if touches(at::ERROR_COUNTERS, 20) {
            self.memory[at::ERROR_COUNTERS..at::ERROR_COUNTERS + 20].fill(0);
        }
        if touches(at::WATCHDOG_COUNTER, 2) {
            self.set(at::WATCHDOG_COUNTER, 2, 0);
        }
        if touches(at::SII_CONFIGURATION, 16) {
            let skipped = at::SII_CONFIGURATION.saturating_sub(start).min(data.len());
            let offset = start.saturating_sub(at::SII_CONFIGURATION);
            self.eeprom.write(at_ns, offset, &data[skipped..]);
        }
        if touches(at::FMMU, 0x100) {
            self.load_units();
        }
        if touches(at::SYNC_MANAGER, 0x80) {
            let asked = self.memory[at::SYNC_MANAGER + 8 + 6] & 2;
            self.load_sync_managers();
            // The master turns this bit over to have the last message once more; the device answers with the same.
            self.events.repeat |= asked != self.sync_managers[1].pdi_control & 2;
        }
        if touches(at::RECEIVE_TIMES, 0x100) {
            self.follow_clock(at_ns, start, end, data);
        }
    }

    fn follow_clock(&mut self, at_ns: u64, start: usize, end: usize, data: &[u8]) {
        let touches = |first: usize, bytes: usize| start < first + bytes && end > first;
        if touches(at::RECEIVE_TIMES, 4) {
            self.clock.latch(at_ns, &self.port_times);
        }
        if !self.extent.clock.has_system_time() {
            return;
        }
        if touches(at::SYSTEM_TIME_OFFSET, 8) {
            self.clock.set_offset(at_ns, self.offset());
        }
        if touches(at::SYSTEM_TIME_DELAY, 4) {
            self.clock.delay = u32_at(&self.memory, at::SYSTEM_TIME_DELAY);
        }
        if touches(at::SPEED_COUNTER, 2) {
            self.clock.restart_compensation(at_ns);
        }
        if touches(at::FILTER_DEPTHS, 1) {
            self.clock.set_filter_depth(self.memory[at::FILTER_DEPTHS]);
        }
        if start == at::SYSTEM_TIME && data.len() >= 4 {
            self.clock.compensate(at_ns, u32_at(data, 0));
        }
        if touches(at::SYNC0_START, 8) {
            self.clock.sync.start = u64_at(&self.memory, at::SYNC0_START);
        }
        if touches(at::SYNC0_CYCLE, 8) {
            let cycles = (
                u32_at(&self.memory, at::SYNC0_CYCLE),
                u32_at(&self.memory, at::SYNC1_CYCLE),
            );
            self.clock.set_cycles(at_ns, cycles.0, cycles.1);
        }
        // The start has to be known before the activation that may come in the same write.
        if touches(at::SYNC_CONTROL, 2) {
            let activation = u16_at(&self.memory, at::SYNC_CONTROL) >> 8;
            self.clock.activate(at_ns, activation as u8);
        }
    }
}
