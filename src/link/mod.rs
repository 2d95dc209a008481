//! What lies between the true world and the laws: sensors and radio on the way in, actuators on the way out.
//!
//! An imperfection is a file here and a [`Link`]. [`Direct`] is the link without any: laws see the true state itself,
//! and nothing is copied.

mod delay;
mod history;
mod interface;

pub use delay::{Delay, DelayError};
pub use history::History;
pub use interface::{Direct, Link, Sensed};
