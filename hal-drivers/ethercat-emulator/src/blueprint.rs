//! What a device is made of, whatever it was described by.

use crate::description::{Clocking, ObjectDescription};
use crate::drive::DriveDescription;
use crate::esc::Make;
use crate::esc::sync_manager::Direction;

/// Everything that a device is built from at power-on.
#[derive(Clone, Debug)]
pub(crate) struct Blueprint {
    pub(crate) name: String,
    /// What the device calls itself in its SII and its dictionary.
    pub(crate) order: String,
    pub(crate) identity: Identity,
    pub(crate) alias: u16,
    pub(crate) make: Make,
    pub(crate) wide_sii: bool,
    /// The SII as it is, where it was given; made from the rest otherwise.
    pub(crate) image: Option<Vec<u8>>,
    pub(crate) mailbox: Option<MailboxPlan>,
    /// Sync managers of process data, with their numbers.
    pub(crate) process: Vec<ProcessPlan>,
    pub(crate) pdos: Vec<Pdo>,
    pub(crate) drive: Option<DriveDescription>,
    pub(crate) objects: Vec<ObjectDescription>,
    /// Whether the master's outputs are taken, and the states followed, without firmware.
    pub(crate) simple: bool,
}

/// Who made what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Vendor, as ETG gives it out.
    pub vendor: u32,
    /// Product of that vendor.
    pub product: u32,
    /// Revision of the product.
    pub revision: u32,
    /// Serial number.
    pub serial: u32,
}

/// Mailboxes as the SII states them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MailboxPlan {
    pub(crate) to_device: (u16, u16),
    pub(crate) to_master: (u16, u16),
    pub(crate) complete_access: bool,
}

/// A sync manager of process data as the SII states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ProcessPlan {
    pub(crate) manager: u8,
    pub(crate) start: u16,
    pub(crate) length: u16,
    pub(crate) control: u8,
    pub(crate) direction: Direction,
}

/// A process data object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pdo {
    pub(crate) index: u16,
    /// The sync manager that carries it from the start; none where it is only offered.
    pub(crate) manager: Option<u8>,
    /// Whether its entries can be changed by the master.
    pub(crate) fixed: bool,
    pub(crate) entries: Vec<PdoEntry>,
}

/// An entry of a process data object; index 0 is a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PdoEntry {
    pub(crate) index: u16,
    pub(crate) sub: u8,
    pub(crate) bits: u8,
}

impl Pdo {
    pub(crate) fn direction(&self) -> Direction {
        if (0x1A00..0x1C00).contains(&self.index) {
            Direction::ToMaster
        } else {
            Direction::ToDevice
        }
    }

    pub(crate) fn bits(&self) -> usize {
        self.entries
            .iter()
            .map(|entry| usize::from(entry.bits))
            .sum()
    }
}

impl Blueprint {
    /// The size of each sync manager's process data follows from what it carries from the start.
    pub(crate) fn measure(&mut self) {
        for plan in &mut self.process {
            let carried = self
                .pdos
                .iter()
                .filter(|pdo| pdo.manager == Some(plan.manager));
            plan.length = carried.map(Pdo::bits).sum::<usize>().div_ceil(8) as u16;
        }
    }

    /// A device without process data and mailbox, as a coupler is.
    pub(crate) fn plain(name: String, order: &str, identity: Identity) -> Self {
        Self {
            name,
            order: order.to_string(),
            identity,
            alias: 0,
            make: Make {
                kind: 0x11,
                revision: 0,
                build: 2,
                fmmus: 8,
                sync_managers: 8,
                ram_kib: 8,
                ports: 0x0f,
                clocking: Clocking::Bits64,
                features: None,
            },
            wide_sii: true,
            image: None,
            mailbox: None,
            process: vec![],
            pdos: vec![],
            drive: None,
            objects: vec![],
            simple: true,
        }
    }
}
