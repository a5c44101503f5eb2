//! Machine files, good and bad.

mod common;
mod overrides;
mod properties;
mod reading;
mod reference;
mod refusals;
