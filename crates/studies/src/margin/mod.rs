//! How much of one key a verdict survives: where between two values it turns, by bisection over seeded flights.
//!
//! [`Plan`] says what is flown, [`Plan::search`] flies it on all threads, and a [`Margin`] holds the bracket and every value
//! that was tried, which it says as JSON, CSV, a page and a table.

mod csv;
mod fly;
mod html;
mod plan;
mod request;
mod result;
mod search;
mod words;

pub use html::MarginPage;
pub use plan::{Asked, MarginError, Plan, Question};
pub use request::{MarginRequest, margin};
pub use result::{Flown, Margin, Probe, SCHEMA_VERSION, Turn};
pub use search::Range;

#[cfg(test)]
mod tests;
