//! Drawer of the pictures of a flight.

use std::path::Path;
use std::sync::Arc;

use crate::flight_log::FlightLog;
use crate::report::Report;
use crate::report::page::Picture;
use tautline_core::failure::Failure;
use tautline_core::monitor::Monitor;
use tautline_recordings::mcap::ExtraTopic;
use tautline_sim::scenario::Scenario;

/// Largest size of the pictures of a page \[bytes\].
pub const PICTURES_BYTES: usize = 900 << 10;

/// Picture with its name, such as `closest`.
pub type NamedPicture = (String, Picture);

/// Drawer of flights, implemented by another crate. `()` draws nothing.
pub trait Pictures: Sync {
    /// Writes pictures of a flight into the folder of its run and returns them for its page. A machine that cannot draw
    /// writes none and warns.
    ///
    /// # Errors
    /// [`Failure`] if a file cannot be written.
    fn draw(
        &self,
        scenario: &Scenario,
        report: &Report,
        log: &Arc<FlightLog>,
        folder: &Path,
        monitor: &dyn Monitor,
    ) -> Result<Vec<NamedPicture>, Failure>;

    /// Returns a topic that is recorded beside positions, so that other viewers can show the flight.
    fn topic(&self, _scenario: &Scenario) -> Option<Box<dyn ExtraTopic>> {
        None
    }
}

impl Pictures for () {
    fn draw(
        &self,
        _scenario: &Scenario,
        _report: &Report,
        _log: &Arc<FlightLog>,
        _folder: &Path,
        _monitor: &dyn Monitor,
    ) -> Result<Vec<NamedPicture>, Failure> {
        Ok(Vec::new())
    }
}
