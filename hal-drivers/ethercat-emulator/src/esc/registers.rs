//! Addresses of the registers of an EtherCAT slave controller, and which of them a master may write.

/// Configured station address.
pub(crate) const STATION_ADDRESS: usize = 0x0010;
/// Alias of the station, from the SII at power-on.
pub(crate) const STATION_ALIAS: usize = 0x0012;
/// Control of the data link layer.
pub(crate) const DL_CONTROL: usize = 0x0100;
/// Links and loops of the ports.
pub(crate) const DL_STATUS: usize = 0x0110;
/// State that the master asks for.
pub(crate) const AL_CONTROL: usize = 0x0120;
/// State that the device is in; bit 4 says that it is there by an error.
pub(crate) const AL_STATUS: usize = 0x0130;
/// Why the device is in an error.
pub(crate) const AL_STATUS_CODE: usize = 0x0134;
/// What the device's firmware is offered to look at.
pub(crate) const AL_EVENT_REQUEST: usize = 0x0220;
/// Error counters of the ports; a write of any of them clears them.
pub(crate) const ERROR_COUNTERS: usize = 0x0300;
/// Divider of the watchdogs: one count is (divider + 2) · 40 ns.
pub(crate) const WATCHDOG_DIVIDER: usize = 0x0400;
/// Time of the watchdog of the firmware, in counts.
pub(crate) const WATCHDOG_PDI: usize = 0x0410;
/// Time of the watchdog of the process data, in counts; 0 is never.
pub(crate) const WATCHDOG_SM: usize = 0x0420;
/// Bit 0: the process data are watched and fresh, or not watched.
pub(crate) const WATCHDOG_STATUS: usize = 0x0440;
/// How often the watchdog of the process data ran out.
pub(crate) const WATCHDOG_COUNTER: usize = 0x0442;
/// Who may use the SII.
pub(crate) const SII_CONFIGURATION: usize = 0x0500;
/// Control and status of the SII.
pub(crate) const SII_CONTROL: usize = 0x0502;
/// The first unit that maps logical addresses; 16 bytes each.
pub(crate) const FMMU: usize = 0x0600;
/// The first sync manager; 8 bytes each.
pub(crate) const SYNC_MANAGER: usize = 0x0800;
/// Local time at which the last latching frame came in at each port.
pub(crate) const RECEIVE_TIMES: usize = 0x0900;
/// System time: the local clock and its offset.
pub(crate) const SYSTEM_TIME: usize = 0x0910;
/// Local time at which the last latching frame reached the processing unit.
pub(crate) const RECEIVE_TIME_UNIT: usize = 0x0918;
/// What is added to the local clock.
pub(crate) const SYSTEM_TIME_OFFSET: usize = 0x0920;
/// Time from the reference clock to here.
pub(crate) const SYSTEM_TIME_DELAY: usize = 0x0928;
/// Mean difference to the reference clock, as sign and magnitude.
pub(crate) const SYSTEM_TIME_DIFFERENCE: usize = 0x092C;
/// Bandwidth of the drift compensation; a write restarts it.
pub(crate) const SPEED_COUNTER: usize = 0x0930;
/// Filter depths of the drift compensation.
pub(crate) const FILTER_DEPTHS: usize = 0x0934;
/// Who controls the sync unit.
pub(crate) const SYNC_CONTROL: usize = 0x0980;
/// Bit 0 starts the cyclic operation, bit 1 SYNC0, bit 2 SYNC1.
pub(crate) const SYNC_ACTIVATION: usize = 0x0981;
/// System time of the next SYNC0.
pub(crate) const SYNC0_START: usize = 0x0990;
/// Time between two SYNC0, in ns.
pub(crate) const SYNC0_CYCLE: usize = 0x09A0;
/// Time from SYNC0 to SYNC1, in ns.
pub(crate) const SYNC1_CYCLE: usize = 0x09A4;
/// Events of the latch inputs.
pub(crate) const LATCH_CONTROL: usize = 0x09A8;
/// Where the process memory begins: outputs of digital terminals lie at its start, all else from 0x1000.
pub(crate) const PROCESS_MEMORY: usize = 0x0F00;

/// What a slave controller has of what is optional.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub(crate) fmmus: usize,
    pub(crate) sync_managers: usize,
    pub(crate) clock: super::Clocking,
}

/// Registers outside of the optional blocks that a master may write, first and last address.
const WRITABLE: &[(usize, usize)] = &[
    (STATION_ADDRESS, 0x0011),
    (0x0020, 0x0021),
    (0x0030, 0x0031),
    (0x0040, 0x0041),
    (DL_CONTROL, 0x0103),
    (0x0108, 0x0109),
    (AL_CONTROL, 0x0121),
    (0x0200, 0x0201),
    (ERROR_COUNTERS, 0x0313),
    (WATCHDOG_DIVIDER, 0x0401),
    (WATCHDOG_PDI, 0x0411),
    (WATCHDOG_SM, 0x0421),
    (WATCHDOG_COUNTER, 0x0443),
    (SII_CONFIGURATION, 0x0501),
    (SII_CONTROL, 0x050F),
];

/// Registers of distributed clocks that a master may write.
const WRITABLE_CLOCK: &[(usize, usize)] = &[
    (SYSTEM_TIME, 0x0917),
    (SYSTEM_TIME_OFFSET, 0x0927),
    (SYSTEM_TIME_DELAY, 0x092B),
    (SPEED_COUNTER, 0x0931),
    (FILTER_DEPTHS, 0x0935),
    (SYNC_CONTROL, SYNC_ACTIVATION),
    (SYNC0_START, 0x0997),
    (SYNC0_CYCLE, 0x09A7),
    (LATCH_CONTROL, 0x09A9),
];

fn within(list: &[(usize, usize)], address: usize) -> bool {
    list.iter()
        .any(|(first, last)| (*first..=*last).contains(&address))
}

impl Extent {
    /// Whether there is anything at a register address.
    pub(crate) fn exists(&self, address: usize) -> bool {
        match address {
            FMMU..0x0700 => address < FMMU + 16 * self.fmmus,
            0x0700..SYNC_MANAGER => false,
            SYNC_MANAGER..RECEIVE_TIMES => address < SYNC_MANAGER + 8 * self.sync_managers,
            RECEIVE_TIMES..SYSTEM_TIME => self.clock != super::Clocking::None,
            SYSTEM_TIME..0x0A00 => self.clock.has_system_time(),
            _ => true,
        }
    }

    /// Whether a master may write the register at `address`.
    pub(crate) fn writable(&self, address: usize) -> bool {
        match address {
            _ if !self.exists(address) => false,
            FMMU..0x0700 | RECEIVE_TIMES..0x0904 => true,
            // Status and the firmware's own control of a sync manager are the device's.
            SYNC_MANAGER..RECEIVE_TIMES => !matches!(address % 8, 5 | 7),
            0x0904..0x0A00 => within(WRITABLE_CLOCK, address),
            _ => within(WRITABLE, address),
        }
    }
}
