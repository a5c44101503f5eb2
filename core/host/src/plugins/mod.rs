//! Plugins: by name or from a library, their log, and a watch over calls that do not come back.

pub mod hang;
pub mod loading;
pub mod plugin_log;
pub mod registry;
mod whole;
