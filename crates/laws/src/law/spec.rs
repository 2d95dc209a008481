//! The list of laws. Every law is built by `new(context, keys)` of its own file.

use serde::{Deserialize, Serialize};

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
            /// Every law, with its default parameters.
            #[must_use]
            pub fn all() -> Vec<Self> {
                vec![$(Self::$kind(<$keys>::default()),)+]
            }

            /// The law, ready to fly.
            ///
            /// # Errors
            /// [`ParameterError`] where it does not exist for these parameters.
            pub fn build(&self, context: &LawContext<'_>) -> Result<Box<dyn Law>, ParameterError> {
                Ok(match self { $(Self::$kind(keys) => Box::new(<$law>::new(context, keys.clone())?),)+ })
            }
        }
    };
}

impl LawSpec {
    /// With the keys that follow from others where they are not given.
    #[must_use]
    pub fn complete(self, a22_per_s: f64) -> Self {
        match self {
            Self::Laplacian(keys) => Self::Laplacian(keys.complete(a22_per_s)),
            other => other,
        }
    }

    /// Whether the law keeps numbers of each edge of a complete graph, which itself takes no memory for them.
    #[must_use]
    pub fn keeps_edges(&self) -> bool {
        matches!(self, Self::EdgeTension(_))
    }
}

laws! {
    /// Distances as springs with a barrier at delta: collision-free on the complete graph.
    EdgeTension(EdgeTensionKeys) => EdgeTensionLaw,
    /// Consensus on the slots over any connected graph, and a tension between all who are near: collision-free.
    Displacement(DisplacementKeys) => DisplacementLaw,
    /// The Laplacian baseline: converges from every start and avoids nothing.
    Laplacian(LaplacianKeys) => LaplacianLaw,
    /// A potential field: consensus on the slots, repulsion from whoever is near, each vehicle braking itself.
    Potential(PotentialKeys) => PotentialLaw,
    /// Velocities that are reciprocally free of collisions, tracked.
    Orca(OrcaKeys) => OrcaLaw,
    /// A controller to the slot, overruled where two could no longer brake.
    CbfQp(CbfQpKeys) => CbfQpLaw,
    /// One distance to all who are near, bounded forces: a lattice, not given slots.
    Flocking(FlockingKeys) => FlockingLaw,
}
