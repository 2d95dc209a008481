//! List of the laws that scenarios may name. Each law is built by `new(context, keys)` of its own file.

use serde::{Deserialize, Serialize};

use super::bvc::{BvcKeys, BvcLaw};
use super::cbf_qp::{CbfQpKeys, CbfQpLaw};
use super::displacement::{DisplacementKeys, DisplacementLaw};
use super::edge_tension::{EdgeTensionKeys, EdgeTensionLaw};
use super::error::ParameterError;
use super::flocking::{FlockingKeys, FlockingLaw};
use super::interface::Law;
use super::interface::LawContext;
use super::laplacian::{LaplacianKeys, LaplacianLaw};
use super::orca::{OrcaKeys, OrcaLaw};
use super::potential::{PotentialKeys, PotentialLaw};

macro_rules! laws {
    ($($(#[doc = $doc:literal])+ $kind:ident($keys:ty) => $law:ty,)+) => {
        /// A control law and its parameters, as `[law]` of a scenario gives them.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
        #[schemars(tag = "kind")]
        #[serde(rename_all = "kebab-case")]
        pub enum LawSpec {
            $($(#[doc = $doc])+ $kind($keys),)+
        }

        impl LawSpec {
            /// Returns every law with its default parameters.
            #[must_use]
            pub fn all() -> Vec<Self> {
                vec![$(Self::$kind(<$keys>::default()),)+]
            }

            /// Builds the law.
            ///
            /// # Errors
            /// [`ParameterError`] if the law does not exist for these parameters.
            pub fn build(&self, context: &LawContext<'_>) -> Result<Box<dyn Law>, ParameterError> {
                Ok(match self { $(Self::$kind(keys) => Box::new(<$law>::new(context, keys.clone())?),)+ })
            }
        }
    };
}

impl LawSpec {
    /// Sets keys that are not given and follow from others.
    #[must_use]
    pub fn complete(self, a22_per_s: f64) -> Self {
        match self {
            Self::Laplacian(keys) => Self::Laplacian(keys.complete(a22_per_s)),
            other => other,
        }
    }

    /// Whether the law stores numbers per edge even for a complete graph, whose edges take no memory themselves.
    #[must_use]
    pub fn keeps_edges(&self) -> bool {
        matches!(self, Self::EdgeTension(_))
    }
}

laws! {
    /// Distances as springs with a barrier at delta: collision-free on the complete graph.
    EdgeTension(EdgeTensionKeys) => EdgeTensionLaw,
    /// Consensus on the slots over any connected graph, and a tension between near vehicles: collision-free.
    Displacement(DisplacementKeys) => DisplacementLaw,
    /// The Laplacian baseline: converges from every start, without collision avoidance.
    Laplacian(LaplacianKeys) => LaplacianLaw,
    /// Potential field: consensus on the slots, repulsion from near vehicles, damping of each own velocity.
    Potential(PotentialKeys) => PotentialLaw,
    /// Tracking of velocities that are reciprocally free of collisions.
    Orca(OrcaKeys) => OrcaLaw,
    /// Tracking of velocities towards the slot that stay in the vehicle's own buffered Voronoi cell.
    Bvc(BvcKeys) => BvcLaw,
    /// A controller to the slot, limited by control barrier functions that keep every pair able to brake.
    CbfQp(CbfQpKeys) => CbfQpLaw,
    /// One distance between near vehicles, bounded forces: forms a lattice; slots are not assigned.
    Flocking(FlockingKeys) => FlockingLaw,
}
