//! Wind of a scenario: the mean wind and gusts as functions of time, and the turbulence.

use std::f64::consts::PI;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dryden::Dryden;

/// Number of standard deviations of turbulence used as its largest value in estimates.
const SIGMAS: f64 = 4.0;

/// Wind. It acts on points that have a drag (`vehicle.drag_per_s`).
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WindSpec {
    /// Constant velocity of the air in m/s; zero by default.
    #[serde(with = "point")]
    #[schemars(with = "Vec<f64>", extend("minItems" = 2, "maxItems" = 3, "default" = [0.0, 0.0, 0.0]))]
    pub mean_m_s: Vector3<f64>,
    /// Gusts, which add up.
    #[serde(rename = "gust", skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("default" = []))]
    pub gusts: Vec<Gust>,
    /// Dryden turbulence at low altitude (MIL-F-8785C), carried past vehicles at the mean wind's speed and at least at
    /// 1 m/s.
    #[serde(rename = "dryden", skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Dryden")]
    pub turbulence: Option<Dryden>,
    /// Whether all vehicles share one turbulence. Otherwise each vehicle has its own.
    pub shared: bool,
}

impl Default for WindSpec {
    /// Returns still air.
    fn default() -> Self {
        Self { mean_m_s: Vector3::zeros(), gusts: Vec::new(), turbulence: None, shared: true }
    }
}

/// Gust that rises to a velocity, holds it and falls back; each slope is half a period of 1 - cos:
///
/// ```text
/// V/2 (1 - cos(pi (t - at)/rise))          at <= t < at + rise
/// V                                        for hold seconds from there
/// V/2 (1 + cos(pi (t - t_fall)/fall))      for fall seconds from there, t_fall = at + rise + hold
/// ```
///
/// Without a hold and with equal slopes this is the gust of airworthiness rules, a full period of 1 - cos. A hold to
/// the end of the run gives the gust of MIL-F-8785C, which rises and stays.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(description = "Gust that rises to a velocity as 1 - cos, holds it, and falls back in the same way.")]
pub struct Gust {
    /// Start time in s.
    #[schemars(extend("minimum" = 0))]
    pub at_s: f64,
    /// Rise time in s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rise_s: f64,
    /// Hold time in s.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub hold_s: f64,
    /// Fall time in s; by default the rise time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "f64", extend("exclusiveMinimum" = 0))]
    pub fall_s: Option<f64>,
    /// Velocity that the gust adds to the wind at full strength in m/s.
    #[serde(with = "point")]
    #[schemars(with = "Vec<f64>", extend("minItems" = 2, "maxItems" = 3))]
    pub velocity_m_s: Vector3<f64>,
    /// Vehicles that the gust affects, from 0 and in ascending order; `None` for all.
    #[serde(default, with = "vehicles", skip_serializing_if = "Option::is_none")]
    #[schemars(
        with = "Vec<u64>",
        inner(range(min = 1)),
        description = "Vehicles that the gust affects, counted from 1; all by default."
    )]
    pub vehicles: Option<Vec<usize>>,
}

/// Serializes a vector as a list of x, y and z, and accepts a list without z.
mod point {
    use nalgebra::Vector3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(vector: &Vector3<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        <[f64; 3]>::from(*vector).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vector3<f64>, D::Error> {
        match Vec::deserialize(deserializer)?[..] {
            [x, y] => Ok(Vector3::new(x, y, 0.0)),
            [x, y, z] => Ok(Vector3::new(x, y, z)),
            ref other => Err(D::Error::invalid_length(other.len(), &"2 or 3 numbers")),
        }
    }
}

/// Serializes vehicles, counted from 1 in files and from 0 in memory.
mod vehicles {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    #[expect(clippy::ref_option, reason = "serde passes a reference to the field")]
    pub(super) fn serialize<S: Serializer>(met: &Option<Vec<usize>>, serializer: S) -> Result<S::Ok, S::Error> {
        met.as_ref().map(|met| met.iter().map(|&vehicle| vehicle as u64 + 1).collect::<Vec<_>>()).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<usize>>, D::Error> {
        let numbers = Vec::<usize>::deserialize(deserializer)?.into_iter();
        let indices = numbers
            .map(|number| number.checked_sub(1).ok_or_else(|| D::Error::custom("vehicles are counted from 1, got 0")));
        let mut met = indices.collect::<Result<Vec<_>, _>>()?;
        met.sort_unstable();
        met.dedup();
        Ok(Some(met))
    }
}

impl Gust {
    /// Fall time \[s\].
    #[must_use]
    pub fn fall_s(&self) -> f64 {
        self.fall_s.unwrap_or(self.rise_s)
    }

    /// Returns the times at which the gust begins to rise, reaches full strength, begins to fall, and ends \[s\].
    #[must_use]
    pub fn corners_s(&self) -> [f64; 4] {
        let full_s = self.at_s + self.rise_s;
        let falls_s = full_s + self.hold_s;
        [self.at_s, full_s, falls_s, falls_s + self.fall_s()]
    }

    /// Returns the strength at a time \[s\] as a fraction of the full velocity.
    #[must_use]
    pub fn share(&self, time_s: f64) -> f64 {
        let [begins_s, full_s, falls_s, ends_s] = self.corners_s();
        let slope = |phase: f64| 0.5 * (1.0 - libm::cos(PI * phase));
        if time_s <= begins_s || time_s >= ends_s {
            0.0
        } else if time_s < full_s {
            slope((time_s - begins_s) / self.rise_s)
        } else if time_s <= falls_s {
            1.0
        } else {
            1.0 - slope((time_s - falls_s) / self.fall_s())
        }
    }

    /// Whether the gust affects a vehicle.
    #[must_use]
    pub fn affects(&self, vehicle: usize) -> bool {
        self.vehicles.as_ref().is_none_or(|met| met.binary_search(&vehicle).is_ok())
    }
}

impl WindSpec {
    /// Whether there is no wind at any time.
    #[must_use]
    pub fn is_still(&self) -> bool {
        *self == Self { shared: self.shared, ..Self::default() }
    }

    /// Returns the mean wind and gusts at a vehicle and a time \[m/s\].
    #[must_use]
    pub fn steady_m_s(&self, vehicle: usize, time_s: f64) -> Vector3<f64> {
        let met = self.gusts.iter().filter(|gust| gust.affects(vehicle));
        met.fold(self.mean_m_s, |sum, gust| sum + gust.share(time_s) * gust.velocity_m_s)
    }

    /// Returns an upper bound of the speed of the air at any vehicle \[m/s\]. With turbulence, which is unbounded, the
    /// bound is an estimate that is rarely exceeded.
    #[must_use]
    pub fn fastest_m_s(&self) -> f64 {
        let gusts: f64 = self.gusts.iter().map(|gust| gust.velocity_m_s.norm()).sum();
        let turbulence = self.turbulence.map_or(0.0, |dryden| SIGMAS * dryden.intensity_m_s().norm());
        self.mean_m_s.norm() + gusts + turbulence
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gust() -> Gust {
        let velocity_m_s = Vector3::new(3.0, -4.0, 0.0);
        Gust { at_s: 2.0, rise_s: 1.0, hold_s: 0.5, fall_s: Some(2.0), velocity_m_s, vehicles: None }
    }

    #[test]
    fn a_gust_rises_holds_and_falls_as_one_minus_cosine() {
        let at = |time_s: f64| gust().share(time_s);
        for (time_s, share) in [(0.0, 0.0), (2.0, 0.0), (2.5, 0.5), (3.0, 1.0), (3.4, 1.0), (3.5, 1.0), (4.5, 0.5)] {
            assert!((at(time_s) - share).abs() < 1e-15, "{time_s}");
        }
        assert_eq!((at(5.5), at(1e9)), (0.0, 0.0));
        assert!((at(2.0 + 1.0 / 3.0) - 0.25).abs() < 1e-15, "1/2 (1 - cos 60 deg)");
        // Slopes begin and end flat, unlike those of a triangle of the same height.
        for corner_s in gust().corners_s() {
            let bend = |h: f64| (at(corner_s + h) - at(corner_s - h)).abs() / h;
            assert!(bend(1e-4) < 1e-3, "{corner_s}");
        }
        let triangle = |time_s: f64| (time_s - 2.0).clamp(0.0, 1.0);
        assert!((triangle(2.0 + 1e-4) - triangle(2.0 - 1e-4)).abs() / 1e-4 > 0.9);
    }

    #[test]
    fn a_gust_adds_to_the_mean_wind_of_listed_vehicles() {
        let gusts = vec![Gust { vehicles: Some(vec![1, 3]), ..gust() }];
        let wind = WindSpec { mean_m_s: Vector3::x(), gusts, ..WindSpec::default() };
        assert!(!wind.is_still() && WindSpec::default().is_still());
        assert_eq!(wind.steady_m_s(0, 3.2), Vector3::x());
        assert_eq!(wind.steady_m_s(3, 3.2), Vector3::new(4.0, -4.0, 0.0));
        assert_eq!(wind.fastest_m_s(), 6.0);
    }
}
