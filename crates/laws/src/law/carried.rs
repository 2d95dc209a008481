//! A reference under laws that know no links: every vehicle knows it, since nobody could hear of it.

use nalgebra::Vector3;

use super::error::ParameterError;
use super::interface::{Capabilities, Controls};
use super::setting::Setting;
use crate::graph::Pinning;
use crate::target::Reference;

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
