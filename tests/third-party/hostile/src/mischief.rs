//! What goes wrong, and when.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tandem_sdk::PluginError;
use tandem_sdk::serde::{Deserialize, Serialize};

/// What it does when its time has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(crate = "tandem_sdk::serde", rename_all = "kebab-case")]
pub enum Misbehave {
    /// Nothing.
    Never,
    /// It panics.
    Panic,
    /// It panics with something that is not a text, and that panics when it is dropped.
    PanicTwice,
    /// It gives numbers that are none.
    NotANumber,
    /// It gives numbers far beyond every limit.
    Beyond,
    /// It emits without end.
    Endless,
    /// It emits ever more, a little time at a time, and never gets on.
    Dawdle,
    /// It reports blocks that it was not given, in an order of its own.
    Order,
    /// It fails, in words.
    Fail,
    /// It does not come back.
    Hang,
    /// It gives a number that stands for nothing.
    Foreign,
}

tandem_sdk::options! {
    pub struct Options {
        /// What it does when its time has come.
        pub misbehave: Misbehave = Misbehave::Never,
        /// The method in which it does so.
        pub method: String = String::new(),
        /// The call of that method, from 1, with which it begins.
        pub call: u32 = 1,
        /// Of a kinematics: its joints are no linear function of the axes.
        pub curved: bool = false,
    }
}

/// Counts the calls of one method.
pub struct Mischief {
    options: Options,
    calls: AtomicU32,
}

struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        panic!("the second panic");
    }
}

impl Mischief {
    pub fn new(options: &Options) -> Result<Self, PluginError> {
        let this = Self { options: options.clone(), calls: AtomicU32::new(0) };
        this.of("new").map(|_| this)
    }

    /// What is to go wrong in this call of `method`; panics and failures do so here.
    pub fn of(&self, method: &str) -> Result<Misbehave, PluginError> {
        if method != self.options.method || self.calls.fetch_add(1, Relaxed) + 1 < self.options.call {
            return Ok(Misbehave::Never);
        }
        match self.options.misbehave {
            Misbehave::Panic => panic!("as it was told"),
            Misbehave::PanicTwice => std::panic::panic_any(Bomb),
            Misbehave::Hang => loop {
                std::thread::park();
            },
            Misbehave::Fail => Err(PluginError::fixed("it fails as it was told")),
            other => Ok(other),
        }
    }

    /// The same where a method cannot fail.
    pub fn quietly(&self, method: &str) -> Misbehave {
        self.of(method).unwrap_or(Misbehave::Never)
    }

    /// A number that takes the place of `value`.
    pub fn number(what: Misbehave, value: f64) -> f64 {
        match what {
            Misbehave::NotANumber => f64::NAN,
            Misbehave::Beyond => 1e6,
            _ => value,
        }
    }
}
