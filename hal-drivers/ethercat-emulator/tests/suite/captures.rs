//! Captures of real terminals, replayed against the emulator: each frame that a master once sent to a coupler and its
//! terminals goes to emulated ones, at its time, and what comes back is compared datagram by datagram.
//!
//! The captures are part of the package `ethercrab`, and are read from where cargo keeps its source.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::path::{Path, PathBuf};

use pcap_file::pcapng::{Block, PcapNgReader};
use tandem_ethercat_emulator::{
    BusDescription, Clocking, DeviceDescription, Kind, MAX_FRAME, ObjectDescription, Wire,
};

/// One datagram as it went out or came back.
#[derive(Clone, Debug, PartialEq)]
struct Datagram {
    command: u8,
    station: u16,
    address: u16,
    data: Vec<u8>,
    counter: u16,
}

/// A frame that went out, when, and what came back.
struct Exchange {
    at_ns: u64,
    sent: Vec<u8>,
    back: Vec<Datagram>,
}

const APWR: u8 = 2;
const FPRD: u8 = 4;
const FPWR: u8 = 5;
const BRD: u8 = 7;
const BWR: u8 = 8;
const FRMW: u8 = 14;

fn captures() -> Option<Vec<PathBuf>> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| std::env::home_dir().map(|home| home.join(".cargo")))?;
    let sources = std::fs::read_dir(home.join("registry/src")).ok()?;
    let mut folders = sources
        .flatten()
        .map(|source| source.path().join("ethercrab-0.7.1/tests"));
    let files = folders.find_map(|folder| std::fs::read_dir(folder).ok())?;
    let mut files: Vec<PathBuf> = files.flatten().map(|file| file.path()).collect();
    files.retain(|file| {
        file.extension()
            .is_some_and(|extension| extension == "pcapng")
    });
    files.sort();
    Some(files)
}

fn number(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn datagrams(frame: &[u8]) -> Vec<Datagram> {
    let (mut all, mut at) = (vec![], 16);
    loop {
        let size = number(frame, at + 6);
        let data = at + 10..at + 10 + usize::from(size & 0x7ff);
        all.push(Datagram {
            command: frame[at],
            station: number(frame, at + 2),
            address: number(frame, at + 4),
            data: frame[data.clone()].to_vec(),
            counter: number(frame, data.end),
        });
        at = data.end + 2;
        if size & 0x8000 == 0 {
            return all;
        }
    }
}

/// Frames that went out, with what came back under the same number of their first datagram.
fn exchanges(file: &Path) -> Vec<Exchange> {
    let mut reader = PcapNgReader::new(File::open(file).unwrap()).unwrap();
    let mut frames = vec![];
    while let Some(block) = reader.next_block() {
        if let Block::EnhancedPacket(packet) = block.unwrap() {
            frames.push((packet.timestamp.as_nanos() as u64, packet.data.to_vec()));
        }
    }
    let begin_ns = frames[0].0;
    let mut waiting: HashMap<u8, usize> = HashMap::new();
    let mut all: Vec<Exchange> = vec![];
    for (at_ns, frame) in frames {
        if frame[6] & 2 == 0 {
            waiting.insert(frame[17], all.len());
            all.push(Exchange {
                at_ns: at_ns - begin_ns,
                sent: frame,
                back: vec![],
            });
        } else if let Some(index) = waiting.remove(&frame[17]) {
            all[index].back = datagrams(&frame);
        }
    }
    all.retain(|exchange| !exchange.back.is_empty());
    all
}

/// The devices of a capture, by what was read from them: SII, clocks, features, units.
fn devices(exchanges: &[Exchange]) -> Vec<DeviceDescription> {
    let all = || exchanges.iter().flat_map(|exchange| &exchange.back);
    let stations: Vec<u16> = all()
        .filter(|d| d.command == APWR && d.address == 0x10)
        .map(|d| number(&d.data, 0))
        .collect();
    // How many devices took the clearing of each unit.
    let takers = |address: u16| {
        all()
            .find(|d| d.command == BWR && d.address == address)
            .map_or(0, |d| d.counter)
    };
    let units = |first: u16, step: u16, device: usize| {
        (0..16)
            .filter(|unit| usize::from(takers(first + step * unit)) > device)
            .count() as u8
    };
    let describe = |(number, station): (usize, &u16)| {
        let own = || all().filter(|d| d.station == *station && d.command == FPRD && d.counter == 1);
        let mut description = DeviceDescription::new(Kind::Image);
        description.image = image(exchanges, *station);
        description.clocking = Some(if own().any(|d| d.address == 0x918) {
            Clocking::Bits64
        } else {
            Clocking::Delays
        });
        description.features = own()
            .find(|d| d.address == 0x08)
            .map(|d| number_of(&d.data));
        description.fmmus = Some(units(0x600, 16, number));
        description.sync_managers = Some(units(0x800, 8, number));
        description.objects = objects(exchanges, *station);
        description
    };
    stations.iter().enumerate().map(describe).collect()
}

fn number_of(data: &[u8]) -> u16 {
    number(data, 0)
}

/// The SII as far as it was read, ones elsewhere.
fn image(exchanges: &[Exchange], station: u16) -> Vec<u8> {
    let mut image = vec![0xff; 0x1000];
    let mut known = vec![false; 0x1000];
    let mut address = 0;
    for datagram in exchanges
        .iter()
        .flat_map(|exchange| &exchange.back)
        .filter(|d| d.station == station)
    {
        match (datagram.command, datagram.address) {
            (FPRD, 0x012) if !known[8] => image[8..10].copy_from_slice(&datagram.data),
            (FPWR, 0x502) => address = 2 * usize::from(number(&datagram.data, 2)),
            (FPRD, 0x508) => {
                for (at, byte) in (address..).zip(&datagram.data) {
                    if !std::mem::replace(&mut known[at], true) {
                        image[at] = *byte;
                    }
                }
            }
            _ => {}
        }
    }
    image
}

/// Entries that were read from a device, and those that were written.
fn objects(exchanges: &[Exchange], station: u16) -> Vec<ObjectDescription> {
    let mut objects: BTreeMap<(u16, u8), ObjectDescription> = BTreeMap::new();
    for datagram in exchanges
        .iter()
        .flat_map(|exchange| &exchange.back)
        .filter(|d| d.station == station)
    {
        let data = &datagram.data;
        if data.len() < 0x80 || !matches!(datagram.command, FPRD | FPWR) || datagram.counter == 0 {
            continue;
        }
        let (command, index, sub) = (data[8], number(data, 9), data[11]);
        let value = match command >> 5 {
            2 if command & 2 == 2 && number(data, 6) >> 12 == 3 => {
                data[12..16 - usize::from(command >> 2 & 3)].to_vec()
            }
            2 if number(data, 6) >> 12 == 3 => {
                data[16..16 + usize::from(number(data, 12))].to_vec()
            }
            1 if number(data, 6) >> 12 == 2 => vec![0; 4 - usize::from(command >> 2 & 3)],
            _ => continue,
        };
        // What is assigned is there.
        if (0x1C10..0x1C20).contains(&index) && sub > 0 && command >> 5 == 1 {
            let assigned = ObjectDescription {
                index: number(data, 12),
                sub: 0,
                value: vec![0],
                writable: false,
            };
            objects.entry((assigned.index, 0)).or_insert(assigned);
        }
        objects.entry((index, sub)).or_insert(ObjectDescription {
            index,
            sub,
            value,
            writable: true,
        });
    }
    objects.into_values().collect()
}

/// What of a datagram's data is the same in any bus of these devices: no times, no values of the outside world.
fn comparable(datagram: &Datagram) -> Vec<u8> {
    let data = &datagram.data;
    match (datagram.command, datagram.address) {
        // What the controllers are made as; times.
        (BRD, 0x0000) | (FPRD | FRMW, 0x0900..0x0A00) => vec![],
        // The status of the SII: whether it is busy, and what it last did.
        (FPRD, 0x0502) => vec![data[0] & 0x40, data[1] & 0x78],
        // A mailbox is full or not.
        (FPRD, 0x0805 | 0x080D) => vec![data[0] & 0x08],
        // A message as long as it is, an SDO without the bytes that it does not use.
        (FPRD, 0x1000..) if data.len() >= 0x80 => message(data),
        _ => data.clone(),
    }
}

fn message(data: &[u8]) -> Vec<u8> {
    let mut message = data[..6 + usize::from(number(data, 0))].to_vec();
    let command = message[8];
    if command >> 5 == 2 && command & 2 == 2 {
        message.truncate(16 - usize::from(command >> 2 & 3));
    }
    // What stands behind the answer to a write is left over from something else.
    if command >> 5 == 3 {
        message.truncate(12);
    }
    message
}

/// Whether the next frame asks the same once more: then a device may be sooner or later than the real one was.
fn is_asked_again(exchanges: &[Exchange], index: usize) -> bool {
    let key = |exchange: &Exchange| {
        (
            exchange.back[0].command,
            exchange.back[0].station,
            exchange.back[0].address,
        )
    };
    exchanges
        .get(index + 1)
        .is_some_and(|next| key(next) == key(&exchanges[index]))
}

/// Replays a capture; answers how many datagrams were compared, and what differs.
fn replay(file: &Path) -> (usize, Vec<String>) {
    let exchanges = exchanges(file);
    let description = BusDescription {
        devices: devices(&exchanges),
        ..BusDescription::default()
    };
    let mut wire = Wire::new(&description).unwrap();
    let (mut compared, mut differences) = (0, vec![]);
    for (index, exchange) in exchanges.iter().enumerate() {
        wire.send(exchange.at_ns, &exchange.sent);
        let mut reply = [0; MAX_FRAME];
        let length = wire
            .receive(exchange.at_ns + 200_000, &mut reply)
            .unwrap_or(0);
        if length == 0 {
            differences.push(format!("frame {index}: no reply"));
            continue;
        }
        if is_asked_again(&exchanges, index) {
            continue;
        }
        let back = datagrams(&reply[..length]);
        for (own, real) in back.iter().zip(&exchange.back) {
            compared += 1;
            let same = own.counter == real.counter && own.station == real.station;
            if !same || comparable(own) != comparable(real) {
                differences.push(format!(
                    "frame {index}: emulated {}\n  real {}",
                    told(own),
                    told(real)
                ));
            }
        }
    }
    (compared, differences)
}

fn told(datagram: &Datagram) -> String {
    let Datagram {
        command,
        station,
        address,
        counter,
        ..
    } = datagram;
    format!(
        "{command} {station:04x}:{address:04x} {:02x?} counter {counter}",
        comparable(datagram)
    )
}

#[test]
fn real_terminals_answered_as_emulated_ones_do() {
    let Some(files) = captures().filter(|files| !files.is_empty()) else {
        println!(
            "skipped: cargo keeps no source of ethercrab 0.7.1 here, whose tests hold the captures"
        );
        return;
    };
    assert_eq!(files.len(), 8);
    let mut failed = vec![];
    for file in files {
        let (compared, differences) = replay(&file);
        let name = file.file_name().unwrap().to_string_lossy().to_string();
        println!(
            "{name}: {compared} datagrams compared, {} differ",
            differences.len()
        );
        assert!(
            compared > 200,
            "{name}: only {compared} datagrams were compared"
        );
        failed.extend(
            differences
                .into_iter()
                .map(|difference| format!("{name}: {difference}")),
        );
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
