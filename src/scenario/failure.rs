//! `[[failure]]`: a vehicle of which a part fails.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::limits::require_finite;
use super::spec::Scenario;
use crate::vehicle::RotorFailure;

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
    /// It commands nothing any more: a point drifts on, a quadrotor's rotors stop.
    Dead {},
    /// A rotor of a quadrotor gives less thrust.
    Rotor {
        /// The rotor, counted from 1 as its model lists them.
        #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 4)))]
        rotor: u64,
        /// Share of its thrust that it still gives, from 0 to less than 1: none unless given.
        #[serde(default)]
        #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1.0), extend("default" = 0.0)))]
        share: f64,
    },
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
                FailureKind::Rotor { rotor, share } => self.check_rotor(entry, rotor, share)?,
                FailureKind::Silent {} => self.check_silent(entry)?,
                FailureKind::Frozen {} => self.check_frozen(entry)?,
            }
        }
        Ok(())
    }

    fn check_rotor(&self, entry: usize, rotor: u64, share: f64) -> Result<(), ScenarioError> {
        let (said, help) = if self.airframe.quadrotor().is_none() {
            (
                "a rotor is to fail, and vehicles are points".to_owned(),
                "set vehicle.model to a quadrotor, or kind to \"dead\"",
            )
        } else if !(1..=4).contains(&rotor) {
            (format!("rotor {rotor} is to fail"), "a quadrotor has rotors 1 to 4")
        } else if !(0.0..1.0).contains(&share) {
            (
                format!("a rotor that fails still gives a share of {share} of its thrust"),
                "set share from 0 to less than 1",
            )
        } else {
            return Ok(());
        };
        Err(ScenarioError::new(said).with_help(help).at_entry("failure", entry))
    }

    /// What becomes of rotors.
    pub(super) fn rotor_failures(&self) -> Vec<RotorFailure> {
        let of_rotors = |failure: &Failure| {
            let (rotor, share) = match failure.kind {
                FailureKind::Dead {} => (None, 0.0),
                FailureKind::Rotor { rotor, share } => (Some(usize::try_from(rotor.checked_sub(1)?).ok()?), share),
                FailureKind::Silent {} | FailureKind::Frozen {} => return None,
            };
            Some(RotorFailure { vehicle: failure.index(), rotor, at_s: failure.at_s, share })
        };
        let exists =
            |failure: &RotorFailure| failure.vehicle < self.count() && failure.rotor.is_none_or(|rotor| rotor < 4);
        self.failures.iter().filter_map(of_rotors).filter(exists).collect()
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
