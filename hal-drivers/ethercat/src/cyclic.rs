//! The frame of a period: one, whose datagrams say for each device by itself whether it took part.
//!
//! It begins with a datagram that no device looks at and that carries a number of its own in every period: a reply that comes
//! late, twice or from somebody else's frame is known by it, however long after, and is never taken for the one awaited.

use tandem_ethercat_emulator::{ETHERTYPE, MAX_FRAME};

use crate::link::Link;

/// Addresses of the Ethernet header: everybody, and the one that `ethercrab` has.
const DESTINATION: [u8; 6] = [0xff; 6];
const SOURCE: [u8; 6] = [0x10; 6];
/// Shortest Ethernet frame without its check sum.
const MIN_FRAME: usize = 60;
/// Where the first datagram begins.
const FIRST: usize = 16;
const HEADER: usize = 10;
const COUNTER: usize = 2;

/// Commands of datagrams.
const NOP: u8 = 0;
const FPRD: u8 = 4;
const FPWR: u8 = 5;
const LRD: u8 = 10;
const LWR: u8 = 11;
const FRMW: u8 = 14;

/// Registers.
const AL_CONTROL: u16 = 0x0120;
const AL_STATUS: u16 = 0x0130;
const SYSTEM_TIME: u16 = 0x0910;

/// Logical addresses of a device's process data, in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Area {
    pub(crate) address: u32,
    pub(crate) bytes: usize,
    /// What the device adds to the working counter of a datagram that reads or writes it.
    pub(crate) counts: u16,
}

/// Where a device is on the bus.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    pub(crate) address: u16,
    pub(crate) outputs: Area,
    pub(crate) inputs: Area,
}

/// A datagram in the frame: where its data begin, how many there are.
#[derive(Clone, Copy, Debug)]
struct DataRange {
    data: usize,
    bytes: usize,
}

#[derive(Clone, Copy, Debug)]
struct Datagrams {
    outputs: Option<(DataRange, u16)>,
    inputs: Option<(DataRange, u16)>,
}

/// What a device's state register held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AlStatus {
    /// Its number in the list of devices.
    pub(crate) device: usize,
    /// Register 0x0130: the state, and 0x10 where there is an error.
    pub(crate) status: u16,
    /// Register 0x0134: why.
    pub(crate) code: u16,
}

/// The frame, and the reply to it.
#[derive(Debug)]
pub(crate) struct Cyclic {
    frame: Vec<u8>,
    reply: Box<[u8; MAX_FRAME]>,
    number: u32,
    devices: Vec<Datagrams>,
    stations: Vec<u16>,
    clock: Option<DataRange>,
    status: DataRange,
    control: DataRange,
    /// Device whose state is asked for in this period.
    asked: usize,
    /// Replies that were none of the frame that was waited for, since the start.
    pub(crate) strays: u64,
}

impl Cyclic {
    /// A frame for these devices; `reference` is the station whose clock leads the others.
    pub(crate) fn new(stations: &[Station], reference: Option<u16>) -> Result<Self, String> {
        let mut frame = vec![0; FIRST];
        frame[..6].copy_from_slice(&DESTINATION);
        frame[6..12].copy_from_slice(&SOURCE);
        frame[12..14].copy_from_slice(&ETHERTYPE.to_be_bytes());
        let mut last = 0;
        let mut add = |command: u8, address: u32, bytes: usize| {
            last = frame.len();
            frame.push(command);
            frame.push(0);
            frame.extend(address.to_le_bytes());
            frame.extend((bytes as u16 | 0x8000).to_le_bytes());
            frame.extend([0, 0]);
            let data = frame.len();
            frame.resize(data + bytes + COUNTER, 0);
            DataRange { data, bytes }
        };
        add(NOP, 0, 4);
        let clock = reference.map(|station| add(FRMW, register(station, SYSTEM_TIME), 8));
        let mut devices = vec![];
        for station in stations {
            let mut area = |command, area: Area| {
                (area.bytes > 0).then(|| (add(command, area.address, area.bytes), area.counts))
            };
            devices.push(Datagrams {
                outputs: area(LWR, station.outputs),
                inputs: area(LRD, station.inputs),
            });
        }
        let first = stations.first().map_or(0, |station| station.address);
        let status = add(FPRD, register(first, AL_STATUS), 6);
        let control = add(NOP, register(first, AL_CONTROL), 2);
        // Behind the last datagram there is none.
        frame[last + 7] &= 0x7f;
        let length = frame.len() - FIRST;
        if frame.len() > MAX_FRAME {
            return Err(format!(
                "the process data of all devices take {length} bytes, and {} fit into a frame",
                MAX_FRAME - FIRST
            ));
        }
        frame[14..16].copy_from_slice(&(length as u16 | 0x1000).to_le_bytes());
        frame.resize(frame.len().max(MIN_FRAME), 0);
        Ok(Self {
            frame,
            reply: Box::new([0; MAX_FRAME]),
            number: 0,
            devices,
            stations: stations.iter().map(|station| station.address).collect(),
            clock,
            status,
            control,
            asked: 0,
            strays: 0,
        })
    }

    /// The outputs of a device, which stay as they are until they are changed.
    pub(crate) fn outputs(&mut self, device: usize) -> &mut [u8] {
        match self.devices[device].outputs {
            Some((place, _)) => &mut self.frame[place.data..place.data + place.bytes],
            None => &mut [],
        }
    }

    /// The inputs of a device; none where it took no part.
    pub(crate) fn inputs(&self, device: usize) -> Option<&[u8]> {
        match self.devices[device].inputs {
            Some((place, counts)) if self.counter(place) == counts => {
                Some(&self.reply[place.data..place.data + place.bytes])
            }
            Some(_) => None,
            None => Some(&[]),
        }
    }

    /// Whether a device took its outputs.
    pub(crate) fn took(&self, device: usize) -> bool {
        self.devices[device]
            .outputs
            .is_none_or(|(place, counts)| self.counter(place) == counts)
    }

    /// Whether a clock leads.
    pub(crate) fn has_clock(&self) -> bool {
        self.clock.is_some()
    }

    /// Time of the clock that leads, ns; none where there is none, or it did not answer.
    pub(crate) fn clock_ns(&self) -> Option<u64> {
        let place = self.clock?;
        let bytes = self.reply[place.data..place.data + 8]
            .try_into()
            .unwrap_or_default();
        // The frame leaves with no time in it, and the devices behind count that they have taken it all the same.
        Some(u64::from_le_bytes(bytes)).filter(|ns| *ns > 0)
    }

    /// The state of the device that was asked for it; none where it did not answer.
    pub(crate) fn al_status(&self) -> Option<AlStatus> {
        let at = self.status.data;
        let word = |at: usize| u16::from_le_bytes([self.reply[at], self.reply[at + 1]]);
        let answered = self.counter(self.status) == 1;
        answered.then(|| AlStatus {
            device: self.asked,
            status: word(at),
            code: word(at + 4),
        })
    }

    /// Asks for the state of a device in the next frame.
    pub(crate) fn ask(&mut self, device: usize) {
        self.asked = device;
        let address = register(self.stations[device], AL_STATUS);
        let at = self.status.data - HEADER + 2;
        self.frame[at..at + 4].copy_from_slice(&address.to_le_bytes());
    }

    /// Requests a state of a device in the next frame; none of any.
    pub(crate) fn request(&mut self, wanted: Option<(usize, u16)>) {
        let start = self.control.data - HEADER;
        let Some((device, state)) = wanted else {
            self.frame[start] = NOP;
            return;
        };
        self.frame[start] = FPWR;
        let address = register(self.stations[device], AL_CONTROL);
        self.frame[start + 2..start + 6].copy_from_slice(&address.to_le_bytes());
        self.frame[self.control.data..self.control.data + 2].copy_from_slice(&state.to_le_bytes());
    }

    fn counter(&self, place: DataRange) -> u16 {
        let at = place.data + place.bytes;
        u16::from_le_bytes([self.reply[at], self.reply[at + 1]])
    }

    /// Sends the frame.
    pub(crate) fn send(&mut self, link: &mut Link) {
        self.number = self.number.wrapping_add(1);
        let at = FIRST + HEADER;
        self.frame[at..at + 4].copy_from_slice(&self.number.to_le_bytes());
        self.frame[FIRST + 1] = self.number as u8;
        link.send(&self.frame);
    }

    /// Sends the frame as it is once more, and takes whatever comes first for its reply; whether anything did.
    pub(crate) fn send_again(&mut self, link: &mut Link, until_ns: u64) -> bool {
        link.send(&self.frame);
        link.receive(until_ns, &mut self.reply).is_some()
    }

    /// Waits for the reply until `until_ns`; whether it came. Other frames that come are left out.
    pub(crate) fn receive(&mut self, link: &mut Link, until_ns: u64) -> bool {
        while let Some(length) = link.receive(until_ns, &mut self.reply) {
            if self.is_reply(length) {
                return true;
            }
            self.strays += 1;
        }
        false
    }

    /// Whether what came is the reply to the frame that was sent last: its number, and every header as it was sent.
    fn is_reply(&self, length: usize) -> bool {
        let stated =
            FIRST + usize::from(u16::from_le_bytes([self.frame[14], self.frame[15]]) & 0x7ff);
        if length < stated
            || self.reply[12..16] != self.frame[12..16]
            || self.reply[6..12] == SOURCE
        {
            return false;
        }
        let number = FIRST..FIRST + HEADER + 4;
        if self.reply[number.clone()] != self.frame[number] {
            return false;
        }
        let mut at = FIRST;
        while at < stated {
            let size = u16::from_le_bytes([self.frame[at + 6], self.frame[at + 7]]);
            let same = self.reply[at] == self.frame[at]
                && self.reply[at + 1] == self.frame[at + 1]
                && self.reply[at + 6..at + 8] == self.frame[at + 6..at + 8];
            if !same {
                return false;
            }
            at += HEADER + usize::from(size & 0x7ff) + COUNTER;
        }
        true
    }
}

fn register(station: u16, register: u16) -> u32 {
    u32::from(station) | u32::from(register) << 16
}
