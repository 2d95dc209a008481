//! `[sensing]`: what vehicles measure of themselves and of whoever is near.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::limits::{at_least_zero, positive};
use super::spec::Scenario;

/// What vehicles measure: exactly, at once and all the time unless given.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SensingSpec {
    /// Standard deviation in m, along each axis, of the error of a measured position: a new one with each measurement
    /// (motion capture 0.001, ultra-wide band 0.1, satellites 1). Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0)))]
    pub position_noise_m: f64,
    /// Standard deviation in m, along each axis, of an error of the own position that a vehicle keeps for the whole flight.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0)))]
    pub position_bias_m: f64,
    /// Standard deviation in m/s, along each axis, of the error of a measured velocity: a new one with each measurement.
    /// Needs `rate_hz`.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0)))]
    pub velocity_noise_m_s: f64,
    /// Measurements a second in Hz, held in between; all the time unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(extend("exclusiveMinimum" = 0)))]
    pub rate_hz: Option<f64>,
    /// How old a measurement is when it is known, in s: delays all that a vehicle knows, its own state too.
    #[serde(skip_serializing_if = "is_off")]
    #[cfg_attr(feature = "schema", schemars(extend("default" = 0.0, "minimum" = 0)))]
    pub latency_s: f64,
    /// The same of what a vehicle sees, with a sensor on board, of whoever is near, in s; `latency_s` unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "schema", schemars(extend("minimum" = 0)))]
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

/// Shortest latency that is not none \[s\].
const SHORTEST_S: f64 = 1e-6;

/// The latency, if it is 0, or at least a microsecond and no longer than the flight.
pub(super) fn latency(key: &'static str, what: &str, latency_s: f64, duration_s: f64) -> Result<f64, ScenarioError> {
    at_least_zero(key, what, latency_s)?;
    if latency_s == 0.0 || (SHORTEST_S..=duration_s).contains(&latency_s) {
        return Ok(latency_s);
    }
    let (said, help) = if latency_s < SHORTEST_S {
        (format!("{what} is {latency_s} s"), format!("give at least {SHORTEST_S} s, or 0 for none"))
    } else {
        (
            format!("{what} is {latency_s} s in a flight of {duration_s} s"),
            "nothing would ever be known but the start: give less, or enlarge time.duration_s".to_owned(),
        )
    };
    Err(ScenarioError::new(said).with_help(help).at(key).at("time.duration_s"))
}

impl Scenario {
    /// Errors and times that are such, errors with a rate at which they are drawn, and nothing that continuous time cannot have.
    pub(super) fn check_sensing(&self) -> Result<(), ScenarioError> {
        let SensingSpec { rate_hz, latency_s, near_latency_s, .. } = self.sensing;
        let noises = [
            ("sensing.position_noise_m", "the error of a measured position", self.sensing.position_noise_m),
            ("sensing.velocity_noise_m_s", "the error of a measured velocity", self.sensing.velocity_noise_m_s),
        ];
        for (key, what, noise) in noises {
            if at_least_zero(key, what, noise)? > 0.0 && rate_hz.is_none() {
                return Err(ScenarioError::new(format!(
                    "{what} is drawn anew with each measurement, and none has a time"
                ))
                .with_help("say how often it is measured: sensing.rate_hz, such as 100")
                .at(key));
            }
        }
        at_least_zero("sensing.position_bias_m", "the lasting error of a position", self.sensing.position_bias_m)?;
        if let Some(rate_hz) = rate_hz {
            positive("sensing.rate_hz", "the rate of measurements", rate_hz)?;
            self.check_sampled("sensing.rate_hz")?;
        }
        latency("sensing.latency_s", "the latency of measurements", latency_s, self.time.duration_s)?;
        let near = "the latency of what is seen of near ones";
        latency("sensing.near_latency_s", near, near_latency_s.unwrap_or(0.0), self.time.duration_s).map(|_| ())
    }

    /// Refuses what happens at instants of its own where time is continuous.
    pub(super) fn check_sampled(&self, key: &'static str) -> Result<(), ScenarioError> {
        if self.plant.holds_commands() || self.time.control_hz.is_some() {
            return Ok(());
        }
        Err(ScenarioError::new(format!(
            "{key} makes what is known jump, and the ideal plant asks the law in continuous time, where nothing does"
        ))
        .with_help("set actuation.control_hz, at which commands are made and held, or plant.kind to \"rapier\"")
        .at(key)
        .at("plant.kind"))
    }
}
