//! Access to the SII, the device's own description, through the registers 0x0500 to 0x050F.

use crate::bytes::{put, u16_at, u32_at};

/// How long the memory takes for one access, in ns; real terminals show busy for 300 to 700 µs.
const ACCESS_NS: u64 = 300_000;
/// How long a write takes, and how long the memory then stores and takes no command, in ns; a real coupler stored for
/// between 3.54 and 3.67 ms.
const WRITE_NS: u64 = 250_000;
const STORE_NS: u64 = 3_600_000;
/// Status bits, of the upper byte of the status register.
const BUSY: u8 = 0x80;
const WRITE_REFUSED: u8 = 0x40;
const COMMAND_FAILED: u8 = 0x20;

/// The memory and its access registers.
#[derive(Clone, Debug)]
pub(crate) struct Eeprom {
    pub(crate) image: Vec<u8>,
    /// Whether a read gives 8 bytes; otherwise 4.
    wide: bool,
    registers: [u8; 16],
    busy_until_ns: u64,
    stores_until_ns: u64,
}

impl Eeprom {
    pub(crate) fn new(image: Vec<u8>, wide: bool) -> Self {
        Self {
            image,
            wide,
            registers: [0; 16],
            busy_until_ns: 0,
            stores_until_ns: 0,
        }
    }

    /// A register from 0x0500 on.
    pub(crate) fn register(&self, at_ns: u64, offset: usize) -> u8 {
        match offset {
            2 => self.registers[2] & 1 | u8::from(self.wide) << 6,
            // The command stays to be seen until it is done.
            3 if at_ns < self.busy_until_ns => self.registers[3] | BUSY,
            3 => self.registers[3] & (WRITE_REFUSED | COMMAND_FAILED),
            _ => self.registers.get(offset).copied().unwrap_or(0),
        }
    }

    /// The master wrote `data` from 0x0500 + `offset` on. A command is done at once, and shows busy as long as it takes.
    pub(crate) fn write(&mut self, at_ns: u64, offset: usize, data: &[u8]) {
        for (register, new) in self.registers.iter_mut().skip(offset).zip(data) {
            *register = *new;
        }
        if offset > 3 || offset + data.len() <= 3 {
            return;
        }
        let command = self.registers[3] & 7;
        let address = u32_at(&self.registers, 4) as usize * 2;
        let mut status = 0;
        let mut takes_ns = ACCESS_NS;
        match command {
            _ if at_ns < self.stores_until_ns => status = COMMAND_FAILED,
            0 | 4 => {}
            1 => {
                let length = if self.wide { 8 } else { 4 };
                for n in 0..length {
                    // Behind its end an empty memory reads as ones.
                    self.registers[8 + n] = self.image.get(address + n).copied().unwrap_or(0xff);
                }
            }
            2 if self.registers[2] & 1 == 0 => status = WRITE_REFUSED,
            2 => match self.image.get_mut(address..address + 2) {
                Some(word) => {
                    put(word, u64::from(u16_at(&self.registers, 8)));
                    self.stores_until_ns = at_ns + STORE_NS;
                    takes_ns = WRITE_NS;
                }
                None => status = COMMAND_FAILED,
            },
            _ => status = COMMAND_FAILED,
        }
        // Leave to write holds for one command.
        self.registers[2] &= !1;
        self.registers[3] = command | status;
        if command != 0 && status == 0 {
            self.busy_until_ns = at_ns + takes_ns;
        }
    }

    /// The alias that the device takes at power-on.
    pub(crate) fn alias(&self) -> u16 {
        u16_at(&self.image, 8)
    }
}
