//! A device on the bus.

use crate::al::{AlCode, AlState};
use crate::blueprint::{Blueprint, Identity, Pdo};
use crate::description::{DescriptionError, DeviceDescription};
use crate::drive::{DriveState, STEP_NS};
use crate::esc::clock::Clock;
use crate::esc::sync_manager::Direction;
use crate::esc::{Eeprom, Esc};
use crate::firmware::dictionary::Slot;
use crate::firmware::{Counters, Firmware};
use crate::frame::{Command, Datagram};
use crate::sii;

/// A device: a slave controller, and the firmware behind it.
#[derive(Clone, Debug)]
pub struct Device {
    pub(crate) plan: Blueprint,
    pub(crate) esc: Esc,
    pub(crate) firmware: Firmware,
    /// Local time at power-on, in ns, and error of the oscillator.
    clock_start_ns: u64,
    drift_ppb: i64,
    next_tick_ns: u64,
    channels: Channels,
}

/// Where inputs and outputs of a terminal lie in its dictionary, in their order.
#[derive(Clone, Debug)]
struct Channels {
    inputs: Vec<Slot>,
    outputs: Vec<Slot>,
    analog_inputs: Vec<Slot>,
    analog_outputs: Vec<Slot>,
}

impl Device {
    pub(crate) fn new(of: &DeviceDescription, number: usize) -> Result<Self, DescriptionError> {
        let plan = of.blueprint(number)?;
        let image = plan.image.clone().unwrap_or_else(|| sii::image(&plan));
        let drift_ppb = (of.drift_ppm * 1000.0).round() as i64;
        let clock = Clock::new(plan.make.clocking, of.clock_start_ns, drift_ppb);
        let esc = Esc::new(&plan.make, Eeprom::new(image, plan.wide_sii), clock);
        let firmware = Firmware::new(&plan);
        let channels = Channels::of(&plan, &firmware);
        let clock_start_ns = of.clock_start_ns;
        Ok(Self {
            plan,
            esc,
            firmware,
            clock_start_ns,
            drift_ppb,
            next_tick_ns: 0,
            channels,
        })
    }

    /// Loses everything but its SII and the place of its axis, as without power.
    pub(crate) fn power_cycle(&mut self, at_ns: u64) {
        let mut clock = Clock::new(self.plan.make.clocking, self.clock_start_ns, 0);
        clock.set_drift(at_ns, self.drift_ppb);
        let eeprom = Eeprom::new(self.esc.eeprom.image.clone(), self.plan.wide_sii);
        let ports = self.esc.port_times;
        self.esc = Esc::new(&self.plan.make, eeprom, clock);
        self.esc.port_times = ports;
        if let (Some(drive), Some(of)) = (&self.firmware.drive, &mut self.plan.drive) {
            of.position_counts = drive.position_and_velocity().0;
        }
        let before = std::mem::replace(&mut self.firmware, Firmware::new(&self.plan));
        self.firmware.trouble = before.trouble;
        if let (Some(drive), Some(before)) = (&mut self.firmware.drive, before.drive) {
            drive.trouble = before.trouble;
        }
    }

    /// Lets the device's own time pass.
    pub(crate) fn advance(&mut self, until_ns: u64) {
        loop {
            let tick = self.next_tick_ns;
            if self.esc.clock.sync_due(until_ns.min(tick)).is_some() {
                self.sync0();
            } else if tick <= until_ns {
                if self.is_idle(until_ns) {
                    self.next_tick_ns = (until_ns / STEP_NS + 1) * STEP_NS;
                    continue;
                }
                self.tick(tick);
                self.next_tick_ns += STEP_NS;
            } else {
                return;
            }
        }
    }

    /// A datagram passes.
    pub(crate) fn pass(&mut self, at_ns: u64, datagram: &Datagram, frame: &mut [u8]) {
        let station = datagram.station(frame);
        match datagram.command {
            Command::None => {}
            Command::Position { reads, writes } => {
                if station == 0 {
                    self.access(at_ns, datagram, frame, reads, writes);
                }
                datagram.pass(frame);
            }
            Command::Station { reads, writes } => {
                if self.esc.has_address(station) {
                    self.access(at_ns, datagram, frame, reads, writes);
                }
            }
            Command::Broadcast { reads, writes } => {
                self.broadcast(at_ns, datagram, frame, reads, writes);
                datagram.pass(frame);
            }
            Command::Logical { reads, writes } => {
                self.logical(at_ns, datagram, frame, reads, writes);
            }
            Command::PositionReadOthersWrite => {
                self.access(at_ns, datagram, frame, station == 0, station != 0);
                datagram.pass(frame);
            }
            Command::StationReadOthersWrite => {
                let own = self.esc.has_address(station);
                self.access(at_ns, datagram, frame, own, !own);
            }
        }
    }

    fn access(
        &mut self,
        at_ns: u64,
        datagram: &Datagram,
        frame: &mut [u8],
        reads: bool,
        writes: bool,
    ) {
        let address = datagram.address(frame);
        let data = datagram.data(frame);
        let mut counted = 0;
        if reads && writes {
            // What is read is what was there before.
            let mut before = [0; crate::frame::MAX_DATA];
            let before = &mut before[..data.len()];
            let read = self.esc.read(at_ns, address, before);
            counted += 2 * u16::from(self.esc.write(at_ns, address, data));
            if read {
                data.copy_from_slice(before);
                counted += 1;
            }
        } else if reads {
            counted += u16::from(self.esc.read(at_ns, address, data));
        } else {
            counted += u16::from(self.esc.write(at_ns, address, data));
        }
        datagram.count(frame, counted);
    }

    fn broadcast(
        &mut self,
        at_ns: u64,
        datagram: &Datagram,
        frame: &mut [u8],
        reads: bool,
        writes: bool,
    ) {
        let address = datagram.address(frame);
        let data = datagram.data(frame);
        let mut counted = 0;
        let mut own = [0; crate::frame::MAX_DATA];
        let own = &mut own[..data.len()];
        let read = reads && self.esc.read(at_ns, address, own);
        if writes {
            counted += u16::from(self.esc.write(at_ns, address, data)) * if reads { 2 } else { 1 };
        }
        if read {
            for (shared, own) in data.iter_mut().zip(own) {
                *shared |= *own;
            }
            counted += 1;
        }
        datagram.count(frame, counted);
    }

    fn logical(
        &mut self,
        at_ns: u64,
        datagram: &Datagram,
        frame: &mut [u8],
        reads: bool,
        writes: bool,
    ) {
        if self.firmware.trouble.deaf {
            return;
        }
        let address = datagram.logical_address(frame);
        let (read, written) = self
            .esc
            .logical(at_ns, address, datagram.data(frame), reads, writes);
        let weight = if reads { 2 } else { 1 };
        datagram.count(frame, u16::from(read) + weight * u16::from(written));
    }

    /// Error of its oscillator as it was described, in parts in 10⁹.
    pub(crate) fn drift_ppb(&self) -> i64 {
        self.drift_ppb
    }

    /// What messages call it.
    pub fn name(&self) -> &str {
        &self.plan.name
    }

    /// Vendor, product, revision and serial number that it states.
    pub fn identity(&self) -> Identity {
        self.plan.identity
    }

    /// The state that it is in on the bus.
    pub fn al_state(&self) -> AlState {
        self.firmware.state
    }

    /// The error that it is in, if it is in one.
    pub fn al_code(&self) -> Option<AlCode> {
        self.firmware.code
    }

    /// What was counted of it.
    pub fn counters(&self) -> Counters {
        self.firmware.counters
    }

    /// The state of a drive; none for other devices.
    pub fn drive_state(&self) -> Option<DriveState> {
        self.firmware.drive.as_ref().map(crate::drive::Drive::state)
    }

    /// Position, in counts, and velocity, in counts/s, of a drive's axis.
    pub fn position_and_velocity_counts(&self) -> Option<(f64, f64)> {
        self.firmware
            .drive
            .as_ref()
            .map(crate::drive::Drive::position_and_velocity)
    }

    /// Where a drive's axis stands by its switches, in counts: homing does not change it.
    pub fn place_counts(&self) -> Option<f64> {
        self.firmware.drive.as_ref().map(crate::drive::Drive::place)
    }

    /// Sets the torque of the process against a drive, as a share of its rated torque.
    pub fn set_load(&mut self, share: f64) {
        if let Some(drive) = &mut self.firmware.drive {
            drive.set_load(share);
        }
    }

    /// System time of its clock, in ns, at the emulator's time `at_ns`.
    pub fn system_time_ns(&self, at_ns: u64) -> u64 {
        self.esc.clock.system_shown(at_ns)
    }

    /// Sets a digital input of a terminal, from 0, or one of the two probe inputs of a drive.
    pub fn set_input(&mut self, input: usize, on: bool) {
        match (&mut self.firmware.drive, self.channels.inputs.get(input)) {
            (Some(drive), _) => drive.set_probe(input, on),
            (None, Some(slot)) => {
                if (self.firmware.dictionary.unsigned(*slot) == 1) != on {
                    self.firmware.dictionary.set(*slot, i64::from(on));
                    self.publish_inputs();
                }
            }
            (None, None) => {}
        }
    }

    /// A digital output of a terminal, from 0; none where it has not so many.
    pub fn output(&self, output: usize) -> Option<bool> {
        self.channels
            .outputs
            .get(output)
            .map(|slot| self.firmware.dictionary.unsigned(*slot) & 1 == 1)
    }

    /// Sets an analog input of a terminal, from 0.
    pub fn set_analog_input(&mut self, input: usize, value: i16) {
        if let Some(slot) = self.channels.analog_inputs.get(input) {
            self.firmware.dictionary.set(*slot, i64::from(value));
            self.publish_inputs();
        }
    }

    /// An analog output of a terminal, from 0; none where it has not so many.
    pub fn analog_output(&self, output: usize) -> Option<i16> {
        self.channels
            .analog_outputs
            .get(output)
            .map(|slot| self.firmware.dictionary.signed(*slot) as i16)
    }

    /// How many digital inputs can be set.
    pub(crate) fn input_count(&self) -> usize {
        if self.plan.drive.is_some() {
            2
        } else {
            self.channels.inputs.len()
        }
    }
}

impl Channels {
    fn of(plan: &Blueprint, firmware: &Firmware) -> Self {
        let find = |direction: Direction, bits: u8| {
            let pdos = plan
                .pdos
                .iter()
                .filter(|pdo: &&Pdo| pdo.direction() == direction);
            let entries = pdos
                .flat_map(|pdo| &pdo.entries)
                .filter(|entry| entry.index != 0 && entry.bits == bits);
            entries
                .filter_map(|entry| firmware.dictionary.slot(entry.index, entry.sub))
                .collect()
        };
        Self {
            inputs: find(Direction::ToMaster, 1),
            outputs: find(Direction::ToDevice, 1),
            analog_inputs: find(Direction::ToMaster, 16),
            analog_outputs: find(Direction::ToDevice, 16),
        }
    }
}
