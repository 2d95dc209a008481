//! Control laws: the acceleration that each vehicle commands, as a function of the states that it knows.
//!
//! Each law has one file with its scenario keys, bounds, energy, certificate and assumptions. `spec` lists the laws
//! that scenarios may name. A custom law implements [`Law`] and runs like the built-in ones (see
//! `examples/own_law.rs`).

mod bvc;
mod cbf_qp;
mod certificate;
mod clearance;
mod consensus;
mod displacement;
mod edge_tension;
mod energy;
mod error;
mod flocking;
mod interface;
mod kernel;
mod laplacian;
mod modes;
mod orca;
mod pinned;
mod potential;
mod spec;
mod tension;
mod velocity_tracking;

pub use bvc::{BvcKeys, BvcLaw};
pub use cbf_qp::{CbfQpKeys, CbfQpLaw, CbfQpVariant};
pub use certificate::{Certificate, LegBound, VoidReason};
pub use displacement::{DisplacementKeys, DisplacementLaw};
pub use edge_tension::{EdgeTensionKeys, EdgeTensionLaw};
pub use error::{LawError, ParameterError};
pub use flocking::{FlockingKeys, FlockingLaw};
pub use interface::{
    Capabilities, Controls, Law, LawContext, RateQuery, Rates, VelocityMargin, WindExposure, certificate_through,
};
pub use laplacian::{LaplacianKeys, LaplacianLaw};
pub use modes::{DelayedLinks, Linear, Mode, ReceivedStateLoop};
pub use orca::{OrcaKeys, OrcaLaw};
pub use potential::{PotentialKeys, PotentialLaw};
pub use spec::LawSpec;
pub use tension::{EdgeTension, TensionError};

#[cfg(test)]
mod tests;
