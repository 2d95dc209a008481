//! Scenarios, and the simulation of vehicles in a rigid-body engine under a control law.
//!
//! [`Scenario`] is a validated flight, read from TOML or built in code; [`Simulation`] flies it step by step. Control
//! laws implement [`Law`], vehicles [`Plant`], imperfections between the true state and the law [`Imperfections`]. Data
//! flows one way:
//!
//! ```text
//! scenario -> sim ( advance -> judge -> sense -> command -> actuate -> apply ) -> samples and events
//! ```
//!
//! | module | holds |
//! | --- | --- |
//! | [`scenario`] | the validated flight and the keys of its file |
//! | [`preflight`] | checks before a flight: stability, certificate, step, equilibria, rigidity |
//! | [`sim`] | the simulation loop |
//! | [`plant`] | equations of motion under a held command; `rapier` is the physics engine |
//! | [`vehicle`] | models of quadrotors and unicycles: forces, rotors, attitude loop |
//! | [`link`] | imperfections between true state and law: radio, sensing, actuation |
//! | [`continuous`] | solution of the equations of motion in continuous time |
//! | [`metrics`] | running metrics of recorded samples |
//! | [`plan`] | formations of a flight, their placement over the swarm, and edge tensions |
//!
//! The feature `drawn`, on by default, reads formations drawn as letters, SVG and PNG pictures. A build without it
//! refuses these shapes with an error that names the feature.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

/// Embeds a file of the folder `assets`. Takes parts of its name.
macro_rules! embedded {
    ($($name:literal),+) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/", env!("TAUTLINE_ASSETS"), "/", $($name),+))
    };
}

pub mod continuous;
pub mod link;
pub mod metrics;
pub mod plan;
pub mod plant;
pub mod preflight;
pub mod scenario;
pub mod shield;
pub mod sim;
pub mod vehicle;

pub use link::Imperfections;
pub use nalgebra;
pub use plant::Plant;
pub use scenario::Scenario;
pub use sim::Simulation;
pub use tautline_audit as audit;
pub use tautline_core::{record, swarm};
pub use tautline_laws::law::Law;
pub use tautline_laws::{formation, graph, law, observation, space, target, wind};
