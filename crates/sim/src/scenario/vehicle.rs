//! What a scenario must be for bodies that are more than points to be flown.

use super::error::ScenarioError;
use super::spec::{Scenario, Space};
use crate::vehicle::{Airframe, Fleet, Ground, ModelError, Quadrotor};
use tautline_laws::space::{Obstacle, Shape};

/// Default rate of the attitude loop \[Hz\].
pub const DEFAULT_ATTITUDE_HZ: f64 = 500.0;
/// Default step of quadrotors \[s\].
pub const QUADROTOR_DT_S: f64 = 1.0 / 500.0;
/// Default rate at which quadrotors are given commands \[Hz\].
pub const QUADROTOR_CONTROL_HZ: f64 = 100.0;

/// A step may be longer than a period by this part of it, which is rounding.
const ROUNDING: f64 = 1e-6;

impl Scenario {
    /// Its quadrotors at the start, trimmed for hover; none where vehicles are points.
    #[must_use]
    pub fn fleet(&self) -> Option<Fleet> {
        let ground = |obstacle: &Obstacle| match obstacle.shape {
            Shape::HalfSpace { normal } => Some(Ground { place_m: obstacle.place_m, normal: normal.normalize() }),
            _ => None,
        };
        let grounds: Vec<_> = self.obstacles.iter().filter_map(ground).collect();
        let fleet = Fleet::trimmed(self.airframe.quadrotor()?, &grounds, &self.start, self.space == Space::Plane);
        let fleet = fleet.failing(self.rotor_failures());
        Some(if self.wind.is_still() { fleet } else { fleet.blown(self.air()) })
    }

    /// Makes every vehicle one of these, with the mass, the hull and the default rates of its kind. Points of a quadrotor's mass
    /// have no drag of their own.
    pub fn set_airframe(&mut self, airframe: Airframe) {
        if let Some(quadrotor) = airframe.quadrotor() {
            self.mass_kg.fill(quadrotor.model.mass_kg);
            self.hull_radius_m.fill(quadrotor.model.hull_radius_m);
            self.a22_per_s = 0.0;
            self.time.dt_s = QUADROTOR_DT_S;
            self.time.control_hz = Some(QUADROTOR_CONTROL_HZ);
        }
        self.airframe = airframe;
    }

    /// A body that can be flown, and an attitude loop that steps can follow.
    pub(super) fn check_airframe(&self) -> Result<(), ScenarioError> {
        self.check_unicycle()?;
        let Some(Quadrotor { model, attitude_hz, .. }) = self.airframe.quadrotor() else { return Ok(()) };
        let refuse = |ModelError { key, message, help }| {
            let key = match key {
                "attitude_rad_s" => "vehicle.attitude_rad_s",
                "attitude_damping" => "vehicle.attitude_damping",
                _ => "vehicle.model",
            };
            ScenarioError::new(message).with_help(help).at(key).at("vehicle.attitude_damping").at("vehicle.model")
        };
        model.check().map_err(refuse)?;
        if attitude_hz * self.time.dt_s > 1.0 + ROUNDING {
            return Err(ScenarioError::new(format!(
                "an attitude loop of {attitude_hz} Hz runs more than once in a step of {} s",
                self.time.dt_s
            ))
            .coded("scenario/step-too-long")
            .with_help(format!(
                "reduce vehicle.attitude_hz to at most {}, or time.dt_s to at most {}",
                1.0 / self.time.dt_s,
                1.0 / attitude_hz
            ))
            .at("vehicle.attitude_hz")
            .at("time.dt_s"));
        }
        model.check_attitude(0.5 / attitude_hz).map_err(|error| refuse(error).at("vehicle.attitude_hz"))
    }
}
