//! Direction from which replay and pictures of a flight show it first.

use nalgebra::Vector3;
use serde::Serialize;

use crate::flight_log::FlightLog;
use tautline_core::obstacle::Shape;
use tautline_core::swarm::row;
use tautline_laws::space::signed_distance_m;

/// Largest number of positions from which the extent of a flight is computed.
const PLACES: usize = 200_000;
/// Largest number of lines of sight of a direction, over all obstacles, and their smallest number.
const SIGHTS: usize = 20_000;
const FEWEST_SIGHTS: usize = 40;
/// Largest number of steps along a line of sight.
const SIGHT_STEPS: u32 = 100;
/// Largest thickness of a planar flight, in units of its extent.
const PLANAR: f64 = 0.02;
/// Largest height of a flat flight, in units of its extent; it is seen from higher up.
const FLAT: f64 = 0.3;
/// Azimuth of the oblique view for a flight along x and along y, and elevation for a flat and any other flight
/// \[degrees\].
const AZIMUTH_DEG: [f64; 2] = [-66.0, -24.0];
const ELEVATION_DEG: [f64; 2] = [46.0, 28.0];
/// Number of azimuths in a full turn among which the view with the fewest hidden vehicles is chosen.
const AZIMUTHS: u32 = 24;
/// Share of hidden vehicles that outweighs half a turn away from the usual azimuth.
const HALF_TURN: f64 = 0.1;
/// Distance of the eye from the middle of a flight, in units of its half diagonal.
const EYE: f64 = 3.0;

/// Direction from which a flight is seen first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Viewpoint {
    /// Azimuth of the oblique view, from the x axis towards the y axis \[degrees\].
    pub azimuth_deg: f64,
    /// Elevation of the oblique view above the horizon \[degrees\].
    pub elevation_deg: f64,
    /// Axis (0 for x, 1 for y, 2 for z) across a planar flight without obstacles, which is seen along this axis.
    pub across: Option<usize>,
}

impl Viewpoint {
    /// Returns the viewpoint of flights with obstacles, each a shape and its position \[m\]. Among the azimuths, that
    /// with the fewest vehicles behind obstacles is chosen; a small gain does not outweigh a large turn.
    #[must_use]
    pub fn of(logs: &[&FlightLog], obstacles: &[(Shape, Vector3<f64>)]) -> Self {
        let places = places(logs);
        let bounds = places.iter().map(|place| [*place; 2]);
        let bounds = bounds.reduce(|[low, high], [place, _]| [low.inf(&place), high.sup(&place)]);
        let [low, high] = bounds.unwrap_or_default();
        let flown = high - low;
        let is_thin = |axis: &usize| flown[*axis] <= PLANAR * flown.max() && flown.max() > 0.0 && obstacles.is_empty();
        let usual_deg = AZIMUTH_DEG[usize::from(flown.y > flown.x)];
        let elevation_deg = ELEVATION_DEG[usize::from(flown.z > FLAT * flown.xy().max())];
        let solid: Vec<_> = obstacles.iter().filter(|(shape, _)| !matches!(shape, Shape::HalfSpace { .. })).collect();
        let sights = (SIGHTS / solid.len().max(1)).max(FEWEST_SIGHTS);
        // A replay opens at the start, which therefore has the weight of the whole flight.
        let start = &places[..logs.first().map_or(0, |log| log.count()).min(places.len())];
        let seen = [start, &places].map(|all| (all, all.len().div_ceil(sights).max(1)));
        let cost = |turn_deg: f64| {
            let back = back(usual_deg + turn_deg, elevation_deg);
            let eye = low / 2.0 + high / 2.0 + back * (EYE * flown.norm() / 2.0);
            let hides = |place: &Vector3<f64>| solid.iter().any(|(shape, at)| is_between(shape, *at, *place, eye));
            let hidden = seen.map(|(all, step)| {
                let count = all.iter().step_by(step).filter(|place| hides(place)).count();
                count as f64 / all.len().div_ceil(step).max(1) as f64
            });
            hidden.iter().sum::<f64>() + HALF_TURN * turn_deg.abs() / 180.0
        };
        // The first of equal costs is the nearest.
        let costs = turns_deg().take(if solid.is_empty() { 1 } else { usize::MAX });
        let costs = costs.map(|turn_deg| (cost(turn_deg), turn_deg));
        let turn_deg = costs.reduce(|best, next| if next.0 < best.0 { next } else { best }).map_or(0.0, |best| best.1);
        let azimuth_deg = usual_deg + turn_deg;
        let azimuth_deg = azimuth_deg - 360.0 * (azimuth_deg / 360.0).round();
        Self { azimuth_deg, elevation_deg, across: [2, 1, 0].into_iter().find(is_thin) }
    }
}

/// Returns angles by which a view may turn, from small to large \[degrees\].
pub fn turns_deg() -> impl Iterator<Item = f64> {
    let step_deg = 360.0 / f64::from(AZIMUTHS);
    (0..=AZIMUTHS / 2).flat_map(move |k| [1.0, -1.0].map(|sign| sign * step_deg * f64::from(k)))
}

/// Returns the unit vector from a target to an eye in this direction.
fn back(azimuth_deg: f64, elevation_deg: f64) -> Vector3<f64> {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth_deg.to_radians().sin_cos(), elevation_deg.to_radians().sin_cos());
    Vector3::new(cos_e * cos_a, cos_e * sin_a, sin_e)
}

/// Returns finite positions of vehicles over flights \[m\].
fn places(logs: &[&FlightLog]) -> Vec<Vector3<f64>> {
    let mut places = Vec::new();
    for log in logs {
        let stride = log.keyframes().len().div_ceil((PLACES / log.count().max(1)).max(2)).max(1);
        for keyframe in log.keyframes().iter().step_by(stride).chain(log.keyframes().last()) {
            let all = (0..keyframe.positions_m.nrows()).map(|k| row(&keyframe.positions_m, k));
            places.extend(all.filter(|place| place.iter().all(|x| x.is_finite())));
        }
    }
    places
}

/// Returns whether a shape at a position is on the straight line between two points \[m\].
#[must_use]
pub fn is_between(shape: &Shape, at_m: Vector3<f64>, from_m: Vector3<f64>, to_m: Vector3<f64>) -> bool {
    let (towards, mut along) = (to_m - from_m, 0.0);
    let length = towards.norm();
    // Steps of the distance to the surface end beyond the shape, inside it or at the other point.
    for _ in 0..SIGHT_STEPS {
        let point = from_m + towards * (along / length);
        let (free_m, _) = signed_distance_m(shape, point - at_m);
        if free_m <= 0.0 {
            return true;
        }
        along += free_m.max(length / f64::from(SIGHT_STEPS));
        if along.is_nan() || along >= length {
            break;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Rows;
    use tautline_laws::space::Metric;

    fn flight(heights_m: [f64; 2]) -> FlightLog {
        let mut log = FlightLog::new(Metric::default(), 1.0);
        for t in 0..=20_u32 {
            let x = f64::from(t);
            log.take_positions(x, Rows::from_row_slice(&[x, 0.0, heights_m[0], x, 2.0, heights_m[1]]));
        }
        log
    }

    #[test]
    fn a_wall_turns_the_view_to_the_other_side() {
        let log = flight([0.0, 8.0]);
        let free = Viewpoint::of(&[&log], &[]);
        assert_eq!((free.azimuth_deg, free.elevation_deg, free.across), (-66.0, 28.0, None));
        let wall = Shape::Box { half_m: Vector3::new(40.0, 0.5, 40.0), yaw_deg: 0.0 };
        let before = Viewpoint::of(&[&log], &[(wall, Vector3::new(10.0, -5.0, 0.0))]);
        assert!(before.azimuth_deg.to_radians().sin() > -0.2, "the eye is not beyond the wall: {before:?}");
        let behind = Viewpoint::of(&[&log], &[(wall, Vector3::new(10.0, 7.0, 0.0))]);
        assert_eq!(behind, free, "a wall behind the vehicles hides none");
    }

    #[test]
    fn a_planar_flight_is_seen_across_its_plane() {
        assert_eq!(Viewpoint::of(&[&flight([1.0, 1.0])], &[]).across, Some(2));
        let ground = (Shape::HalfSpace { normal: Vector3::z() }, Vector3::zeros());
        assert_eq!(Viewpoint::of(&[&flight([1.0, 1.0])], &[ground]).across, None);
        assert_eq!(Viewpoint::of(&[&FlightLog::default()], &[]).across, None);
    }
}
