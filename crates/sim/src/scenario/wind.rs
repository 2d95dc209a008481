//! What a wind must be for a swarm to be flown in it.

use nalgebra::Vector3;

use super::error::ScenarioError;
use super::spec::{Scenario, Space};
use tautline_laws::wind::Gust;

/// Steps that a slope of a gust takes at least: it is followed from step to step.
const STEPS_A_SLOPE: f64 = 10.0;

impl Scenario {
    /// A wind that the vehicles feel.
    pub(super) fn check_wind(&self) -> Result<(), ScenarioError> {
        let drag_per_s = self.drag_per_s;
        if drag_per_s * self.time.dt_s > 1.0 {
            return Err(ScenarioError::new(format!(
                "one step of {} s is longer than the time 1/drag = {} s in which the air brakes a vehicle",
                self.time.dt_s,
                1.0 / drag_per_s
            ))
            .coded("scenario/step-too-long")
            .with_help("reduce time.dt_s or vehicle.drag_per_s")
            .at("vehicle.drag_per_s")
            .at("time.dt_s"));
        }
        if self.airframe.quadrotor().is_some() && drag_per_s != 0.0 {
            return Err(ScenarioError::new(format!("a drag of {drag_per_s} 1/s on vehicles that are no points"))
                .coded("scenario/unsupported-by-vehicle")
                .with_help("leave it out: the drag of a quadrotor is that of its rotors and its body, in its model")
                .at("vehicle.drag_per_s")
                .at("vehicle.model"));
        }
        if self.airframe.quadrotor().is_none() && !self.wind.is_still() && drag_per_s == 0.0 {
            return Err(ScenarioError::new(
                "a wind blows and the vehicles are points without drag, which do not feel it",
            )
            .coded("scenario/unsupported-by-vehicle")
            .with_help(
                "set vehicle.drag_per_s to what a vehicle loses of its velocity through still air, for example 0.3",
            )
            .at("wind")
            .at("vehicle.drag_per_s"));
        }
        self.check_air("wind.mean_m_s", "the mean wind", self.wind.mean_m_s)?;
        self.wind.gusts.iter().try_for_each(|gust| self.check_gust(gust))
    }

    /// A velocity of the air \[m/s\], level where the swarm lives in the plane.
    fn check_air(&self, key: &'static str, what: &str, air_m_s: Vector3<f64>) -> Result<(), ScenarioError> {
        if self.space == Space::Plane && air_m_s.z != 0.0 {
            return Err(ScenarioError::new(format!(
                "{what} blows at {} m/s along z, out of the plane z = 0",
                air_m_s.z
            ))
            .coded("scenario/plane")
            .with_help("set its z to 0, or swarm.dimensions to 3")
            .at(key)
            .at("swarm.dimensions"));
        }
        Ok(())
    }

    fn check_gust(&self, gust: &Gust) -> Result<(), ScenarioError> {
        let Gust { at_s, rise_s, velocity_m_s, ref vehicles, .. } = *gust;
        self.check_air("wind.gust", "a gust", velocity_m_s)?;
        let shortest_s = STEPS_A_SLOPE * self.time.dt_s;
        for (what, slope_s) in [("the rise of a gust", rise_s), ("the fall of a gust", gust.fall_s())] {
            if slope_s < shortest_s {
                return Err(ScenarioError::new(format!(
                    "{what} takes {slope_s} s, too short to be followed in steps of {} s",
                    self.time.dt_s
                ))
                .coded("scenario/step-too-long")
                .with_help(format!("give it at least {shortest_s} s, or reduce time.dt_s"))
                .at("wind.gust")
                .at("time.dt_s"));
            }
        }
        if at_s >= self.time.duration_s {
            return Err(ScenarioError::new(format!(
                "a gust begins at {at_s} s, after the flight of {} s",
                self.time.duration_s
            ))
            .coded("scenario/outside-flight")
            .with_help("let it begin earlier, or enlarge time.duration_s")
            .at("wind.gust")
            .at("time.duration_s"));
        }
        match vehicles.as_deref() {
            Some([]) => Err(ScenarioError::new("a gust meets no vehicle")
                .with_help("leave out `vehicles`: it then meets all")
                .at("wind.gust")),
            Some(met) if !met.is_sorted() || met.last().is_some_and(|&last| last >= self.count()) => {
                Err(ScenarioError::new("a gust meets a vehicle that the swarm does not have")
                    .coded("scenario/unknown-vehicle")
                    .with_help(format!("vehicles are counted from 1 to {}", self.count()))
                    .at("wind.gust"))
            }
            _ => Ok(()),
        }
    }
}
