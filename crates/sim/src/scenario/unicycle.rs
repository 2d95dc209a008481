//! What a scenario must be for unicycles to be flown.

use super::error::ScenarioError;
use super::spec::{PlantSpec, Scenario, Space};
use crate::vehicle::{Heading, Unicycle};
use tautline_core::swarm::row;

/// A start may be off a limit of speed by this part of it, which is rounding.
const ROUNDING: f64 = 1e-9;

impl Scenario {
    /// Limits that are some, and a start in the plane that keeps to them.
    pub(super) fn check_unicycle(&self) -> Result<(), ScenarioError> {
        let Some(unicycle) = self.airframe.unicycle() else { return Ok(()) };
        let Unicycle { min_speed_m_s, max_speed_m_s, .. } = *unicycle;
        if min_speed_m_s > max_speed_m_s {
            return Err(ScenarioError::new(format!(
                "the least speed of {min_speed_m_s} m/s is more than the largest of {max_speed_m_s} m/s"
            ))
            .with_help("reduce vehicle.min_speed_m_s, or enlarge vehicle.max_speed_m_s")
            .at("vehicle.min_speed_m_s")
            .at("vehicle.max_speed_m_s"));
        }
        if self.space != Space::Plane {
            return Err(ScenarioError::new("unicycles move in the plane z = 0, and this swarm lives in space")
                .coded("scenario/plane")
                .with_help("set every z to 0 and swarm.dimensions to 2, or fly another vehicle.model")
                .at("vehicle.model")
                .at("swarm.dimensions"));
        }
        if !matches!(self.plant, PlantSpec::Rapier) {
            return Err(ScenarioError::new("the ideal plant flies points and quadrotors, no unicycles")
                .coded("scenario/unsupported-by-plant")
                .with_help("leave out plant.kind: the way of a unicycle is solved in closed form")
                .at("plant.kind")
                .at("vehicle.model"));
        }
        if self.a22_per_s != 0.0 {
            return Err(ScenarioError::new("a unicycle has no velocity coefficient a22")
                .coded("scenario/unsupported-by-vehicle")
                .with_help("leave out swarm.a22_per_s")
                .at("swarm.a22_per_s")
                .at("vehicle.model"));
        }
        if self.drag_per_s != 0.0 || !self.wind.is_still() {
            let key = if self.drag_per_s == 0.0 { "wind" } else { "vehicle.drag_per_s" };
            return Err(ScenarioError::new("a unicycle does not feel the air")
                .coded("scenario/unsupported-by-vehicle")
                .with_help("leave out [wind] and vehicle.drag_per_s, or fly another vehicle.model")
                .at(key)
                .at("vehicle.model"));
        }
        for i in 0..self.count() {
            let speed_m_s = Heading::of(row(&self.start.velocities_m_s, i)).speed_m_s;
            let (least, most) = (min_speed_m_s * (1.0 - ROUNDING), max_speed_m_s * (1.0 + ROUNDING));
            if !(least..=most).contains(&speed_m_s) {
                return Err(ScenarioError::new(format!(
                    "vehicle {} starts at {speed_m_s} m/s, and a unicycle here goes at {min_speed_m_s} to {max_speed_m_s} m/s",
                    i + 1
                )).coded("scenario/out-of-range")
                .with_help("give start.velocities_m_s, a velocity for each vehicle, or change the limits of its speed")
                .at_entry("start.velocities_m_s", i)
                .at("vehicle.min_speed_m_s")
                .at("vehicle.model"));
            }
        }
        Ok(())
    }
}
