//! Flights of shielded vehicles on the ideal plant.

mod flights;
pub(crate) mod random;
mod reference;
mod twins;
mod world;
