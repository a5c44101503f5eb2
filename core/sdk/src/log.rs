//! Words for the operator's log, from any loop.
//!
//! A shared library has globals of its own, so a plugin does not print: it writes a record of fixed size, which the host
//! takes into a ring made beforehand and shows later, on the soft side. Neither allocates, locks or waits, so that
//! `exchange` may do it as well. Where nobody listens (a test without a host) the record is dropped.

use crate::abi::layout::{Layout, START, fold, fold_text, layout, layout_of_enum, table};
use std::fmt::{self, Write};
use std::sync::atomic::{AtomicPtr, Ordering};

/// Longest text of a record, bytes; what is longer ends in `…`.
pub const LOG_TEXT: usize = 200;
/// Longest name of a source, bytes.
pub const LOG_SOURCE: usize = 40;

/// How much a record matters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum LogLevel {
    /// Good to know.
    #[default]
    Info = 0,
    /// Something is not as it should be.
    Warning = 1,
    /// Something failed; what follows from it is told elsewhere.
    Error = 2,
}

layout_of_enum!(LogLevel {
    Info,
    Warning,
    Error
});

/// One line of the log.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct LogRecord {
    /// How much it matters, as a number until it has been looked at.
    level: u32,
    source: Short<LOG_SOURCE>,
    text: Short<LOG_TEXT>,
}

layout!(LogRecord {
    level,
    source,
    text
});

impl LogRecord {
    /// A record; a text that is too long is cut. Any loop; does not allocate.
    pub fn new(level: LogLevel, source: &str, text: fmt::Arguments<'_>) -> Self {
        let mut this = Self {
            level: level as u32,
            source: Short::EMPTY,
            text: Short::EMPTY,
        };
        // A text that does not fit is an error of the formatter, and marked by it.
        let _ = this.source.write_str(source);
        let _ = this.text.write_fmt(text);
        this
    }

    /// How much it matters. A number that stands for no level matters most.
    pub fn level(&self) -> LogLevel {
        LogLevel::try_from(self.level).unwrap_or(LogLevel::Error)
    }

    /// The crate that wrote it.
    pub fn source(&self) -> &str {
        self.source.as_str()
    }

    /// What it says.
    pub fn text(&self) -> &str {
        self.text.as_str()
    }
}

/// A text of bounded length, in place.
#[derive(Clone, Copy)]
#[repr(C)]
struct Short<const N: usize> {
    length: u32,
    bytes: [u8; N],
}

impl<const N: usize> Layout for Short<N> {
    const HASH: u64 = fold(fold_text(START, "Short"), N as u64);
}

/// What stands at the end of a text that was cut.
const CUT: &str = "…";

impl<const N: usize> Short<N> {
    const EMPTY: Self = Self {
        length: 0,
        bytes: [0; N],
    };

    fn as_str(&self) -> &str {
        let bytes = self.bytes.get(..self.length as usize).unwrap_or_default();
        std::str::from_utf8(bytes).unwrap_or("a text that is not UTF-8")
    }

    fn push(&mut self, text: &str) {
        let from = self.length as usize;
        self.bytes[from..from + text.len()].copy_from_slice(text.as_bytes());
        self.length += text.len() as u32;
    }
}

impl<const N: usize> Write for Short<N> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let Some(room) = N.checked_sub(CUT.len() + self.length as usize) else {
            return Err(fmt::Error);
        };
        if text.len() <= room {
            self.push(text);
            return Ok(());
        }
        self.push(&text[..text.floor_char_boundary(room)]);
        self.push(CUT);
        Err(fmt::Error)
    }
}

table! {
    /// What a host offers its plugins.
    pub struct HostTable {
        abi_version: u32,
        log: unsafe extern "C" fn(*const LogRecord),
    }
}

impl HostTable {
    /// A table whose `log` takes a record from any thread, the fine loop's included.
    pub const fn new(log: unsafe extern "C" fn(*const LogRecord)) -> Self {
        Self {
            abi_version: crate::ABI_VERSION,
            log,
        }
    }
}

static HOST: AtomicPtr<HostTable> = AtomicPtr::new(std::ptr::null_mut());

/// Makes `host` the one that this copy of the SDK writes to. A host calls it for the plugins linked into it; shared
/// libraries get theirs when they are loaded.
pub fn attach(host: &'static HostTable) {
    HOST.store(std::ptr::from_ref(host).cast_mut(), Ordering::Release);
}

/// Hands a record to the host. Any loop; does not allocate, lock or wait.
pub fn write(record: &LogRecord) {
    // SAFETY: `attach` takes tables that live as long as the program.
    let host = unsafe { HOST.load(Ordering::Acquire).as_ref() };
    if let Some(host) = host {
        // SAFETY: the record lives for the call.
        unsafe { (host.log)(record) };
    }
}

/// Writes to the host's log: `tandem_sdk::log!(Warning, "{lost} frames lost")`. The levels are those of
/// [`LogLevel`]. Any loop: it does not allocate, lock or wait; a text beyond [`LOG_TEXT`] is cut.
#[macro_export]
macro_rules! log {
    ($level:ident, $($text:tt)+) => {
        $crate::log::write(&$crate::log::LogRecord::new(
            $crate::log::LogLevel::$level,
            env!("CARGO_PKG_NAME"),
            format_args!($($text)+),
        ))
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_cut_at_a_character() {
        let record = LogRecord::new(
            LogLevel::Info,
            "driver",
            format_args!("{}", "é".repeat(200)),
        );
        assert_eq!(record.source(), "driver");
        assert!(
            record.text().len() <= LOG_TEXT && record.text().ends_with("é…"),
            "{}",
            record.text()
        );
        let short = LogRecord::new(
            LogLevel::Error,
            "driver",
            format_args!("joint {} of {}", 1, 3),
        );
        assert_eq!(short.text(), "joint 1 of 3");
    }
}
