//! What some runs say of all that could have been flown: shares, means, quantiles and differences with 95 % intervals.
//!
//! [`Proportion::new`], [`Estimate`] and [`Paired`] are two-sided, with at most 2.5 % on either side, and for a number of runs that was
//! fixed beforehand. [`Proportion::upper_bound`] is one-sided, with at most 5 % above. Whoever wants to stop where the answer is known takes [`anytime`] and [`ConfidenceSequence`], which hold at
//! every number of runs at once. `coverage` measures how often each of them holds the truth.

mod estimate;
mod proportion;
mod sequence;

pub use estimate::Estimate;
pub use proportion::{Paired, Proportion};
pub use sequence::{ConfidenceSequence, anytime, looks};

/// How often an interval holds the true value.
pub const CONFIDENCE: f64 = 0.95;

/// Probability that an interval leaves out on either side.
const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);

#[cfg(test)]
mod tests;
