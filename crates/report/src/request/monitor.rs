//! What a caller gives to a request: a monitor, which takes notes and ends the work, and a drawer of pictures.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Failure;
use crate::flight_log::FlightLog;
use crate::report::page::Picture;
use tautline_recordings::mcap::ExtraTopic;
use tautline_sim::scenario::Scenario;

/// Receives the output of a request while it is worked on. The command line prints it, other programs mostly drop it.
///
/// All methods but [`Self::interruption`] do nothing by default.
pub trait Monitor: Sync {
    /// The flag that ends the work once it is set.
    fn interruption(&self) -> &Arc<AtomicBool>;

    /// Takes a part of the answer in words, as soon as it is known and before files are written.
    fn say(&self, _text: &str) {}

    /// Takes a note or a warning.
    fn warn(&self, _text: &str) {}

    /// Takes the content of an output file named `-`.
    ///
    /// # Errors
    /// [`Failure`] where the content cannot be written.
    fn data(&self, _text: &str) -> Result<(), Failure> {
        Ok(())
    }

    /// A task begins, of `total` units of work where their number is known.
    fn begin(&self, _task: &str, _total: Option<u64>) {}

    /// `units` more units of the task are done.
    fn advance(&self, _units: u64) {}

    /// The task is at its end.
    fn finish(&self) {}

    /// Whether the caller has ended the work.
    fn is_interrupted(&self) -> bool {
        self.interruption().load(Ordering::Relaxed)
    }
}

/// Drops the output of a part of a request, which the same caller can end.
#[derive(Clone, Copy)]
pub struct Quiet<'a>(&'a Arc<AtomicBool>);

impl<'a> Quiet<'a> {
    /// Ends with the work that this monitor watches.
    #[must_use]
    pub fn new(of: &'a dyn Monitor) -> Self {
        Self(of.interruption())
    }
}

impl Monitor for Quiet<'_> {
    fn interruption(&self) -> &Arc<AtomicBool> {
        self.0
    }
}

/// Drops all output.
#[derive(Clone, Debug, Default)]
pub struct Silent {
    /// The flag that ends the work once it is set.
    pub interruption: Arc<AtomicBool>,
}

impl Monitor for Silent {
    fn interruption(&self) -> &Arc<AtomicBool> {
        &self.interruption
    }
}

/// Room for the pictures of a page \[bytes\].
pub const PICTURES_BYTES: usize = 900 << 10;

/// A picture and its name, such as `closest`.
pub type NamedPicture = (String, Picture);

/// Draws flights; another crate implements it. `()` draws nothing.
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
