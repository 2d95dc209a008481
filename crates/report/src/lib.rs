//! Flights and audits as reports, figures and pages with a replay.
//!
//! | module | holds |
//! | --- | --- |
//! | [`request`] | everything that `tautline run` and `tautline audit` do, for programs |
//! | [`run`] | flies a scenario and returns its report |
//! | [`report`] | `report.json`, `report.html` and the verdict in words |
//! | [`flight_log`] | the history of a flight in bounded memory |
//! | [`drawing`] | rules and geometry that replays, pictures and figures share |
//! | [`figures`] | a run as charts in SVG |
//! | [`replay`] | a flight packed into a page: positions on a grid, links, slots, obstacles and what the judge found |

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

pub mod drawing;
pub mod figures;
pub mod flight_log;
pub mod replay;
pub mod report;
pub mod request;
pub mod run;
mod simplify;

pub use nalgebra;
pub use tautline_sim::scenario;
