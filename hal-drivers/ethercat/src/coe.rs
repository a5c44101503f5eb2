//! Objects of a device, read and written by SDO.

use ethercrab::error::{CoeAbortCode, Error, MailboxError};
use std::ops::Deref;

use ethercrab::{SubDevice, SubDeviceRef};

use crate::map::{Entry, Map};
use crate::survey::Value;

/// How often an SDO is asked for again behind an emergency message, which `ethercrab` takes for its answer.
const EMERGENCIES: u32 = 4;

/// Most entries of a mapping that are read: 64 would be 256 bytes.
const MAX_ENTRIES: u8 = 64;

/// The objects of one device; its words name it.
pub(crate) struct Objects<'a, 'm, S = &'a SubDevice> {
    pub(crate) device: &'a SubDeviceRef<'m, S>,
    pub(crate) called: &'a str,
}

/// Asks again where an emergency message came in between.
macro_rules! patiently {
    ($sdo:expr) => {{
        let mut left = EMERGENCIES;
        loop {
            match $sdo.await {
                Err(Error::Mailbox(MailboxError::Emergency { .. })) if left > 0 => left -= 1,
                other => break other,
            }
        }
    }};
}

impl<S: Deref<Target = SubDevice>> Objects<'_, '_, S> {
    fn failed(&self, doing: &str, index: u16, sub: u8, error: &Error) -> String {
        let why = match error {
            Error::Mailbox(MailboxError::Aborted { code, .. }) => format!("it refuses: {code}"),
            Error::Mailbox(MailboxError::Emergency { error_code, .. }) => {
                format!("it only sends emergency messages, the last with code {error_code:#06x}")
            }
            Error::Timeout(_) => "its mailbox does not answer".to_string(),
            other => other.to_string(),
        };
        format!("{}: {doing} {index:04X}:{sub:02X}: {why}", self.called)
    }

    /// Reads a number of so many bytes, without a sign.
    pub(crate) async fn read(&self, index: u16, sub: u8, bytes: usize) -> Result<u32, String> {
        let value = match bytes {
            1 => patiently!(self.device.sdo_read::<u8>(index, sub)).map(u32::from),
            2 => patiently!(self.device.sdo_read::<u16>(index, sub)).map(u32::from),
            _ => patiently!(self.device.sdo_read::<u32>(index, sub)),
        };
        value.map_err(|error| self.failed("reading", index, sub, &error))
    }

    /// Reads a number of as many bytes as the device gives.
    pub(crate) async fn read_any(&self, index: u16, sub: u8) -> Result<Value, String> {
        let mut refused = String::new();
        for bytes in [4_u8, 2, 1] {
            match self.read(index, sub, usize::from(bytes)).await {
                Ok(number) => {
                    return Ok(Value {
                        number,
                        bits: bytes * 8,
                    });
                }
                Err(words) => refused = words,
            }
        }
        Err(refused)
    }

    /// Reads a number where the device has the object.
    pub(crate) async fn read_if_there(
        &self,
        index: u16,
        sub: u8,
        bytes: usize,
    ) -> Result<Option<u32>, String> {
        let value = match bytes {
            1 => patiently!(self.device.sdo_read::<u8>(index, sub)).map(u32::from),
            2 => patiently!(self.device.sdo_read::<u16>(index, sub)).map(u32::from),
            _ => patiently!(self.device.sdo_read::<u32>(index, sub)),
        };
        match value {
            Ok(value) => Ok(Some(value)),
            Err(Error::Mailbox(MailboxError::Aborted {
                code: CoeAbortCode::NotFound | CoeAbortCode::SubIndexNotFound,
                ..
            })) => Ok(None),
            Err(error) => Err(self.failed("reading", index, sub, &error)),
        }
    }

    /// Writes a number of so many bytes.
    pub(crate) async fn write(
        &self,
        index: u16,
        sub: u8,
        value: u32,
        bytes: usize,
    ) -> Result<(), String> {
        let written = match bytes {
            1 => patiently!(self.device.sdo_write(index, sub, value as u8)),
            2 => patiently!(self.device.sdo_write(index, sub, value as u16)),
            _ => patiently!(self.device.sdo_write(index, sub, value)),
        };
        written.map_err(|error| self.failed("writing", index, sub, &error))
    }

    /// Writes a number and reads it back.
    pub(crate) async fn write_and_judge(
        &self,
        index: u16,
        sub: u8,
        value: u32,
        bytes: usize,
    ) -> Result<(), String> {
        self.write(index, sub, value, bytes).await?;
        let now = self.read(index, sub, bytes).await?;
        if now == value {
            return Ok(());
        }
        Err(format!(
            "{}: {index:04X}:{sub:02X} was written as {value:#x} and reads {now:#x}",
            self.called
        ))
    }

    /// Maps objects: `assignment` is 1C12 or 1C13, `mapping` 1600 or 1A00.
    pub(crate) async fn map(
        &self,
        assignment: u16,
        mapping: u16,
        entries: &[Entry],
    ) -> Result<(), String> {
        self.write(assignment, 0, 0, 1).await?;
        self.write(mapping, 0, 0, 1).await?;
        for (sub, entry) in (1..).zip(entries) {
            let mapped = self.write(mapping, sub, entry.word(), 4).await;
            mapped.map_err(|error| {
                format!("{error} (object {:04X}; map = \"device\" takes what the device maps by itself)", entry.index)
            })?;
        }
        self.write(mapping, 0, entries.len() as u32, 1).await?;
        self.write(assignment, 1, u32::from(mapping), 2).await?;
        self.write(assignment, 0, 1, 1).await
    }

    /// What is mapped.
    pub(crate) async fn mapped(&self, assignment: u16) -> Result<Map, String> {
        let mut map = Map::default();
        let mappings = self.read(assignment, 0, 1).await? as u8;
        for assigned in 1..=mappings.min(MAX_ENTRIES) {
            let mapping = self.read(assignment, assigned, 2).await? as u16;
            let entries = self.read(mapping, 0, 1).await? as u8;
            for sub in 1..=entries.min(MAX_ENTRIES) {
                map.0.push(Entry::of(self.read(mapping, sub, 4).await?));
            }
        }
        Ok(map)
    }
}
