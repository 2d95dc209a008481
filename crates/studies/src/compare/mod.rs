//! Laws side by side: the same starts, the same plant and the same audit under each of them.
//!
//! [`Plan`] says what is flown, [`Plan::fly`] flies it on all threads, and a [`Comparison`] is a row of numbers a law, which it
//! says as JSON, CSV, LaTeX, a page and a table. A single flight is [`fly`], a row of numbers too.

mod csv;
mod effort;
mod flight;
mod html;
mod latex;
mod measures;
mod parallel;
mod plan;
mod request;
mod result;
mod side_by_side;
mod words;

pub use effort::Effort;
pub use flight::{FlightRow, Outcome, fly};
pub use html::ComparePage;
pub use parallel::in_parallel;
pub use plan::{CompareError, Plan};
pub use request::{CompareRequest, compare};
pub use result::{Comparison, LawPerformance, LawRow, Performance, SCHEMA_VERSION};
pub use side_by_side::Watch;

#[cfg(test)]
mod tests;
