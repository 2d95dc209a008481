//! `[sensing]`: what vehicles measure of themselves and of whoever is near.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What vehicles measure: exactly, at once and all the time unless given.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensingSpec {
    /// Standard deviation in m, along each axis, of the error of a measured position: a new one with each measurement
    /// (motion capture 0.001, ultra-wide band 0.1, satellites 1). Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub position_noise_m: f64,
    /// Standard deviation in m, along each axis, of an error of the own position that a vehicle keeps for the whole flight.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub position_bias_m: f64,
    /// Standard deviation in m/s, along each axis, of the error of a measured velocity: a new one with each measurement.
    /// Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub velocity_noise_m_s: f64,
    /// Measurements a second in Hz, held in between; all the time unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate_hz: Option<f64>,
    /// How old a measurement is when it is known, in s: delays all that a vehicle knows, its own state too.
    #[serde(skip_serializing_if = "is_off")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub latency_s: f64,
    /// The same of what a vehicle sees, with a sensor on board, of whoever is near, in s; `latency_s` unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub near_latency_s: Option<f64>,
}

impl SensingSpec {
    /// Whether vehicles know their own present state and that of whoever is near.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        *self == Self::default() || (Self { near_latency_s: None, ..*self } == Self::default() && self.near_s() == 0.0)
    }

    /// Whether measurements are off the truth.
    #[must_use]
    pub fn is_noisy(&self) -> bool {
        self.position_noise_m > 0.0 || self.velocity_noise_m_s > 0.0 || self.position_bias_m > 0.0
    }

    /// How old what is seen of near ones is when it is known \[s\].
    #[must_use]
    pub fn near_s(&self) -> f64 {
        self.near_latency_s.unwrap_or(self.latency_s)
    }
}

/// Whether a number that is 0 unless given is not.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
pub(super) fn is_off(number: &f64) -> bool {
    *number == 0.0
}
