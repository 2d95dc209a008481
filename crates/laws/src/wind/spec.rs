//! Wind of a scenario: the mean wind and gusts as functions of time, and the turbulence.

use std::f64::consts::PI;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::dryden::Dryden;

/// Number of standard deviations of turbulence used as its largest value in estimates.
const SIGMAS: f64 = 4.0;

/// Wind. It acts on quadrotors, and on points that have a drag (`vehicle.drag_per_s`).
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

    /// Returns an upper bound of the speed of the air at any of `count` vehicles until a time \[s\], in m/s. For mean
    /// wind and gusts the bound is at most a ten-thousandth above the largest speed. With turbulence, which is
    /// unbounded, the bound is an estimate that is rarely exceeded.
    #[must_use]
    pub fn fastest_m_s(&self, count: usize, until_s: f64) -> f64 {
        let turbulence = self.turbulence.map_or(0.0, |dryden| SIGMAS * dryden.intensity_m_s().norm());
        let listed = |vehicle: usize| self.gusts.iter().any(|gust| gust.vehicles.is_some() && gust.affects(vehicle));
        let any_other = (0..count).find(|&vehicle| !listed(vehicle));
        let mut vehicles: Vec<_> =
            self.gusts.iter().filter_map(|gust| gust.vehicles.as_ref()).flatten().copied().collect();
        vehicles.retain(|&vehicle| vehicle < count);
        vehicles.extend(any_other);
        vehicles.sort_unstable();
        vehicles.dedup();
        let mut met: Vec<Vec<&Gust>> = Vec::new();
        for vehicle in vehicles {
            let of_vehicle: Vec<_> = self.gusts.iter().filter(|gust| gust.affects(vehicle)).collect();
            if !met.contains(&of_vehicle) {
                met.push(of_vehicle);
            }
        }
        let steady = met.iter().map(|gusts| Superposition { mean_m_s: self.mean_m_s, gusts }.fastest_m_s(until_s));
        steady.fold(self.mean_m_s.norm(), f64::max) + turbulence
    }
}

/// Relative excess of a bound that is not narrowed further.
const EXCESS: f64 = 1e-4;
/// Relative excess of a bound that is rounding.
const ROUNDING: f64 = 1e-12;
/// Speed below which the excess is relative to the sum of all speeds, as a share of this sum.
const CANCELLED: f64 = 0.01;
/// Largest number of halvings of an interval.
const MOST_HALVINGS: u32 = 20;

/// Mean wind and the gusts that affect one vehicle.
struct Superposition<'a> {
    mean_m_s: Vector3<f64>,
    gusts: &'a [&'a Gust],
}

impl Superposition<'_> {
    fn speed_m_s(&self, time_s: f64) -> f64 {
        self.gusts.iter().fold(self.mean_m_s, |sum, gust| sum + gust.share(time_s) * gust.velocity_m_s).norm()
    }

    /// Returns an upper bound of the speed from time 0 until a time \[s\].
    ///
    /// Intervals between two corners are halved until their bounds are narrow.
    fn fastest_m_s(&self, until_s: f64) -> f64 {
        let mut ends_s = vec![0.0, until_s];
        ends_s.extend(self.gusts.iter().flat_map(|gust| gust.corners_s()).filter(|&end_s| end_s < until_s));
        ends_s.retain(|&end_s| end_s >= 0.0);
        ends_s.sort_by(f64::total_cmp);
        let reached_m_s = ends_s.iter().map(|&end_s| self.speed_m_s(end_s)).fold(0.0, f64::max);
        let gusts_m_s: f64 = self.gusts.iter().map(|gust| gust.velocity_m_s.norm()).sum();
        // Velocities may cancel, and no bound of several gusts is 0.
        let least_m_s = CANCELLED * (self.mean_m_s.norm() + gusts_m_s);
        let mut fastest_m_s = reached_m_s;
        let mut open: Vec<_> = ends_s.windows(2).map(|ends| (ends[0], ends[1], 0)).collect();
        while let Some((from_s, to_s, halvings)) = open.pop() {
            let bound_m_s = self.bound_m_s(from_s, to_s);
            if bound_m_s <= fastest_m_s * (1.0 + ROUNDING) {
                continue;
            }
            if bound_m_s <= fastest_m_s + EXCESS * fastest_m_s.max(least_m_s) || halvings == MOST_HALVINGS {
                fastest_m_s = fastest_m_s.max(bound_m_s);
                continue;
            }
            let middle_s = f64::midpoint(from_s, to_s);
            fastest_m_s = fastest_m_s.max(self.speed_m_s(middle_s));
            open.extend([(from_s, middle_s, halvings + 1), (middle_s, to_s, halvings + 1)]);
        }
        fastest_m_s
    }

    /// Returns an upper bound of the speed in an interval of h seconds without a corner inside.
    ///
    /// The share s of each gust is monotone there. The speed is convex in the share of a single gust, so it is largest
    /// at an end. With several gusts, the smaller of two bounds holds. Each share lies between its values at the ends:
    ///
    /// ```text
    /// |mean + sum of middle s times V| + sum of half the range of s times |V|
    /// ```
    ///
    /// The velocity leaves the straight line between its ends by at most h^2/8 times the largest second derivative:
    ///
    /// ```text
    /// larger speed at an end + h^2/8 sum of |V| (pi/slope)^2/2
    /// ```
    fn bound_m_s(&self, from_s: f64, to_s: f64) -> f64 {
        let (mut middle_m_s, mut reach_m_s, mut bend_m_s3, mut changing) = (self.mean_m_s, 0.0, 0.0, 0);
        for gust in self.gusts {
            let (first, last) = (gust.share(from_s), gust.share(to_s));
            middle_m_s += 0.5 * (first + last) * gust.velocity_m_s;
            if first != last {
                let speed_m_s = gust.velocity_m_s.norm();
                let [_, full_s, ..] = gust.corners_s();
                let slope_s = if to_s <= full_s { gust.rise_s } else { gust.fall_s() };
                reach_m_s += 0.5 * (first - last).abs() * speed_m_s;
                bend_m_s3 += 0.5 * (PI / slope_s).powi(2) * speed_m_s;
                changing += 1;
            }
        }
        let at_end_m_s = self.speed_m_s(from_s).max(self.speed_m_s(to_s));
        if changing < 2 {
            return at_end_m_s;
        }
        (middle_m_s.norm() + reach_m_s).min(at_end_m_s + 0.125 * (to_s - from_s).powi(2) * bend_m_s3)
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
        let share_at = |time_s: f64| gust().share(time_s);
        for (time_s, share) in [(0.0, 0.0), (2.0, 0.0), (2.5, 0.5), (3.0, 1.0), (3.4, 1.0), (3.5, 1.0), (4.5, 0.5)] {
            assert!((share_at(time_s) - share).abs() < 1e-15, "{time_s}");
        }
        assert_eq!((share_at(5.5), share_at(1e9)), (0.0, 0.0));
        assert!((share_at(2.0 + 1.0 / 3.0) - 0.25).abs() < 1e-15, "1/2 (1 - cos 60 deg)");
        // Slopes begin and end flat, unlike those of a triangle of the same height.
        for corner_s in gust().corners_s() {
            let bend = |h: f64| (share_at(corner_s + h) - share_at(corner_s - h)).abs() / h;
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
        assert_eq!(wind.fastest_m_s(4, 9.0), 32.0_f64.sqrt());
        assert_eq!(wind.fastest_m_s(1, 9.0), 1.0, "vehicle 1 meets no gust");
        assert_eq!(wind.fastest_m_s(4, 2.0), 1.0, "the gust begins at 2 s");
    }

    /// A gust along x of 1 s up and 1 s down, from a time on.
    fn along_x(at_s: f64, x_m_s: f64, vehicles: Option<Vec<usize>>) -> Gust {
        let velocity_m_s = Vector3::new(x_m_s, 0.0, 0.0);
        Gust { at_s, rise_s: 1.0, hold_s: 0.0, fall_s: None, velocity_m_s, vehicles }
    }

    #[test]
    fn the_fastest_wind_is_the_largest_over_time_and_vehicle() {
        let fastest_m_s = |gusts: Vec<Gust>| WindSpec { gusts, ..WindSpec::default() }.fastest_m_s(3, 60.0);
        assert_eq!(fastest_m_s(vec![along_x(1.0, 1.0, None), along_x(20.0, 1.0, None)]), 1.0, "one after the other");
        assert_eq!(fastest_m_s(vec![along_x(1.0, 1.0, None), along_x(1.0, 1.0, None)]), 2.0, "at the same time");
        assert_eq!(fastest_m_s(vec![along_x(1.0, 1.0, Some(vec![0])), along_x(1.0, 1.0, Some(vec![1]))]), 1.0);
        assert_eq!(fastest_m_s(vec![along_x(1.0, 1.0, Some(vec![0, 2])), along_x(1.0, 1.0, Some(vec![1, 2]))]), 2.0);
        assert_eq!(fastest_m_s(vec![along_x(1.0, 1.0, None), along_x(1.0, -1.0, Some(vec![1]))]), 1.0, "they cancel");
        // A fall and a rise of equal gusts one second apart add up to 1 at all times between the two peaks.
        let crossed_m_s = fastest_m_s(vec![along_x(1.0, 1.0, None), along_x(2.0, 1.0, None)]);
        assert!((1.0..1.0 + 2.0 * EXCESS).contains(&crossed_m_s), "{crossed_m_s}");
    }

    #[test]
    fn the_fastest_wind_is_a_bound_without_holes() {
        let mut state = 1_u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for case in 0..200 {
            let gusts = (0..=case % 5).map(|_| Gust {
                at_s: 8.0 * unit(),
                rise_s: 0.01 + 3.0 * unit(),
                hold_s: if unit() < 0.5 { 0.0 } else { 2.0 * unit() },
                fall_s: Some(0.01 + 3.0 * unit()),
                velocity_m_s: Vector3::new(4.0 * unit() - 2.0, 4.0 * unit() - 2.0, unit()),
                vehicles: (unit() < 0.5).then(|| vec![0]),
            });
            let gusts = gusts.collect();
            let wind = WindSpec { mean_m_s: Vector3::new(unit(), -unit(), 0.0), gusts, ..WindSpec::default() };
            let bound_m_s = wind.fastest_m_s(2, 10.0);
            let instants = (0..=20_000).map(|step| f64::from(step) * 5e-4);
            let speeds = instants.flat_map(|time_s| [0, 1].map(|vehicle| wind.steady_m_s(vehicle, time_s).norm()));
            let sampled_m_s = speeds.fold(0.0, f64::max);
            assert!(sampled_m_s <= bound_m_s * (1.0 + 2.0 * ROUNDING), "{case}: {sampled_m_s} above {bound_m_s}");
            assert!(bound_m_s <= sampled_m_s * (1.0 + 1e-3), "{case}: {bound_m_s} far above {sampled_m_s}");
        }
    }
}
