//! The seed of whatever is random in a flight.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Chance in flight: wind, sensors, radio.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NoiseTable {
    /// Seed of every random number that is drawn in flight (`ChaCha8`, the same on every machine). The start has a seed of
    /// its own.
    pub(super) seed: u64,
}
