//! What lies between the true world and the laws: sensors and radio on the way in, actuators on the way out.
//!
//! An imperfection is a file here, and [`of`] puts those of a scenario together into one [`Imperfections`]. [`Direct`] has
//! none: laws see the true state itself, and nothing is copied. docs/imperfections.md has the equations.
//!
//! Whatever happens at instants of its own (measurements, messages) happens when the flight has come to them
//! ([`Imperfections::settle`]) and depends on the seed, on who it happens to and on its number alone: not on steps, on how often a
//! trial state is asked about, or on threads.

mod actuation;
mod ages;
mod failing;
mod history;
mod interface;
mod links;
mod loss;
mod messages;
mod noise;
mod sensing;
mod world;

pub use history::History;
pub use interface::{Direct, Imperfections, Sensed, Traffic};
pub use world::of;
