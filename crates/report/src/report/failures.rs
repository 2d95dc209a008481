//! Vehicles of which a part failed.

use serde::{Deserialize, Serialize};

use tautline_sim::scenario::{Failure, FailureKind};

/// A vehicle of which a part failed, for the rest of the flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailedVehicle {
    /// The vehicle, from 1.
    pub vehicle: u64,
    /// From when on \[s\].
    pub at_s: f64,
    /// What failed, as the scenario names it: `dead`, `rotor`, `silent` or `frozen`.
    pub kind: String,
}

impl From<&Failure> for FailedVehicle {
    fn from(failure: &Failure) -> Self {
        let kind = match failure.kind {
            FailureKind::Dead {} => "dead",
            FailureKind::Rotor { .. } => "rotor",
            FailureKind::Silent {} => "silent",
            FailureKind::Frozen {} => "frozen",
        };
        Self { vehicle: failure.vehicle, at_s: failure.at_s, kind: kind.to_owned() }
    }
}

impl FailedVehicle {
    /// Those that failed within so many seconds, in one line.
    pub(super) fn line(failed: &[Self]) -> String {
        let one = |failed: &Self| format!("vehicle {} ({}) at {} s", failed.vehicle, failed.kind, failed.at_s);
        failed.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}
