//! The slave controller: what answers frames without any firmware.

pub(crate) mod clock;
mod eeprom;
mod fmmu;
pub(crate) mod registers;
pub(crate) mod sync_manager;
mod write;

pub use clock::Clocking;
pub(crate) use eeprom::Eeprom;

use crate::bytes::{copy_bits, put, u16_at, u32_at};
use clock::Clock;
use fmmu::{Fmmu, Overlap};
use registers as at;
use sync_manager::{Access, Direction, SyncManager};

/// Bytes of registers and process memory.
const MEMORY: usize = 0x3000;
/// Most units that map logical addresses, and most sync managers, that a device has.
pub(crate) const MAX_UNITS: usize = 16;

/// Registers, process memory and everything that acts on them by itself.
#[derive(Clone, Debug)]
pub(crate) struct Esc {
    memory: Vec<u8>,
    extent: at::Extent,
    /// Those that map anything, in their order.
    fmmus: [Fmmu; MAX_UNITS],
    active_fmmus: usize,
    pub(crate) sync_managers: [SyncManager; MAX_UNITS],
    pub(crate) clock: Clock,
    pub(crate) eeprom: Eeprom,
    /// When frames come in at each port, counted from the arrival at port 0, in ns; none where no cable is.
    pub(crate) port_times: [Option<u64>; 4],
    /// The last write that the watchdog watches.
    last_trigger_ns: Option<u64>,
    pub(crate) events: Events,
}

/// What happened since the firmware last looked.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Events {
    /// The master wrote AL control.
    pub(crate) al_control: bool,
    /// Sync managers whose buffer the master filled, a bit each.
    pub(crate) written: u16,
    /// Mailboxes that the master emptied, a bit each.
    pub(crate) emptied: u16,
    /// The master asks for the last message again.
    pub(crate) repeat: bool,
}

/// What a slave controller is made as.
#[derive(Clone, Debug)]
pub(crate) struct Make {
    pub(crate) kind: u8,
    pub(crate) revision: u8,
    pub(crate) build: u16,
    pub(crate) fmmus: u8,
    pub(crate) sync_managers: u8,
    pub(crate) ram_kib: u8,
    /// What each port is: 0 not there, 2 E-bus, 3 MII; two bits each.
    pub(crate) ports: u8,
    pub(crate) clocking: Clocking,
    /// The register of features, where it is not what follows from the rest.
    pub(crate) features: Option<u16>,
}

impl Make {
    /// Enhanced links, separate error counters; clocks, their width and SYNC0.
    fn features(&self) -> u16 {
        let clocks = match self.clocking {
            Clocking::None => 0,
            Clocking::Delays => 0x0C,
            Clocking::Bits32 => 0x104,
            Clocking::Bits64 => 0x10C,
        };
        self.features.unwrap_or(0xF0 | clocks)
    }
}

impl Esc {
    pub(crate) fn new(make: &Make, eeprom: Eeprom, clock: Clock) -> Self {
        let extent = at::Extent {
            fmmus: usize::from(make.fmmus).min(MAX_UNITS),
            sync_managers: usize::from(make.sync_managers).min(MAX_UNITS),
            clock: make.clocking,
        };
        let mut esc = Self {
            memory: vec![0; MEMORY],
            extent,
            fmmus: [Fmmu::default(); MAX_UNITS],
            active_fmmus: 0,
            sync_managers: [SyncManager::default(); MAX_UNITS],
            clock,
            eeprom,
            port_times: [None; 4],
            last_trigger_ns: None,
            events: Events::default(),
        };
        esc.power_on(make);
        esc
    }

    fn power_on(&mut self, make: &Make) {
        let features = make.features().to_le_bytes();
        let head = [
            make.kind,
            make.revision,
            make.build as u8,
            (make.build >> 8) as u8,
            make.fmmus,
            make.sync_managers,
            make.ram_kib,
            make.ports,
            features[0],
            features[1],
        ];
        self.memory[..head.len()].copy_from_slice(&head);
        self.set(at::STATION_ALIAS, 2, u64::from(self.eeprom.alias()));
        self.set(at::DL_CONTROL, 4, 0x0000_0001);
        self.set(at::WATCHDOG_DIVIDER, 2, 0x09C2);
        self.set(at::WATCHDOG_PDI, 2, 1000);
        self.set(at::WATCHDOG_SM, 2, 1000);
        self.set(at::SPEED_COUNTER, 2, 0x1000);
        self.set(at::FILTER_DEPTHS, 2, 0x0C04);
        self.set(at::AL_CONTROL, 2, 1);
        self.set(at::AL_STATUS, 2, 1);
    }

    /// A 16-bit register or datum.
    pub(crate) fn u16(&self, address: usize) -> u16 {
        u16_at(&self.memory, address)
    }

    /// Sets a register of up to 8 bytes from inside of the device.
    pub(crate) fn set(&mut self, address: usize, bytes: usize, value: u64) {
        put(&mut self.memory[address..address + bytes], value);
    }

    /// Whether a datagram with a station address is for this device.
    pub(crate) fn has_address(&self, address: u16) -> bool {
        let alias_in_use = self.memory[at::DL_CONTROL + 3] & 1 == 1;
        address == self.u16(at::STATION_ADDRESS)
            || alias_in_use && address == self.u16(at::STATION_ALIAS)
    }

    /// A master reads; answers whether the working counter counts it.
    pub(crate) fn read(&mut self, at_ns: u64, address: usize, into: &mut [u8]) -> bool {
        let end = (address + into.len()).min(MEMORY);
        if into.is_empty() || address >= MEMORY {
            return false;
        }
        if address >= at::PROCESS_MEMORY {
            if !self.pass_sync_managers(at_ns, address, end, false) {
                return false;
            }
        } else {
            if !(address..end).any(|address| self.extent.exists(address)) {
                return false;
            }
            self.refresh(at_ns, address, end);
        }
        into[..end - address].copy_from_slice(&self.memory[address..end]);
        into[end - address..].fill(0);
        true
    }

    /// Brings registers that are not memory up to date before `start..end` is read.
    fn refresh(&mut self, at_ns: u64, start: usize, end: usize) {
        let touches = |first: usize, last: usize| start < last && end > first;
        if touches(at::SYNC_MANAGER, at::RECEIVE_TIMES) {
            for (index, manager) in self.sync_managers.iter().enumerate() {
                self.memory[at::SYNC_MANAGER + 8 * index + 5] = manager.status();
                self.memory[at::SYNC_MANAGER + 8 * index + 7] = manager.pdi_control;
            }
        }
        if touches(at::WATCHDOG_STATUS, at::WATCHDOG_STATUS + 2) {
            self.set(
                at::WATCHDOG_STATUS,
                2,
                u64::from(!self.watchdog_expired(at_ns)),
            );
        }
        if touches(at::SII_CONFIGURATION, at::SII_CONFIGURATION + 16) {
            for offset in 0..16 {
                self.memory[at::SII_CONFIGURATION + offset] = self.eeprom.register(at_ns, offset);
            }
        }
        if touches(at::RECEIVE_TIMES, 0x0A00) {
            self.refresh_clock(at_ns);
        }
    }

    fn refresh_clock(&mut self, at_ns: u64) {
        for (port, time) in self.clock.receive_times.into_iter().enumerate() {
            self.set(at::RECEIVE_TIMES + 4 * port, 4, u64::from(time));
        }
        if !self.extent.clock.has_system_time() {
            return;
        }
        self.set(at::SYSTEM_TIME, 8, self.clock.system_shown(at_ns));
        self.set(at::RECEIVE_TIME_UNIT, 8, self.clock.receive_time_unit);
        self.set(
            at::SYSTEM_TIME_DIFFERENCE,
            4,
            u64::from(self.clock.difference_shown()),
        );
        self.set(at::SYNC0_START, 8, self.clock.sync_next_shown());
    }

    /// Asks all sync managers for an access, and lets it happen where none refuses.
    fn pass_sync_managers(&mut self, at_ns: u64, start: usize, end: usize, writes: bool) -> bool {
        let mut verdicts = [Access::Beside; MAX_UNITS];
        for (verdict, manager) in verdicts
            .iter_mut()
            .zip(&self.sync_managers[..self.extent.sync_managers])
        {
            *verdict = manager.judge(start, end, writes);
        }
        if verdicts.contains(&Access::Refused) {
            return false;
        }
        for (index, verdict) in verdicts
            .into_iter()
            .enumerate()
            .filter(|(_, verdict)| *verdict != Access::Beside)
        {
            let manager = &mut self.sync_managers[index];
            manager.follow(verdict, writes);
            if verdict != Access::Completed {
                continue;
            }
            if writes {
                self.events.written |= 1 << index;
                if manager.triggers_watchdog() {
                    self.last_trigger_ns = Some(at_ns);
                }
            } else if manager.is_mailbox() {
                self.events.emptied |= 1 << index;
            }
        }
        true
    }

    /// A master reads or writes by logical address; answers which of both the working counter counts.
    pub(crate) fn logical(
        &mut self,
        at_ns: u64,
        address: u32,
        data: &mut [u8],
        reads: bool,
        writes: bool,
    ) -> (bool, bool) {
        let (mut read, mut written) = (false, false);
        // What is written is taken before what is read lies over it: both may be the same logical bytes.
        for index in 0..self.active_fmmus {
            let unit = self.fmmus[index];
            if unit.writes
                && writes
                && let Some(part) = unit.overlap(address, data.len())
            {
                written |= self.take(at_ns, part, data);
            }
        }
        for index in 0..self.active_fmmus {
            let unit = self.fmmus[index];
            if unit.reads
                && reads
                && let Some(part) = unit.overlap(address, data.len())
            {
                read |= self.give(at_ns, part, data);
            }
        }
        (read, written)
    }

    /// Writes the part of a datagram that a unit maps into the memory; whether it was granted.
    fn take(&mut self, at_ns: u64, part: Overlap, data: &[u8]) -> bool {
        let start = part.physical_bit / 8;
        let end = (part.physical_bit + part.bits).div_ceil(8).min(MEMORY);
        if start >= end {
            return false;
        }
        if part.is_of_bytes() {
            return self.write(at_ns, start, &data[part.data_bit / 8..][..end - start]);
        }
        let mut buffer = [0; crate::frame::MAX_DATA];
        let bytes = &mut buffer[..end - start];
        bytes.copy_from_slice(&self.memory[start..end]);
        copy_bits(data, part.data_bit, bytes, part.physical_bit % 8, part.bits);
        self.write(at_ns, start, bytes)
    }

    /// Reads the part of a datagram that a unit maps out of the memory; whether it was granted.
    fn give(&mut self, at_ns: u64, part: Overlap, data: &mut [u8]) -> bool {
        let start = part.physical_bit / 8;
        let end = (part.physical_bit + part.bits).div_ceil(8).min(MEMORY);
        if start >= end {
            return false;
        }
        if part.is_of_bytes() {
            return self.read(at_ns, start, &mut data[part.data_bit / 8..][..end - start]);
        }
        let mut buffer = [0; crate::frame::MAX_DATA];
        let bytes = &mut buffer[..end - start];
        let granted = self.read(at_ns, start, bytes);
        if granted {
            copy_bits(bytes, part.physical_bit % 8, data, part.data_bit, part.bits);
        }
        granted
    }

    /// The time of the process data watchdog, in ns; none where it is off.
    fn watchdog_ns(&self) -> Option<u64> {
        let counts = u64::from(self.u16(at::WATCHDOG_SM));
        (counts > 0).then(|| counts * (u64::from(self.u16(at::WATCHDOG_DIVIDER)) + 2) * 40)
    }

    /// Whether process data are watched and too old.
    pub(crate) fn watchdog_expired(&self, at_ns: u64) -> bool {
        let (Some(limit), Some(last)) = (self.watchdog_ns(), self.last_trigger_ns) else {
            return false;
        };
        at_ns.saturating_sub(last) > limit
            && self
                .sync_managers
                .iter()
                .any(|manager| manager.is_active() && manager.triggers_watchdog())
    }

    /// Counts a watchdog that ran out, and lets it wait for the next write.
    pub(crate) fn watchdog_bit(&mut self) {
        let counter = &mut self.memory[at::WATCHDOG_COUNTER];
        *counter = counter.saturating_add(1);
        self.last_trigger_ns = None;
    }

    /// What the master last put into a sync manager's buffer.
    pub(crate) fn buffer(&self, index: usize) -> &[u8] {
        let manager = &self.sync_managers[index];
        let end = (manager.start + manager.length).min(MEMORY);
        self.memory.get(manager.start..end).unwrap_or_default()
    }

    /// The memory of a buffer that the device fills; it counts as filled from then on.
    pub(crate) fn fill(&mut self, index: usize) -> &mut [u8] {
        let manager = &mut self.sync_managers[index];
        manager.full = true;
        let end = (manager.start + manager.length).min(MEMORY);
        self.memory.get_mut(manager.start..end).unwrap_or_default()
    }

    /// Whether the master uses a sync manager, in the direction that the device expects.
    pub(crate) fn is_set_up(&self, index: usize, direction: Direction) -> bool {
        let manager = &self.sync_managers[index];
        let end = manager.start + manager.length;
        manager.is_active()
            && manager.direction() == direction
            && manager.start >= at::PROCESS_MEMORY
            && end <= MEMORY
    }

    /// Takes the registers of the clock away, or gives them back.
    pub(crate) fn set_clocking(&mut self, clocking: Clocking) {
        self.extent.clock = clocking;
    }

    fn load_units(&mut self) {
        self.active_fmmus = 0;
        for index in 0..self.extent.fmmus {
            let unit = Fmmu::of(&self.memory[at::FMMU + 16 * index..][..16]);
            if unit.is_active() {
                self.fmmus[self.active_fmmus] = unit;
                self.active_fmmus += 1;
            }
        }
    }

    fn load_sync_managers(&mut self) {
        for index in 0..self.extent.sync_managers {
            let registers = &self.memory[at::SYNC_MANAGER + 8 * index..][..8];
            self.sync_managers[index].configure(registers);
        }
    }

    /// The system time offset as it was written.
    fn offset(&self) -> u64 {
        u64::from(u32_at(&self.memory, at::SYSTEM_TIME_OFFSET))
            | u64::from(u32_at(&self.memory, at::SYSTEM_TIME_OFFSET + 4)) << 32
    }
}
