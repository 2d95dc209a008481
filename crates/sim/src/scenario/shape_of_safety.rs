//! What the shape of safety must be for a law to keep it.

use super::error::ScenarioError;
use super::spec::{Safety, Scenario};

/// Two safety distances that differ by less than this part are the same.
const ROUNDING: f64 = 1e-9;

impl Scenario {
    /// An ellipsoid of revolution as wide as delta, under a law that keeps ellipsoids apart.
    pub(super) fn check_safety(&self) -> Result<(), ScenarioError> {
        let Safety::Ellipsoid { half_axes_m: [a_m, b_m, _] } = self.safety else { return Ok(()) };
        let key = "safety.half_axes_m";
        if a_m != b_m {
            return Err(ScenarioError::new(format!("an ellipsoid with level half axes of {a_m} m and {b_m} m"))
                .with_help("vehicles turn: give both the same, the larger one")
                .at(key));
        }
        let (delta_m, width_m) = (self.delta_m, 2.0 * a_m);
        if (delta_m - width_m).abs() > ROUNDING * width_m {
            return Err(ScenarioError::new(format!(
                "a safety distance of {delta_m} m, and ellipsoids that touch side by side at {width_m} m"
            ))
            .with_help("leave law.delta_m out: it is twice the level half axes")
            .at("law.delta_m")
            .at(key));
        }
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
