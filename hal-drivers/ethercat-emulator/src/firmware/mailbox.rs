//! The mailbox: messages in, messages out, one at a time in either direction.

use std::collections::VecDeque;

use super::sdo::{Context, SdoServer};
use crate::bytes::u16_at;

/// Bytes of a mailbox header.
const HEADER: usize = 6;
/// Kinds of messages: an error, CAN over EtherCAT.
const ERROR: u8 = 0;
const COE: u8 = 3;
/// Codes of the error message: a protocol that the device has not, a header that is wrong.
const UNSUPPORTED: u16 = 2;
const INVALID_HEADER: u16 = 4;
/// Services of CAN over EtherCAT.
const EMERGENCY: u16 = 1;
/// Messages that wait for the master; more are dropped, oldest first.
const MAX_WAITING: usize = 16;

/// A device's mailbox.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mailbox {
    pub(crate) server: SdoServer,
    waiting: VecDeque<Vec<u8>>,
    /// The message that the master reads, or read last.
    last: Vec<u8>,
    /// Number of the last message out, and in; 1 to 7.
    sent: u8,
    received: u8,
}

impl Mailbox {
    /// Takes a message; what it answers waits to be read.
    pub(crate) fn take(&mut self, message: &[u8], context: &mut Context) {
        let length = usize::from(u16_at(message, 0));
        let kind = message.get(5).map_or(0, |byte| byte & 15);
        let number = message.get(5).map_or(0, |byte| byte >> 4 & 7);
        // A message that comes twice under one number is the first one again.
        if number != 0 && number == self.received {
            return;
        }
        self.received = number;
        let Some(body) = message.get(HEADER..HEADER + length) else {
            self.fail(INVALID_HEADER);
            return;
        };
        match kind {
            COE => {
                for answer in self.server.serve(body, context) {
                    self.send(COE, &answer);
                }
            }
            _ => self.fail(UNSUPPORTED),
        }
    }

    fn fail(&mut self, code: u16) {
        let code = code.to_le_bytes();
        self.send(ERROR, &[1, 0, code[0], code[1]]);
    }

    /// Tells the master of a drive's fault, unasked.
    pub(crate) fn emergency(&mut self, code: u16, register: u8) {
        let mut body = (EMERGENCY << 12).to_le_bytes().to_vec();
        body.extend(code.to_le_bytes());
        body.push(register);
        body.extend([0; 5]);
        self.send(COE, &body);
    }

    fn send(&mut self, kind: u8, body: &[u8]) {
        self.sent = self.sent % 7 + 1;
        let mut message = (body.len() as u16).to_le_bytes().to_vec();
        message.extend([0, 0, 0, kind | self.sent << 4]);
        message.extend(body);
        if self.waiting.len() == MAX_WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(message);
    }

    /// The next message for the master.
    pub(crate) fn next(&mut self) -> Option<&[u8]> {
        self.last = self.waiting.pop_front()?;
        Some(&self.last)
    }

    /// The message that was read last, for a master that lost it.
    pub(crate) fn again(&self) -> &[u8] {
        &self.last
    }

    /// Forgets everything, as on leaving PRE-OPERATIONAL.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }
}
