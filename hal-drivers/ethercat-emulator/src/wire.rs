//! The wire between a master and the bus: frames take their time, and the faults of a script happen to them.

use std::collections::VecDeque;

use crate::bus::{Bus, MAX_FRAME};
use crate::description::{BusDescription, DescriptionError};
use crate::faults::{BusFault, Span, What, When};
use crate::frame::is_ethercat;

/// Replies that wait; a master that reads none loses the oldest.
const MAX_REPLIES: usize = 256;

/// A bus behind a wire. Frames go in by [`Wire::send`] and come out by [`Wire::receive`], at times that the caller gives.
/// Nothing is allocated once as many replies have been on their way as ever are at a time.
#[derive(Clone, Debug)]
pub struct Wire {
    bus: Bus,
    faults: Vec<Scheduled>,
    replies: VecDeque<Reply>,
    free: Vec<Vec<u8>>,
    held: Option<Reply>,
    frames: u64,
    cycles: u64,
    travel: bool,
}

#[derive(Clone, Debug)]
struct Scheduled {
    fault: BusFault,
    ends: Option<End>,
    state: Progress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Waits,
    Active,
    Over,
}

/// When a fault that has begun is over.
#[derive(Clone, Copy, Debug)]
enum End {
    Frame(u64),
    Cycle(u64),
    Ns(u64),
}

#[derive(Clone, Debug)]
struct Reply {
    due_ns: u64,
    frame: Vec<u8>,
}

/// What becomes of the frame at hand.
#[derive(Clone, Copy, Debug, Default)]
struct Fate {
    lost: Option<Lost>,
    swapped: bool,
    /// A frame that comes before the reply.
    before: Option<Before>,
    late_ns: u64,
    duplicate_ns: Option<u64>,
    bytes: Option<usize>,
    corrupt: Option<(usize, u8)>,
}

/// Where a frame is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lost {
    Request,
    Reply,
}

/// What comes that nobody asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Before {
    Foreign,
    Stray,
}

impl Wire {
    /// Builds a bus and its wire.
    ///
    /// # Errors
    /// What names a device that is not there, or cannot be built.
    pub fn new(description: &BusDescription) -> Result<Self, DescriptionError> {
        let bus = Bus::new(description)?;
        let mut wire = Self {
            bus,
            faults: vec![],
            replies: VecDeque::new(),
            free: vec![],
            held: None,
            frames: 0,
            cycles: 0,
            travel: true,
        };
        for fault in &description.faults {
            wire.add(fault.clone())?;
        }
        Ok(wire)
    }

    /// Whether frames take the time that they take on a cable; otherwise a reply is back at once, as behind a real one.
    pub fn set_travel(&mut self, travel: bool) {
        self.travel = travel;
    }

    /// Adds a fault to the script. It allocates.
    ///
    /// # Errors
    /// What names a device that is not there, or cannot be built.
    pub fn add(&mut self, fault: BusFault) -> Result<(), DescriptionError> {
        self.bus.judge_fault(&fault.what)?;
        let span = fault
            .lasts
            .or(fault.what.is_of_frames().then_some(Span::Frames(1)));
        let times = [
            matches!(fault.at, When::Ms(ms) if !(0.0..1e12).contains(&ms)),
            matches!(span, Some(Span::Ms(ms)) if !(0.0..1e12).contains(&ms)),
        ];
        if times.contains(&true) {
            return Err(DescriptionError::Reference(
                "a fault begins and lasts at least 0 ms".to_string(),
            ));
        }
        self.faults.push(Scheduled {
            fault: BusFault {
                lasts: span,
                ..fault
            },
            ends: None,
            state: Progress::Waits,
        });
        Ok(())
    }

    /// Lets a fault begin now, with the next frame where it is one of frames.
    ///
    /// # Errors
    /// What names a device that is not there, or cannot be built.
    pub fn inject(&mut self, what: What, lasts: Option<Span>) -> Result<(), DescriptionError> {
        let at = if what.is_of_frames() {
            When::Frame(self.frames + 1)
        } else {
            When::Ms(self.bus.now_ns() as f64 / 1e6)
        };
        self.add(BusFault { at, lasts, what })?;
        self.advance(self.bus.now_ns());
        Ok(())
    }

    /// Ends every fault that is there now: cables are plugged again, devices do as they should.
    pub fn mend(&mut self) {
        for index in 0..self.faults.len() {
            if self.faults[index].state == Progress::Active {
                self.end(index);
            }
        }
    }

    /// The bus.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// The bus, to set inputs.
    pub fn bus_mut(&mut self) -> &mut Bus {
        &mut self.bus
    }

    /// Frames that came in, and those of them with process data.
    pub fn frames_and_cycles(&self) -> (u64, u64) {
        (self.frames, self.cycles)
    }

    /// Lets time pass; faults with a time begin and end at it, not at the end of what passes.
    pub fn advance(&mut self, now_ns: u64) {
        while let Some((index, at_ns)) = self.next_by_time().filter(|(_, at_ns)| *at_ns <= now_ns) {
            self.bus.advance(at_ns);
            match self.faults[index].state {
                Progress::Waits => self.begin(index, at_ns),
                _ => self.end(index),
            }
        }
        self.bus.advance(now_ns);
    }

    /// The fault that begins or ends next by the time.
    fn next_by_time(&self) -> Option<(usize, u64)> {
        let due =
            |scheduled: &Scheduled| match (scheduled.state, scheduled.fault.at, scheduled.ends) {
                (Progress::Waits, When::Ms(ms), _) => Some((ms * 1e6) as u64),
                (Progress::Active, _, Some(End::Ns(ns))) => Some(ns),
                _ => None,
            };
        let all = self
            .faults
            .iter()
            .enumerate()
            .filter_map(|(index, fault)| Some((index, due(fault)?)));
        all.min_by_key(|(_, at_ns)| *at_ns)
    }

    fn begin(&mut self, index: usize, now_ns: u64) {
        let scheduled = &mut self.faults[index];
        scheduled.state = Progress::Active;
        scheduled.ends = scheduled.fault.lasts.map(|span| match span {
            Span::Frames(count) => End::Frame(self.frames.max(1) + count),
            Span::Cycles(count) => End::Cycle(self.cycles.max(1) + count),
            Span::Ms(ms) => End::Ns(now_ns.saturating_add((ms * 1e6) as u64)),
        });
        self.bus.trouble(&scheduled.fault.what, true);
    }

    fn end(&mut self, index: usize) {
        let scheduled = &mut self.faults[index];
        scheduled.state = Progress::Over;
        self.bus.trouble(&scheduled.fault.what, false);
    }

    /// Lets faults that go by frames begin and end with the frame that was just counted.
    fn schedule(&mut self, now_ns: u64, cyclic: bool) {
        for index in 0..self.faults.len() {
            let scheduled = &self.faults[index];
            let over = match scheduled.ends {
                Some(End::Frame(frame)) => self.frames >= frame,
                Some(End::Cycle(cycle)) => self.cycles >= cycle && cyclic,
                _ => false,
            };
            let begins = match scheduled.fault.at {
                When::Frame(frame) => self.frames >= frame,
                When::Cycle(cycle) => self.cycles >= cycle && cyclic,
                When::Ms(_) => false,
            };
            match scheduled.state {
                Progress::Active if over => self.end(index),
                Progress::Waits if begins => self.begin(index, now_ns),
                _ => {}
            }
        }
    }

    fn fate(&self) -> Fate {
        let mut fate = Fate::default();
        for scheduled in self
            .faults
            .iter()
            .filter(|scheduled| scheduled.state == Progress::Active)
        {
            match scheduled.fault.what {
                What::LostRequest => fate.lost = Some(Lost::Request),
                What::LostReply => fate.lost = Some(Lost::Reply),
                What::Late { by_us } => fate.late_ns = (by_us * 1000.0) as u64,
                What::Duplicate { after_us } => {
                    fate.duplicate_ns = Some((after_us * 1000.0) as u64);
                }
                What::Swapped => fate.swapped = true,
                What::Corrupt { byte, mask } => fate.corrupt = Some((byte, mask)),
                What::Truncated { bytes } => fate.bytes = Some(bytes),
                What::Foreign => fate.before = Some(Before::Foreign),
                What::Stray => fate.before = Some(Before::Stray),
                _ => {}
            }
        }
        fate
    }

    /// A frame of the master. Frames of other protocols, and such as are too long, go nowhere.
    pub fn send(&mut self, now_ns: u64, frame: &[u8]) {
        self.advance(now_ns);
        if !is_ethercat(frame) {
            return;
        }
        self.frames += 1;
        let cyclic = self.bus.read(frame);
        self.cycles += u64::from(cyclic);
        self.schedule(now_ns, cyclic);
        let fate = self.fate();
        if fate.lost == Some(Lost::Request) {
            return;
        }
        let mut reply = self.buffer(frame);
        let Some(travel_ns) = self.bus.pass_read(&mut reply) else {
            self.free.push(reply);
            return;
        };
        if fate.lost == Some(Lost::Reply) {
            self.free.push(reply);
            return;
        }
        self.answer(
            now_ns + if self.travel { travel_ns } else { 0 },
            reply,
            &fate,
        );
    }

    fn answer(&mut self, due_ns: u64, mut reply: Vec<u8>, fate: &Fate) {
        if let Some(before) = fate.before {
            let mut other = self.buffer(&reply);
            match before {
                Before::Stray => other[12..14].copy_from_slice(&[0x08, 0x00]),
                // Another master's source address and another number of its datagram.
                Before::Foreign => {
                    other[6..12].copy_from_slice(&[0x02, 0x1b, 0x21, 0x0f, 0x0e, 0x01]);
                    if let Some(number) = other.get_mut(17) {
                        *number = number.wrapping_add(128);
                    }
                }
            }
            self.queue(due_ns, other);
        }
        if let Some((byte, mask)) = fate.corrupt {
            let last = reply.len() - 1;
            reply[byte.min(last)] ^= mask;
        }
        reply.truncate(fate.bytes.unwrap_or(MAX_FRAME));
        let due_ns = due_ns + fate.late_ns;
        if let Some(after_ns) = fate.duplicate_ns {
            let again = self.buffer(&reply);
            self.queue(due_ns + after_ns, again);
        }
        if fate.swapped {
            self.held = Some(Reply {
                due_ns,
                frame: reply,
            });
            return;
        }
        self.queue(due_ns, reply);
        if let Some(held) = self.held.take() {
            self.queue(due_ns.max(held.due_ns), held.frame);
        }
    }

    fn buffer(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut buffer = self
            .free
            .pop()
            .unwrap_or_else(|| Vec::with_capacity(MAX_FRAME));
        buffer.clear();
        buffer.extend(frame);
        buffer
    }

    fn queue(&mut self, due_ns: u64, frame: Vec<u8>) {
        if self.replies.len() == MAX_REPLIES
            && let Some(oldest) = self.replies.pop_front()
        {
            self.free.push(oldest.frame);
        }
        let place = self.replies.partition_point(|reply| reply.due_ns <= due_ns);
        self.replies.insert(place, Reply { due_ns, frame });
    }

    /// When the next reply is back, in ns.
    pub fn next_reply_ns(&self) -> Option<u64> {
        self.replies.front().map(|reply| reply.due_ns)
    }

    /// The next reply that is back by now, copied into `into`, and its length; one that is too long for it is cut.
    pub fn receive(&mut self, now_ns: u64, into: &mut [u8]) -> Option<usize> {
        self.advance(now_ns);
        let due = self.next_reply_ns().is_some_and(|due_ns| due_ns <= now_ns);
        let reply = if due {
            self.replies.pop_front()?
        } else {
            return None;
        };
        let length = reply.frame.len().min(into.len());
        into[..length].copy_from_slice(&reply.frame[..length]);
        self.free.push(reply.frame);
        Some(length)
    }
}
