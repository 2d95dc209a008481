//! The report on a recording: as JSON, in words, and as a page.
//!
//! The first keys of its JSON are those of a flight's `report.json` ([`Judgement`](crate::report::Judgement)).

mod envelope;
mod moments;
mod plan;
mod report;
mod well_clear;
mod words;

pub use envelope::{CornerFindings, LimitFindings};
pub use plan::{PlanCertificate, PlanDistance, PlanReport, PlanUnknown};
pub use report::{Clock, EarlyEnd, PresenceSpan, PresenceSummary, RecordedReport, RunObjection, Source};
pub use report::{PairFinding, VehicleFinding, unit};
pub use well_clear::WellClearFindings;
pub(crate) use words::THE_PLAN;
pub use words::interval;
