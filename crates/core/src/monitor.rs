//! Interface between a request and its caller: notes, progress and interruption.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::failure::Failure;

/// Receiver of the output of a request. The command line prints it; most other programs drop it.
///
/// All methods except [`Self::interruption`] do nothing by default.
pub trait Monitor: Sync {
    /// Returns the flag that ends the work once it is set.
    fn interruption(&self) -> &Arc<AtomicBool>;

    /// Receives a part of the answer in words, as soon as it is known and before files are written.
    fn say(&self, _text: &str) {}

    /// Receives a note or a warning.
    fn warn(&self, _text: &str) {}

    /// Receives the content of an output file named `-`.
    ///
    /// # Errors
    /// [`Failure`] if the content cannot be written.
    fn data(&self, _text: &str) -> Result<(), Failure> {
        Ok(())
    }

    /// Starts a task of `total` units of work, if the number is known.
    fn begin(&self, _task: &str, _total: Option<u64>) {}

    /// Advances the task by `units`.
    fn advance(&self, _units: u64) {}

    /// Ends the task.
    fn finish(&self) {}

    /// Returns whether the caller has ended the work.
    fn is_interrupted(&self) -> bool {
        self.interruption().load(Ordering::Relaxed)
    }
}

/// A monitor that drops the output of a part of a request and shares the interruption of another monitor.
#[derive(Clone, Copy)]
pub struct Quiet<'a>(&'a Arc<AtomicBool>);

impl<'a> Quiet<'a> {
    /// Returns a monitor with the interruption of `monitor`.
    #[must_use]
    pub fn new(monitor: &'a dyn Monitor) -> Self {
        Self(monitor.interruption())
    }
}

impl Monitor for Quiet<'_> {
    fn interruption(&self) -> &Arc<AtomicBool> {
        self.0
    }
}

/// A monitor that drops all output.
#[derive(Clone, Debug, Default)]
pub struct Silent {
    /// Flag that ends the work once it is set.
    pub interruption: Arc<AtomicBool>,
}

impl Monitor for Silent {
    fn interruption(&self) -> &Arc<AtomicBool> {
        &self.interruption
    }
}
