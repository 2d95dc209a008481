//! Shares, means, quantiles and differences of pairs, with 95 % intervals.
//!
//! | interval | holds for | error probability |
//! | --- | --- | --- |
//! | [`Proportion::new`], [`Estimate`], [`Paired`] | a number of runs fixed beforehand | at most 2.5 % on either side |
//! | [`Proportion::upper_bound`] | a number of runs fixed beforehand | at most 5 % above |
//! | [`anytime`], [`ConfidenceSequence`] | every number of runs at once, for early stops | at most 5 % |
//!
//! The tests of this module measure how often each interval contains the truth.

mod estimate;
mod proportion;
mod sequence;

pub use estimate::Estimate;
pub use proportion::{Paired, Proportion};
pub use sequence::{ConfidenceSequence, anytime, looks};

/// Probability with which an interval contains the true value.
pub const CONFIDENCE: f64 = 0.95;

/// Error probability on either side of an interval.
const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);

#[cfg(test)]
mod tests;
