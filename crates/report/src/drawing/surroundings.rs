//! Box around a flight, and the ground below.

use nalgebra::Vector3;

use super::obstacles::{box_corners, is_level, shape_bounds};
use tautline_core::obstacle::Shape;

/// Distance around a flight up to which obstacles belong to it, in units of its extent.
const OBSTACLE_ROOM: f64 = 0.2;
/// Largest height of the lowest position above z = 0, relative to the extent of the flight, at which the ground is
/// drawn at z = 0.
const NEAR_GROUND: f64 = 0.3;
/// Approximate number of lines on the ground along the longer side.
const GROUND_LINES: f64 = 12.0;
/// Largest size of a swarm that a camera follows, relative to the extent of its flight.
const TRAVELLING: f64 = 0.4;
/// Radius around a flight without vehicles \[m\].
const NO_RADIUS_M: f64 = 1.0;

/// Box around a flight, with the obstacles near it and the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// Smallest and largest coordinates of vehicles' centres, and of the obstacles near them \[m\].
    pub box_m: [Vector3<f64>; 2],
    /// Largest radius around a vehicle \[m\].
    pub around_m: f64,
    /// Half the diagonal of the box around vehicles' centres \[m\].
    flown_m: f64,
    /// Corners around each bounded obstacle, moved into the room around the flight \[m\].
    pub obstacles_m: Vec<Vector3<f64>>,
    /// Ground.
    pub ground: Ground,
}

/// Lines on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Opposite corners, at multiples of the distance of two lines \[m\].
    pub corners_m: [Vector3<f64>; 2],
    /// Distance of two lines \[m\].
    pub step_m: f64,
    /// Whether the ground is an obstacle.
    pub is_obstacle: bool,
}

impl Surroundings {
    /// Returns the surroundings of a flight with these smallest and largest coordinates of vehicles' centres, radius
    /// around each vehicle, and obstacles, each a shape and its position \[m\].
    #[must_use]
    pub fn of(flown_m: Option<[Vector3<f64>; 2]>, around_m: f64, obstacles: &[(Shape, Vector3<f64>)]) -> Self {
        let [lowest, highest] = flown_m.unwrap_or_default();
        let around_m = if flown_m.is_some() { around_m } else { NO_RADIUS_M };
        let extent = highest - lowest;
        let room = Vector3::repeat(OBSTACLE_ROOM * extent.max() + around_m);
        let near = |corner: Vector3<f64>| corner.sup(&(lowest - room)).inf(&(highest + room));
        let around =
            obstacles.iter().filter_map(|(shape, at)| shape_bounds(shape).map(|ends| ends.map(|end| at + end)));
        let around = around.filter(|_| flown_m.is_some());
        let obstacles_m: Vec<_> = around.flat_map(box_corners).map(near).collect();
        let [low, high] = obstacles_m.iter().fold([lowest, highest], |[low, high], at| [low.inf(at), high.sup(at)]);
        let hard_z = obstacles.iter().find_map(|(shape, at)| match shape {
            Shape::HalfSpace { normal } if is_level(*normal) => Some(at.z),
            _ => None,
        });
        let is_near = lowest.z >= 0.0 && lowest.z <= NEAR_GROUND * extent.norm() + around_m;
        let z = hard_z.unwrap_or(if is_near { 0.0 } else { low.z - around_m });
        let step_m = round_step(((high - low).xy().max().max(2.0 * around_m) + 2.0 * around_m) / GROUND_LINES);
        let corner = |point: Vector3<f64>, round: fn(f64) -> f64| {
            let point = (point / step_m).map(round) * step_m;
            Vector3::new(point.x, point.y, z)
        };
        let corners_m = [corner(low.add_scalar(-around_m), f64::floor), corner(high.add_scalar(around_m), f64::ceil)];
        let ground = Ground { corners_m, step_m, is_obstacle: hard_z.is_some() };
        let flown_m = (highest / 2.0 - lowest / 2.0).norm();
        Self { box_m: [low, high], around_m, flown_m, obstacles_m, ground }
    }

    /// Returns the middle of the box \[m\].
    #[must_use]
    pub fn middle_m(&self) -> Vector3<f64> {
        // Halved first: the sum of the largest doubles overflows.
        let [low, high] = self.box_m;
        low / 2.0 + high / 2.0
    }

    /// Returns whether a swarm of this size, half a diagonal \[m\], travels so far that a camera follows it.
    #[must_use]
    pub fn is_far_for(&self, swarm_m: f64) -> bool {
        swarm_m < TRAVELLING * self.flown_m
    }

    /// Returns half the sides of the box with the radius around vehicles \[m\].
    pub(crate) fn half_m(&self) -> Vector3<f64> {
        let [low, high] = self.box_m;
        (high / 2.0 - low / 2.0).add_scalar(self.around_m)
    }
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
    fn ground_squares_cover_the_box_in_moderate_number() {
        for reach_m in [1e-3, 0.7, 3.0, 49.0, 1e6] {
            let (low, high) = (Vector3::repeat(-reach_m), Vector3::new(reach_m, 0.5 * reach_m, 0.0));
            let Ground { corners_m: [least, most], step_m, .. } = Surroundings::of(Some([low, high]), 0.0, &[]).ground;
            assert!(most.x >= high.x && most.y >= high.y && least.x <= low.x && least.y <= low.y);
            assert_eq!((least.z, most.z), (low.z, low.z));
            let lines = ((most - least) / step_m).xy().add_scalar(1.0).sum();
            assert!((10.0..60.0).contains(&lines), "{step_m} m: {lines} lines");
        }
    }

    #[test]
    fn the_ground_is_at_an_obstacle_at_zero_or_below_the_flight() {
        let level_m = |low_z: f64, obstacles: &[(Shape, Vector3<f64>)]| {
            let flown_m = [Vector3::new(0.0, 0.0, low_z), Vector3::new(4.0, 4.0, low_z + 1.0)];
            Surroundings::of(Some(flown_m), 0.5, obstacles).ground.corners_m[0].z
        };
        let floor = (Shape::HalfSpace { normal: Vector3::z() }, Vector3::new(0.0, 0.0, -3.0));
        assert_eq!(
            [level_m(1.0, &[floor]), level_m(1.0, &[]), level_m(9.0, &[]), level_m(-1.0, &[])],
            [-3.0, 0.0, 8.5, -1.5]
        );
    }

    #[test]
    fn far_obstacles_widen_the_box_by_a_part_of_the_flight() {
        let flown_m = [Vector3::zeros(), Vector3::new(10.0, 10.0, 0.0)];
        let far = (Shape::Ball { radius_m: 1.0 }, Vector3::new(1000.0, 5.0, 0.0));
        let [low, high] = Surroundings::of(Some(flown_m), 0.5, &[far]).box_m;
        assert_eq!((low, high), (Vector3::new(0.0, 0.0, -1.0), Vector3::new(12.5, 10.0, 1.0)));
    }

    #[test]
    fn ground_steps_are_round_numbers() {
        let steps = [0.9, 1.0, 1.1, 3.0, 7.0, 0.03, 1234.0].map(round_step);
        assert_eq!(steps, [1.0, 1.0, 2.0, 5.0, 10.0, 0.05, 2000.0]);
        assert_eq!([0.0, -1.0, f64::NAN, f64::INFINITY].map(round_step), [1.0; 4]);
    }
}
