//! What a caller sees of a request while it is worked on, and how a caller ends it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Failure;

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
