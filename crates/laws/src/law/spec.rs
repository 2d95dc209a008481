//! The list of laws. What there is to know of a law stands in its own file; this list is the only one.

use serde::{Deserialize, Serialize};

use super::cbf_qp::CbfQpKeys;
use super::displacement::DisplacementKeys;
use super::edge_tension::EdgeTensionKeys;
use super::error::ParameterError;
use super::flocking::FlockingKeys;
use super::interface::Law;
use super::laplacian::LaplacianKeys;
use super::orca::OrcaKeys;
use super::potential::PotentialKeys;
use super::setting::Setting;

macro_rules! laws {
    ($($(#[doc = $doc:literal])+ $kind:ident($keys:ty),)+) => {
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
            pub fn build(&self, setting: &Setting<'_>) -> Result<Box<dyn Law>, ParameterError> {
                Ok(match self { $(Self::$kind(keys) => Box::new(keys.build(setting)?),)+ })
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
    EdgeTension(EdgeTensionKeys),
    /// Consensus on the slots over any connected graph, and a tension between all who are near: collision-free.
    Displacement(DisplacementKeys),
    /// The Laplacian baseline: converges from every start and avoids nothing.
    Laplacian(LaplacianKeys),
    /// A potential field: consensus on the slots, repulsion from whoever is near, each vehicle braking itself.
    Potential(PotentialKeys),
    /// Velocities that are reciprocally free of collisions, tracked.
    Orca(OrcaKeys),
    /// A controller to the slot, overruled where two could no longer brake.
    CbfQp(CbfQpKeys),
    /// One distance to all who are near, bounded forces: a lattice, not given slots.
    Flocking(FlockingKeys),
}
