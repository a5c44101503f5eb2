//! Bytes of a sender: those that act at once, wherever they stand, and lines of what is left.

use super::RX_BYTES;

/// Longest line, bytes: a longer one could not be counted.
const MAX_LINE_BYTES: usize = RX_BYTES - 1;

/// A step of an override.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// To so many percent.
    To(u32),
    /// By so many percent.
    By(i32),
}

/// What acts at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RealTime {
    /// `?`: a status report.
    Status,
    /// `!`: feed hold.
    Hold,
    /// `~`: cycle start, or on after a hold.
    Resume,
    /// Ctrl-X: soft reset.
    Reset,
    /// The safety door as if it opened.
    Door,
    /// Jogs end.
    CancelJog,
    /// Override of the feed.
    Feed(Step),
    /// Override of rapids.
    Rapid(u32),
    /// Override of the spindle, which there is none of.
    Spindle,
    /// Flood coolant on or off.
    Flood,
    /// Mist coolant on or off.
    Mist,
}

impl RealTime {
    /// What `byte` asks for, if anything.
    pub fn of(byte: u8) -> Option<Self> {
        Some(match byte {
            b'?' => Self::Status,
            b'!' => Self::Hold,
            b'~' => Self::Resume,
            0x18 => Self::Reset,
            0x84 => Self::Door,
            0x85 => Self::CancelJog,
            0x90 => Self::Feed(Step::To(100)),
            0x91 => Self::Feed(Step::By(10)),
            0x92 => Self::Feed(Step::By(-10)),
            0x93 => Self::Feed(Step::By(1)),
            0x94 => Self::Feed(Step::By(-1)),
            0x95 => Self::Rapid(100),
            0x96 => Self::Rapid(50),
            0x97 => Self::Rapid(25),
            0x99..=0x9e => Self::Spindle,
            0xa0 => Self::Flood,
            0xa1 => Self::Mist,
            _ => return None,
        })
    }
}

/// A line, without its end and what is no text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SentLine {
    /// The text.
    pub text: String,
    /// Bytes that the sender counts for it, its end included.
    pub bytes: usize,
    /// It was longer than a line may be; the text is cut off.
    pub too_long: bool,
}

/// What was heard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A byte that acts at once.
    RealTime(RealTime),
    /// A line.
    Line(SentLine),
}

/// Takes a sender's bytes apart.
#[derive(Clone, Debug, Default)]
pub struct Scanner {
    text: String,
    bytes: usize,
    too_long: bool,
    behind_return: bool,
    /// A C2 came, which may be of a character or of a byte that acts at once.
    behind_lead: bool,
    /// Bytes to come of a character that is no ASCII.
    continuation: u8,
}

impl Scanner {
    /// Takes a byte.
    ///
    /// Senders that write text as UTF-8 send 0x91 as C2 91: a C2 is passed over. Bytes of other characters, such as stand in
    /// comments, ask for nothing.
    pub fn push(&mut self, byte: u8) -> Option<Heard> {
        if self.continuation > 0 && (0x80..0xc0).contains(&byte) {
            self.continuation -= 1;
            self.bytes += 1;
            return None;
        }
        self.continuation = match byte {
            0xc3..=0xdf => 1,
            0xe0..=0xef => 2,
            0xf0..=0xf4 => 3,
            _ => 0,
        };
        if let Some(real_time) = RealTime::of(byte) {
            if real_time == RealTime::Reset {
                self.forget();
            }
            self.behind_lead = false;
            return Some(Heard::RealTime(real_time));
        }
        let behind_return = std::mem::take(&mut self.behind_return);
        self.bytes += usize::from(std::mem::replace(&mut self.behind_lead, byte == 0xc2));
        match byte {
            b'\n' if behind_return => None,
            b'\n' | b'\r' => {
                self.behind_return = byte == b'\r';
                let line = SentLine {
                    text: std::mem::take(&mut self.text),
                    bytes: self.bytes + 1,
                    too_long: self.too_long,
                };
                self.bytes = 0;
                self.too_long = false;
                Some(Heard::Line(line))
            }
            0xc2 => None,
            _ => {
                self.bytes += 1;
                self.too_long |= self.text.len() >= MAX_LINE_BYTES;
                let is_text = byte == b'\t' || (b' '..0x7f).contains(&byte);
                if is_text && !self.too_long {
                    self.text.push(char::from(byte));
                }
                None
            }
        }
    }

    /// Bytes of the line that has not ended yet.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// The line that has not ended yet never was.
    pub fn forget(&mut self) {
        self.bytes = 0;
        self.too_long = false;
        self.behind_lead = false;
        self.text.clear();
    }
}
