//! From a description to what a device is built from.

use crate::blueprint::{Blueprint, Identity, MailboxPlan, Pdo, PdoEntry, ProcessPlan};
use crate::description::{DescriptionError, DeviceDescription, Kind};
use crate::drive;
use crate::esc::sync_manager::Direction;
use crate::esc::{Clocking, MAX_UNITS};
use crate::sii;

/// Vendor of terminals.
const BECKHOFF: u32 = 2;
/// Where outputs of a terminal without firmware lie, where its inputs lie.
const SIMPLE_OUTPUTS: u16 = 0x0F00;
const SIMPLE_INPUTS: u16 = 0x1000;
/// Bytes of a mailbox, unless stated, and least and most: a header and an SDO; one frame.
const MAILBOX_BYTES: u16 = 128;
const MIN_MAILBOX_BYTES: u16 = 24;
const MAX_MAILBOX_BYTES: u16 = 1024;
/// Most channels of a terminal.
const MAX_CHANNELS: u8 = 64;
/// Control of a buffer that the master writes, watched; of one that it reads.
const OUTPUTS_WATCHED: u8 = 0x64;
const OUTPUTS_SIMPLE: u8 = 0x44;
const INPUTS: u8 = 0x20;
const INPUTS_SIMPLE: u8 = 0x00;

impl DeviceDescription {
    /// What the device number `device` of a bus is built from.
    pub(crate) fn blueprint(&self, device: usize) -> Result<Blueprint, DescriptionError> {
        let wrong = |cause: String| DescriptionError::Device { device, cause };
        if self
            .channels
            .is_some_and(|channels| channels == 0 || channels > MAX_CHANNELS)
        {
            return Err(wrong(format!("channels is 1 to {MAX_CHANNELS}")));
        }
        if !(-10_000.0..=10_000.0).contains(&self.drift_ppm) {
            return Err(wrong("drift_ppm is -10000 to 10000".to_string()));
        }
        if self
            .fmmus
            .max(self.sync_managers)
            .is_some_and(|units| usize::from(units) > MAX_UNITS)
        {
            return Err(wrong(format!(
                "fmmus and sync_managers are at most {MAX_UNITS}"
            )));
        }
        let bytes = self.mailbox_bytes.unwrap_or(MAILBOX_BYTES);
        if !(MIN_MAILBOX_BYTES..=MAX_MAILBOX_BYTES).contains(&bytes) {
            return Err(wrong(format!(
                "mailbox_bytes is {MIN_MAILBOX_BYTES} to {MAX_MAILBOX_BYTES}"
            )));
        }
        let mut plan = match self.kind {
            Kind::Coupler => self.coupler(),
            Kind::DigitalInputs => self.digital(Direction::ToMaster),
            Kind::DigitalOutputs => self.digital(Direction::ToDevice),
            Kind::AnalogInputs => self.analog(Direction::ToMaster),
            Kind::AnalogOutputs => self.analog(Direction::ToDevice),
            Kind::Drive => {
                self.drive.judge().map_err(wrong)?;
                self.drive()
            }
            Kind::Image => self.of_image().map_err(wrong)?,
        };
        self.overrule(&mut plan);
        Ok(plan)
    }

    fn named(&self, kind: &str) -> String {
        if self.name.is_empty() {
            kind.to_string()
        } else {
            self.name.clone()
        }
    }

    fn overrule(&self, plan: &mut Blueprint) {
        let identity = &mut plan.identity;
        identity.vendor = self.vendor.unwrap_or(identity.vendor);
        identity.product = self.product.unwrap_or(identity.product);
        identity.revision = self.revision.unwrap_or(identity.revision);
        if self.serial != 0 {
            identity.serial = self.serial;
        }
        if self.alias != 0 {
            plan.alias = self.alias;
        }
        plan.make.fmmus = self.fmmus.unwrap_or(plan.make.fmmus);
        plan.make.sync_managers = self.sync_managers.unwrap_or(plan.make.sync_managers);
        plan.make.clocking = self.clocking.unwrap_or(plan.make.clocking);
        plan.make.features = self.features.or(plan.make.features);
        plan.objects.clone_from(&self.objects);
        plan.wide_sii = self.wide_sii.unwrap_or(plan.wide_sii);
        if let (Some(mailbox), Some(complete)) = (&mut plan.mailbox, self.complete_access) {
            mailbox.complete_access = complete;
        }
    }

    fn coupler(&self) -> Blueprint {
        let identity = Identity {
            vendor: BECKHOFF,
            product: 0x044C_2C52,
            revision: 0x0012_0000,
            serial: 0,
        };
        let mut plan = Blueprint::plain(self.named("coupler"), "EK1100", identity);
        plan.make.sync_managers = 4;
        plan.make.fmmus = 3;
        // It has a clock that others can follow, and no SYNC0.
        plan.make.features = Some(0x00FC);
        plan
    }

    fn digital(&self, direction: Direction) -> Blueprint {
        let channels = self.channels.unwrap_or(8);
        let inputs = direction == Direction::ToMaster;
        let (kind, order, product) = if inputs {
            ("inputs", "EL1008", 0x03F0_3052)
        } else {
            ("outputs", "EL2008", 0x07D8_3052)
        };
        let identity = Identity {
            vendor: BECKHOFF,
            product,
            revision: 0x0011_0000,
            serial: 0,
        };
        let mut plan = Blueprint::plain(self.named(kind), order, identity);
        let (start, control) = if inputs {
            (SIMPLE_INPUTS, INPUTS_SIMPLE)
        } else {
            (SIMPLE_OUTPUTS, OUTPUTS_SIMPLE)
        };
        plan.process = vec![ProcessPlan {
            manager: 0,
            start,
            length: 0,
            control,
            direction,
        }];
        let (first_pdo, first_object) = if inputs {
            (0x1A00, 0x6000)
        } else {
            (0x1600, 0x7000)
        };
        let pdo = |channel: u8| {
            let entry = PdoEntry {
                index: first_object + 0x10 * u16::from(channel),
                sub: 1,
                bits: 1,
            };
            Pdo {
                index: first_pdo + u16::from(channel),
                manager: Some(0),
                fixed: true,
                entries: vec![entry],
            }
        };
        plan.pdos = (0..channels).map(pdo).collect();
        plan.make.clocking = Clocking::Delays;
        plan.measure();
        plan
    }

    fn with_mailbox(&self, plan: &mut Blueprint) {
        let bytes = self.mailbox_bytes.unwrap_or(MAILBOX_BYTES);
        let complete_access = true;
        plan.mailbox = Some(MailboxPlan {
            to_device: (0x1000, bytes),
            to_master: (0x1400, bytes),
            complete_access,
        });
        plan.simple = false;
        plan.process = vec![
            ProcessPlan {
                manager: 2,
                start: 0x1800,
                length: 0,
                control: OUTPUTS_WATCHED,
                direction: Direction::ToDevice,
            },
            ProcessPlan {
                manager: 3,
                start: 0x1C00,
                length: 0,
                control: INPUTS,
                direction: Direction::ToMaster,
            },
        ];
    }

    fn analog(&self, direction: Direction) -> Blueprint {
        let channels = self.channels.unwrap_or(4);
        let inputs = direction == Direction::ToMaster;
        let (kind, order, product) = if inputs {
            ("analog inputs", "EL3004", 0x0BBC_3052)
        } else {
            ("analog outputs", "EL4004", 0x0FA4_3052)
        };
        let identity = Identity {
            vendor: BECKHOFF,
            product,
            revision: 0x0014_0000,
            serial: 0,
        };
        let mut plan = Blueprint::plain(self.named(kind), order, identity);
        self.with_mailbox(&mut plan);
        let entry = |index: u16, sub, bits| PdoEntry { index, sub, bits };
        let pdo = |channel: u8| {
            let channel = u16::from(channel);
            // Of an input: under range, over range, two limits, error, a gap, state of the value, toggle, the value.
            let object = 0x6000 + 0x10 * channel;
            let status = [(1, 1), (2, 1), (3, 2), (5, 2), (7, 1)]
                .map(|(sub, bits)| entry(object, sub, bits));
            let (index, entries) = if inputs {
                let rest = [
                    entry(0, 0, 7),
                    entry(object, 0x0f, 1),
                    entry(object, 0x10, 1),
                    entry(object, 0x11, 16),
                ];
                (0x1A00 + channel, [&status[..], &rest[..]].concat())
            } else {
                (
                    0x1600 + channel,
                    vec![entry(0x7000 + 0x10 * channel, 1, 16)],
                )
            };
            Pdo {
                index,
                manager: Some(if inputs { 3 } else { 2 }),
                fixed: true,
                entries,
            }
        };
        plan.pdos = (0..channels).map(pdo).collect();
        plan.measure();
        plan
    }

    fn drive(&self) -> Blueprint {
        let identity = Identity {
            vendor: 0x0E1A,
            product: 0x0402,
            revision: 1,
            serial: 0,
        };
        let mut plan = Blueprint::plain(self.named("drive"), "TANDEM-402", identity);
        self.with_mailbox(&mut plan);
        plan.pdos = drive::default_pdos();
        plan.drive = Some(self.drive.clone());
        plan.measure();
        plan
    }

    fn of_image(&self) -> Result<Blueprint, String> {
        if self.image.len() < 0x80 {
            return Err("image has at least 128 bytes".to_string());
        }
        let contents = sii::contents(&self.image);
        let mut plan = Blueprint::plain(self.named("device"), "", contents.identity);
        plan.alias = contents.alias;
        plan.simple = contents.mailbox.is_none();
        plan.mailbox = contents.mailbox;
        plan.process = contents.process;
        plan.pdos = contents.pdos;
        plan.image = Some(self.image.clone());
        Ok(plan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_into_a_sii_is_read_out_of_it() {
        let kinds = [
            Kind::Coupler,
            Kind::DigitalInputs,
            Kind::DigitalOutputs,
            Kind::AnalogInputs,
            Kind::Drive,
        ];
        for kind in kinds {
            let mut description = DeviceDescription::new(kind);
            description.alias = 1001;
            description.serial = 77;
            let plan = description.blueprint(0).unwrap();
            let contents = sii::contents(&sii::image(&plan));
            assert_eq!(contents.identity, plan.identity, "{kind:?}");
            assert_eq!(contents.alias, 1001);
            assert_eq!(contents.mailbox, plan.mailbox);
            assert_eq!(without_mailboxes(contents.process), plan.process);
            let mut pdos = plan.pdos;
            pdos.sort_by_key(|pdo| std::cmp::Reverse(pdo.index));
            let mut found = contents.pdos;
            found.sort_by_key(|pdo| std::cmp::Reverse(pdo.index));
            let bare = |pdos: Vec<Pdo>| {
                pdos.into_iter()
                    .map(|pdo| Pdo { fixed: true, ..pdo })
                    .collect::<Vec<_>>()
            };
            assert_eq!(bare(found), bare(pdos));
        }
    }

    fn without_mailboxes(process: Vec<ProcessPlan>) -> Vec<ProcessPlan> {
        process
            .into_iter()
            .filter(|plan| plan.control & 3 != 2)
            .collect()
    }

    #[test]
    fn what_cannot_be_built_is_refused() {
        let mut description = DeviceDescription::new(Kind::DigitalInputs);
        description.channels = Some(0);
        let refused = description.blueprint(3).unwrap_err().to_string();
        assert_eq!(refused, "device 3: channels is 1 to 64");
    }
}
