//! What the flight asked of bodies that turn.

use serde::{Deserialize, Serialize};

/// Numbers of quadrotors, over all samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VehicleNumbers {
    /// Name of their model.
    pub model: String,
    /// Largest angle between a vehicle's thrust and the vertical \[deg\].
    pub max_tilt_deg: f64,
    /// Largest thrust of a rotor over the most that it has.
    pub thrust_share: f64,
}

impl VehicleNumbers {
    pub(super) fn line(&self) -> String {
        let Self { model, max_tilt_deg, thrust_share } = self;
        format!(
            "{model}, tilted by {max_tilt_deg:.1} degrees at most, rotors at {:.0} % of their most",
            100.0 * thrust_share
        )
    }
}
