//! What a law is built from, and what its keys must be.

use nalgebra::Vector3;

use super::error::ParameterError;
use super::interface::{Capabilities, Controls};
use crate::formation::Formation;
use crate::graph::{Graph, Pinning};
use crate::space::{Metric, Obstacle};
use crate::target::{Guidance, Leg, Reference};
use crate::wind::WindSpec;

/// What a law is built from beside its own keys.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// Who talks to whom.
    pub links: &'a Graph,
    /// The formation of the first leg.
    pub formation: &'a Formation,
    /// The legs after it.
    pub later: &'a [Leg],
    /// The motion that formations are carried along with, and who knows it.
    pub guidance: Option<&'a Guidance>,
    /// What stands in the way.
    pub obstacles: &'a [Obstacle],
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Velocity coefficient a22 of the vehicles \[1/s\], drag of the air included.
    pub a22_per_s: f64,
    /// The lengths that delta is one of, and that vehicles are kept apart in.
    pub metric: Metric,
    /// What pushes them beside their commands, where anything does.
    pub blown: Option<Blown<'a>>,
}

/// A wind, and how it is felt.
#[derive(Clone, Copy, Debug)]
pub struct Blown<'a> {
    /// What blows.
    pub wind: &'a WindSpec,
    /// Acceleration of a vehicle over the velocity of the air past it \[1/s\].
    pub drag_per_s: f64,
    /// End of the flight \[s\].
    pub until_s: f64,
    /// A distance that exceeds delta by no more than this is not told from it \[m\].
    pub resolution_m: f64,
}

impl<'a> Setting<'a> {
    /// One formation, wherever it comes to be.
    #[must_use]
    pub fn new(links: &'a Graph, formation: &'a Formation, delta_m: f64, a22_per_s: f64) -> Self {
        Self {
            links,
            formation,
            later: &[],
            guidance: None,
            obstacles: &[],
            delta_m,
            a22_per_s,
            metric: Metric::default(),
            blown: None,
        }
    }

    /// Who knows the reference.
    pub(super) fn pinning(&self) -> Pinning {
        self.guidance.map_or(Pinning::Nobody, |guidance| guidance.known_by.clone())
    }
}

/// What vehicles know of a reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carried {
    /// Whether there is one.
    is_guided: bool,
    /// Whether they are told how it accelerates.
    is_fed: bool,
}

impl Carried {
    /// Of a scenario.
    ///
    /// # Errors
    /// [`ParameterError::ReferenceNotHeard`] where some do not know the reference.
    pub(super) fn new(setting: &Setting<'_>) -> Result<Self, ParameterError> {
        let Some(guidance) = setting.guidance else { return Ok(Self { is_guided: false, is_fed: false }) };
        match guidance.known_by {
            Pinning::All => Ok(Self { is_guided: true, is_fed: guidance.feed_forward }),
            Pinning::Nobody | Pinning::Listed(_) | Pinning::Leader(_) => Err(ParameterError::ReferenceNotHeard),
        }
    }

    /// r'' as far as it is told \[m/s^2\].
    pub(super) fn fed_m_s2(self, reference: &Reference) -> Vector3<f64> {
        if self.is_fed { reference.acceleration_m_s2 } else { Vector3::zeros() }
    }

    /// What a law with such a reference controls and needs.
    pub(super) fn capabilities(self) -> Capabilities {
        const SEES: &str = "each sees who is near and how fast it moves";
        let needs: &[&str] = if self.is_guided {
            &["all share a compass, know where they are and know the reference", SEES]
        } else {
            &["all share a compass and know where they are", SEES]
        };
        let controls = if self.is_guided { Controls::Places } else { Controls::Displacements };
        Capabilities { needs, controls, ..Capabilities::default() }
    }
}
