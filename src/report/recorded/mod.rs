//! The report on a recording: as JSON, in words, and as a page.
//!
//! `separation` and `audit` have the keys of a flight's `report.json`; what a recording adds stands beside them.

mod moments;
mod report;
mod words;

pub use report::{Basis, Between, Clock, Obstacles, OfPair, OfVehicle, RecordedAudit, RecordedReport, Source};
pub use words::interval;
