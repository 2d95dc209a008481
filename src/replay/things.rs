//! Obstacles as a page holds them.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use nalgebra::Vector3;
use serde::Serialize;

use super::extent::Extent;
use super::mesh::Mesh;
use super::words::{LONGEST_NAME, cut};
use crate::audit::{Obstacle, Shape};

/// Most points of the way of an obstacle.
const MOST_POINTS: usize = 500;

/// What is in the way.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Thing {
    name: String,
    /// Of a ball \[m\], which has no triangles.
    radius_m: Option<f64>,
    /// Triangles, and lines, in single precision from its place \[m\].
    solid: String,
    rims: String,
    opacity: f64,
    /// When \[s\] it is where \[m\].
    path: Vec<[f64; 4]>,
}

impl Thing {
    /// As it is drawn; a way of many points through every so many of them.
    pub(super) fn of(obstacle: &Obstacle, extent: &Extent) -> Self {
        let place_m = obstacle.path.first().map_or(Vector3::zeros(), |point| point.1);
        let mesh = Mesh::of(&obstacle.shape, extent.middle_m() - place_m, 1.5 * extent.reach_m());
        let stride = obstacle.path.len().div_ceil(MOST_POINTS).max(1);
        let points = obstacle.path.iter().step_by(stride).chain(obstacle.path.last().filter(|_| stride > 1));
        let (radius_m, opacity) = match obstacle.shape {
            Shape::Ball { radius_m } => (Some(radius_m), 1.0),
            Shape::Capsule { .. } => (None, 1.0),
            Shape::Box { .. } => (None, 0.5),
            Shape::HalfSpace { .. } => (None, 0.14),
        };
        Self {
            name: cut(&obstacle.name, LONGEST_NAME),
            radius_m,
            solid: singles(&mesh.solid),
            rims: singles(&mesh.rims),
            opacity,
            path: points.map(|&(time_s, at)| [time_s, at.x, at.y, at.z]).collect(),
        }
    }
}

/// Numbers in single precision, the least byte first, as base64.
#[expect(clippy::cast_possible_truncation, reason = "drawn in single precision")]
pub(super) fn singles(places: &[Vector3<f64>]) -> String {
    let numbers = places.iter().flat_map(|place| place.iter().copied().collect::<Vec<_>>());
    BASE64.encode(numbers.flat_map(|x| (x as f32).to_le_bytes()).collect::<Vec<_>>())
}
