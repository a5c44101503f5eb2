//! The SII: the description that a device carries in its memory, made and read.

use crate::blueprint::{Blueprint, Identity, MailboxPlan, Pdo, PdoEntry, ProcessPlan};
use crate::bytes::{put, u16_at, u32_at};
use crate::esc::sync_manager::Direction;

/// Numbers of the categories.
const STRINGS: u16 = 10;
const GENERAL: u16 = 30;
const FMMU: u16 = 40;
const SYNC_MANAGERS: u16 = 41;
const TX_PDO: u16 = 50;
const RX_PDO: u16 = 51;
const END: u16 = 0xffff;
/// Where the categories begin, in bytes.
const CATEGORIES: usize = 0x80;
/// What a mailbox carries: CAN over EtherCAT.
const COE: u16 = 4;
/// Bits of the details of CAN over EtherCAT: SDO, information, assignment and mapping of PDOs, complete access.
const COE_DETAILS: u8 = 0x0f;
const COMPLETE_ACCESS: u8 = 0x20;

/// Makes the image of a device.
pub(crate) fn image(plan: &Blueprint) -> Vec<u8> {
    let mut image = header(plan);
    category(&mut image, STRINGS, &strings(&[&plan.order, &plan.name]));
    category(&mut image, GENERAL, &general(plan));
    let mut usage: Vec<u8> = plan
        .process
        .iter()
        .map(|process| {
            if process.direction == Direction::ToDevice {
                1
            } else {
                2
            }
        })
        .collect();
    if plan.mailbox.is_some() {
        usage.push(3);
    }
    category(&mut image, FMMU, &usage);
    category(&mut image, SYNC_MANAGERS, &sync_managers(plan));
    for (number, direction) in [(TX_PDO, Direction::ToMaster), (RX_PDO, Direction::ToDevice)] {
        let mut bytes = vec![];
        for pdo in plan.pdos.iter().filter(|pdo| pdo.direction() == direction) {
            put_pdo(&mut bytes, pdo);
        }
        category(&mut image, number, &bytes);
    }
    image.extend(END.to_le_bytes());
    let kibibits = image.len().next_power_of_two().max(256) * 8 / 1024;
    put(&mut image[0x7c..0x7e], kibibits as u64 - 1);
    image.resize(kibibits * 1024 / 8, 0xff);
    image
}

fn header(plan: &Blueprint) -> Vec<u8> {
    let mut image = vec![0; CATEGORIES];
    let Identity {
        vendor,
        product,
        revision,
        serial,
    } = plan.identity;
    // Interface to the firmware: digital outputs without firmware, or a processor.
    put(&mut image[0..2], if plan.simple { 0x0104 } else { 0x0C08 });
    put(&mut image[8..10], u64::from(plan.alias));
    let sum = checksum(&image[..14]);
    put(&mut image[14..16], u64::from(sum));
    for (at, value) in [
        (0x10, vendor),
        (0x14, product),
        (0x18, revision),
        (0x1c, serial),
    ] {
        put(&mut image[at..at + 4], u64::from(value));
    }
    if let Some(mailbox) = plan.mailbox {
        let fields = [
            mailbox.to_device.0,
            mailbox.to_device.1,
            mailbox.to_master.0,
            mailbox.to_master.1,
            COE,
        ];
        for (field, value) in fields.into_iter().enumerate() {
            put(
                &mut image[0x30 + 2 * field..0x32 + 2 * field],
                u64::from(value),
            );
        }
    }
    put(&mut image[0x7e..0x80], 1);
    image
}

/// The check sum over the configuration area: x⁸ + x² + x + 1, from ones.
fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0xff, |sum, byte| {
        (0..8).fold(sum ^ byte, |sum: u8, _| {
            if sum & 0x80 == 0 {
                sum << 1
            } else {
                sum << 1 ^ 7
            }
        })
    })
}

fn category(image: &mut Vec<u8>, number: u16, bytes: &[u8]) {
    if bytes.is_empty() {
        return;
    }
    image.extend(number.to_le_bytes());
    image.extend((bytes.len().div_ceil(2) as u16).to_le_bytes());
    image.extend(bytes);
    if !bytes.len().is_multiple_of(2) {
        image.push(0);
    }
}

fn strings(texts: &[&str]) -> Vec<u8> {
    let mut bytes = vec![texts.len() as u8];
    for text in texts {
        let text = &text.as_bytes()[..text.len().min(255)];
        bytes.push(text.len() as u8);
        bytes.extend(text);
    }
    bytes
}

fn general(plan: &Blueprint) -> Vec<u8> {
    let mut bytes = vec![0; 32];
    // Numbers of the strings of order and name.
    bytes[2] = 1;
    bytes[3] = 2;
    if let Some(mailbox) = plan.mailbox {
        bytes[5] = COE_DETAILS
            | if mailbox.complete_access {
                COMPLETE_ACCESS
            } else {
                0
            };
    }
    // What each port is, four bits each: 1 MII, 3 E-bus.
    for port in 0..4 {
        let kind = match plan.make.ports >> (2 * port) & 3 {
            3 => 1,
            2 => 3,
            _ => 0,
        };
        bytes[16 + port / 2] |= kind << (4 * (port % 2));
    }
    bytes
}

fn sync_managers(plan: &Blueprint) -> Vec<u8> {
    let mut bytes = vec![];
    let mut one = |start: u16, length: u16, control: u8, enable: u8, usage: u8| {
        bytes.extend(start.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend([control, 0, enable, usage]);
    };
    if let Some(mailbox) = plan.mailbox {
        one(mailbox.to_device.0, mailbox.to_device.1, 0x26, 1, 1);
        one(mailbox.to_master.0, mailbox.to_master.1, 0x22, 1, 2);
    }
    for process in &plan.process {
        let usage = if process.direction == Direction::ToDevice {
            3
        } else {
            4
        };
        one(
            process.start,
            process.length,
            process.control,
            u8::from(process.length > 0),
            usage,
        );
    }
    bytes
}

fn put_pdo(bytes: &mut Vec<u8>, pdo: &Pdo) {
    bytes.extend(pdo.index.to_le_bytes());
    bytes.extend([
        pdo.entries.len() as u8,
        pdo.manager.unwrap_or(0xff),
        0,
        0,
        0,
        0,
    ]);
    for entry in &pdo.entries {
        bytes.extend(entry.index.to_le_bytes());
        bytes.extend([entry.sub, 0, type_of(entry.bits), entry.bits, 0, 0]);
    }
}

/// The number of the unsigned type of so many bits.
pub(crate) fn type_of(bits: u8) -> u8 {
    match bits {
        1 => 1,
        8 => 5,
        16 => 6,
        32 => 7,
        2..8 => 0x2f + bits,
        _ => 0,
    }
}

/// What an image says that a device has; none of it where the image ends early.
pub(crate) struct Contents {
    pub(crate) identity: Identity,
    pub(crate) alias: u16,
    pub(crate) mailbox: Option<MailboxPlan>,
    pub(crate) process: Vec<ProcessPlan>,
    pub(crate) pdos: Vec<Pdo>,
}

/// Reads an image.
pub(crate) fn contents(image: &[u8]) -> Contents {
    let word = |at: usize| u16_at(image, 2 * at);
    let long = |at: usize| u32_at(image, 2 * at);
    let mut contents = Contents {
        identity: Identity {
            vendor: long(8),
            product: long(10),
            revision: long(12),
            serial: long(14),
        },
        alias: word(4),
        mailbox: None,
        process: vec![],
        pdos: vec![],
    };
    let mut details = 0;
    let mut at = CATEGORIES;
    while at + 4 <= image.len() && u16_at(image, at) != END {
        let end = at + 4 + 2 * usize::from(u16_at(image, at + 2));
        let bytes = image.get(at + 4..end.min(image.len())).unwrap_or_default();
        match u16_at(image, at) {
            GENERAL => details = bytes.get(5).copied().unwrap_or(0),
            SYNC_MANAGERS => contents.process = processes(bytes),
            TX_PDO | RX_PDO => read_pdos(bytes, &mut contents.pdos),
            _ => {}
        }
        at = end;
    }
    if word(0x1c) & COE != 0 && word(0x19) > 0 {
        contents.mailbox = Some(MailboxPlan {
            to_device: (word(0x18), word(0x19)),
            to_master: (word(0x1a), word(0x1b)),
            complete_access: details & COMPLETE_ACCESS != 0,
        });
    }
    contents
}

fn processes(bytes: &[u8]) -> Vec<ProcessPlan> {
    let one = |(number, bytes): (usize, &[u8])| {
        let direction = match bytes[7] {
            3 => Direction::ToDevice,
            4 => Direction::ToMaster,
            // Some old devices state no usage: the control byte says who writes; a mailbox is none.
            0 if bytes[4] & 3 != 2 && bytes[4] & 4 != 0 => Direction::ToDevice,
            0 if bytes[4] & 3 != 2 => Direction::ToMaster,
            _ => return None,
        };
        let (start, length) = (u16_at(bytes, 0), u16_at(bytes, 2));
        Some(ProcessPlan {
            manager: number as u8,
            start,
            length,
            control: bytes[4],
            direction,
        })
    };
    bytes.chunks_exact(8).enumerate().filter_map(one).collect()
}

fn read_pdos(mut bytes: &[u8], pdos: &mut Vec<Pdo>) {
    while let Some((head, rest)) = bytes.split_at_checked(8) {
        let Some((entries, rest)) = rest.split_at_checked(8 * usize::from(head[2])) else {
            return;
        };
        let entry = |bytes: &[u8]| PdoEntry {
            index: u16_at(bytes, 0),
            sub: bytes[2],
            bits: bytes[5],
        };
        pdos.push(Pdo {
            index: u16_at(head, 0),
            manager: (head[3] < 16).then_some(head[3]),
            fixed: true,
            entries: entries.chunks_exact(8).map(entry).collect(),
        });
        bytes = rest;
    }
}
