//! Control laws: what acceleration each vehicle asks for, given what it knows.
//!
//! A law is a file: its keys in a scenario, its bounds, its energy, its certificate and what that assumes. `spec` lists
//! the laws that scenarios may name. A law of your own implements [`Law`] and is flown like the built-in ones
//! (see `examples/own_law.rs`).

mod cbf_qp;
mod certificate;
mod clearance;
mod consensus;
mod displacement;
mod edge_tension;
mod energy;
mod error;
mod flocking;
mod half_spaces;
mod interface;
mod kernel;
mod laplacian;
mod modes;
mod orca;
mod pinned;
mod potential;
mod spec;
mod tension;

pub use cbf_qp::{CbfQpKeys, CbfQpLaw};
pub use certificate::{Certificate, LegBound, Void};
pub use displacement::{DisplacementKeys, DisplacementLaw};
pub use edge_tension::{EdgeTensionKeys, EdgeTensionLaw};
pub use error::{LawError, ParameterError};
pub use flocking::{FlockingKeys, FlockingLaw};
pub use interface::{
    Capabilities, Controls, Law, LawContext, RateQuery, Rates, VelocityMargin, WindExposure, certificate_through,
};
pub use laplacian::{LaplacianKeys, LaplacianLaw};
pub use modes::{Heard, HeardLinks, Linear, Mode};
pub use orca::{OrcaKeys, OrcaLaw};
pub use potential::{PotentialKeys, PotentialLaw};
pub use spec::LawSpec;
pub use tension::{EdgeTension, TensionError};

#[cfg(test)]
mod tests;
