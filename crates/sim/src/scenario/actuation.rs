//! `[actuation]`: how commands become accelerations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How commands become accelerations: as given and at once unless given.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ActuationSpec {
    /// Limit of each vehicle's acceleration in m/s^2: longer commands are shortened, in their direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: Option<f64>,
    /// Time constant in s with which the acceleration follows the command, lag a' = u - a, from none at the start.
    #[serde(skip_serializing_if = "super::sensing::is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub lag_s: f64,
}
