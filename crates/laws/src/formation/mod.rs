//! Formations: a slot per vehicle, the desired distances, and the errors of a swarm with respect to the shape.
//!
//! Laws that control distances reach a formation only up to a rotation, a reflection and a translation, so the errors
//! here may exclude these motions.

mod assignment;
#[cfg(feature = "drawn")]
mod drawn;
mod fit;
mod shapes;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::space::closest_pair;
use tautline_core::swarm::{Pair, Rows, row, separation, set_row};

pub use assignment::{most_assigned, optimal_slots, optimal_slots_around};
#[cfg(feature = "drawn")]
pub use drawn::{Drawing, DrawingError, MAX_DRAWN_SLOTS, MAX_PIXELS, MAX_TEXT_CHARS};
pub use fit::affine_dimension;
pub use fit::{Freedom, PositionError, RigidMotion, best_rigid_motion, procrustes_rms_m};
pub use fit::{evaluated_edges, largest_edge_error_m};
pub use shapes::NARROWEST_V_RAD;

/// Target shape: slot `h_i` for vehicle i.
#[derive(Clone, Debug, PartialEq)]
pub struct Formation {
    /// Positions of the slots, N x 3 \[m\].
    pub slots_m: Rows,
}

impl Formation {
    /// Formation with the given slots \[m\].
    #[must_use]
    pub fn points(slots_m: Rows) -> Self {
        Self { slots_m }
    }

    /// Returns the same slots in another order: vehicle i gets slot `slots[i]`.
    ///
    /// # Panics
    /// If a slot is out of range.
    #[must_use]
    pub fn reordered(&self, slots: &[usize]) -> Self {
        let mut slots_m = Rows::zeros(slots.len());
        slots.iter().enumerate().for_each(|(i, &slot)| set_row(&mut slots_m, i, row(&self.slots_m, slot)));
        Self { slots_m }
    }

    /// The source paper's five slots in the plane z = 0. For d = `side_m` they are (0, 0), (d, 0), (d/2, sqrt(3) d/2),
    /// (0, sqrt(3) d) and (d, sqrt(3) d).
    #[must_use]
    pub fn pentagon(side_m: f64) -> Self {
        let height = 3.0_f64.sqrt();
        let unit = [(0.0, 0.0), (1.0, 0.0), (0.5, height / 2.0), (0.0, height), (1.0, height)];
        Self::from_fn(unit.len(), |i| Vector3::new(unit[i].0, unit[i].1, 0.0) * side_m)
    }

    /// Slots evenly spaced on a circle about the origin in the plane z = 0, counterclockwise from (`radius_m`, 0, 0).
    #[must_use]
    pub fn circle(count: usize, radius_m: f64) -> Self {
        Self::from_fn(count, |i| {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * i as f64 / count as f64);
            Vector3::new(radius_m * cos, radius_m * sin, 0.0)
        })
    }

    /// Slots evenly spaced along the x axis, from the origin.
    #[must_use]
    pub fn line(count: usize, spacing_m: f64) -> Self {
        Self::from_fn(count, |i| Vector3::new(i as f64 * spacing_m, 0.0, 0.0))
    }

    /// Square grid in the plane z = 0, from the origin, rows along x. It is as near to a square as the number allows;
    /// the last row may be shorter.
    #[must_use]
    pub fn grid(count: usize, spacing_m: f64) -> Self {
        let root = count.isqrt();
        let columns = if root * root < count { root + 1 } else { root };
        Self::from_fn(count, |i| Vector3::new((i % columns) as f64 * spacing_m, (i / columns) as f64 * spacing_m, 0.0))
    }

    /// Nearly even slots on a sphere about the origin, by the Fibonacci spiral: equal steps in z, and a turn by the
    /// golden angle pi (3 - sqrt(5)) per slot.
    #[must_use]
    pub fn sphere(count: usize, radius_m: f64) -> Self {
        let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        Self::from_fn(count, |i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let ring = (1.0 - z * z).sqrt();
            let (sin, cos) = libm::sincos(golden_angle * i as f64);
            Vector3::new(ring * cos, ring * sin, z) * radius_m
        })
    }

    fn from_fn(count: usize, slot: impl Fn(usize) -> Vector3<f64>) -> Self {
        let mut slots_m = Rows::zeros(count);
        for i in 0..count {
            set_row(&mut slots_m, i, slot(i));
        }
        Self { slots_m }
    }

    /// Number of slots N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.slots_m.nrows()
    }

    /// Desired distance `d_ij` between vehicles `i` and `j` \[m\].
    ///
    /// # Panics
    /// If a vehicle is out of range.
    #[inline]
    #[must_use]
    pub fn desired_distance(&self, i: usize, j: usize) -> f64 {
        separation(&self.slots_m, i, j)
    }

    /// Dimension of the smallest affine subspace that contains all slots, see [`affine_dimension`].
    #[must_use]
    pub fn affine_dimension(&self, relative_tolerance: f64) -> usize {
        affine_dimension(&self.slots_m, relative_tolerance)
    }

    /// Whether every slot lies exactly in the plane z = 0.
    #[must_use]
    pub fn is_in_plane_z0(&self) -> bool {
        self.slots_m.column(2).iter().all(|&z| z == 0.0)
    }

    /// Returns the two nearest slots and their distance \[m\], see [`closest_pair`].
    #[must_use]
    pub fn min_distance(&self) -> Option<(Pair, f64)> {
        closest_pair(&self.slots_m)
    }
}

/// Pixels of a picture that are drawn.
#[derive(Clone, Copy, Debug, Deserialize, Eq, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Ink {
    /// Pixels darker than middle grey on white.
    Dark,
    /// Pixels lighter than middle grey on black.
    Light,
    /// Pixels with an opacity of more than half.
    Opaque,
}

#[cfg(test)]
mod tests;
