//! `[actuation]`: how commands become accelerations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;

/// How commands become accelerations: as given and at once unless given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ActuationSpec {
    /// No vehicle is accelerated by more than this \[m/s^2\]: longer commands are shortened.
    pub max_accel_m_s2: Option<f64>,
    /// Time constant with which the acceleration follows the command \[s\]; 0 where it is the command.
    pub lag_s: f64,
}

/// How commands become accelerations.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ActuationTable {
    /// How often the law is asked in Hz, each command being held in between: the same as `time.control_hz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) control_hz: Option<f64>,
    /// No vehicle is accelerated by more than this in m/s^2: longer commands are shortened, in their direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    max_accel_m_s2: Option<f64>,
    /// Time constant in s with which the acceleration follows the command, lag a' = u - a, from none at the start.
    #[serde(skip_serializing_if = "super::sensing::is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    lag_s: f64,
}

impl ActuationTable {
    /// The control rate \[Hz\], of which `[time]` has the same key.
    pub(super) fn control_hz(&self, of_time_hz: Option<f64>) -> Result<Option<f64>, ScenarioError> {
        match (self.control_hz, of_time_hz) {
            (Some(own_hz), Some(of_time_hz)) if own_hz != of_time_hz => Err(ScenarioError::new(format!(
                "actuation.control_hz is {own_hz} and time.control_hz is {of_time_hz}, and both are the control rate"
            ))
            .coded("scenario/exclusive-keys")
            .with_help("keep one of them")
            .at("actuation.control_hz")
            .at("time.control_hz")),
            (own_hz, of_time_hz) => Ok(own_hz.or(of_time_hz)),
        }
    }

    pub(super) fn spec(&self) -> ActuationSpec {
        ActuationSpec { max_accel_m_s2: self.max_accel_m_s2, lag_s: self.lag_s }
    }
}

impl From<ActuationSpec> for ActuationTable {
    fn from(spec: ActuationSpec) -> Self {
        Self { control_hz: None, max_accel_m_s2: spec.max_accel_m_s2, lag_s: spec.lag_s }
    }
}
