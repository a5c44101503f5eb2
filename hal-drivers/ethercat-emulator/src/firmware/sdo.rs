//! The SDO server: reads and writes of the dictionary through the mailbox, whole, in segments, or an object at once.

use super::dictionary::{Abort, Access, Dictionary};
use super::process;
use super::sdo_information;
use crate::al::AlState;
use crate::bytes::{u16_at, u32_at};
use crate::drive;
use crate::faults::SdoRefusal;

/// Services of CAN over EtherCAT.
pub(super) const REQUEST: u16 = 2;
pub(super) const RESPONSE: u16 = 3;
pub(super) const INFORMATION: u16 = 8;
/// Where the data of a message begin: behind the service, behind command, index and sub-index too.
pub(super) const BODY: usize = 2;
const DATA: usize = 6;
/// Least bytes of an SDO message.
const SHORTEST: usize = 10;
/// Most bytes that a master may send to one entry.
const MAX_DOWNLOAD: usize = 4096;

/// What a request is judged by.
pub(crate) struct Context<'a> {
    pub(crate) dictionary: &'a mut Dictionary,
    pub(crate) state: AlState,
    /// Most bytes of an answer, without the mailbox header.
    pub(crate) room: usize,
    pub(crate) complete_access: bool,
    /// Entries that a fault refuses.
    pub(crate) refusals: &'a [SdoRefusal],
    pub(crate) is_drive: bool,
}

/// A transfer in segments that goes on.
#[derive(Clone, Debug)]
struct Transfer {
    index: u16,
    sub: u8,
    complete: bool,
    data: Vec<u8>,
    /// Bytes that are through, or that will come.
    at: usize,
    toggle: bool,
}

/// Serves one request at a time.
#[derive(Clone, Debug, Default)]
pub(crate) struct SdoServer {
    upload: Option<Transfer>,
    download: Option<Transfer>,
}

type Answer = Result<Vec<u8>, Abort>;

impl SdoServer {
    /// Answers a message of CAN over EtherCAT.
    pub(crate) fn serve(&mut self, message: &[u8], context: &mut Context) -> Vec<Vec<u8>> {
        match u16_at(message, 0) >> 12 {
            REQUEST if message.len() >= SHORTEST => {
                self.request(message, context).into_iter().collect()
            }
            INFORMATION => sdo_information::serve(message, context.dictionary, context.room),
            _ => vec![],
        }
    }

    fn request(&mut self, message: &[u8], context: &mut Context) -> Option<Vec<u8>> {
        let command = message[BODY];
        let (index, sub) = (u16_at(message, BODY + 1), message[BODY + 3]);
        let answer = match command >> 5 {
            0 => self.download_segment(message, context),
            1 => self.download(message, index, sub, context),
            2 => self.upload(command, index, sub, context),
            3 => self.upload_segment(command, context.room),
            4 => {
                *self = Self::default();
                return None;
            }
            _ => Err(Abort::COMMAND),
        };
        Some(answer.unwrap_or_else(|abort| {
            *self = Self::default();
            let mut refusal = head(REQUEST, 0x80, index, sub);
            refusal.extend(abort.0.to_le_bytes());
            refusal
        }))
    }

    fn upload(&mut self, command: u8, index: u16, sub: u8, context: &mut Context) -> Answer {
        let complete = command & 0x10 != 0;
        refused(context, index, sub)?;
        let data = if complete {
            read_object(context, index, sub)?
        } else {
            read_entry(context, index, sub)?
        };
        if data.len() <= 4 && !complete {
            let unused = 4 - data.len() as u8;
            let mut answer = head(RESPONSE, 0x43 | unused << 2, index, sub);
            answer.extend(&data);
            answer.resize(SHORTEST, 0);
            return Ok(answer);
        }
        let mut answer = head(RESPONSE, 0x41 | command & 0x10, index, sub);
        answer.extend((data.len() as u32).to_le_bytes());
        let at = data.len().min(context.room.saturating_sub(SHORTEST));
        answer.extend(&data[..at]);
        self.upload = (at < data.len()).then_some(Transfer {
            index,
            sub,
            complete,
            data,
            at,
            toggle: false,
        });
        Ok(answer)
    }

    fn upload_segment(&mut self, command: u8, room: usize) -> Answer {
        let transfer = self.upload.as_mut().ok_or(Abort::COMMAND)?;
        if (command & 0x10 != 0) != transfer.toggle {
            return Err(Abort::TOGGLE);
        }
        let rest = &transfer.data[transfer.at..];
        let now = rest.len().min(room.saturating_sub(BODY + 1).max(7));
        let last = now == rest.len();
        let unused = 7_usize.saturating_sub(now) as u8;
        let mut answer = (RESPONSE << 12).to_le_bytes().to_vec();
        answer.push(u8::from(transfer.toggle) << 4 | unused << 1 | u8::from(last));
        answer.extend(&rest[..now]);
        answer.resize(answer.len().max(SHORTEST), 0);
        transfer.at += now;
        transfer.toggle = !transfer.toggle;
        if last {
            self.upload = None;
        }
        Ok(answer)
    }

    fn download(&mut self, message: &[u8], index: u16, sub: u8, context: &mut Context) -> Answer {
        let command = message[BODY];
        let complete = command & 0x10 != 0;
        refused(context, index, sub)?;
        let answer = || {
            let mut answer = head(RESPONSE, 0x60, index, sub);
            answer.resize(SHORTEST, 0);
            answer
        };
        if command & 2 != 0 {
            let stated = if command & 1 != 0 {
                4 - usize::from(command >> 2 & 3)
            } else {
                4
            };
            write(context, index, sub, complete, &message[DATA..DATA + stated])?;
            return Ok(answer());
        }
        let size = u32_at(message, DATA) as usize;
        if size > MAX_DOWNLOAD {
            return Err(Abort::TOO_LONG);
        }
        let data = &message[SHORTEST..];
        if data.len() >= size {
            write(context, index, sub, complete, &data[..size])?;
        } else {
            let data = data.to_vec();
            self.download = Some(Transfer {
                index,
                sub,
                complete,
                data,
                at: size,
                toggle: false,
            });
        }
        Ok(answer())
    }

    fn download_segment(&mut self, message: &[u8], context: &mut Context) -> Answer {
        let command = message[BODY];
        let transfer = self.download.as_mut().ok_or(Abort::COMMAND)?;
        if (command & 0x10 != 0) != transfer.toggle {
            return Err(Abort::TOGGLE);
        }
        let data = &message[BODY + 1..];
        let unused = if data.len() <= 7 {
            usize::from(command >> 1 & 7)
        } else {
            0
        };
        transfer
            .data
            .extend(&data[..data.len().saturating_sub(unused)]);
        if transfer.data.len() > transfer.at {
            return Err(Abort::TOO_LONG);
        }
        let mut answer = (RESPONSE << 12).to_le_bytes().to_vec();
        answer.push(0x20 | u8::from(transfer.toggle) << 4);
        answer.resize(SHORTEST, 0);
        transfer.toggle = !transfer.toggle;
        if command & 1 != 0 {
            let Some(Transfer {
                index,
                sub,
                complete,
                data,
                at,
                ..
            }) = self.download.take()
            else {
                return Err(Abort::COMMAND);
            };
            if data.len() < at {
                return Err(Abort::TOO_SHORT);
            }
            write(context, index, sub, complete, &data)?;
        }
        Ok(answer)
    }
}

fn head(service: u16, command: u8, index: u16, sub: u8) -> Vec<u8> {
    let mut answer = (service << 12).to_le_bytes().to_vec();
    answer.push(command);
    answer.extend(index.to_le_bytes());
    answer.push(sub);
    answer
}

fn refused(context: &Context, index: u16, sub: u8) -> Result<(), Abort> {
    let refusal = context
        .refusals
        .iter()
        .find(|refusal| refusal.meets(index, sub));
    refusal.map_or(Ok(()), |refusal| Err(Abort(refusal.abort)))
}

fn read_entry(context: &Context, index: u16, sub: u8) -> Answer {
    let slot = context.dictionary.find(index, sub)?;
    if process::is_list(index) && u64::from(sub) > context.dictionary.number(index, 0) {
        return Err(Abort::NO_SUB);
    }
    Ok(context.dictionary.entry(slot).value.clone())
}

/// An object at once: the count in two bytes, then the entries one behind the other.
fn read_object(context: &Context, index: u16, sub: u8) -> Answer {
    if !context.complete_access || sub > 1 {
        return Err(Abort::UNSUPPORTED);
    }
    let entries = context.dictionary.of_object(index);
    let Some(count) = entries.first() else {
        return Err(Abort::NO_OBJECT);
    };
    if entries.len() == 1 {
        return Ok(count.value.clone());
    }
    let mut data = if sub == 0 {
        vec![count.value[0], 0]
    } else {
        vec![]
    };
    let most = count.value[0];
    for entry in entries
        .iter()
        .filter(|entry| (1..=most).contains(&entry.sub))
    {
        data.extend(&entry.value);
    }
    Ok(data)
}

fn write(
    context: &mut Context,
    index: u16,
    sub: u8,
    complete: bool,
    data: &[u8],
) -> Result<(), Abort> {
    if !complete {
        return write_entry(context, index, sub, data, false);
    }
    if !context.complete_access || sub > 1 {
        return Err(Abort::UNSUPPORTED);
    }
    let mut rest = data;
    if sub == 0 {
        let count = *rest.first().ok_or(Abort::TOO_SHORT)?;
        rest = rest.get(2..).unwrap_or_default();
        write_entry(context, index, 0, &[0], true)?;
        for sub in 1..=count {
            let slot = context.dictionary.find(index, sub)?;
            let size = context.dictionary.entry(slot).value.len();
            let (one, after) = rest.split_at_checked(size).ok_or(Abort::TOO_SHORT)?;
            write_entry(context, index, sub, one, true)?;
            rest = after;
        }
        return write_entry(context, index, 0, &[count], true);
    }
    for sub in 1..=u8::MAX {
        if rest.is_empty() {
            break;
        }
        let slot = context.dictionary.find(index, sub)?;
        let size = context.dictionary.entry(slot).value.len();
        let (one, after) = rest.split_at_checked(size).ok_or(Abort::TOO_SHORT)?;
        write_entry(context, index, sub, one, true)?;
        rest = after;
    }
    Ok(())
}

/// `at_once` says that a whole object is written, which needs no emptying of a list before.
fn write_entry(
    context: &mut Context,
    index: u16,
    sub: u8,
    data: &[u8],
    at_once: bool,
) -> Result<(), Abort> {
    let slot = context.dictionary.find(index, sub)?;
    let entry = context.dictionary.entry(slot);
    match entry.access {
        Access::ReadOnly => return Err(Abort::READ_ONLY),
        Access::Setup if context.state != AlState::PreOp => return Err(Abort::STATE),
        Access::Setup | Access::ReadWrite => {}
    }
    entry.takes(data.len())?;
    if process::is_list(index) {
        process::judge_write(context.dictionary, index, sub, data, at_once)?;
    }
    if context.is_drive {
        drive::judge_write(context.dictionary, index, sub, data)?;
    }
    let value = &mut context.dictionary.entry_mut(slot).value;
    value.clear();
    value.extend(data);
    Ok(())
}
