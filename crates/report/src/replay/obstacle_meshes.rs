//! Meshes of obstacles in a page: triangles, lines and paths.

use nalgebra::Vector3;
use serde::Serialize;

use super::singles;
use crate::drawing::{Surroundings, box_sides, perpendicular, plane_section};
use crate::simplify::needed;
use tautline_audit::MovingObstacle;
use tautline_core::obstacle::Shape;

/// An obstacle as data of a page.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Thing {
    /// Radius of a ball \[m\], which has no triangles.
    radius_m: Option<f64>,
    /// Triangles and lines in single precision, relative to its position \[m\].
    solid: String,
    rims: String,
    opacity: f64,
    /// Times \[s\] and positions \[m\].
    path: Vec<[f64; 4]>,
    /// Largest distance of the drawn path from the true one \[m\].
    #[serde(skip)]
    pub(super) off_m: f64,
}

/// Largest size of a point of a path \[bytes\].
pub(super) const POINT_BYTES: usize = 4 * 26;

impl Thing {
    /// Returns the data of an obstacle, with a path of about `most` points that includes its positions at `times_s`
    /// \[s\].
    pub(super) fn of(obstacle: &MovingObstacle, around: &Surroundings, times_s: &[f64], most: usize) -> Self {
        let place_m = obstacle.path.first().map_or(Vector3::zeros(), |point| point.1);
        let mesh = Mesh::of(&obstacle.shape, around.middle_m() - place_m, 1.5 * around.half_m().norm());
        let (kept, off_m) = simplified(&obstacle.path, times_s, most);
        let points = kept.into_iter().map(|k| obstacle.path[k]);
        let (radius_m, opacity) = match obstacle.shape {
            Shape::Ball { radius_m } => (Some(radius_m), 1.0),
            Shape::Capsule { .. } | Shape::Box { .. } => (None, 1.0),
            Shape::HalfSpace { .. } => (None, 0.14),
        };
        Self {
            radius_m,
            solid: singles(&mesh.solid),
            rims: singles(&mesh.rims),
            opacity,
            path: points.map(|(time_s, at)| [time_s, at.x, at.y, at.z]).collect(),
            off_m,
        }
    }
}

/// Returns the kept points of a path, about `most`: the first and the last, those around `times_s`, and the farthest
/// from the simplified path. Also returns the largest distance of a dropped point \[m\].
fn simplified(path: &[(f64, Vector3<f64>)], times_s: &[f64], most: usize) -> (Vec<usize>, f64) {
    let Some(last) = path.len().checked_sub(1) else { return (Vec::new(), 0.0) };
    let around = times_s.iter().flat_map(|&at_s| {
        let after = path.partition_point(|point| point.0 < at_s);
        [after.saturating_sub(1), after.min(last)]
    });
    let mut kept: Vec<_> = [0, last].into_iter().chain(around.take(most / 2)).collect();
    kept.sort_unstable();
    kept.dedup();
    let mut needed = needed(&kept, 0.0, |k, from, to| {
        let [(from_s, a), (time_s, at), (to_s, b)] = [from, k, to].map(|k| path[k]);
        (at - (a + (b - a) * ((time_s - from_s) / (to_s - from_s)))).norm()
    });
    needed.sort_by(|a, b| b.1.total_cmp(&a.1));
    let off_m = needed.get(most.saturating_sub(kept.len())).map_or(0.0, |point| point.1);
    kept.extend(needed.iter().filter(|point| point.1 > off_m).map(|point| point.0));
    kept.sort_unstable();
    (kept, off_m)
}

/// Number of segments of a full turn, and of a quarter turn, of a capsule.
const TURN: u32 = 24;
const QUARTER: i32 = 4;
/// Number of lines across a plane.
const HATCHES: u32 = 8;

/// Triangles, each corner a position and a normal (zero without shading), and lines, each two positions, relative to
/// the position of the obstacle \[m\].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mesh {
    pub(super) solid: Vec<Vector3<f64>>,
    pub(super) rims: Vec<Vector3<f64>>,
}

impl Mesh {
    /// Returns the mesh of an obstacle. A plane is drawn around its point below the middle of the flight, `middle`
    /// relative to the obstacle \[m\], up to `reach_m`. A ball has no mesh, because it is drawn like the vehicles.
    pub(super) fn of(shape: &Shape, middle: Vector3<f64>, reach_m: f64) -> Self {
        match *shape {
            Shape::Ball { .. } => Self::default(),
            Shape::Box { half_m, yaw_deg } => of_box(half_m, yaw_deg),
            Shape::Capsule { from_m, to_m, radius_m } => of_capsule(from_m, to_m, radius_m),
            Shape::HalfSpace { normal } => of_plane(plane_section(normal, middle, reach_m)),
        }
    }
}

fn of_box(half_m: Vector3<f64>, yaw_deg: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for [middle, u, v] in box_sides(half_m, yaw_deg) {
        mesh.square(middle, u, v, middle.try_normalize(0.0).unwrap_or_default());
        for end in [-1.0, 1.0] {
            mesh.rims.extend([middle + u * end - v, middle + u * end + v]);
        }
    }
    mesh
}

fn of_plane([foot, u, v]: [Vector3<f64>; 3]) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.square(foot, u, v, Vector3::zeros());
    for k in 0..=HATCHES {
        let share = 2.0 * f64::from(k) / f64::from(HATCHES) - 1.0;
        mesh.rims.extend([foot + u * share - v, foot + u * share + v, foot + v * share - u, foot + v * share + u]);
    }
    mesh
}

fn of_capsule(from_m: Vector3<f64>, to_m: Vector3<f64>, radius_m: f64) -> Mesh {
    let along = (to_m - from_m).try_normalize(0.0).unwrap_or(Vector3::z());
    let [u, v] = perpendicular(along);
    let rings: Vec<_> =
        (-QUARTER..=0).map(|lift| (from_m, lift)).chain((0..=QUARTER).map(|lift| (to_m, lift))).collect();
    let corner = |(end, lift): (Vector3<f64>, i32), turn: u32| {
        let (sin, cos) = (f64::from(lift) / f64::from(QUARTER) * std::f64::consts::FRAC_PI_2).sin_cos();
        let (y, x) = (f64::from(turn % TURN) / f64::from(TURN) * std::f64::consts::TAU).sin_cos();
        let normal = along * sin + (u * x + v * y) * cos;
        [end + normal * radius_m, normal]
    };
    let mut mesh = Mesh::default();
    for two in rings.windows(2) {
        for turn in 0..TURN {
            let [a, b] = [0, 1].map(|more| corner(two[0], turn + more));
            let [c, d] = [0, 1].map(|more| corner(two[1], turn + more));
            mesh.solid.extend([a, b, d, a, d, c].into_iter().flatten());
        }
    }
    mesh
}

impl Mesh {
    fn square(&mut self, middle: Vector3<f64>, u: Vector3<f64>, v: Vector3<f64>, normal: Vector3<f64>) {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        self.solid.extend(corners.into_iter().flat_map(|(s, t)| [middle + u * s + v * t, normal]));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn simplified_paths_keep_extremes_and_report_their_error() {
        // At rest except for a jump of five points.
        let x = |k: u32| if (2003..2008).contains(&k) { 5.0 } else { 0.0 };
        let path: Vec<_> = (0..5000).map(|k| (f64::from(k), Vector3::new(x(k), 0.0, 0.0))).collect();
        let (kept, off_m) = simplified(&path, &[], 100);
        assert_eq!((kept, off_m), (vec![0, 2002, 2003, 2007, 2008, 4999], 0.0));
        let circle = |k: u32| (f64::from(k) * 0.01).sin_cos();
        let path: Vec<_> = (0..5000).map(|k| (f64::from(k), Vector3::new(circle(k).0, circle(k).1, 0.0))).collect();
        let (kept, off_m) = simplified(&path, &[1234.5], 50);
        assert!((45..=50).contains(&kept.len()) && kept.contains(&1234) && kept.contains(&1235), "{kept:?}");
        assert!((0.01..1.5).contains(&off_m), "{off_m}");
        let line = |at: f64| {
            let k = kept.partition_point(|&k| (k as f64) < at).max(1);
            let (a, b) = (path[kept[k - 1]], path[kept[k]]);
            a.1 + (b.1 - a.1) * ((at - a.0) / (b.0 - a.0))
        };
        let farthest_m = path.iter().map(|&(at_s, at)| (line(at_s) - at).norm()).fold(0.0, f64::max);
        assert!((farthest_m - off_m).abs() < 1e-9, "{farthest_m} and {off_m}");
        assert_eq!(simplified(&[], &[0.0], 9), (Vec::new(), 0.0));
        // With the farthest point alone the path is farther off than without it.
        let path = [0.0, -0.9, 1.0, 0.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let path: Vec<_> = path.into_iter().enumerate().map(|(k, at)| (k as f64, at)).collect();
        assert_eq!(simplified(&path, &[], 3), (vec![0, 3], 1.0));
    }

    #[test]
    fn corners_are_on_the_surface_and_normals_point_outwards() {
        let middle = Vector3::new(1.0, 2.0, 3.0);
        let shapes = [
            Shape::Box { half_m: Vector3::new(1.0, 2.0, 3.0), yaw_deg: 23.0 },
            Shape::Capsule { from_m: Vector3::new(-1.0, 0.0, 0.5), to_m: Vector3::new(2.0, 1.0, 0.0), radius_m: 0.7 },
            Shape::Capsule { from_m: Vector3::zeros(), to_m: Vector3::zeros(), radius_m: 0.7 },
            Shape::HalfSpace { normal: Vector3::new(0.0, 1.0, 2.0) },
        ];
        for shape in shapes {
            let off = |at: &Vector3<f64>| match shape {
                Shape::Box { half_m, yaw_deg } => {
                    let at = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw_deg.to_radians()) * at;
                    at.zip_map(&half_m, |x, half| x.abs() - half).max()
                }
                Shape::Capsule { from_m, to_m, radius_m } => {
                    let along = to_m - from_m;
                    let share = ((at - from_m).dot(&along) / along.norm_squared().max(1e-300)).clamp(0.0, 1.0);
                    (at - from_m - along * share).norm() - radius_m
                }
                Shape::HalfSpace { normal } => at.dot(&normal.normalize()),
                Shape::Ball { .. } => f64::NAN,
            };
            let mesh = Mesh::of(&shape, middle, 10.0);
            assert!(mesh.solid.len() >= 12 && mesh.solid.len().is_multiple_of(6), "whole triangles");
            for corner in mesh.solid.chunks(2) {
                assert!(off(&corner[0]).abs() < 1e-9, "{shape:?}: {}", corner[0]);
                assert!(corner[1].norm() < 1e-9 || off(&(corner[0] + corner[1] * 0.01)) > 0.0099, "{shape:?}");
            }
            assert!(mesh.rims.iter().all(|at| off(at).abs() < 1e-9));
        }
    }
}
