//! Values of the scenario file: numbers for each vehicle, points, edges, lists of vehicles.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use tautline_core::swarm::{Rows, set_row};
use tautline_laws::target::Begins;

/// One number for all vehicles or a list with one for each.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum PerVehicle {
    /// The same for all.
    All(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// One for each.
    Each(#[schemars(extend("items" = { "type": "number", "exclusiveMinimum": 0 }))] Vec<f64>),
}

/// x, y and, unless it is 0, z.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(with = "Vec<f64>", extend("minItems" = 2, "maxItems" = 3))]
#[serde(untagged)]
pub(super) enum Point {
    /// In the plane z = 0.
    Plane([f64; 2]),
    /// In space.
    Space([f64; 3]),
}

/// Two vehicles, counted from 1.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(transparent)]
pub(super) struct Edge(#[schemars(inner(range(min = 1)))] pub(super) [u64; 2]);

impl Point {
    /// x, y and z.
    pub(super) fn coordinates(self) -> [f64; 3] {
        match self {
            Self::Plane([x, y]) => [x, y, 0.0],
            Self::Space(coordinates) => coordinates,
        }
    }
}

/// Some vehicles, counted from 1, or all of them.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum Vehicles {
    /// All of them.
    All(All),
    /// These.
    Listed(#[schemars(inner(range(min = 1)))] Vec<u64>),
}

/// The word `all`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum All {
    /// All of them.
    All,
}

/// When a leg begins.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(super) enum LegStart {
    /// Once the one before it is reached.
    When(Reached),
    /// At this time in s.
    At(f64),
}

/// The word `reached`.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Reached {
    /// Once the one before it is reached.
    Reached,
}

impl LegStart {
    pub(super) fn begins(self) -> Begins {
        match self {
            Self::When(Reached::Reached) => Begins::Reached,
            Self::At(start_s) => Begins::At(start_s),
        }
    }
}

/// A row for each point.
pub(super) fn rows(points: &[Point]) -> Rows {
    let mut rows = Rows::zeros(points.len());
    for (i, point) in points.iter().enumerate() {
        set_row(&mut rows, i, point.coordinates().into());
    }
    rows
}
