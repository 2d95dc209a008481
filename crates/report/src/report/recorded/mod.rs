//! The report on a recording: as JSON, in words, and as a page.
//!
//! `separation` and `audit` have the keys of a flight's `report.json`; what a recording adds stands beside them.

mod envelope;
mod moments;
mod report;
mod words;

pub use envelope::{OfCorners, OfLimit};
pub use report::{Basis, Between, Clock, EarlyEnd, Obstacles, RecordedAudit, RecordedReport, Seen, SeenWhen, Source};
pub use report::{OfPair, OfVehicle};
pub use words::interval;
