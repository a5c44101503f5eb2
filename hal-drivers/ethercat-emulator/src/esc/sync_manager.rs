//! Sync managers: who may touch which part of the process memory, and what follows from it.

/// One sync manager as its registers set it, and how far its buffer is.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SyncManager {
    pub(crate) start: usize,
    pub(crate) length: usize,
    control: u8,
    activate: u8,
    /// The firmware's control: bit 0 closes the sync manager.
    pub(crate) pdi_control: u8,
    /// A mailbox holds a message; a buffer has been filled once.
    pub(crate) full: bool,
    /// A mailbox has been opened at its start and not yet been left at its end.
    open: bool,
}

/// Who writes a sync manager's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// The device writes, the master reads.
    ToMaster,
    /// The master writes, the device reads.
    ToDevice,
}

/// What an access means for the sync manager it meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Memory beside this sync manager.
    Beside,
    /// Not granted: the working counter does not count it.
    Refused,
    /// Granted.
    Granted,
    /// Granted, and the last byte was touched: the buffer changes hands.
    Completed,
}

impl SyncManager {
    /// Takes over what the master wrote into the eight registers; a change of them empties the buffer.
    pub(crate) fn configure(&mut self, registers: &[u8]) {
        let new = Self {
            start: usize::from(crate::bytes::u16_at(registers, 0)),
            length: usize::from(crate::bytes::u16_at(registers, 2)),
            control: registers[4],
            activate: registers[6],
            ..*self
        };
        let same = (self.start, self.length, self.control, self.activate & 1)
            == (new.start, new.length, new.control, new.activate & 1);
        *self = if same {
            new
        } else {
            Self {
                full: false,
                open: false,
                ..new
            }
        };
    }

    /// Whether it guards anything.
    pub(crate) fn is_active(&self) -> bool {
        self.activate & 1 == 1 && self.length > 0
    }

    /// Who writes.
    pub(crate) fn direction(&self) -> Direction {
        if self.control >> 2 & 3 == 1 {
            Direction::ToDevice
        } else {
            Direction::ToMaster
        }
    }

    /// Whether it is a mailbox; otherwise it is a buffer that always holds the newest.
    pub(crate) fn is_mailbox(&self) -> bool {
        self.control & 3 == 2
    }

    /// Whether a write starts the watchdog anew.
    pub(crate) fn triggers_watchdog(&self) -> bool {
        self.control & 0x40 != 0 && self.direction() == Direction::ToDevice
    }

    /// Its status register: bit 3 is a full mailbox, bits 4 and 5 are 3 until a buffer is filled.
    pub(crate) fn status(&self) -> u8 {
        match (self.is_mailbox(), self.full) {
            (true, full) => u8::from(full) << 3,
            (false, true) => 0,
            (false, false) => 3 << 4,
        }
    }

    /// Judges an access of the master to `start..end`; `writes` says in which direction.
    pub(crate) fn judge(&self, start: usize, end: usize, writes: bool) -> Access {
        let last = self.start + self.length;
        if !self.is_active() || end <= self.start || start >= last {
            return Access::Beside;
        }
        let own_direction = writes == (self.direction() == Direction::ToDevice);
        if !own_direction || self.pdi_control & 1 == 1 {
            return Access::Refused;
        }
        if self.is_mailbox() {
            let ready = self.full != writes;
            if !ready || !(self.open || start <= self.start) {
                return Access::Refused;
            }
        } else if !writes && !self.full {
            return Access::Refused;
        }
        if end >= last {
            Access::Completed
        } else {
            Access::Granted
        }
    }

    /// Follows an access that was granted.
    pub(crate) fn follow(&mut self, access: Access, writes: bool) {
        match access {
            Access::Completed => {
                self.open = false;
                if self.is_mailbox() || writes {
                    self.full = writes;
                }
            }
            Access::Granted => self.open = self.is_mailbox(),
            Access::Beside | Access::Refused => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mailbox_is_read_once_when_it_is_full_and_from_its_start() {
        let mut mailbox = SyncManager::default();
        // 16 bytes from 0x1000, a mailbox that the master reads, switched on.
        mailbox.configure(&[0x00, 0x10, 16, 0, 0x22, 0, 1, 0]);
        assert_eq!(mailbox.judge(0x1000, 0x1010, false), Access::Refused);
        mailbox.full = true;
        assert_eq!(mailbox.judge(0x1000, 0x1010, true), Access::Refused);
        assert_eq!(mailbox.judge(0x1004, 0x1010, false), Access::Refused);
        assert_eq!(mailbox.judge(0x1010, 0x1020, false), Access::Beside);
        for (start, end, verdict) in [
            (0x1000, 0x1008, Access::Granted),
            (0x1008, 0x1010, Access::Completed),
        ] {
            assert_eq!(mailbox.judge(start, end, false), verdict);
            mailbox.follow(verdict, false);
        }
        assert_eq!(mailbox.judge(0x1000, 0x1010, false), Access::Refused);
    }
}
