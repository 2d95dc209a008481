//! Outlines of obstacles, from above and in space.

use nalgebra::{Rotation2, Vector2, Vector3};

use crate::drawing::{box_corners, box_sides, perpendicular};
use tautline_audit::MovingObstacle;
use tautline_core::obstacle::Shape;

/// Number of corners of a full circle.
const CORNERS: u32 = 48;

/// A rectangle of the plane: smallest and largest x and y \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    pub(super) low: (f64, f64),
    pub(super) high: (f64, f64),
}

/// Returns the outline of an obstacle at its first position, within a window: x and y \[m\]. It is empty for level
/// ground and for an obstacle outside.
pub(super) fn outline(obstacle: &MovingObstacle, window: Window) -> Vec<(f64, f64)> {
    let Some((_, place_m)) = obstacle.path.first() else { return Vec::new() };
    let place = place_m.xy();
    let corners = match obstacle.shape {
        Shape::Ball { radius_m } => stadium(Vector2::zeros(), Vector2::zeros(), radius_m),
        Shape::Capsule { from_m, to_m, radius_m } => stadium(from_m.xy(), to_m.xy(), radius_m),
        Shape::Box { half_m, yaw_deg } => [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| Rotation2::new(yaw_deg.to_radians()) * Vector2::new(x * half_m.x, y * half_m.y))
            .to_vec(),
        Shape::HalfSpace { normal } => {
            let Some(out) = normal.xy().try_normalize(1e-3 * normal.norm()) else { return Vec::new() };
            let far = 2.0 * (window.high.0 - window.low.0).hypot(window.high.1 - window.low.1)
                + [window.low, window.high].iter().map(|&(x, y)| (Vector2::new(x, y) - place).norm()).sum::<f64>();
            let along = Vector2::new(-out.y, out.x) * far;
            vec![along, along - out * far, -along - out * far, -along]
        }
    };
    clipped(corners.into_iter().map(|at| (place.x + at.x, place.y + at.y)).collect(), window)
}

/// Returns all points within a radius of a segment, as a polygon.
fn stadium(from: Vector2<f64>, to: Vector2<f64>, radius: f64) -> Vec<Vector2<f64>> {
    let along = (to - from).try_normalize(1e-12).unwrap_or(Vector2::x());
    let corner = |k: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(CORNERS)).sin_cos();
        let out = Vector2::new(cos, sin);
        (if out.dot(&along) > 0.0 { to } else { from }) + out * radius
    };
    (0..CORNERS).map(corner).collect()
}

/// Returns the part of a convex polygon within a window (Sutherland and Hodgman).
fn clipped(mut corners: Vec<(f64, f64)>, Window { low, high }: Window) -> Vec<(f64, f64)> {
    type Inside = fn((f64, f64)) -> f64;
    let sides: [(Inside, f64); 4] =
        [(|at| at.0, low.0), (|at| -at.0, -high.0), (|at| at.1, low.1), (|at| -at.1, -high.1)];
    for (coordinate, least) in sides {
        let beyond = |at: (f64, f64)| coordinate(at) - least;
        let around = corners.iter().copied().zip(corners.iter().copied().cycle().skip(1));
        corners = around
            .flat_map(|(a, b)| {
                let (from, to) = (beyond(a), beyond(b));
                let share = from / (from - to);
                let crossing =
                    ((from < 0.0) != (to < 0.0)).then_some((a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1)));
                [Some(a).filter(|_| from >= 0.0), crossing]
            })
            .flatten()
            .collect();
    }
    corners
}

/// An upright box: smallest and largest coordinates \[m\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Room {
    pub(super) low: Vector3<f64>,
    pub(super) high: Vector3<f64>,
}

impl Room {
    /// Returns the part of a segment within the box (Liang and Barsky).
    fn clip(&self, from: Vector3<f64>, to: Vector3<f64>) -> Option<[Vector3<f64>; 2]> {
        let along = to - from;
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            if along[axis] == 0.0 {
                if !(self.low[axis]..=self.high[axis]).contains(&from[axis]) {
                    return None;
                }
                continue;
            }
            let [one, other] = [self.low, self.high].map(|end| (end[axis] - from[axis]) / along[axis]);
            (first, last) = (first.max(one.min(other)), last.min(one.max(other)));
        }
        // Ends within the box stay exact, so that the segments of a line join.
        let at = |share: f64| if share == 1.0 { to } else { from + along * share };
        (first <= last).then(|| [first, last].map(at))
    }

    /// Returns the corners of the section of the box by a plane through a position, in order around their middle.
    fn section(&self, place: Vector3<f64>, normal: Vector3<f64>) -> Vec<Vector3<f64>> {
        let corners = box_corners([self.low, self.high]);
        let edges = (0..8_usize).flat_map(|k| (0..3).map(move |axis| (k, k | 1 << axis))).filter(|(k, to)| k != to);
        let mut crossings: Vec<_> = edges
            .filter_map(|(k, to)| {
                let (from, to) = (corners[k], corners[to]);
                let [near, far] = [from, to].map(|at| (at - place).dot(&normal));
                ((near < 0.0) != (far < 0.0)).then(|| from + (to - from) * (near / (near - far)))
            })
            .collect();
        let middle = crossings.iter().sum::<Vector3<f64>>() / crossings.len().max(1) as f64;
        let [across, up] = perpendicular(normal.normalize());
        let angle = |at: &Vector3<f64>| (at - middle).dot(&up).atan2((at - middle).dot(&across));
        crossings.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        crossings
    }
}

/// Returns the outline of an obstacle at its first position as lines within a box. A box has its edges, and a ball has
/// great circles. A capsule has rings and two lengthwise sections.
pub(super) fn wires(obstacle: &MovingObstacle, room: &Room) -> Vec<Vec<Vector3<f64>>> {
    let Some(&(_, place)) = obstacle.path.first() else { return Vec::new() };
    let closed: Vec<Vec<Vector3<f64>>> = match obstacle.shape {
        Shape::Ball { radius_m } => capsule(Vector3::zeros(), Vector3::zeros(), radius_m),
        Shape::Capsule { from_m, to_m, radius_m } => capsule(from_m, to_m, radius_m),
        Shape::Box { half_m, yaw_deg } => {
            // Every edge is one of the faces below and above, or of two sides.
            let faces = box_sides(half_m, yaw_deg).enumerate().filter(|(side, _)| side / 2 != 1);
            let corners = |[out, u, v]: [Vector3<f64>; 3]| vec![out + u + v, out - u + v, out - u - v, out + u - v];
            faces.map(|(_, face)| corners(face)).collect()
        }
        Shape::HalfSpace { normal } => {
            let section = room.section(place, normal);
            vec![section.into_iter().map(|at| at - place).collect()]
        }
    };
    let mut wires: Vec<Vec<Vector3<f64>>> = Vec::new();
    for corners in closed {
        let next = corners.iter().cycle().skip(1);
        let mut is_joined = false;
        for (&from, &to) in corners.iter().zip(next) {
            let Some([from, to]) = room.clip(place + from, place + to) else {
                is_joined = false;
                continue;
            };
            match wires.last_mut().filter(|wire| is_joined && wire.last() == Some(&from)) {
                Some(wire) => wire.push(to),
                None => wires.push(vec![from, to]),
            }
            is_joined = true;
        }
    }
    wires
}

/// Returns two lengthwise sections of a capsule, and rings around its ends.
fn capsule(from: Vector3<f64>, to: Vector3<f64>, radius: f64) -> Vec<Vec<Vector3<f64>>> {
    let along = (to - from).try_normalize(1e-12).unwrap_or(Vector3::z());
    let [across, up] = perpendicular(along);
    let ring = |one: Vector3<f64>, other: Vector3<f64>, ends: [Vector3<f64>; 2]| -> Vec<Vector3<f64>> {
        let corner = |k: u32| {
            let (sin, cos) = (std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(CORNERS)).sin_cos();
            (if cos > 0.0 { ends[1] } else { ends[0] }) + (one * cos + other * sin) * radius
        };
        (0..CORNERS).map(corner).collect()
    };
    let mut lines = vec![ring(along, across, [from, to]), ring(along, up, [from, to]), ring(across, up, [from; 2])];
    if from != to {
        lines.push(ring(across, up, [to; 2]));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wires_stay_within_the_box_and_on_the_surface() {
        let room = Room { low: Vector3::repeat(-10.0), high: Vector3::repeat(10.0) };
        let at = |shape, place_m| {
            wires(&MovingObstacle { name: String::new(), shape, clearance_m: None, path: vec![(0.0, place_m)] }, &room)
        };
        let ball = at(Shape::Ball { radius_m: 2.0 }, Vector3::new(9.0, 0.0, 0.0));
        let places = || ball.iter().flatten();
        assert!(places().all(|place| place.x <= 10.0 + 1e-9), "{ball:?}");
        assert!(places().any(|place| (place.x - 10.0).abs() < 1e-9), "cut by a wall");
        assert!(places().all(|place| (place - Vector3::new(9.0, 0.0, 0.0)).norm() < 2.0 + 1e-9));
        let house = at(Shape::Box { half_m: Vector3::new(1.0, 2.0, 3.0), yaw_deg: 17.0 }, Vector3::zeros());
        assert_eq!(house.iter().map(Vec::len).collect::<Vec<_>>(), [5, 5, 5, 5], "four closed faces");
        let ground = at(Shape::HalfSpace { normal: Vector3::z() }, Vector3::zeros());
        assert_eq!(ground.iter().map(Vec::len).collect::<Vec<_>>(), [5], "a rectangle");
        assert!(at(Shape::Ball { radius_m: 2.0 }, Vector3::new(30.0, 0.0, 0.0)).is_empty());
        let cable = Shape::Capsule { from_m: -Vector3::x() * 3.0, to_m: Vector3::x() * 3.0, radius_m: 0.5 };
        assert_eq!(at(cable, Vector3::zeros()).len(), 4);
    }

    const WINDOW: Window = Window { low: (-10.0, -10.0), high: (10.0, 10.0) };

    fn area(shape: Shape, place_m: Vector3<f64>) -> f64 {
        let obstacle = MovingObstacle { name: String::new(), shape, clearance_m: None, path: vec![(0.0, place_m)] };
        let corners = outline(&obstacle, WINDOW);
        let next = corners.iter().cycle().skip(1);
        0.5 * corners.iter().zip(next).map(|(a, b)| a.0 * b.1 - a.1 * b.0).sum::<f64>().abs()
    }

    #[test]
    fn outlines_have_the_area_of_the_obstacle_within_the_window() {
        let ball = Shape::Ball { radius_m: 2.0 };
        let circle = 4.0 * std::f64::consts::PI;
        assert!((area(ball, Vector3::zeros()) / circle - 1.0).abs() < 0.01);
        assert!((area(ball, Vector3::new(10.0, 0.0, 5.0)) / circle - 0.5).abs() < 0.01, "half is outside");
        assert_eq!(area(ball, Vector3::new(30.0, 0.0, 0.0)), 0.0);
        let cable = Shape::Capsule { from_m: -Vector3::x() * 3.0, to_m: Vector3::x() * 3.0, radius_m: 0.5 };
        assert!((area(cable, Vector3::zeros()) - 6.0 - 0.25 * std::f64::consts::PI).abs() < 0.05);
        let house = Shape::Box { half_m: Vector3::new(1.0, 2.0, 3.0), yaw_deg: 40.0 };
        assert!((area(house, Vector3::zeros()) - 8.0).abs() < 1e-9);
        let wall = Shape::HalfSpace { normal: Vector3::new(0.0, 2.0, 0.0) };
        assert!((area(wall, Vector3::new(3.0, -5.0, 0.0)) - 100.0).abs() < 1e-6);
        assert_eq!(area(Shape::HalfSpace { normal: Vector3::z() }, Vector3::zeros()), 0.0, "level ground");
    }
}
