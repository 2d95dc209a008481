//! The report on a recording: as JSON, in words, and as a page.
//!
//! The keys of `separation` and `audit` are those of a flight's `report.json`.

mod envelope;
mod moments;
mod report;
mod words;

pub use envelope::{OfCorners, OfLimit};
pub use report::{Basis, Between, Clock, EarlyEnd, Obstacles, RecordedAudit, RecordedReport, Seen, SeenWhen, Source};
pub use report::{OfPair, OfVehicle};
pub use words::interval;
