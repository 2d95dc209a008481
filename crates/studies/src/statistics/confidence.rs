//! How sure all intervals are.

/// How often an interval holds the true value.
pub const CONFIDENCE: f64 = 0.95;

/// What an interval leaves out on either side.
pub(super) const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);
