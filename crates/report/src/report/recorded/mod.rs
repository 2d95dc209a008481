//! The report on a recording: as JSON, in words, and as a page.
//!
//! The keys of `separation` and `audit` are those of a flight's `report.json`.

mod envelope;
mod moments;
mod plan;
mod report;
mod well_clear;
mod words;

pub use envelope::{CornerFindings, LimitFindings};
pub use plan::{PlanCertificate, PlanDistance, PlanReport, PlanUnknown};
pub use report::{
    AssumedMotion, Basis, Clock, EarlyEnd, Obstacles, PresenceSpan, PresenceSummary, RecordedAudit, RecordedReport,
    Source,
};
pub use report::{PairFinding, VehicleFinding, unit};
pub use well_clear::WellClearFindings;
pub use words::interval;
