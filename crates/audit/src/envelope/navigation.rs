//! Rules of drone shows: no horizontal motion below the navigation floor, and yaw rates between setpoints.

use nalgebra::Vector3;

use super::extremum::{EnclosedValue, Enclosure, Precision, largest};
use crate::polynomial::value;
use crate::sweep::Interval;
use tautline_core::track::Sample;

/// Horizontal speed up to which a vehicle counts as not moving horizontally \[m/s\], as in Skybrush Studio.
pub const LEVEL_MOTION_M_S: f64 = 0.01;

/// Returns the negated height of a vehicle that moves horizontally, and minus infinity for one that does not. The first
/// two components are the horizontal velocity \[m/s\], the third is the height \[m\].
fn lowness(motion: Vector3<f64>) -> f64 {
    if motion.xy().norm() > LEVEL_MOTION_M_S { -motion.z } else { f64::NEG_INFINITY }
}

/// Returns the negated height at an instant with this velocity, if the vehicle moves horizontally.
pub(super) fn lowness_at(place_m: Vector3<f64>, velocity_m_s: Vector3<f64>) -> Option<f64> {
    let lowness = lowness(Vector3::new(velocity_m_s.x, velocity_m_s.y, place_m.z));
    lowness.is_finite().then_some(lowness)
}

/// Encloses the negated least height in horizontal motion between two samples; `None` without horizontal motion.
///
/// Under a bound A on the acceleration the velocity is within A h / 2 of the mean velocity, and the height within A h^2
/// / 8 of the line. Somewhere the horizontal speed is at least that of the mean velocity, at an unknown height.
pub(super) fn lowness_between(
    window: Interval,
    (before, seen): (&Sample, &Sample),
    mean: Vector3<f64>,
    bound_m_s2: f64,
    rounding_m_s: f64,
) -> Option<EnclosedValue> {
    let h = seen.time_s - before.time_s;
    let over = Interval { from_s: before.time_s.max(window.from_s), to_s: seen.time_s.min(window.to_s) };
    let height = |time_s: f64| before.position_m.lerp(&seen.position_m, (time_s - before.time_s) / h).z;
    let (first, second) = (height(over.from_s), height(over.to_s));
    let (lowest, highest) = (first.min(second), first.max(second));
    let (speed, deviation_m) = (mean.xy().norm() - rounding_m_s, bound_m_s2 * h * h / 8.0);
    let is_moving = speed > LEVEL_MOTION_M_S;
    if over.from_s >= over.to_s || (!is_moving && speed + 0.5 * bound_m_s2 * h <= LEVEL_MOTION_M_S) {
        return None;
    }
    let fraction = if second < first { 1.0 } else { 0.0 };
    let is_whole = over.from_s == before.time_s && over.to_s == seen.time_s;
    let lower = match bound_m_s2 > 0.0 {
        false => -lowest,
        true if is_moving && is_whole => -highest - deviation_m,
        true => f64::NEG_INFINITY,
    };
    Some((over, Enclosure { lower, upper: deviation_m - lowest, at: fraction }))
}

/// Encloses the negated least height of a curve where it moves horizontally. `place` and `velocity` are polynomials of
/// the same fraction.
pub(super) fn lowness_along(place: &[Vector3<f64>], velocity: &[Vector3<f64>], goal: Precision) -> Enclosure {
    let zero = Vector3::zeros();
    let motion: Vec<_> = place
        .iter()
        .enumerate()
        .map(|(k, place)| velocity.get(k).map_or(Vector3::new(0.0, 0.0, place.z), |v| Vector3::new(v.x, v.y, place.z)))
        .collect();
    largest(&motion, goal, |part, basis| {
        let is_moving = basis.points(part).any(|point| point.xy().norm() > LEVEL_MOTION_M_S);
        let lowest = basis.points(part).map(|point| -point.z).fold(f64::NEG_INFINITY, f64::max);
        let upper = if is_moving { lowest } else { f64::NEG_INFINITY };
        [lowness(part.first().copied().unwrap_or(zero)), lowness(value(part, 1.0)), upper]
    })
}

/// Returns the yaw rates \[deg/s\] between setpoints of time \[s\] and yaw \[deg\] within a window. The yaw is constant
/// before the first and after the last setpoint.
pub(super) fn yaw_rates(setpoints: &[[f64; 2]], window: Interval) -> Vec<EnclosedValue> {
    let rates = setpoints.windows(2).filter_map(|two| {
        let [[from_s, from], [to_s, to]] = [two[0], two[1]];
        let over = Interval { from_s: from_s.max(window.from_s), to_s: to_s.min(window.to_s) };
        let rate = ((to - from) / (to_s - from_s)).abs();
        (over.from_s < over.to_s).then_some((over, Enclosure { lower: rate, upper: rate, at: 0.0 }))
    });
    rates.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn goal() -> Precision {
        Precision { known: f64::NEG_INFINITY, bound: f64::INFINITY, width: 1e-9, coarse: 0.0 }
    }

    #[test]
    fn the_least_height_counts_only_in_horizontal_motion() {
        // Climbs with 1 m/s for 4 s; the horizontal velocity is u - 1/2 for fractions u: it passes 0 at 2 m.
        let place = [Vector3::zeros(), Vector3::new(0.0, 0.0, 4.0)];
        let level = [Vector3::new(-0.5, 0.0, 1.0), Vector3::new(1.0, 0.0, 0.0)];
        let found = lowness_along(&place, &level, goal());
        assert!(found.lower <= 0.0 && 0.0 <= found.upper && found.upper - found.lower < 1e-8, "{found:?}");
        // Moves horizontally from the middle on only.
        let late = [Vector3::new(-1.0, 0.0, 1.0), Vector3::new(0.0, 0.0, 0.0)];
        let still = [Vector3::new(0.0, 0.0, 1.0), Vector3::zeros()];
        assert!(lowness_along(&place, &late, goal()).lower >= -1e-9);
        let found = lowness_along(&place, &still, goal());
        assert_eq!((found.lower, found.upper), (f64::NEG_INFINITY, f64::NEG_INFINITY));
    }

    #[test]
    fn yaw_rates_are_those_between_setpoints_in_the_window() {
        let setpoints = [[0.0, 0.0], [2.0, 60.0], [4.0, 0.0], [5.0, 350.0]];
        let rates = |from_s: f64, to_s: f64| -> Vec<_> {
            yaw_rates(&setpoints, Interval { from_s, to_s }).iter().map(|(_, found)| found.upper).collect()
        };
        assert_eq!(rates(0.0, 9.0), [30.0, 30.0, 350.0]);
        assert_eq!(rates(2.5, 3.0), [30.0]);
        assert!(rates(5.0, 9.0).is_empty());
    }
}
