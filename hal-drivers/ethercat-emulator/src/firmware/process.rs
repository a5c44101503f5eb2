//! Process data: which entries of the dictionary lie where in a sync manager's buffer.

use super::dictionary::{Abort, Access, Dictionary, Kind, Slot};
use crate::blueprint::{Blueprint, Pdo, ProcessPlan};
use crate::bytes::{copy_bits, u16_at, u32_at};
use crate::esc::sync_manager::Direction;

/// Entries of a process data object, and objects of an assignment, at most.
pub(crate) const MAX_ENTRIES: u8 = 24;
/// Most bytes of the process data of one sync manager.
const MAX_BYTES: usize = 1024;
/// The assignment of sync manager 0; the others follow.
const ASSIGNMENT: u16 = 0x1C10;

/// Entries in the buffer of one sync manager.
#[derive(Clone, Debug)]
pub(crate) struct Mapping {
    pub(crate) manager: usize,
    pub(crate) direction: Direction,
    pub(crate) bytes: usize,
    parts: Vec<Part>,
}

#[derive(Clone, Copy, Debug)]
struct Part {
    bit: usize,
    bits: usize,
    slot: Slot,
}

/// Whether an object is an assignment or a mapping, whose entries count only up to what sub-index 0 says.
pub(crate) fn is_list(index: u16) -> bool {
    is_assignment(index) || is_mapping(index)
}

fn is_assignment(index: u16) -> bool {
    (ASSIGNMENT..ASSIGNMENT + 16).contains(&index)
}

fn is_mapping(index: u16) -> bool {
    (0x1600..0x1C00).contains(&index)
}

fn direction_of(index: u16) -> Direction {
    if index >= 0x1A00 {
        Direction::ToMaster
    } else {
        Direction::ToDevice
    }
}

/// Adds assignments, mappings and the mapped entries themselves to a dictionary.
pub(crate) fn describe(plan: &Blueprint, dictionary: &mut Dictionary) {
    let types = if plan.mailbox.is_some() {
        vec![1, 2]
    } else {
        vec![]
    };
    let mut types: Vec<(u8, i64)> = (0..).zip(types).collect();
    for process in &plan.process {
        types.push((
            process.manager,
            if process.direction == Direction::ToDevice {
                3
            } else {
                4
            },
        ));
        let index = ASSIGNMENT + u16::from(process.manager);
        let carried: Vec<u16> = plan
            .pdos
            .iter()
            .filter(|pdo| pdo.manager == Some(process.manager))
            .map(|pdo| pdo.index)
            .collect();
        dictionary.name(index, "PDO assignment");
        dictionary.add(
            index,
            0,
            Kind::U8,
            Access::Setup,
            i64::from(carried.len() as u8),
        );
        for sub in 1..=MAX_ENTRIES.max(carried.len() as u8) {
            let pdo = carried.get(usize::from(sub) - 1).copied().unwrap_or(0);
            dictionary.add(index, sub, Kind::U16, Access::Setup, i64::from(pdo));
        }
    }
    if let Some(last) = types.iter().map(|(manager, _)| manager + 1).max() {
        dictionary.name(0x1C00, "sync manager types");
        dictionary.add(0x1C00, 0, Kind::U8, Access::ReadOnly, i64::from(last));
        for manager in 0..last {
            let usage = types
                .iter()
                .find(|(number, _)| *number == manager)
                .map_or(0, |(_, usage)| *usage);
            dictionary.add(0x1C00, manager + 1, Kind::U8, Access::ReadOnly, usage);
        }
    }
    for pdo in &plan.pdos {
        describe_pdo(pdo, dictionary);
    }
}

fn describe_pdo(pdo: &Pdo, dictionary: &mut Dictionary) {
    let access = if pdo.fixed {
        Access::ReadOnly
    } else {
        Access::Setup
    };
    dictionary.name(pdo.index, "PDO mapping");
    dictionary.add(
        pdo.index,
        0,
        Kind::U8,
        access,
        i64::from(pdo.entries.len() as u8),
    );
    let room = if pdo.fixed {
        pdo.entries.len() as u8
    } else {
        MAX_ENTRIES
    };
    for sub in 1..=room {
        let entry = pdo.entries.get(usize::from(sub) - 1);
        let mapped = entry.map_or(0, |e| {
            i64::from(e.index) << 16 | i64::from(e.sub) << 8 | i64::from(e.bits)
        });
        dictionary.add(pdo.index, sub, Kind::U32, access, mapped);
    }
    let access = if pdo.direction() == Direction::ToDevice {
        Access::ReadWrite
    } else {
        Access::ReadOnly
    };
    for entry in pdo.entries.iter().filter(|entry| entry.index != 0) {
        let kind = match entry.bits {
            16 => Kind::I16,
            32 => Kind::I32,
            bits => Kind::Bits(bits),
        };
        dictionary.add(
            entry.index,
            0,
            Kind::U8,
            Access::ReadOnly,
            i64::from(entry.sub),
        );
        dictionary.add(entry.index, entry.sub, kind, access, 0);
    }
}

/// What the assignments and mappings say now; none where it is too long.
pub(crate) fn mappings(process: &[ProcessPlan], dictionary: &Dictionary) -> Option<Vec<Mapping>> {
    process
        .iter()
        .map(|plan| mapping(*plan, dictionary))
        .collect()
}

fn mapping(plan: ProcessPlan, dictionary: &Dictionary) -> Option<Mapping> {
    let assignment = ASSIGNMENT + u16::from(plan.manager);
    let (mut bit, mut parts) = (0, vec![]);
    for sub in 1..=dictionary.number(assignment, 0).min(u64::from(u8::MAX)) as u8 {
        let pdo = dictionary.number(assignment, sub) as u16;
        for sub in 1..=dictionary.number(pdo, 0).min(u64::from(u8::MAX)) as u8 {
            let entry = dictionary.number(pdo, sub) as u32;
            let index = (entry >> 16) as u16;
            let sub = (entry >> 8) as u8;
            let bits = (entry & 0xff) as usize;
            // What is mapped and not there, as in a device that only its SII describes, takes its place and no value.
            parts.extend(
                dictionary
                    .slot(index, sub)
                    .map(|slot| Part { bit, bits, slot }),
            );
            bit += bits;
        }
    }
    let bytes = bit.div_ceil(8);
    (bytes <= MAX_BYTES).then_some(Mapping {
        manager: usize::from(plan.manager),
        direction: plan.direction,
        bytes,
        parts,
    })
}

impl Mapping {
    /// Takes what the master sent into the dictionary.
    pub(crate) fn unpack(&self, buffer: &[u8], dictionary: &mut Dictionary) {
        for part in &self.parts {
            copy_bits(
                buffer,
                part.bit,
                &mut dictionary.entry_mut(part.slot).value,
                0,
                part.bits,
            );
        }
    }

    /// Puts what the master reads into a buffer.
    pub(crate) fn pack(&self, dictionary: &Dictionary, buffer: &mut [u8]) {
        for part in &self.parts {
            copy_bits(
                &dictionary.entry(part.slot).value,
                0,
                buffer,
                part.bit,
                part.bits,
            );
        }
    }

    /// Clears what the master sent, as outputs without a master are.
    pub(crate) fn clear(&self, dictionary: &mut Dictionary) {
        for part in &self.parts {
            dictionary.entry_mut(part.slot).value.fill(0);
        }
    }
}

/// Judges a write of an assignment or a mapping: it is emptied, filled, and counted, in this order.
pub(crate) fn judge_write(
    dictionary: &Dictionary,
    index: u16,
    sub: u8,
    data: &[u8],
    at_once: bool,
) -> Result<(), Abort> {
    let count = dictionary.number(index, 0);
    if sub > 0 && count > 0 && !at_once {
        return Err(Abort::STATE);
    }
    if sub == 0 {
        let asked = data[0];
        return if asked > MAX_ENTRIES {
            Err(Abort::VALUE)
        } else {
            judge_list(dictionary, index, asked)
        };
    }
    if is_assignment(index) {
        let pdo = u16_at(data, 0);
        let offered = pdo == 0 || is_mapping(pdo) && !dictionary.of_object(pdo).is_empty();
        let output = pdo < 0x1A00;
        let expected =
            dictionary.number(0x1C00, (index - ASSIGNMENT) as u8 + 1) == if output { 3 } else { 4 };
        return if offered && (expected || pdo == 0) {
            Ok(())
        } else {
            Err(Abort::NOT_MAPPABLE)
        };
    }
    judge_mapped(dictionary, index, u32_at(data, 0))
}

fn judge_mapped(dictionary: &Dictionary, pdo: u16, mapped: u32) -> Result<(), Abort> {
    let index = (mapped >> 16) as u16;
    let sub = (mapped >> 8) as u8;
    let bits = (mapped & 0xff) as usize;
    if index == 0 || (1..8).contains(&index) {
        // A gap.
        return Ok(());
    }
    let entry = dictionary.entry(dictionary.find(index, sub)?);
    let input = direction_of(pdo) == Direction::ToMaster;
    let process = (0x2000..0xA000).contains(&index);
    let allowed = process && (input || entry.access == Access::ReadWrite) && entry.bits() == bits;
    if allowed {
        Ok(())
    } else {
        Err(Abort::NOT_MAPPABLE)
    }
}

fn judge_list(dictionary: &Dictionary, index: u16, count: u8) -> Result<(), Abort> {
    let entry = |sub| dictionary.number(index, sub);
    if is_assignment(index) {
        let missing = (1..=count).any(|sub| entry(sub) == 0);
        return if missing {
            Err(Abort::NOT_MAPPABLE)
        } else {
            Ok(())
        };
    }
    let bits: u64 = (1..=count).map(|sub| entry(sub) & 0xff).sum();
    if bits > 8 * MAX_BYTES as u64 {
        Err(Abort::MAPPED_TOO_LONG)
    } else {
        Ok(())
    }
}
