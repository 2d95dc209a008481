//! `report.json`, `report.html` and the verdict in words.
//!
//! A [`Report`] is built from what the loop, the judge and the metrics found, and knows how to say it: as JSON with
//! stable keys, as a page for people, as one line, and as a short table. The keys are those of the structures below, in
//! their order; units are in the names, vehicles are numbered from 1. What does not apply, or is not a finite number, is
//! null.

mod artefact;
mod ellipsoid;
mod energy;
mod failures;
mod findings;
mod flight;
mod html;
mod hulls;
mod legs;
mod moments;
mod network;
mod obstacles;
pub mod page;
pub mod recorded;
mod strain;
mod vehicles;
mod verdict;
mod verification;
mod words;

pub use artefact::{ArtefactError, write_atomically, write_atomically_with};
pub use ellipsoid::Ellipsoid;
pub use failures::FailedVehicle;
pub use findings::{Findings, INTERRUPTED, Performance, Run};
pub use flight::{
    Audit, ClosedForm, Control, Energy, FormationNumbers, Parry, Rapier, Report, SCHEMA_VERSION, ScenarioIdentity,
    Separation, Tool, Velocity, Violation,
};
pub use html::RunPage;
pub use hulls::{Hulls, PassedThrough};
pub use legs::LegNumbers;
pub use network::Network;
pub use obstacles::{ObstacleApproach, ObstacleViolation, Obstacles};
pub use strain::VehicleNumbers;
pub use tautline_audit::Status;
pub use verdict::{Fails, Verdict};
pub use verification::Verification;

#[cfg(test)]
mod early_end_tests;
#[cfg(test)]
mod promise_tests;
#[cfg(test)]
mod tests;
