//! Findings with the names of whom they are on.

use serde::Serialize;

/// A finding on a pair, with their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfPair<T> {
    /// Their names.
    pub who: [String; 2],
    /// What was found.
    #[serde(flatten)]
    pub finding: T,
}

/// A finding on a vehicle, with its name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfVehicle<T> {
    /// Its name.
    pub vehicle: String,
    /// What was found.
    #[serde(flatten)]
    pub finding: T,
}
