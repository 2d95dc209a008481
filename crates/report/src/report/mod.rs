//! `report.json`, `report.html` and the verdict in words.
//!
//! A [`Report`] combines the findings of simulation, audit and metrics. It is written as JSON with stable keys, as a
//! page, as a verdict line and as a short table. The JSON keys are the fields of the structures below, in their order.
//! Units are in the names, and vehicles are numbered from 1. Numbers that do not apply or are not finite are null.

mod answer;
mod findings;
mod flight;
mod html;
mod hulls;
mod legs;
pub mod page;
pub mod recorded;
mod section;
mod shield;
mod verdict;
mod words;

pub use answer::{Answer, Detectors, Enclosure, Finding, FindingList, Judgement, Objects, Part, Question};
pub use flight::{
    Control, Ellipsoid, Energy, FailedVehicle, FlightCertificate, FlightResult, FormationNumbers, Performance, Report,
    Run, SCHEMA_VERSION, ScenarioIdentity, Tool, VehicleNumbers, Velocity, Verification,
};
pub use html::RunPage;
pub use hulls::{Hulls, PassedThrough};
pub use legs::LegNumbers;
pub use shield::ShieldNumbers;
pub use tautline_audit::Status;
pub use verdict::{Reason, UnmetCriterion, Verdict};

#[cfg(test)]
mod tests;
