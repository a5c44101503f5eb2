//! The devices of a bus in the order in which a frame meets them, and the cables between them.

use crate::description::{BusDescription, DescriptionError, Plug, Switch};
use crate::device::Device;
use crate::esc::registers;
use crate::faults::What;
use crate::frame::{self, Command, Datagram, datagrams, is_ethercat};

/// Most devices of a bus.
const MAX_DEVICES: usize = 256;
/// Ports of a device behind its first, in the order in which a frame leaves by them.
const PORTS: [usize; 3] = [3, 1, 2];

/// A bus: a frame goes in and comes back changed. It has no clock: every call says what time it is.
#[derive(Clone, Debug)]
pub struct Bus {
    devices: Vec<Device>,
    cables: Vec<Cable>,
    /// Cut before the first device.
    unplugged: bool,
    /// Time that a frame takes around, in ns.
    ring_ns: u64,
    now_ns: u64,
    switches: Vec<Switch>,
    /// Kept from frame to frame, so that a frame allocates nothing.
    found: Vec<Datagram>,
}

/// How a device hangs on the bus.
#[derive(Clone, Copy, Debug)]
struct Cable {
    plug: Option<Plug>,
    travel_ns: u64,
    /// No device behind this one is reached.
    cut_behind: bool,
    /// When a frame is here, counted from its start; none where it does not get here.
    arrival_ns: Option<u64>,
}

impl Bus {
    /// Builds the devices of a description, with power on at time 0.
    ///
    /// # Errors
    /// What names a device that is not there, or cannot be built.
    pub fn new(description: &BusDescription) -> Result<Self, DescriptionError> {
        let described = &description.devices;
        if described.len() > MAX_DEVICES {
            return Err(DescriptionError::Reference(format!(
                "a bus has at most {MAX_DEVICES} devices"
            )));
        }
        let devices: Result<Vec<Device>, _> = (0..)
            .zip(described)
            .map(|(n, d)| Device::new(d, n))
            .collect();
        let cable = |(number, of): (usize, &crate::description::DeviceDescription)| Cable {
            plug: (number > 0).then(|| {
                of.plug.unwrap_or(Plug {
                    device: number.saturating_sub(1),
                    port: 1,
                })
            }),
            travel_ns: of.cable_ns.min(1_000_000),
            cut_behind: false,
            arrival_ns: None,
        };
        let mut bus = Self {
            devices: devices?,
            cables: described.iter().enumerate().map(cable).collect(),
            unplugged: false,
            ring_ns: 0,
            now_ns: 0,
            switches: description.switches.clone(),
            found: vec![],
        };
        bus.judge_cables()?;
        bus.judge_switches()?;
        bus.measure();
        Ok(bus)
    }

    fn judge_cables(&mut self) -> Result<(), DescriptionError> {
        for (device, cable) in self.cables.iter().enumerate() {
            let Some(Plug {
                device: parent,
                port,
            }) = cable.plug
            else {
                continue;
            };
            let taken = self.cables[..device]
                .iter()
                .any(|other| other.plug == cable.plug);
            if parent >= device || !(1..=3).contains(&port) || taken {
                let cause = format!(
                    "plug is port 1 to 3, and free, of a device before it; not port {port} of {parent}"
                );
                return Err(DescriptionError::Device { device, cause });
            }
        }
        let mut order = vec![];
        if !self.cables.is_empty() {
            self.walk(0, 0, &mut order);
        }
        match (0..).zip(&order).find(|(place, device)| place != *device) {
            Some((place, _)) => {
                let cause = "a frame does not meet the devices in this order: it leaves by port 3, then 1, then 2";
                Err(DescriptionError::Device {
                    device: place,
                    cause: cause.to_string(),
                })
            }
            None => Ok(()),
        }
    }

    fn judge_switches(&self) -> Result<(), DescriptionError> {
        for switch in &self.switches {
            let input = self
                .devices
                .get(switch.device)
                .is_some_and(|device| switch.input < device.input_count());
            let drive = self
                .devices
                .get(switch.drive)
                .is_some_and(|device| device.plan.drive.is_some());
            if !input || !drive {
                let cause = format!(
                    "switches: input {} of {} by drive {}",
                    switch.input, switch.device, switch.drive
                );
                return Err(DescriptionError::Reference(format!("{cause} is not there")));
            }
        }
        Ok(())
    }

    /// Refuses a fault that names what is not there.
    pub(crate) fn judge_fault(&self, what: &What) -> Result<(), DescriptionError> {
        let Some(number) = what.device() else {
            return Ok(());
        };
        let Some(device) = self.devices.get(number) else {
            return Err(DescriptionError::Reference(format!(
                "a fault is about device {number}, which is not there"
            )));
        };
        if what.needs_drive() && device.plan.drive.is_none() {
            return Err(DescriptionError::Reference(format!(
                "a fault of drives is about device {number}, which is none"
            )));
        }
        Ok(())
    }

    fn child(&self, of: usize, port: usize) -> Option<usize> {
        let plug = Some(Plug { device: of, port });
        self.cables.iter().position(|cable| cable.plug == plug)
    }

    /// Follows a frame through a device and everything behind it; answers when it is back out of its first port.
    fn walk(&mut self, device: usize, arrival_ns: u64, order: &mut Vec<usize>) -> u64 {
        order.push(device);
        self.cables[device].arrival_ns = Some(arrival_ns);
        let mut times = [Some(0), None, None, None];
        let mut now_ns = arrival_ns;
        let ports = if self.cables[device].cut_behind {
            &[][..]
        } else {
            &PORTS
        };
        for port in ports.iter().copied() {
            let Some(child) = self.child(device, port) else {
                continue;
            };
            let travel_ns = self.cables[child].travel_ns;
            now_ns = self.walk(child, now_ns + travel_ns, order) + travel_ns;
            times[port] = Some(now_ns - arrival_ns);
        }
        let served = !self.devices[device].plan.process.is_empty();
        let status = dl_status(&times) | u16::from(served) << 1;
        let esc = &mut self.devices[device].esc;
        esc.port_times = times;
        esc.set(registers::DL_STATUS, 2, u64::from(status));
        now_ns
    }

    /// Follows a frame around, after a change of the cables.
    fn measure(&mut self) {
        for cable in &mut self.cables {
            cable.arrival_ns = None;
        }
        self.ring_ns = 0;
        if !self.unplugged && !self.cables.is_empty() {
            self.ring_ns = self.walk(0, 0, &mut vec![]);
        }
    }

    /// Lets time pass for every device. Time that goes back is no time.
    pub fn advance(&mut self, now_ns: u64) {
        if now_ns < self.now_ns {
            return;
        }
        self.now_ns = now_ns;
        for device in &mut self.devices {
            device.advance(self.now_ns);
        }
        for switch in &self.switches {
            let Some(place) = self.devices[switch.drive]
                .firmware
                .drive
                .as_ref()
                .map(crate::drive::Drive::place)
            else {
                continue;
            };
            self.devices[switch.device].set_input(switch.input, place > switch.above_counts);
        }
    }

    /// Passes a frame through the devices, each at the time at which it gets there. Answers how long it takes around,
    /// in ns, or nothing where no frame comes back: without devices, or for another protocol. Allocates nothing.
    pub fn pass(&mut self, now_ns: u64, frame: &mut [u8]) -> Option<u64> {
        self.advance(now_ns);
        if !is_ethercat(frame) {
            return None;
        }
        self.read(frame);
        self.pass_read(frame)
    }

    /// Finds the datagrams of a frame, which [`Bus::pass_read`] passes; whether process data are among them.
    pub(crate) fn read(&mut self, frame: &[u8]) -> bool {
        self.found.clear();
        self.found.extend(datagrams(frame));
        let logical = |datagram: &Datagram| matches!(datagram.command, Command::Logical { .. });
        self.found.iter().any(logical)
    }

    /// Passes the frame whose datagrams were found last, at the time up to which the devices have lived.
    pub(crate) fn pass_read(&mut self, frame: &mut [u8]) -> Option<u64> {
        if self.unplugged || self.devices.is_empty() {
            return None;
        }
        for (device, cable) in self.devices.iter_mut().zip(&self.cables) {
            let Some(arrival_ns) = cable.arrival_ns else {
                continue;
            };
            let at_ns = self.now_ns + arrival_ns;
            device.advance(at_ns);
            device.frame_comes();
            for datagram in &self.found {
                device.pass(at_ns, datagram, frame);
            }
            device.frame_passed(at_ns);
        }
        // The first device marks the source as locally administered, by which a master knows what came around.
        frame[6] |= 2;
        Some(self.ring_ns + 80 * frame.len() as u64)
    }

    /// The devices.
    pub fn devices(&self) -> &[Device] {
        &self.devices
    }

    /// One device, to set its inputs; none where there are not so many.
    pub fn device_mut(&mut self, device: usize) -> Option<&mut Device> {
        self.devices.get_mut(device)
    }

    /// Cuts the cable behind a device, or before the first, or mends it.
    pub(crate) fn cut(&mut self, behind: Option<usize>, cut: bool) {
        match behind {
            None => self.unplugged = cut,
            Some(device) => {
                if let Some(cable) = self.cables.get_mut(device) {
                    cable.cut_behind = cut;
                }
            }
        }
        self.measure();
    }

    /// Takes the power from a device for a moment.
    pub(crate) fn power_cycle(&mut self, device: usize) {
        let now_ns = self.now_ns;
        if let Some(device) = self.devices.get_mut(device) {
            device.power_cycle(now_ns);
        }
        self.measure();
    }

    /// Up to when the devices have lived, ns from power-on.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }
}

/// Links and loops of the ports: a port with a cable is open, any other one closed. Bit 0 says that the SII is loaded.
fn dl_status(times: &[Option<u64>; 4]) -> u16 {
    let ports = times.iter().enumerate().map(|(port, time)| {
        let shift = 2 * port as u16;
        if time.is_some() {
            1 << (4 + port) | 2 << (8 + shift)
        } else {
            1 << (8 + shift)
        }
    });
    ports.sum::<u16>() | 0x01
}

/// Longest frame that a bus passes.
pub const MAX_FRAME: usize = frame::MAX_FRAME;
