//! Shield.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod brake;
pub mod choice;
pub mod contract;
pub mod fleet;
pub mod plane;
pub mod report;
pub mod settings;
pub mod shield;
pub mod tube;

pub use brake::State;
pub use contract::Message;
pub use fleet::Fleet;
pub use report::Counters;
pub use settings::{Limits, Settings, ShieldError, Start};
pub use shield::Shield;

#[cfg(test)]
mod tests;
