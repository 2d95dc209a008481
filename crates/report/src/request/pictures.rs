//! Pictures of flights, which are drawn by a crate that this one does not depend on.

use std::path::Path;
use std::sync::Arc;

use tautline_recordings::mcap::ExtraTopic;
use tautline_sim::scenario::Scenario;

use super::{Failure, Monitor};
use crate::flight_log::FlightLog;
use crate::report::page::Picture;

/// Room for the pictures of a page \[bytes\].
pub const PICTURES_BYTES: usize = 900 << 10;

/// A picture and its name, such as `closest`.
pub type NamedPicture = (String, Picture);

/// Draws flights. `()` draws nothing.
pub trait Pictures: Sync {
    /// Writes pictures of a flight of the scenario into the folder of its run and returns them for its page. A machine that
    /// cannot draw writes none and warns.
    ///
    /// # Errors
    /// [`Failure`] where a file cannot be written.
    fn draw(
        &self,
        scenario: &Scenario,
        log: &Arc<FlightLog>,
        folder: &Path,
        monitor: &dyn Monitor,
    ) -> Result<Vec<NamedPicture>, Failure>;

    /// Flies the scenario and draws the instant `at_s` \[s\]: an image as a data URI of about `room_bytes`.
    ///
    /// # Errors
    /// [`Failure`] where the scenario cannot be flown or the machine cannot draw.
    fn shot(&self, scenario: &Scenario, at_s: f64, room_bytes: usize) -> Result<String, Failure>;

    /// A topic that is recorded beside positions, so that other viewers can show the flight.
    fn topic(&self, _scenario: &Scenario) -> Option<Box<dyn ExtraTopic>> {
        None
    }
}

impl Pictures for () {
    fn draw(
        &self,
        _scenario: &Scenario,
        _log: &Arc<FlightLog>,
        _folder: &Path,
        _monitor: &dyn Monitor,
    ) -> Result<Vec<NamedPicture>, Failure> {
        Ok(Vec::new())
    }

    fn shot(&self, _scenario: &Scenario, _at_s: f64, _room_bytes: usize) -> Result<String, Failure> {
        Err(Failure::machine("pictures/none", "this build draws nothing"))
    }
}
