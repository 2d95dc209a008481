//! `[[failure]]`: vehicles with a failed part.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ImperfectionSpec;
use super::sensing::SAME_S;
use crate::scenario::{ErrorKind, Scenario, ScenarioError, entry_key};
use crate::vehicle::RotorFailure;
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::law::VoidReason;

/// A failure of a part of a vehicle, which lasts to the end of the flight.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// The vehicle, counted from 1.
    #[schemars(range(min = 1))]
    pub vehicle: u64,
    /// Start time in s.
    pub at_s: f64,
    /// Kind of the failure.
    #[schemars(flatten)]
    pub kind: FailureKind,
}

/// Kind of a failure.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[schemars(tag = "kind")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum FailureKind {
    /// The vehicle has no more commands: a point drifts on, a quadrotor's rotors stop.
    Dead {},
    /// A rotor of a quadrotor gives less thrust.
    Rotor {
        /// The rotor, counted from 1 in the order of the model.
        #[schemars(range(min = 1, max = 4))]
        rotor: u64,
        /// Share of its thrust that the rotor still gives, from 0 to less than 1; 0 unless given.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1.0), extend("default" = 0.0))]
        share: f64,
    },
    /// The vehicle sends no more messages. Needs `network.rate_hz`.
    Silent {},
    /// The vehicle keeps its last command.
    Frozen {},
}

impl Failure {
    /// Returns whether the vehicle sends no more messages.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        matches!(self.kind, FailureKind::Silent {})
    }

    /// Returns the vehicle, counted from 0.
    #[must_use]
    pub fn index(&self) -> usize {
        usize::try_from(self.vehicle.saturating_sub(1)).unwrap_or(usize::MAX)
    }
}

impl ImperfectionSpec for Vec<Failure> {
    fn is_exact(&self) -> bool {
        self.is_empty()
    }

    fn check(&self, scenario: &Scenario) -> Result<(), ScenarioError> {
        for (entry, failure) in self.iter().enumerate() {
            let &Failure { vehicle, at_s, kind } = failure;
            if vehicle == 0 || failure.index() >= scenario.count() {
                let problem = format!("the vehicle must be from 1 to {}, got {vehicle}", scenario.count());
                let help = "vehicles are counted from 1";
                return Err(ErrorKind::UnknownVehicle.at(&[&entry_key("failure", entry)], problem, help));
            }
            if !(0.0..scenario.time.duration_s).contains(&at_s) {
                let problem =
                    format!("at_s must be from 0 s to less than {} s, got {at_s} s", scenario.time.duration_s);
                let help = "give a time within the flight";
                let keys = [&*entry_key("failure", entry), "time.duration_s"];
                return Err(ErrorKind::OutsideFlight.at(&keys, problem, help));
            }
            match kind {
                FailureKind::Dead {} => {}
                FailureKind::Rotor { share, .. } => scenario.check_rotor(entry, share)?,
                FailureKind::Silent {} => scenario.check_silent(entry)?,
                FailureKind::Frozen {} => scenario.check_frozen(entry)?,
            }
        }
        Ok(())
    }

    fn voids(&self) -> Vec<VoidReason> {
        let void =
            |failure: &Failure| if failure.is_silent() { VoidReason::MessagesLost } else { VoidReason::VehicleFails };
        self.iter().map(void).collect()
    }
}

impl Scenario {
    fn check_rotor(&self, entry: usize, share: f64) -> Result<(), ScenarioError> {
        let (kind, said, help) = if self.airframe.quadrotor().is_none() {
            (
                ErrorKind::UnsupportedByVehicle,
                "points have no rotors that can fail".to_owned(),
                "set vehicle.model to a quadrotor, or kind to \"dead\"",
            )
        } else if !(0.0..1.0).contains(&share) {
            (
                ErrorKind::OutOfRange,
                format!("share must be from 0 to less than 1, got {share}"),
                "share is the part of its thrust that the rotor still gives",
            )
        } else {
            return Ok(());
        };
        Err(kind.at(&[&entry_key("failure", entry)], said, help))
    }

    fn check_frozen(&self, entry: usize) -> Result<(), ScenarioError> {
        if self.plant.holds_commands() || self.time.control_hz.is_some() {
            return Ok(());
        }
        let problem = "vehicles of the ideal plant hold no command in continuous time";
        let help = "set time.control_hz, or plant.kind to \"rapier\"";
        Err(ErrorKind::UnsupportedByPlant.at(&[&entry_key("failure", entry), "plant.kind"], problem, help))
    }

    fn check_silent(&self, entry: usize) -> Result<(), ScenarioError> {
        if self.message_hz().is_some() {
            return Ok(());
        }
        let problem = "a vehicle cannot fall silent without a rate of messages";
        let help = "set network.rate_hz, such as 50";
        Err(ErrorKind::MissingKey.at(&[&entry_key("failure", entry)], problem, help))
    }

    /// Returns the failures of rotors.
    pub(crate) fn rotor_failures(&self) -> Vec<RotorFailure> {
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
}

/// Replaces the commands of failed vehicles.
#[derive(Clone, Debug)]
pub(super) struct FailureEffects {
    all: Vec<FailedVehicle>,
}

#[derive(Clone, Debug)]
struct FailedVehicle {
    vehicle: usize,
    at_s: f64,
    /// Command after the failure \[m/s^2\]; unknown until the failure if the vehicle keeps its last command.
    kept: Option<Vector3<f64>>,
}

impl FailureEffects {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let failed = scenario.failures.iter().filter_map(|failure| {
            let kept = match failure.kind {
                FailureKind::Dead {} => Some(Vector3::zeros()),
                FailureKind::Frozen {} => None,
                FailureKind::Silent {} | FailureKind::Rotor { .. } => return None,
            };
            Some(FailedVehicle { vehicle: failure.index(), at_s: failure.at_s, kept })
        });
        Self { all: failed.collect() }
    }

    /// Changes the commands of a time \[s\].
    pub(super) fn act(&mut self, time_s: f64, command: &mut Rows) {
        for failed in self.all.iter_mut().filter(|failed| time_s + SAME_S >= failed.at_s) {
            let kept = *failed.kept.get_or_insert_with(|| row(command, failed.vehicle));
            set_row(command, failed.vehicle, kept);
        }
    }
}
