//! Adaptive multilevel splitting: the probability of events too rare for plain sampling.
//!
//! A number of flights is flown. Each round ends the flights with the lowest scores, and replaces each of them by a
//! copy of a surviving flight. The level of the round is the largest score that it ended. A copy follows the survivor
//! up to its first step above the level, and has fresh noise from there on.
//!
//! The product of the surviving fractions of all rounds estimates the probability of the event ([`split`]). The
//! estimate is without bias for any number of flights. Source: Brehier, Gazeau, Goudenege, Lelievre and Rousset, Annals
//! of Applied Probability 26(6), 2016.
//!
//! [`estimate`] returns the probability that a flight is violated, [`Repetitions`] the interval of several estimates,
//! and [`replay`] repeats a violated flight.

mod estimate;
mod levels;
mod lineage;
#[cfg(test)]
mod tests;

pub use estimate::{
    Repetitions, Splitting, SplittingSettings, StateHashAtStep, ViolatedFlight, check, estimate, replay,
};
pub use levels::{RandomProcess, SplitResult, SplittingRule, split};
pub use lineage::{Branch, Genealogy, Lineage};
