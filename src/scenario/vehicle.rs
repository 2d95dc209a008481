//! `[vehicle]` of the scenario file.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What carries out commands.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub(super) struct VehicleTable {
    /// Drag of a point over its mass in 1/s, linear in the velocity W of the air past it:
    /// p'' = a22 v + u + drag (W - v).
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0)))]
    pub(super) drag_per_s: f64,
}
