//! A flag that ends an audit before its time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Says whether the work is to stop. Loops that may take long look at it, and leave what they found incomplete: who started
/// the work looks at it too, and drops the result.
#[derive(Clone, Debug, Default)]
pub(super) struct Interruption(Option<Arc<AtomicBool>>);

impl Interruption {
    pub(super) fn new(flag: Arc<AtomicBool>) -> Self {
        Self(Some(flag))
    }

    #[inline]
    pub(super) fn is_set(&self) -> bool {
        self.0.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}
