//! Objects of a device, read and written by SDO.

use ethercrab::error::{CoeAbortCode, Error, MailboxError};
use std::future::poll_fn;
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::pin::pin;
use std::task::{Context, Poll};

use ethercrab::{SubDevice, SubDeviceRef};
use ethercrab_wire::WireError;

use crate::map::{Entry, Map};
use crate::requests::Request;
use crate::survey::Value;

/// How often an SDO is asked for again behind an emergency message, which `ethercrab` takes for its answer, and behind a frame whose
/// answer was late: `ethercrab` sends that again, and the device does not take what stands in its mailbox already.
pub(crate) const MAX_REPEATS: u32 = 4;

/// Most entries of a mapping that are read: 64 would be 256 bytes.
const MAX_ENTRIES: u8 = 64;

/// The objects of one device; its words name it.
pub(crate) struct Objects<'a, 'm, S = &'a SubDevice> {
    pub(crate) device: &'a SubDeviceRef<'m, S>,
    pub(crate) called: &'a str,
}

/// Asks again where an emergency message came in between, or the mailbox was taken.
macro_rules! patiently {
    ($sdo:expr) => {{
        let mut left = MAX_REPEATS;
        loop {
            match caught($sdo).await {
                Err(error) if left > 0 && may_pass(&error) => left -= 1,
                other => break other,
            }
        }
    }};
}

/// Whether the same question may be answered when it is asked again: something else came in between, the mailbox was taken, or
/// the answer was that of a question that had been asked twice.
pub(crate) fn may_pass(error: &Error) -> bool {
    matches!(
        error,
        Error::Mailbox(MailboxError::Emergency { .. } | MailboxError::SdoResponseInvalid { .. })
            | Error::WorkingCounter { .. }
    )
}

/// An emergency message where an answer was awaited. Its code is gone with it; a drive's fault code is told by the drive's state.
fn no_answer() -> Error {
    Error::Mailbox(MailboxError::Emergency {
        error_code: 0,
        error_register: 0,
    })
}

/// What `sdo` comes to. An emergency message that comes between the question and its answer is looked at by `ethercrab` (0.7.1) as if it
/// were the answer: the low bits of its code make no command, or they do, and then an assertion fails. Both are told as the error that
/// the lines behind that assertion would have made of it.
pub(crate) async fn caught<T>(sdo: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
    let mut sdo = pin!(sdo);
    let look = |context: &mut Context<'_>| {
        // Nothing of it is used again: what it has borrowed of the frames is given back as it is dropped.
        let polled = catch_unwind(AssertUnwindSafe(|| sdo.as_mut().poll(context)));
        match polled {
            Ok(Poll::Ready(Err(Error::Wire(WireError::InvalidValue)))) => {
                Poll::Ready(Err(no_answer()))
            }
            Ok(other) => other,
            Err(panic) => {
                let words = panic.downcast_ref::<String>();
                if words.is_some_and(|words| words.contains("Emergency")) {
                    Poll::Ready(Err(no_answer()))
                } else {
                    resume_unwind(panic)
                }
            }
        }
    };
    poll_fn(look).await
}

impl<S: Deref<Target = SubDevice>> Objects<'_, '_, S> {
    fn failed(&self, doing: &str, index: u16, sub: u8, error: &Error) -> String {
        let why = match error {
            Error::Mailbox(MailboxError::Aborted { code, .. }) => format!("it refuses: {code}"),
            Error::Mailbox(MailboxError::Emergency { .. }) => {
                "it sends an emergency message in place of each answer, or what is no answer"
                    .to_string()
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

    /// Does what is asked: reads an object, or writes it and reads it back.
    pub(crate) async fn ask(&self, request: &Request) -> Result<Value, String> {
        let (index, sub) = (request.object.index, request.object.sub);
        let Some(value) = request.value else {
            return self.read_any(index, sub).await;
        };
        let bytes = usize::from(value.bits / 8);
        self.write_and_judge(index, sub, value.number, bytes)
            .await?;
        Ok(value)
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
