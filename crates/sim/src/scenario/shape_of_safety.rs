//! What the shape of safety must be for a law to keep it.

use super::error::ScenarioError;
use super::limits::positive;
use super::spec::{Safety, Scenario};

impl Scenario {
    /// An ellipsoid with a height, under a law that knows of ellipsoids.
    pub(super) fn check_safety(&self) -> Result<(), ScenarioError> {
        let Safety::Ellipsoid { half_height_m } = self.safety else { return Ok(()) };
        positive("safety.half_axes_m", "half of the height of the ellipsoid", half_height_m)?;
        let Ok(law) = self.law() else { return Ok(()) };
        if law.capabilities().uses_ellipsoid_metric {
            return Ok(());
        }
        Err(ScenarioError::new(format!("the law `{}` keeps balls from each other, not ellipsoids", law.name()))
            .coded("scenario/unsupported-by-law")
            .with_help("set law.kind to \"displacement\", or safety.shape to \"ball\"")
            .at("safety.shape")
            .at("law.kind"))
    }
}
