//! What keys and signals command: a run of this process, or a controller in another one.

use std::sync::atomic::Ordering::Relaxed;

use tandem_host::Command;
use tandem_session::operator::OperatorHub;

/// How the operator's switches stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanelSwitches {
    pub hold: bool,
    pub single_block: bool,
    pub optional_stop: bool,
    /// 1 for the programmed feed.
    pub feed_override: f64,
    /// The highest feed override that is granted, as far as it is known here.
    pub max_feed_ratio: f64,
}

/// Takes an operator's commands.
pub trait Panel: Send + Sync {
    /// Gives a command.
    ///
    /// # Errors
    /// Why it is refused, in words.
    fn give(&self, command: Command) -> Result<(), String>;

    /// How the switches stand.
    fn switches(&self) -> PanelSwitches;
}

impl Panel for OperatorHub {
    fn give(&self, command: Command) -> Result<(), String> {
        OperatorHub::give(self, command).map(|_| ())
    }

    fn switches(&self) -> PanelSwitches {
        let controls = self.controls();
        PanelSwitches {
            hold: controls.hold.load(Relaxed),
            single_block: controls.single_block.load(Relaxed),
            optional_stop: controls.optional_stop.load(Relaxed),
            feed_override: controls.feed_override.load(),
            max_feed_ratio: self.max_feed_ratio(),
        }
    }
}
