//! `report.json`, `report.html` and the verdict in words.
//!
//! A [`Report`] is built from what the loop, the judge and the metrics found, and knows how to say it: as JSON with
//! stable keys, as a page for people, as one line, and as a short table. The keys are those of the structures below, in
//! their order; units are in the names, vehicles are numbered from 1. What does not apply, or is not a finite number, is
//! null.

mod artefact;
mod flight;
mod html;
mod hulls;
mod legs;
mod moments;
mod obstacles;
pub mod page;
pub mod recorded;
mod section;
mod verdict;
mod words;

pub use artefact::{ArtefactError, write_atomically, write_atomically_with};
pub use flight::{
    Audit, ClosedForm, Control, Ellipsoid, Energy, FailedVehicle, FlightResult, FormationNumbers, INTERRUPTED, Parry,
    Performance, Rapier, Report, Run, SCHEMA_VERSION, ScenarioIdentity, Separation, Tool, VehicleNumbers, Velocity,
    Verification, Violation,
};
pub use html::RunPage;
pub use hulls::{Hulls, PassedThrough};
pub use legs::LegNumbers;
pub use obstacles::{ObstacleApproach, ObstacleViolation, Obstacles};
pub use tautline_audit::Status;
pub use verdict::{Fails, Verdict};

#[cfg(test)]
mod tests;
