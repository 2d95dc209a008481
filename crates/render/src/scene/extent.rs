//! Extent of a flight: scene coordinates, ground, and framing, constant over all frames.

use nalgebra::Vector3;

use super::camera::{Area, Camera, CameraSpec, Direction, Lens};
use super::compose::View;
use crate::error::RenderError;
use crate::timeline::Timeline;
use tautline_core::obstacle::Shape;
use tautline_core::swarm::{Pair, Rows, row};
use tautline_report::drawing::{Ground, Surroundings, Viewpoint, box_corners, is_between, shape_bounds, turns_deg};
use tautline_report::flight_log::{Frame, Keyframe};

/// Largest number of vehicle positions that framing uses.
const FRAMED_PLACES: usize = 200_000;
/// Largest number of vehicles that a message names.
const MAX_NAMED: usize = 8;
/// Radius of the view around a followed vehicle, in units of delta, or of the vehicle's radius without delta.
const FOLLOWED_DELTAS: f64 = 3.0;
const FOLLOWED_RADII: f64 = 20.0;
/// Radius of the view around the closest pair, in units of its separation.
const CLOSEST_DISTANCES: f64 = 1.1;
/// Part of a flight over which a camera that follows the swarm smooths its movement.
const SMOOTHED: f64 = 0.04;
/// Largest number of times at which a camera that follows the swarm is computed.
const FOLLOWED_TIMES: usize = 2000;
/// Smallest depth that is drawn, in units of the largest: centimetres in a flight of tens of kilometres.
const NEAREST: f64 = 1e-6;

/// Box around all vehicles at a time.
#[derive(Clone, Copy, Debug)]
struct SwarmBox {
    time_s: f64,
    centre: Vector3<f64>,
    half: Vector3<f64>,
}

/// Extent of a flight, origin of its scene coordinates, and ground.
#[derive(Debug)]
pub struct Extent {
    origin_m: Vector3<f64>,
    /// Positions of vehicles over the flight and of obstacles near it, with the radius that must be visible around
    /// them.
    balls: Vec<(Vector3<f64>, f64)>,
    /// Directions of the cameras `Auto` and `Perspective`.
    auto: Direction,
    oblique: Direction,
    /// Boxes around all vehicles, smoothed over time.
    swarm: Vec<SwarmBox>,
    /// Whether the swarm travels so far that the camera `Auto` follows it.
    travels: bool,
    /// Largest speed of a vehicle between two samples \[m/s\].
    pub(super) max_speed_m_s: f64,
    /// Whether a flight has a violation.
    pub(super) has_violations: bool,
    /// Ground, in scene coordinates.
    pub(super) ground: Ground,
    /// Bounding ball of everything: centre and radius \[m\].
    reach: (Vector3<f64>, f64),
    /// Corners around the boxes among the obstacles, which may be beyond \[m\].
    boxes_m: Vec<Vector3<f64>>,
}

impl Extent {
    /// Computes the extent of a flight so far.
    #[must_use]
    pub fn of(timeline: &Timeline) -> Self {
        Self::of_all(&[timeline])
    }

    /// Computes the common extent of flights, for pictures side by side.
    #[must_use]
    pub fn of_all(timelines: &[&Timeline]) -> Self {
        let mut balls: Vec<(Vector3<f64>, f64)> = Vec::new();
        let mut swarm: Vec<SwarmBox> = Vec::new();
        let mut max_speed_m_s = 0.0_f64;
        for timeline in timelines {
            let keyframes = timeline.log.keyframes();
            let most = (FRAMED_PLACES / timeline.count().max(1)).clamp(2, FOLLOWED_TIMES);
            let stride = keyframes.len().div_ceil(most).max(1);
            let mut before: Option<&Keyframe> = None;
            for keyframe in keyframes.iter().step_by(stride).chain(keyframes.last()) {
                let first = balls.len();
                for k in 0..keyframe.positions_m.nrows() {
                    let place = row(&keyframe.positions_m, k);
                    if !place.iter().all(|x| x.is_finite()) {
                        continue;
                    }
                    balls.push((place, timeline.keep_out_m(k)));
                    if let Some(before) = before.filter(|before| before.time_s < keyframe.time_s) {
                        let moved_m = (place - row(&before.positions_m, k)).norm();
                        max_speed_m_s = max_speed_m_s.max(moved_m / (keyframe.time_s - before.time_s));
                    }
                }
                let radius_m = balls[first..].iter().fold(0.0, |largest: f64, (_, radius)| largest.max(*radius));
                swarm.extend(bounds(&balls[first..]).map(|[low, high]| SwarmBox {
                    time_s: keyframe.time_s,
                    centre: low / 2.0 + high / 2.0,
                    half: (high / 2.0 - low / 2.0).add_scalar(radius_m),
                }));
                before = Some(keyframe);
            }
        }
        swarm.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let largest = balls.iter().fold(0.0_f64, |largest, (_, radius)| largest.max(*radius));
        let obstacles = timelines.iter().flat_map(|timeline| &timeline.plan).flat_map(|plan| &plan.obstacles);
        let solids: Vec<_> = obstacles.map(|obstacle| (obstacle.shape, obstacle.place_m)).collect();
        let around = Surroundings::of(bounds(&balls), largest, &solids);
        let origin_m = around.middle_m();
        balls.extend(around.obstacles_m.iter().map(|corner| (*corner, 0.0)));
        for (place, _) in &mut balls {
            *place -= origin_m;
        }
        for around in &mut swarm {
            around.centre -= origin_m;
        }
        let logs: Vec<_> = timelines.iter().map(|timeline| &*timeline.log).collect();
        let Viewpoint { azimuth_deg, elevation_deg, across } = Viewpoint::of(&logs, &solids);
        let oblique = Direction::perspective(azimuth_deg, elevation_deg);
        let auto = across.map_or(oblique, |axis| [Direction::SIDE, Direction::FRONT, Direction::TOP][axis]);
        let ground = Ground { corners_m: around.ground.corners_m.map(|corner| corner - origin_m), ..around.ground };
        let [low, high] = around.box_m.map(|corner| corner - origin_m);
        let (lowest, highest) = (ground.corners_m[0].inf(&low), ground.corners_m[1].sup(&high));
        let reach = ((lowest + highest) / 2.0, (highest - lowest).norm() / 2.0 + around.around_m + ground.step_m);
        let boxes = solids.iter().filter(|(shape, _)| matches!(shape, Shape::Box { .. }));
        let boxes = boxes.filter_map(|(shape, at_m)| Some((box_corners(shape_bounds(shape)?), at_m - origin_m)));
        let swarm = smoothed(&swarm);
        let largest_m = swarm.iter().map(|around| around.half.norm()).fold(0.0, f64::max);
        let travels = around.is_far_for(largest_m);
        Self {
            origin_m,
            balls,
            auto,
            oblique,
            swarm,
            travels,
            max_speed_m_s,
            has_violations: timelines.iter().any(|timeline| timeline.has_violations()),
            ground,
            reach,
            boxes_m: boxes.flat_map(|(corners, at_m)| corners.map(|corner| corner + at_m)).collect(),
        }
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
        let area = view.area(self.has_violations);
        let camera = match &view.camera {
            CameraSpec::Auto => self.overview(self.auto, frame, area),
            CameraSpec::Perspective => self.framing(self.oblique, &[], area),
            CameraSpec::Top => self.framing(Direction::TOP, &[], area),
            CameraSpec::Front => self.framing(Direction::FRONT, &[], area),
            CameraSpec::Side => self.framing(Direction::SIDE, &[], area),
            CameraSpec::Orbit(orbit) => Camera::orbiting(*orbit, Vector3::zeros(), view.size_px),
            CameraSpec::Follow(Some(name)) => {
                let vehicle = find(timeline, name)?;
                let radius_m = FOLLOWED_RADII * timeline.radius_m[vehicle];
                let around_m = timeline.delta_m.map_or(radius_m, |delta_m| FOLLOWED_DELTAS * delta_m);
                let place = self.place(&frame.positions_m, vehicle).map(|place| (place, around_m));
                self.framing(self.auto, place.as_slice(), area)
            }
            CameraSpec::Follow(None) => self.framing(self.auto, &self.swarm_at(frame.time_s), area),
            CameraSpec::Closest => match frame.nearest {
                Some((pair, _)) => self.close_up(timeline, frame, pair, view),
                None => self.framing(self.auto, &[], area),
            },
        };
        Ok(camera.adjusted(&view.adjustment))
    }

    /// Returns the camera of a view for a picture of a pair. If an obstacle hides a vehicle of the pair, the camera
    /// `Auto` turns to a direction that shows both and hides the fewest other vehicles; of equal ones, to the smallest
    /// angle. Without such a direction it keeps its own.
    ///
    /// # Errors
    /// As [`Extent::camera`].
    pub fn camera_on(
        &self,
        timeline: &Timeline,
        frame: &Frame,
        view: &View,
        pair: Pair,
    ) -> Result<Camera, RenderError> {
        let camera = self.camera(timeline, frame, view)?;
        let is_hidden = |camera: &Camera, k: usize| {
            let aside = camera.right * timeline.radius_m[k];
            let places = self.place(&frame.positions_m, k).map(|place| [place - aside, place, place + aside]);
            places.into_iter().flatten().any(|place| self.is_behind_obstacle(timeline, camera, place))
        };
        let is_pair_hidden = |camera: &Camera| is_hidden(camera, pair.first()) || is_hidden(camera, pair.second());
        if view.camera != CameraSpec::Auto || !is_pair_hidden(&camera) {
            return Ok(camera);
        }
        let turned = turns_deg().map(|turn_deg| {
            let direction = Direction { azimuth_deg: self.auto.azimuth_deg + turn_deg, ..self.auto };
            self.overview(direction, frame, view.area(self.has_violations)).adjusted(&view.adjustment)
        });
        let hidden = |camera: &Camera| (0..timeline.count()).filter(|&k| is_hidden(camera, k)).count();
        Ok(turned.filter(|camera| !is_pair_hidden(camera)).min_by_key(hidden).unwrap_or(camera))
    }

    /// Returns whether a solid obstacle is between a camera and a position in scene coordinates.
    pub(super) fn is_behind_obstacle(&self, timeline: &Timeline, camera: &Camera, place: Vector3<f64>) -> bool {
        let distance_m = camera.project(place).map_or(0.0, |projection| projection.depth_m);
        let towards = match camera.lens {
            Lens::Perspective(_) => camera.eye_m - place,
            Lens::Parallel(_) => camera.back * distance_m,
        };
        let from_m = place + self.origin_m;
        timeline.plan.iter().flat_map(|plan| &plan.obstacles).any(|obstacle| {
            !matches!(obstacle.shape, Shape::HalfSpace { .. })
                && is_between(&obstacle.shape, obstacle.place_m, from_m, from_m + towards)
        })
    }

    /// Returns a camera in a direction that frames the flight, or the swarm if it travels far.
    fn overview(&self, direction: Direction, frame: &Frame, area: Area) -> Camera {
        let swarm = if self.travels { self.swarm_at(frame.time_s) } else { Vec::new() };
        self.framing(direction, &swarm, area)
    }

    /// Returns a camera near a pair, or one that frames the flight if a vehicle of the pair is absent.
    pub(crate) fn close_up(&self, timeline: &Timeline, frame: &Frame, pair: Pair, view: &View) -> Camera {
        let area = view.area(self.has_violations);
        let [first, second] = [pair.first(), pair.second()].map(|k| self.place(&frame.positions_m, k));
        let (Some(first), Some(second)) = (first, second) else { return self.framing(self.auto, &[], area) };
        let distance_m = (second - first).norm();
        // The hulls of two vehicles at one position are visible too, for any delta.
        let keep_out_m = 2.0 * timeline.keep_out_m(pair.first()).max(timeline.keep_out_m(pair.second()));
        let ball = ((first + second) / 2.0, CLOSEST_DISTANCES * distance_m.max(keep_out_m));
        self.framing(self.auto, &[ball], area)
    }

    /// Returns a camera that frames these balls, or the flight without any ball.
    fn framing(&self, direction: Direction, balls: &[(Vector3<f64>, f64)], area: Area) -> Camera {
        Camera::framing(direction, if balls.is_empty() { &self.balls } else { balls }, area)
    }

    /// Returns the corners of the box around all vehicles at a time \[s\].
    fn swarm_at(&self, time_s: f64) -> Vec<(Vector3<f64>, f64)> {
        let next = self.swarm.partition_point(|around| around.time_s <= time_s);
        let (from, to) = (self.swarm.get(next.saturating_sub(1)), self.swarm.get(next).or(self.swarm.last()));
        let (Some(from), Some(to)) = (from, to) else { return Vec::new() };
        let span_s = to.time_s - from.time_s;
        let part = if span_s > 0.0 { ((time_s - from.time_s) / span_s).clamp(0.0, 1.0) } else { 0.0 };
        let (centre, half) = (from.centre.lerp(&to.centre, part), from.half.lerp(&to.half, part));
        box_corners([centre - half, centre + half]).map(|corner| (corner, 0.0)).to_vec()
    }

    /// Returns the smallest and largest depth of the content for a camera \[m\].
    pub(super) fn depth_m(&self, camera: &Camera) -> [f64; 2] {
        let (centre, radius) = self.reach;
        let middle = -camera.in_camera_frame(centre).z;
        let boxes = || self.boxes_m.iter().map(|corner| -camera.in_camera_frame(*corner).z);
        let far = boxes().fold(middle + radius, f64::max).max(1e-2);
        [boxes().fold(middle - radius, f64::min).max(NEAREST * far), far]
    }
}

/// Returns the lowest and highest coordinates of balls' centres.
fn bounds(balls: &[(Vector3<f64>, f64)]) -> Option<[Vector3<f64>; 2]> {
    let places = balls.iter().map(|(place, _)| [*place; 2]);
    places.reduce(|[low, high], [place, _]| [low.inf(&place), high.sup(&place)])
}

/// Smooths boxes over time. Each result contains the box of its time.
fn smoothed(swarm: &[SwarmBox]) -> Vec<SwarmBox> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a length")]
    let reach = (SMOOTHED * swarm.len() as f64) as usize;
    let near = |k: usize| k.saturating_sub(reach)..(k + reach + 1).min(swarm.len());
    let mean =
        |k: usize| swarm[near(k)].iter().map(|around| around.centre).sum::<Vector3<f64>>() / near(k).len() as f64;
    let centres: Vec<_> = (0..swarm.len()).map(mean).collect();
    let half = |k: usize| swarm[k].half + (swarm[k].centre - centres[k]).abs();
    let largest = |k: usize| near(k).map(half).fold(Vector3::zeros(), |most: Vector3<f64>, half| most.sup(&half));
    let largest: Vec<_> = (0..swarm.len()).map(largest).collect();
    let half = |k: usize| largest[near(k)].iter().sum::<Vector3<f64>>() / near(k).len() as f64;
    let smooth = |k: usize| SwarmBox { time_s: swarm[k].time_s, centre: centres[k], half: half(k) };
    (0..swarm.len()).map(smooth).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smoothed_box_contains_the_box_of_its_time() {
        let box_at = |k: u32| SwarmBox {
            time_s: f64::from(k),
            centre: Vector3::new(f64::from(k * k % 13), 0.0, f64::from(k)),
            half: Vector3::repeat(1.0 + f64::from(k % 3)),
        };
        let swarm: Vec<_> = (0..100).map(box_at).collect();
        for (around, smooth) in swarm.iter().zip(smoothed(&swarm)) {
            let beyond = (around.centre - smooth.centre).abs() + around.half - smooth.half;
            assert!(beyond.max() <= 1e-12, "{around:?} {smooth:?}");
        }
    }
}
