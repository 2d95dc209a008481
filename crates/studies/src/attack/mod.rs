//! The worst start, wind or loss within stated bounds, searched for by an optimiser over the smallest separation of a flight.
//!
//! [`Plan`] says what may be varied and how far, [`Plan::search`] flies candidates on all threads, and an [`Attack`] holds the
//! worst that was found. A search that finds nothing proves nothing.

mod bounds;
mod cma_es;
mod csv;
mod fold;
mod html;
mod method;
mod plan;
mod request;
mod result;
mod search;
mod words;

pub use bounds::{Bound, Variation};
pub use html::AttackPage;
pub use method::Method;
pub use plan::{Asked, AttackError, Plan};
pub use request::{AttackRequest, FLIGHTS, SEEDS_OF_A_CANDIDATE, attack};
pub use result::{Attack, Candidate, Flown, SCHEMA_VERSION};

#[cfg(test)]
mod tests;
