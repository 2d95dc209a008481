//! Extent of a flight: scene coordinates, ground, and framing, constant over all frames.

use std::sync::{Mutex, PoisonError};

use nalgebra::Vector3;

use super::camera::{Camera, CameraSpec, ISO_DEG, Orbit};
use super::compose::View;
use crate::error::RenderError;
use crate::timeline::Timeline;
use tautline_core::swarm::{Pair, Rows, row};
use tautline_laws::space::{Obstacle, Shape};
use tautline_report::flight_log::Frame;

/// Largest number of vehicle positions that framing uses.
const FRAMED_PLACES: usize = 200_000;
/// Largest height of the lowest position above z = 0, relative to the extent of the flight, at which the ground is
/// drawn at z = 0.
const NEAR_GROUND: f64 = 0.3;
/// Approximate number of ground lines along the longer side.
const GROUND_LINES: f64 = 12.0;
/// Largest number of vehicles that a message names.
const MAX_NAMED: usize = 8;
/// Radius of the view around a followed vehicle, in units of delta, or of the vehicle's radius without delta.
const FOLLOWED_DELTAS: f64 = 3.0;
const FOLLOWED_RADII: f64 = 20.0;
/// Radius of the view around the closest pair, in units of its separation.
const CLOSEST_DISTANCES: f64 = 1.1;
/// Smallest depth that is drawn, in units of the largest: centimetres in a flight of tens of kilometres.
const NEAREST: f64 = 1e-6;
/// Distance around the flight up to which obstacles are framed, in units of its extent.
const OBSTACLE_ROOM: f64 = 0.5;
/// Margin around the ground for its scale, in units of the line distance.
const SCALE_ROOM: f64 = 0.6;

/// Extent of a flight, origin of its scene coordinates, and ground.
#[derive(Debug)]
pub struct Extent {
    origin_m: Vector3<f64>,
    /// Positions of vehicles over the flight with the radius that must be visible around them, and corners of the
    /// ground.
    positions: Vec<(Vector3<f64>, f64)>,
    /// Last computed framing; it is the same for all pictures of a film.
    framed: Mutex<Option<(CameraSpec, Camera)>>,
    /// Corners of the ground, in scene coordinates \[m\].
    pub(super) ground_m: [Vector3<f64>; 2],
    /// Distance of ground lines \[m\].
    pub(super) grid_m: f64,
    /// Bounding ball of everything: centre and radius \[m\].
    reach: (Vector3<f64>, f64),
}

impl Extent {
    /// Computes the extent of a flight so far.
    #[must_use]
    pub fn of(timeline: &Timeline) -> Self {
        let keyframes = timeline.log.keyframes();
        let stride = keyframes.len().div_ceil((FRAMED_PLACES / timeline.count().max(1)).max(2)).max(1);
        let mut positions: Vec<(Vector3<f64>, f64)> = Vec::new();
        for keyframe in keyframes.iter().step_by(stride).chain(keyframes.last()) {
            let there = (0..keyframe.positions_m.nrows()).map(|k| (k, row(&keyframe.positions_m, k)));
            let there = there.filter(|(_, place)| place.iter().all(|x| x.is_finite()));
            positions.extend(there.map(|(k, place)| (place, timeline.keep_out_m(k))));
        }
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let mut largest = 0.0_f64;
        for (place, radius) in &positions {
            (low, high, largest) = (low.inf(place), high.sup(place), largest.max(*radius));
        }
        let flight_bounds = if positions.is_empty() { [Vector3::zeros(); 2] } else { [low, high] };
        if !positions.is_empty() {
            let room = Vector3::repeat(OBSTACLE_ROOM * (high - low).max().max(largest));
            let [least, most] = [low - room, high + room];
            let obstacles = timeline.plan.iter().flat_map(|plan| &plan.obstacles);
            for corner in obstacles.flat_map(corners).map(|corner| corner.sup(&least).inf(&most)) {
                (low, high) = (low.inf(&corner), high.sup(&corner));
                positions.push((corner, 0.0));
            }
        }
        if positions.is_empty() {
            (low, high, largest) = (Vector3::zeros(), Vector3::zeros(), 1.0);
        }
        // Halved first: the difference of the largest doubles overflows.
        let origin_m = low / 2.0 + high / 2.0;
        for (place, _) in &mut positions {
            *place -= origin_m;
        }
        let [lowest, highest] = flight_bounds;
        let is_near = lowest.z >= 0.0 && lowest.z <= NEAR_GROUND * (highest - lowest).norm() + largest;
        let z = if is_near { 0.0 } else { low.z - largest } - origin_m.z;
        let (low, high) = (low - origin_m, high - origin_m);
        let span = (high.x - low.x).max(high.y - low.y).max(2.0 * largest) + 2.0 * largest;
        let grid_m = round_step(span / GROUND_LINES);
        let corner = |at: Vector3<f64>, round: fn(f64) -> f64| {
            let at = ((at + origin_m) / grid_m).map(round) * grid_m - origin_m;
            Vector3::new(at.x, at.y, z)
        };
        let margin = Vector3::repeat(largest);
        let ground_m = [corner(low - margin, f64::floor), corner(high + margin, f64::ceil)];
        let room = SCALE_ROOM * grid_m;
        for x in [ground_m[0].x - room, ground_m[1].x + room] {
            positions.extend([ground_m[0].y - room, ground_m[1].y + room].map(|y| (Vector3::new(x, y, z), 0.0)));
        }
        let (lowest, highest) = (ground_m[0].inf(&low), ground_m[1].sup(&high));
        let reach = ((lowest + highest) / 2.0, (highest - lowest).norm() / 2.0 + largest + grid_m);
        Self { origin_m, positions, framed: Mutex::new(None), ground_m, grid_m, reach }
    }

    /// Returns the bounding ball of everything in scene coordinates: centre \[m\] and radius \[m\].
    pub(super) fn reach(&self) -> (Vector3<f64>, f64) {
        self.reach
    }

    /// Returns the origin of the scene coordinates in coordinates of the recording \[m\].
    #[must_use]
    pub fn origin_m(&self) -> Vector3<f64> {
        self.origin_m
    }

    /// Returns a row of a position table in scene coordinates \[m\]; `None` if it is not finite.
    pub(crate) fn place(&self, positions_m: &Rows, k: usize) -> Option<Vector3<f64>> {
        let place = row(positions_m, k) - self.origin_m;
        place.iter().all(|x| x.is_finite()).then_some(place)
    }

    /// Returns the camera of a view of a frame.
    ///
    /// # Errors
    /// [`RenderError::NoVehicle`] if the camera follows a vehicle that the flight does not have.
    pub fn camera(&self, timeline: &Timeline, frame: &Frame, view: &View) -> Result<Camera, RenderError> {
        let framing = |spec| self.framing(spec, view.size_px);
        Ok(match &view.camera {
            CameraSpec::Orbit(orbit) => Camera::orbiting(*orbit, Vector3::zeros(), view.size_px),
            CameraSpec::Follow(name) => {
                let vehicle = find(timeline, name)?;
                let radius_m = FOLLOWED_RADII * timeline.radius_m[vehicle];
                let around_m = timeline.delta_m.map_or(radius_m, |delta_m| FOLLOWED_DELTAS * delta_m);
                let place = self.place(&frame.positions_m, vehicle);
                place.map_or_else(|| framing(&CameraSpec::Iso), |place| Camera::close_up(place, around_m, view.size_px))
            }
            CameraSpec::Closest => match frame.nearest {
                Some((pair, _)) => self.close_up(timeline, frame, pair, view.size_px),
                None => framing(&CameraSpec::Iso),
            },
            spec => framing(spec),
        })
    }

    /// Returns a camera near a pair, or one that frames the flight if a vehicle of the pair is absent.
    pub(crate) fn close_up(&self, timeline: &Timeline, frame: &Frame, pair: Pair, size_px: [u32; 2]) -> Camera {
        let [first, second] = [pair.first(), pair.second()].map(|k| self.place(&frame.positions_m, k));
        let (Some(first), Some(second)) = (first, second) else { return self.framing(&CameraSpec::Iso, size_px) };
        let distance_m = (second - first).norm();
        // The hulls of two vehicles at one position are visible too, for any delta.
        let keep_out_m = 2.0 * timeline.keep_out_m(pair.first()).max(timeline.keep_out_m(pair.second()));
        Camera::close_up((first + second) / 2.0, CLOSEST_DISTANCES * distance_m.max(keep_out_m), size_px)
    }

    fn framing(&self, spec: &CameraSpec, size_px: [u32; 2]) -> Camera {
        let mut framed = self.framed.lock().unwrap_or_else(PoisonError::into_inner);
        match &*framed {
            Some((known, camera)) if known == spec && camera.size_px == size_px => *camera,
            _ => {
                let camera = Camera::framing(spec, &self.positions, size_px);
                *framed = Some((spec.clone(), camera));
                camera
            }
        }
    }

    /// Returns the orbit and the target \[m\] of a camera that frames the flight as [`CameraSpec::Iso`] does: the
    /// initial camera of the window.
    #[must_use]
    pub fn orbit(&self, size_px: [u32; 2]) -> (Orbit, Vector3<f64>) {
        let Camera { eye_m, back, .. } = self.framing(&CameraSpec::Iso, size_px);
        let ([azimuth_deg, elevation_deg], ahead_m) = (ISO_DEG, back.dot(&eye_m));
        (Orbit { azimuth_deg, elevation_deg, distance_m: ahead_m.max(self.grid_m) }, eye_m - back * ahead_m)
    }

    /// Returns the smallest and largest depth of the content for a camera \[m\].
    pub(super) fn depth_m(&self, camera: &Camera) -> [f64; 2] {
        let (centre, radius) = self.reach;
        let middle = -camera.in_camera_frame(centre).z;
        let far = (middle + radius).max(1e-2);
        [(middle - radius).max(NEAREST * far), far]
    }
}

/// Returns the corners of a box around an obstacle \[m\]; empty for an unbounded one.
fn corners(obstacle: &Obstacle) -> Vec<Vector3<f64>> {
    let (low, high) = match obstacle.shape {
        Shape::Ball { radius_m } => (-Vector3::repeat(radius_m), Vector3::repeat(radius_m)),
        Shape::Capsule { from_m, to_m, radius_m } => {
            let round = Vector3::repeat(radius_m);
            (from_m.inf(&to_m) - round, from_m.sup(&to_m) + round)
        }
        Shape::Box { half_m, .. } => {
            let across = half_m.xy().norm();
            let half = Vector3::new(across, across, half_m.z);
            (-half, half)
        }
        Shape::HalfSpace { .. } => return Vec::new(),
    };
    let corner = |k: usize| Vector3::from_fn(|axis, _| if k >> axis & 1 == 0 { low[axis] } else { high[axis] });
    (0..8).map(|k| obstacle.place_m + corner(k)).collect()
}

/// Returns the index of the vehicle with this name.
fn find(timeline: &Timeline, name: &str) -> Result<usize, RenderError> {
    timeline.vehicles.iter().position(|vehicle| vehicle == name).ok_or_else(|| {
        let mut vehicles = timeline.vehicles.iter().take(MAX_NAMED).cloned().collect::<Vec<_>>().join(", ");
        if timeline.count() > MAX_NAMED {
            vehicles = format!("{vehicles} and {} more", timeline.count() - MAX_NAMED);
        }
        RenderError::NoVehicle(format!("there is no vehicle `{name}` to follow; the flight has {vehicles}"))
    })
}

/// Returns the smallest of 1, 2 and 5 times a power of ten at or above a length; 1 for an invalid length.
fn round_step(length_m: f64) -> f64 {
    if !(length_m > 0.0 && length_m.is_finite()) {
        return 1.0;
    }
    let power = 10.0_f64.powf(length_m.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|&step| step >= length_m).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_steps_are_round_numbers() {
        let steps = [0.9, 1.0, 1.1, 3.0, 7.0, 0.03, 1234.0].map(round_step);
        assert_eq!(steps, [1.0, 1.0, 2.0, 5.0, 10.0, 0.05, 2000.0]);
        assert_eq!([0.0, -1.0, f64::NAN, f64::INFINITY].map(round_step), [1.0; 4]);
    }
}
