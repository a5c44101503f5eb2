//! Keys and signals for a machine that a controller drives.

use std::sync::{Mutex, PoisonError};

use serde_json::{Value, json};
use tandem_host::Command;

use super::connection::RequestSender;
use crate::operator::{Panel, PanelSwitches};

/// Commands become requests, whose answers come by themselves.
pub struct RemotePanel {
    requests: RequestSender,
    switches: Mutex<PanelSwitches>,
}

impl RemotePanel {
    /// Nothing is known of the switches yet.
    pub fn new(requests: RequestSender) -> Self {
        Self {
            requests,
            switches: Mutex::new(PanelSwitches {
                hold: false,
                single_block: false,
                optional_stop: false,
                feed_override: 1.0,
                // The controller knows it, and says so where more is asked for.
                max_feed_ratio: f64::INFINITY,
            }),
        }
    }

    /// The switches stand as this status says.
    pub fn follow(&self, status: &Value) {
        let mut switches = self.lock();
        let on = |key: &str| status[key].as_bool().unwrap_or_default();
        switches.hold = on("hold") || status["waits_on_line"].is_u64();
        switches.single_block = on("single_block");
        switches.optional_stop = on("optional_stop");
        switches.feed_override = status["feed_override"].as_f64().unwrap_or(1.0);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, PanelSwitches> {
        // What lies in it is whole after every statement.
        self.switches.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Panel for RemotePanel {
    fn give(&self, command: Command) -> Result<(), String> {
        let mut switches = self.lock();
        let with = match command {
            Command::FeedOverride(ratio) | Command::RapidOverride(ratio) => {
                json!({ "ratio": ratio })
            }
            Command::OptionalStop(on) | Command::SingleBlock(on) => json!({ "on": on }),
            _ => json!({}),
        };
        self.requests
            .say(command.name(), with)
            .map_err(|gone| gone.words().to_string())?;
        // Until the next status says how they stand.
        match command {
            Command::Hold => switches.hold = true,
            Command::Resume => switches.hold = false,
            Command::FeedOverride(ratio) => switches.feed_override = ratio,
            Command::OptionalStop(on) => switches.optional_stop = on,
            Command::SingleBlock(on) => switches.single_block = on,
            _ => {}
        }
        Ok(())
    }

    fn switches(&self) -> PanelSwitches {
        *self.lock()
    }
}
