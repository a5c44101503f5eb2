//! What a device does besides answering frames: states, mailbox, process data.

pub(crate) mod cycle;
pub(crate) mod dictionary;
pub(crate) mod mailbox;
pub(crate) mod process;
pub(crate) mod sdo;
mod sdo_information;
#[cfg(test)]
mod sdo_tests;
mod states;

use crate::al::{AlCode, AlState};
use crate::blueprint::Blueprint;
use crate::drive::Drive;
use crate::faults::SdoRefusal;
use dictionary::{Access, Dictionary, Kind};
use mailbox::Mailbox;
use process::Mapping;

/// The firmware of a device.
#[derive(Clone, Debug, Default)]
pub(crate) struct Firmware {
    pub(crate) state: AlState,
    pub(crate) code: Option<AlCode>,
    /// A change of state that is under way.
    change: Option<states::Change>,
    pub(crate) dictionary: Dictionary,
    mailbox: Option<Mailbox>,
    /// When the message in the mailbox is answered.
    mail_due_ns: Option<u64>,
    pub(crate) mappings: Vec<Mapping>,
    pub(crate) drive: Option<Drive>,
    sync: cycle::SyncWatch,
    pub(crate) trouble: Trouble,
    pub(crate) counters: Counters,
}

/// What is wrong with a device, as faults set it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trouble {
    /// States that it refuses, with the code.
    pub(crate) refused: Vec<(AlState, AlCode)>,
    /// States that it never answers for.
    pub(crate) hanging: Vec<AlState>,
    /// Entries that it refuses.
    pub(crate) sdos: Vec<SdoRefusal>,
    /// Its mailbox takes messages and answers none.
    pub(crate) silent: bool,
    /// So many of its next answers have an emergency message before them, with this code.
    pub(crate) emergencies: (u32, u16),
    /// It does not see process data.
    pub(crate) deaf: bool,
}

/// What was counted of a device since power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Process data that came in.
    pub outputs: u64,
    /// SYNC0 while the device takes process data.
    pub sync0: u64,
    /// Those of them before which no new process data had come.
    pub sync0_without_outputs: u64,
    /// How often the watchdog of the process data ran out.
    pub watchdog: u64,
}

impl Firmware {
    /// The firmware of a device at power-on.
    pub(crate) fn new(plan: &Blueprint) -> Self {
        let mut dictionary = Dictionary::default();
        // What is there first stays: a file may describe any object otherwise.
        for object in &plan.objects {
            dictionary.add_value(object);
        }
        let identity = plan.identity;
        dictionary.name(0x1000, "device type");
        dictionary.add(
            0x1000,
            0,
            Kind::U32,
            Access::ReadOnly,
            if plan.drive.is_some() {
                0x0002_0192
            } else {
                0x1389
            },
        );
        for (index, name, text) in [
            (0x1008, "device name", &plan.order),
            (0x1009, "hardware version", &plan.name),
        ] {
            dictionary.name(index, name);
            dictionary.add_text(index, text);
        }
        dictionary.name(0x100A, "software version");
        dictionary.add_text(0x100A, env!("CARGO_PKG_VERSION"));
        dictionary.name(0x1018, "identity");
        dictionary.add(0x1018, 0, Kind::U8, Access::ReadOnly, 4);
        let numbers = [
            identity.vendor,
            identity.product,
            identity.revision,
            identity.serial,
        ];
        for (sub, number) in (1..).zip(numbers) {
            dictionary.add(0x1018, sub, Kind::U32, Access::ReadOnly, i64::from(number));
        }
        if let Some(drive) = &plan.drive {
            Drive::describe(drive, &mut dictionary);
        }
        process::describe(plan, &mut dictionary);
        let drive = plan
            .drive
            .as_ref()
            .and_then(|drive| Drive::new(drive, &dictionary));
        Self {
            dictionary,
            drive,
            mailbox: plan.mailbox.map(|_| Mailbox::default()),
            ..Self::default()
        }
    }
}
