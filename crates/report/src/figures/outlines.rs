//! Outlines of obstacles from above.

use nalgebra::{Rotation2, Vector2};

use tautline_audit::{Obstacle, Shape};

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
pub(super) fn outline(obstacle: &Obstacle, window: Window) -> Vec<(f64, f64)> {
    let Some((_, place_m)) = obstacle.path.first() else { return Vec::new() };
    let place = place_m.xy();
    let corners = match obstacle.shape {
        Shape::Ball { radius_m } => stadium(Vector2::zeros(), Vector2::zeros(), radius_m),
        Shape::Capsule { from_m, to_m, radius_m } => stadium(from_m.xy(), to_m.xy(), radius_m),
        Shape::Box { half_m, yaw_rad } => [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(x, y)| Rotation2::new(yaw_rad) * Vector2::new(x * half_m.x, y * half_m.y))
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const WINDOW: Window = Window { low: (-10.0, -10.0), high: (10.0, 10.0) };

    fn area(shape: Shape, place_m: Vector3<f64>) -> f64 {
        let obstacle = Obstacle { name: String::new(), shape, clearance_m: None, path: vec![(0.0, place_m)] };
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
        let house = Shape::Box { half_m: Vector3::new(1.0, 2.0, 3.0), yaw_rad: 0.7 };
        assert!((area(house, Vector3::zeros()) - 8.0).abs() < 1e-9);
        let wall = Shape::HalfSpace { normal: Vector3::new(0.0, 2.0, 0.0) };
        assert!((area(wall, Vector3::new(3.0, -5.0, 0.0)) - 100.0).abs() < 1e-6);
        assert_eq!(area(Shape::HalfSpace { normal: Vector3::z() }, Vector3::zeros()), 0.0, "level ground");
    }
}
