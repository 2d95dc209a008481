//! `[[failure]]`: a vehicle of which a part fails.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::limits::require_finite;
use super::spec::Scenario;

/// A vehicle of which a part fails, for the rest of the flight.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// The vehicle, counted from 1.
    #[cfg_attr(feature = "schema", schemars(range(min = 1)))]
    pub vehicle: u64,
    /// From when on in s.
    pub at_s: f64,
    /// What fails.
    #[cfg_attr(feature = "schema", schemars(flatten))]
    pub kind: FailureKind,
}

/// What fails.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema), schemars(tag = "kind"))]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum FailureKind {
    /// It commands nothing any more: a point drifts on.
    Dead {},
    /// It sends nothing any more. Needs `network.rate_hz`.
    Silent {},
    /// Its command stays as it was.
    Frozen {},
}

impl Failure {
    /// Whether it sends nothing any more.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        matches!(self.kind, FailureKind::Silent {})
    }

    /// The vehicle, from 0.
    #[must_use]
    pub fn index(&self) -> usize {
        usize::try_from(self.vehicle.saturating_sub(1)).unwrap_or(usize::MAX)
    }
}

impl Scenario {
    /// Vehicles that there are, times within the flight, and nothing that continuous time cannot have.
    pub(super) fn check_failures(&self) -> Result<(), ScenarioError> {
        for (entry, failure) in self.failures.iter().enumerate() {
            let &Failure { vehicle, at_s, kind } = failure;
            if vehicle == 0 || failure.index() >= self.count() {
                return Err(ScenarioError::new(format!(
                    "vehicle {vehicle} is to fail, and there are {}",
                    self.count()
                ))
                .with_help("vehicles are counted from 1")
                .at_entry("failure", entry));
            }
            require_finite("the time of a failure", at_s).map_err(|error| error.at_entry("failure", entry))?;
            if !(0.0..self.time.duration_s).contains(&at_s) {
                return Err(ScenarioError::new(format!(
                    "vehicle {vehicle} is to fail at {at_s} s, in a flight from 0 s to {} s",
                    self.time.duration_s
                ))
                .with_help("let it fail within the flight")
                .at_entry("failure", entry)
                .at("time.duration_s"));
            }
            match kind {
                FailureKind::Dead {} => {}
                FailureKind::Silent {} => self.check_silent(entry)?,
                FailureKind::Frozen {} => self.check_frozen(entry)?,
            }
        }
        Ok(())
    }

    fn check_frozen(&self, entry: usize) -> Result<(), ScenarioError> {
        if self.plant.holds_commands() || self.time.control_hz.is_some() {
            return Ok(());
        }
        Err(ScenarioError::new("the ideal plant's vehicles hold no command that could stay as it was")
            .with_help("set actuation.control_hz, or plant.kind to \"rapier\"")
            .at_entry("failure", entry)
            .at("plant.kind"))
    }

    fn check_silent(&self, entry: usize) -> Result<(), ScenarioError> {
        if self.message_hz().is_some() {
            return Ok(());
        }
        Err(ScenarioError::new("a vehicle is to send nothing any more, and nothing says how often messages are sent")
            .with_help("set network.rate_hz, such as 50")
            .at_entry("failure", entry))
    }
}
