//! The information service: which objects there are, and what they are called.

use super::dictionary::{Abort, Access, Dictionary};
use super::sdo::INFORMATION;
use crate::bytes::u16_at;

/// Where the body of a request begins: behind the service, its kind, a gap and the number of fragments that follow.
const BODY: usize = 6;
/// Kinds of requests, of which an answer is one more; and of a refusal.
const LIST: u8 = 1;
const OBJECT: u8 = 3;
const ENTRY: u8 = 5;
const REFUSAL: u8 = 7;

/// Answers a request, in as many messages as it takes.
pub(crate) fn serve(message: &[u8], dictionary: &Dictionary, room: usize) -> Vec<Vec<u8>> {
    let kind = message.get(2).map_or(0, |kind| kind & 0x7f);
    let index = u16_at(message, BODY);
    let sub = message.get(BODY + 2).copied().unwrap_or(0);
    let answer = match kind {
        LIST => Ok(list(index, dictionary)),
        OBJECT => object(index, dictionary),
        ENTRY => entry(index, sub, dictionary),
        _ => Err(Abort::COMMAND),
    };
    match answer {
        Ok(body) => fragments(kind + 1, &body, room),
        Err(abort) => fragments(REFUSAL, &abort.0.to_le_bytes(), room),
    }
}

fn fragments(kind: u8, body: &[u8], room: usize) -> Vec<Vec<u8>> {
    // Fragments of a list hold whole indexes.
    let most = (room.saturating_sub(BODY) & !1).max(8);
    let count = body.len().div_ceil(most);
    let one = |(number, part): (usize, &[u8])| {
        let left = (count - 1 - number) as u16;
        let mut message = (INFORMATION << 12).to_le_bytes().to_vec();
        message.extend([kind | if left > 0 { 0x80 } else { 0 }, 0]);
        message.extend(left.to_le_bytes());
        message.extend(part);
        message
    };
    body.chunks(most).enumerate().map(one).collect()
}

/// List 0 has the lengths of the lists; list 1 is all objects. The others are given as empty.
fn list(number: u16, dictionary: &Dictionary) -> Vec<u8> {
    let mut body = number.to_le_bytes().to_vec();
    match number {
        0 => {
            body.extend((dictionary.objects().count() as u16).to_le_bytes());
            body.extend([0; 8]);
        }
        1 => body.extend(dictionary.objects().flat_map(u16::to_le_bytes)),
        _ => {}
    }
    body
}

fn object(index: u16, dictionary: &Dictionary) -> Result<Vec<u8>, Abort> {
    let entries = dictionary.of_object(index);
    let (Some(first), Some(last)) = (entries.first(), entries.last()) else {
        return Err(Abort::NO_OBJECT);
    };
    let mut body = index.to_le_bytes().to_vec();
    body.extend(first.kind.number().to_le_bytes());
    // A variable is 7, a record 9.
    body.extend([last.sub, if entries.len() == 1 { 7 } else { 9 }]);
    body.extend(dictionary.name_of(index).bytes());
    Ok(body)
}

fn entry(index: u16, sub: u8, dictionary: &Dictionary) -> Result<Vec<u8>, Abort> {
    let entry = dictionary.entry(dictionary.find(index, sub)?);
    // Read in the three states with a mailbox; written in them, or in the first only.
    let access: u16 = match entry.access {
        Access::ReadOnly => 0x07,
        Access::ReadWrite => 0x3f,
        Access::Setup => 0x0f,
    };
    let mut body = index.to_le_bytes().to_vec();
    body.extend([sub, 0]);
    body.extend(entry.kind.number().to_le_bytes());
    body.extend((entry.bits() as u16).to_le_bytes());
    body.extend(access.to_le_bytes());
    body.extend(dictionary.name_of(index).bytes());
    Ok(body)
}
