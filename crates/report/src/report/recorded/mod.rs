//! The report on a recording: as JSON, in words, and as a page.
//!
//! The first keys of its JSON are those of a flight's `report.json` ([`Judgement`](crate::report::Judgement)).

mod moments;
mod plan;
mod report;
mod words;

pub use super::findings::interval;
pub use plan::{PlanCertificate, PlanDistance, PlanReport, PlanUnknown};
pub use report::{
    Clock, Corners, EarlyEnd, PresenceSpan, PresenceSummary, RecordedReport, RunObjection, Source, VehicleFinding, unit,
};
pub(crate) use words::THE_PLAN;
