//! `[[failure]]`: a vehicle of which a part fails.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A vehicle of which a part fails, for the rest of the flight.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// The vehicle, counted from 1.
    #[schemars(range(min = 1))]
    pub vehicle: u64,
    /// From when on in s.
    pub at_s: f64,
    /// What fails.
    #[schemars(flatten)]
    pub kind: FailureKind,
}

/// What fails.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[schemars(tag = "kind")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum FailureKind {
    /// It commands nothing any more: a point drifts on, a quadrotor's rotors stop.
    Dead {},
    /// A rotor of a quadrotor gives less thrust.
    Rotor {
        /// The rotor, counted from 1 as its model lists them.
        #[schemars(range(min = 1, max = 4))]
        rotor: u64,
        /// Share of its thrust that it still gives, from 0 to less than 1: none unless given.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0), extend("default" = 0.0))]
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
