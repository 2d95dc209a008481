//! What a wind must be for a swarm to be flown in it.

use nalgebra::Vector3;

use super::error::ScenarioError;
use super::limits::{at_least_zero, positive, require_finite};
use super::spec::{Scenario, Space};
use tautline_laws::wind::{Dryden, Gust};

/// Steps that a slope of a gust takes at least: it is followed from step to step.
const STEPS_A_SLOPE: f64 = 10.0;

impl Scenario {
    /// A wind of finite numbers that points feel by their drag.
    pub(super) fn check_wind(&self) -> Result<(), ScenarioError> {
        let drag_per_s = at_least_zero("vehicle.drag_per_s", "the drag", self.drag_per_s)?;
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
        self.wind.gusts.iter().try_for_each(|gust| self.check_gust(gust))?;
        self.wind.turbulence.map_or(Ok(()), |dryden| check_turbulence(&dryden))
    }

    /// A velocity of the air \[m/s\], level where the swarm lives in the plane.
    fn check_air(&self, key: &'static str, what: &str, air_m_s: Vector3<f64>) -> Result<(), ScenarioError> {
        for number in air_m_s.iter() {
            require_finite(format_args!("a component of {what}"), *number).map_err(|error| error.at(key))?;
        }
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
        let Gust { at_s, rise_s, hold_s, fall_s, velocity_m_s, ref vehicles } = *gust;
        self.check_air("wind.gust", "a gust", velocity_m_s)?;
        at_least_zero("wind.gust", "the beginning of a gust", at_s)?;
        at_least_zero("wind.gust", "the hold of a gust", hold_s)?;
        let shortest_s = STEPS_A_SLOPE * self.time.dt_s;
        for (what, slope_s) in [("the rise of a gust", rise_s), ("the fall of a gust", fall_s)] {
            if positive("wind.gust", what, slope_s)? < shortest_s {
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
                Err(ScenarioError::new("the vehicles that a gust meets are out of order, or not of the swarm")
                    .coded("scenario/unknown-vehicle")
                    .with_help(format!("list them in ascending order, from 0 to {}", self.count() - 1))
                    .at("wind.gust"))
            }
            _ => Ok(()),
        }
    }
}

fn check_turbulence(dryden: &Dryden) -> Result<(), ScenarioError> {
    positive("wind.dryden", "the wind speed at 20 feet", dryden.speed_20ft_m_s)?;
    let height_m = positive("wind.dryden", "the height above the ground", dryden.height_m)?;
    if (Dryden::LOWEST_M..=Dryden::HIGHEST_M).contains(&height_m) {
        return Ok(());
    }
    Err(ScenarioError::new(format!("turbulence at a height of {height_m} m, for which its scales are not made"))
        .coded("scenario/out-of-range")
        .with_help("set height_m to 3.048 (10 feet) for what flies lower, and to at most 304.8 (1000 feet)")
        .at("wind.dryden"))
}
