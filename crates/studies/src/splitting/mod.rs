//! Events too rare to be met by chance: adaptive multilevel splitting.
//!
//! So many flights are flown. Those that came least near to the event are ended; each is flown again as a copy of one that came
//! nearer, up to the step at which that one was past where the best of the ended had come, and from there on with fresh noise. What
//! each round leaves of the flights multiplies to the probability of the event ([`split`]), without bias for any number of flights
//! (Brehier, Gazeau, Goudenege, Lelievre and Rousset, Annals of Applied Probability 26(6), 2016).
//!
//! [`estimate`] asks for the probability that a flight is violated, [`Repetitions`] gives the interval of several estimates, and
//! [`replay`] flies a bad flight again.

mod estimate;
mod levels;
mod lineage;
#[cfg(test)]
mod tests;

pub use estimate::{BadFlight, Repetitions, Settings, Splitting, StateAt, check, estimate, replay};
pub use levels::{Path, Rule, Split, split};
pub use lineage::{Branch, Genealogy, Lineage};
