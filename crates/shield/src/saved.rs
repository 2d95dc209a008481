//! Saved shields, and vectors in saved data.

use std::sync::Arc;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::brake::State;
use crate::contracts::SavedContracts;
use crate::plane::Segment;
use crate::report::Counters;
use crate::settings::{Settings, ShieldError, ShieldFault};
use crate::shield::{Leg, Shield};
use crate::start::Start;

/// State of a shield between two instants.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedShield {
    pub(crate) settings: Settings,
    pub(crate) starts: Vec<Start>,
    pub(crate) period: u64,
    pub(crate) reference: State,
    #[serde(with = "vector")]
    pub(crate) acceleration: Vector3<f64>,
    pub(crate) next: State,
    pub(crate) segment: Segment,
    pub(crate) past: Vec<State>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) legs: Vec<Leg>,
    #[serde(default)]
    pub(crate) held: [f64; 3],
    pub(crate) contracts: SavedContracts,
    pub(crate) counters: Counters,
}

impl SavedShield {
    /// Number of vehicles with an announced start.
    #[must_use]
    pub fn vehicles(&self) -> usize {
        self.starts.len()
    }

    /// Returns the shield, which continues with the same bits.
    ///
    /// # Errors
    /// If the data are not those of a shield of this version.
    pub fn load(&self) -> Result<Shield, ShieldError> {
        let limits = self.settings.limits()?;
        let starts: Arc<[Start]> = self.starts.as_slice().into();
        starts.iter().try_for_each(Start::check)?;
        let delay = self.settings.measurement_delay_periods;
        let states = [&self.reference, &self.next].into_iter().chain(&self.past);
        let [_, longest_s] = limits.times_s();
        let is_leg = |leg: &Leg| leg.command.iter().all(|value| value.is_finite()) && leg.seconds <= longest_s;
        let has_commands = self.held.iter().all(|value| value.is_finite()) && self.legs.iter().all(is_leg);
        let is_finite = states.clone().all(State::is_finite) && self.segment.is_finite() && has_commands;
        if !(is_finite && self.acceleration.iter().all(|value| value.is_finite()) && self.past.len() <= delay + 1) {
            let problem = "the saved state has a number that no shield saves".into();
            return Err(ShieldError::new(
                ShieldFault::Altered,
                "saved",
                problem,
                self.past.len() as f64,
                "give unaltered data",
            ));
        }
        // A shield without the commands since the oldest measurement would leave out the feedback.
        let legs = (limits.most_legs() as u64).min(self.period.saturating_sub(1));
        if self.legs.len() as u64 != legs {
            let problem = format!("the saved state has another number of commands than the {legs} that a shield saves");
            let (found, remedy) = (self.legs.len() as f64, "give unaltered data");
            return Err(ShieldError::new(ShieldFault::Altered, "saved", problem, found, remedy));
        }
        Shield::loaded(self, &limits, &starts)
    }
}

/// Vectors as lists of three numbers.
pub(crate) mod vector {
    use nalgebra::Vector3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(vector: &Vector3<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        <[f64; 3]>::from(*vector).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vector3<f64>, D::Error> {
        <[f64; 3]>::deserialize(deserializer).map(Vector3::from)
    }
}
