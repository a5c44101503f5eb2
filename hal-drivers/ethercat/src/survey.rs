//! A bus looked at by people: what is there, in which state, what its objects are. Nothing is enabled and nothing moves.

use std::path::Path;

use ethercrab::error::Error;
use ethercrab::{Command, SubDeviceGroup};
use tandem_ethercat_emulator::BusDescription;
use tandem_sdk::{DriverContext, Name};

use crate::bring_up::{self, Identity};
use crate::bus::{Bus, Counters, Seen};
use crate::check::MAX_DEVICES;
use crate::coe::Objects;
use crate::link::Link;
use crate::master::Master;
use crate::options::{EMULATED, Options};
use crate::reactions::REACTIONS;
use crate::time;
use crate::words::{al_code, al_state, joint_code, status};

/// State of a device, and why, in one piece.
const AL_STATUS: u16 = 0x0130;

/// Most bytes of process data that a bus may have to be looked at.
const MAX_BYTES: usize = 1400;

/// How often a bus that is watched is told of, ns.
const TELL_NS: u64 = 100_000_000;

/// The modes of operation that 6502 has bits for, by their numbers.
const MODES: [(u32, &str); 8] = [
    (1, "pp"),
    (2, "vl"),
    (3, "pv"),
    (4, "tq"),
    (6, "hm"),
    (8, "csp"),
    (9, "csv"),
    (10, "cst"),
];

/// A device that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Who it says that it is.
    pub identity: Identity,
    /// Whether it has a distributed clock that gives SYNC0.
    pub clock: bool,
    /// Objects in its process data: towards it and from it, as `6040:00 16`. Empty where it has no mailbox.
    pub maps: [Vec<String>; 2],
    /// Modes of operation that it can do, in letters; empty where it is no drive.
    pub modes: Vec<&'static str>,
    /// What a drive does by itself on stops, on faults and when the bus is lost, in words.
    pub reactions: Vec<String>,
}

/// The state of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// Its place, from 0.
    pub place: u16,
    /// The state in letters: `SAFE-OP`.
    pub state: &'static str,
    /// Register 0x0134, and what it means, where it is in an error.
    pub error: Option<(u16, &'static str)>,
}

/// The value of an object, as many bytes as the device gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Value {
    /// The number, without a sign.
    pub number: u32,
    /// Its bits: 8, 16 or 32.
    pub bits: u8,
}

impl Value {
    /// The number with a sign.
    pub fn signed(&self) -> i64 {
        let negative = self.number >> (self.bits - 1) & 1 == 1;
        i64::from(self.number) - if negative { 1 << self.bits } else { 0 }
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (digits, number, bits) = (usize::from(self.bits / 4), self.number, self.bits);
        let signed = self.signed();
        write!(
            f,
            "0x{number:0digits$x}, {number}, {signed} with a sign, {bits} bits"
        )
    }
}

/// A device of a bus in operation, as people watch it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Watched {
    /// What it is called.
    pub called: String,
    /// Its state, and register 0x0134 in words where there is an error.
    pub state: String,
    /// The status word of a drive, with its words.
    pub status: Option<String>,
    /// Why it counts as lost.
    pub lost: Option<String>,
    /// The objects that were asked for, with their values, or why they could not be read.
    pub objects: Vec<String>,
}

/// One end of a bus, with a master that enables nothing.
pub struct Survey {
    link: Link,
    master: Option<Master>,
}

impl Survey {
    /// At a network interface, or at an emulated bus on virtual time.
    ///
    /// # Errors
    /// The interface is not there, not allowed, or taken; the description is none.
    pub fn open(interface: &str, emulated: Option<&str>) -> Result<Self, String> {
        let link = match emulated {
            Some(text) => {
                let description =
                    BusDescription::from_toml(text).map_err(|error| error.to_string())?;
                Link::emulated(&description, false)?
            }
            None => Link::interface(interface)?,
        };
        let master =
            Master::take(false).ok_or_else(|| "there is no memory for another bus".to_string())?;
        Ok(Self {
            link,
            master: Some(master),
        })
    }

    /// At the bus of a driver's options.
    ///
    /// # Errors
    /// As of [`Survey::open`].
    pub fn of(options: &Options, context: &DriverContext) -> Result<Self, String> {
        if options.interface != EMULATED {
            return Self::open(&options.interface, None);
        }
        let description =
            crate::check::emulated(options, context).map_err(|error| error.to_string())?;
        let master =
            Master::take(false).ok_or_else(|| "there is no memory for another bus".to_string())?;
        Ok(Self {
            link: Link::emulated(&description, false)?,
            master: Some(master),
        })
    }

    /// Writes every frame from here on into a file that Wireshark opens.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn record(&mut self, path: &Path) -> Result<(), String> {
        self.link.record(path)
    }

    fn parts(&mut self) -> Result<(&mut Master, &mut Link), String> {
        let master = self
            .master
            .as_mut()
            .ok_or_else(|| "the bus is closed".to_string())?;
        Ok((master, &mut self.link))
    }

    /// What is on the bus. It brings the devices to PRE-OP, and back to INIT.
    ///
    /// # Errors
    /// What does not answer, or cannot be set up.
    pub fn scan(&mut self) -> Result<Vec<Found>, String> {
        let (master, link) = self.parts()?;
        master.run(link, |main| async move {
            let group: SubDeviceGroup<MAX_DEVICES, MAX_BYTES> = main
                .init_single_group(time::now_ns)
                .await
                .map_err(|error| failed(&error))?;
            let mut found = vec![];
            for (place, device) in group.iter(main).enumerate() {
                let called = format!("device {place}");
                let objects = Objects {
                    device: &device,
                    called: &called,
                };
                let mut one = Found {
                    identity: bring_up::identity(&device),
                    clock: device.dc_support().enhanced(),
                    maps: [vec![], vec![]],
                    modes: vec![],
                    reactions: vec![],
                };
                for (map, assignment) in one.maps.iter_mut().zip([0x1C12, 0x1C13]) {
                    // A device without a mailbox has no objects.
                    let Ok(mapped) = objects.mapped(assignment).await else {
                        break;
                    };
                    *map = mapped
                        .0
                        .iter()
                        .map(|e| format!("{:04X}:{:02X} {}", e.index, e.sub, e.bits))
                        .collect();
                }
                if !one.maps[0].is_empty()
                    && let Ok(Some(modes)) = objects.read_if_there(0x6502, 0, 4).await
                {
                    one.modes = MODES
                        .iter()
                        .filter(|(mode, _)| modes >> (mode - 1) & 1 == 1)
                        .map(|(_, name)| *name)
                        .collect();
                    for reaction in &REACTIONS {
                        one.reactions.extend(reaction.told(&objects).await?);
                    }
                }
                found.push(one);
            }
            bring_up::leave(main).await;
            Ok(found)
        })
    }

    /// The states of all devices, which stay as they are.
    ///
    /// # Errors
    /// No device answers.
    pub fn states(&mut self) -> Result<Vec<State>, String> {
        let (master, link) = self.parts()?;
        master.run(link, |main| async move {
            let mut states = vec![];
            for place in 0..MAX_DEVICES as u16 {
                let words = match Command::aprd(place, AL_STATUS)
                    .receive::<[u8; 6]>(main)
                    .await
                {
                    Ok(words) => words,
                    // Behind the last device nobody answers.
                    Err(Error::WorkingCounter { .. }) if place > 0 => break,
                    Err(error) => return Err(failed(&error)),
                };
                let status = u16::from_le_bytes([words[0], words[1]]);
                let code = u16::from_le_bytes([words[4], words[5]]);
                let error = (status & 0x10 != 0).then(|| (code, al_code(code)));
                states.push(State {
                    place,
                    state: al_state(status),
                    error,
                });
            }
            Ok(states)
        })
    }

    /// Reads an object of the device at a place.
    ///
    /// # Errors
    /// What the device refuses, in words.
    pub fn read(&mut self, place: usize, index: u16, sub: u8) -> Result<Value, String> {
        self.with_objects(place, async |objects| objects.read_any(index, sub).await)
    }

    /// Writes an object of the device at a place, and reads it back.
    ///
    /// # Errors
    /// What the device refuses, in words.
    pub fn write(&mut self, place: usize, index: u16, sub: u8, value: Value) -> Result<(), String> {
        self.with_objects(place, async |objects| {
            objects
                .write_and_judge(index, sub, value.number, usize::from(value.bits / 8))
                .await
        })
    }

    fn with_objects<T>(
        &mut self,
        place: usize,
        ask: impl AsyncFnOnce(&Objects<'_, '_>) -> Result<T, String>,
    ) -> Result<T, String> {
        let (master, link) = self.parts()?;
        master.run(link, |main| async move {
            let group: SubDeviceGroup<MAX_DEVICES, MAX_BYTES> = main
                .init_single_group(time::now_ns)
                .await
                .map_err(|error| failed(&error))?;
            let device = group.subdevice(main, place);
            let device = device.map_err(|_| {
                format!(
                    "there is no device {place}: {} are on the bus, from 0",
                    group.len()
                )
            })?;
            let called = format!("device {place}");
            let answer = ask(&Objects {
                device: &device,
                called: &called,
            })
            .await;
            bring_up::leave(main).await;
            answer
        })
    }
}

impl Drop for Survey {
    fn drop(&mut self) {
        if let Some(master) = self.master.take() {
            master.give_back();
        }
    }
}

fn failed(error: &Error) -> String {
    format!(
        "the bus cannot be set up ({error}); is it powered, and the first cable at its input port?"
    )
}

/// A context with the joints that the options name, for those who bring a bus up without a machine.
pub fn context_of(options: &Options, fine_period_s: f64, real_time: bool) -> DriverContext {
    let named: Vec<_> = options
        .devices
        .iter()
        .filter(|device| device.joint.is_some())
        .collect();
    let mut context = DriverContext::new(named.len().min(tandem_sdk::MAX_AXES), fine_period_s);
    for (joint, device) in context.joints.iter_mut().zip(named) {
        joint.name = Name::new(device.joint.as_deref().unwrap_or_default());
        joint.rotary = u32::from(device.counts_per_mm.is_none() && device.mm_per_turn.is_none());
    }
    context.real_time = u32::from(real_time);
    context
}

/// An object of the device at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Place of the device, from 0.
    pub place: usize,
    /// Index of the object.
    pub index: u16,
    /// Its sub-index.
    pub sub: u8,
}

/// What [`watch`] is to look at.
#[derive(Clone, Debug, Default)]
pub struct Watch<'a> {
    /// A file for every frame from power-on; what Wireshark opens.
    pub record: Option<&'a Path>,
    /// How long, s.
    pub time_s: f64,
    /// Objects that are read beside the process data, each time that something is told.
    pub objects: &'a [Object],
}

/// Brings a bus to OP with its drives disabled, exchanges for so long, and tells what it sees ten times a second: on the wall
/// clock, or with `interface = "emulated"` on virtual time.
///
/// # Errors
/// What cannot be brought up.
pub fn watch(
    options: &Options,
    fine_period_s: f64,
    what: &Watch<'_>,
    mut tell: impl FnMut(&[Watched], &Counters, Option<i64>),
) -> Result<(), String> {
    let context = context_of(options, fine_period_s, options.interface != EMULATED);
    let mut bus = Bus::open(options, &context)?;
    if let Some(path) = what.record {
        bus.link_mut().record(path)?;
    }
    let until_ns = bus.link_mut().now_ns() + (what.time_s.max(0.0) * 1e9) as u64;
    bus.start()?;
    let mut tell_ns = bus.link_mut().now_ns();
    while bus.link_mut().now_ns() < until_ns {
        bus.turn();
        if bus.link_mut().now_ns() >= tell_ns {
            tell_ns += TELL_NS;
            tell(
                &watched(&mut bus, what.objects),
                &bus.counters,
                bus.phase_ns(),
            );
        }
    }
    tell(
        &watched(&mut bus, what.objects),
        &bus.counters,
        bus.phase_ns(),
    );
    bus.stop();
    Ok(())
}

fn watched(bus: &mut Bus, objects: &[Object]) -> Vec<Watched> {
    let read: Vec<_> = objects
        .iter()
        .map(|object| {
            let Object { place, index, sub } = *object;
            let told = match bus.read_object(*object) {
                Ok(value) => format!("{index:04X}:{sub:02X} = {value}"),
                Err(words) => words,
            };
            (place, told)
        })
        .collect();
    let line = |(place, seen): (usize, Seen<'_>)| {
        let (al, code) = (seen.al, seen.al_code);
        let error = if al & 0x10 != 0 {
            format!(", {code:04X}: {}", al_code(code))
        } else {
            String::new()
        };
        Watched {
            called: seen.called.to_string(),
            state: format!("{}{error}", al_state(al)),
            status: seen
                .status
                .map(|word| format!("{word:04X} {}", status(word))),
            lost: seen.lost.map(joint_code),
            objects: read
                .iter()
                .filter(|(of, _)| *of == place)
                .map(|(_, told)| told.clone())
                .collect(),
        }
    };
    bus.watch().into_iter().enumerate().map(line).collect()
}
