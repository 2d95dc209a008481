//! Errors of a swarm with respect to a shape, after the best rigid motion or translation.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::Formation;
use crate::graph::Graph;
use tautline_core::swarm::{Rows, first_row_not_finite, row};

/// Motions that leave a formation equivalent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// None: every slot is an absolute position.
    Fixed,
    /// A translation.
    Translation,
    /// Any rigid motion, reflections included.
    RigidMotion,
}

/// Distances of positions from the slots of a fitted formation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionError {
    /// Root mean square distance \[m\].
    pub rms_m: f64,
    /// Largest distance of a vehicle from its slot \[m\].
    pub max_m: f64,
}

impl PositionError {
    /// Error without a fit.
    pub const UNKNOWN: Self = Self { rms_m: f64::NAN, max_m: f64::NAN };

    /// Computes the error after the motion within `freedom` of least root mean square error. With [`Freedom::Fixed`]
    /// the slots are moved by `place_m` \[m\]. Returns [`PositionError::UNKNOWN`] if there is no fit. Allocates
    /// nothing.
    #[must_use]
    pub fn of(positions_m: &Rows, formation: &Formation, place_m: Vector3<f64>, freedom: Freedom) -> Self {
        let (count, slots_m) = (positions_m.nrows(), &formation.slots_m);
        let offset_m = match freedom {
            Freedom::RigidMotion => {
                let fit = Fit::new(positions_m, formation);
                return fit.map_or(Self::UNKNOWN, |fit| Self::of_residuals(fit.residuals_m(positions_m, formation)));
            }
            _ if count == 0 || slots_m.nrows() != count => return Self::UNKNOWN,
            Freedom::Translation => centre(positions_m) - centre(slots_m),
            Freedom::Fixed => place_m,
        };
        Self::of_residuals((0..count).map(|i| row(positions_m, i) - row(slots_m, i) - offset_m))
    }

    /// Sums squared residuals, because |P|^2 + |H|^2 - 2 tr S would cancel near a perfect fit. A NaN residual makes
    /// both errors NaN, since `max` would ignore it.
    fn of_residuals(residuals_m: impl ExactSizeIterator<Item = Vector3<f64>>) -> Self {
        let count = residuals_m.len();
        let (sum, most) = residuals_m
            .map(|residual_m| residual_m.norm_squared())
            .fold((0.0, 0.0_f64), |(sum, most), square| (sum + square, most.max(square)));
        let rms_m = (sum / count as f64).sqrt();
        Self { rms_m, max_m: if rms_m.is_nan() { f64::NAN } else { most.sqrt() } }
    }
}

/// Isometry of space: x -> rotation x + translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion {
    /// Orthogonal 3 x 3 matrix; its determinant is -1 for a reflection.
    pub rotation: Matrix3<f64>,
    /// Translation \[m\].
    pub translation_m: Vector3<f64>,
}

impl RigidMotion {
    /// Returns the image of a point \[m\].
    #[must_use]
    pub fn apply(&self, point_m: Vector3<f64>) -> Vector3<f64> {
        self.rotation * point_m + self.translation_m
    }

    /// Whether the motion is a reflection.
    #[must_use]
    pub fn reflects(&self) -> bool {
        self.rotation.determinant() < 0.0
    }
}

/// Returns the isometry that maps the slots onto the positions with the least sum of squared errors, reflections
/// allowed (orthogonal Procrustes problem).
///
/// With the centred tables P (positions) and H (slots), the rotation is U V^T of the singular value decomposition
/// H^T P = V S U^T. For a flat shape the rotation out of its plane is arbitrary. Returns `None` for an empty swarm,
/// different numbers of positions and slots, or values that are not finite. Allocates nothing.
#[must_use]
pub fn best_rigid_motion(positions_m: &Rows, formation: &Formation) -> Option<RigidMotion> {
    Fit::new(positions_m, formation).map(|fit| RigidMotion {
        rotation: fit.rotation,
        translation_m: fit.positions_centre - fit.rotation * fit.slots_centre,
    })
}

/// Returns the root mean square distance \[m\] between positions and slots after [`best_rigid_motion`]; NaN without a
/// fit. Allocates nothing.
#[must_use]
pub fn procrustes_rms_m(positions_m: &Rows, formation: &Formation) -> f64 {
    PositionError::of(positions_m, formation, Vector3::zeros(), Freedom::RigidMotion).rms_m
}

/// Returns the sum of the two largest distances \[m\] of positions from their slots after [`best_rigid_motion`]; NaN
/// without a fit. Allocates nothing.
pub(super) fn two_largest_errors_m(positions_m: &Rows, formation: &Formation) -> f64 {
    let Some(fit) = Fit::new(positions_m, formation) else { return f64::NAN };
    let distances_m = fit.residuals_m(positions_m, formation).map(|residual_m| residual_m.norm());
    let (first, second) = distances_m.fold((0.0_f64, 0.0_f64), |(first, second), distance_m| {
        (first.max(distance_m), second.max(first.min(distance_m)))
    });
    first + second
}

struct Fit {
    rotation: Matrix3<f64>,
    positions_centre: Vector3<f64>,
    slots_centre: Vector3<f64>,
}

impl Fit {
    /// Returns the vector from each fitted slot to its position \[m\].
    fn residuals_m<'a>(
        &'a self,
        positions_m: &'a Rows,
        formation: &'a Formation,
    ) -> impl ExactSizeIterator<Item = Vector3<f64>> + 'a {
        (0..positions_m.nrows()).map(move |i| {
            let slot = row(&formation.slots_m, i) - self.slots_centre;
            row(positions_m, i) - self.positions_centre - self.rotation * slot
        })
    }

    fn new(positions_m: &Rows, formation: &Formation) -> Option<Self> {
        let slots_m = &formation.slots_m;
        let count = positions_m.nrows();
        if count == 0 || slots_m.nrows() != count {
            return None;
        }
        let (positions_centre, slots_centre) = (centre(positions_m), centre(slots_m));
        let mut covariance = Matrix3::zeros();
        for i in 0..count {
            let position = row(positions_m, i) - positions_centre;
            covariance += position * (row(slots_m, i) - slots_centre).transpose();
        }
        let largest = covariance.amax();
        if !covariance.iter().all(|x| x.is_finite()) {
            return None;
        }
        let svd = if largest > 0.0 { covariance / largest } else { covariance }.svd(true, true);
        Some(Self { rotation: svd.u? * svd.v_t?, positions_centre, slots_centre })
    }
}

/// Largest number of edges of a complete graph for which each edge is evaluated.
const MOST_EDGES: usize = 1_000_000;

/// Returns the number of edges or vehicles that [`largest_edge_error_m`] evaluates.
#[must_use]
pub fn evaluated_edges(graph: &Graph) -> usize {
    if is_bounded(graph) { graph.count() } else { graph.edge_count() }
}

/// Whether [`largest_edge_error_m`] uses the O(N) bound.
fn is_bounded(graph: &Graph) -> bool {
    graph.is_complete() && graph.edge_count() > MOST_EDGES
}

/// Largest error of a desired distance over the edges of the graph, `max |l_ij - d_ij|` \[m\]; 0 without edges.
///
/// On a complete graph of more than a million edges (1414 vehicles) it is an upper bound, in O(N). The error of a
/// distance is at most the sum of the distances of its two vehicles from their slots. The bound adds the two largest of
/// these distances after [`best_rigid_motion`](super::best_rigid_motion). Two vehicles displaced in opposite directions
/// attain it.
///
/// NaN if a position of an edge is NaN, or if positions, formation and graph have different numbers of vehicles.
#[must_use]
pub fn largest_edge_error_m(positions_m: &Rows, formation: &Formation, graph: &Graph) -> f64 {
    let count = positions_m.nrows();
    if formation.count() != count || graph.count() != count {
        return f64::NAN;
    }
    if is_bounded(graph) {
        return two_largest_errors_m(positions_m, formation);
    }
    let mut largest = 0.0;
    for i in 0..count {
        let (position, slot) = (row(positions_m, i), row(&formation.slots_m, i));
        for j in graph.later_neighbours(i) {
            let distance_m = (row(positions_m, j) - position).norm();
            let error = (distance_m - (row(&formation.slots_m, j) - slot).norm()).abs();
            if error.is_nan() {
                return f64::NAN;
            }
            largest = f64::max(largest, error);
        }
    }
    largest
}

/// Returns the dimension of the smallest affine subspace that contains all rows: 0 a point, 1 a line, 2 a plane, 3
/// space.
///
/// Counts the singular values of the centred table above `relative_tolerance` times the largest one. An empty table and
/// one with a value that is not finite have dimension 0.
#[must_use]
pub fn affine_dimension(rows: &Rows, relative_tolerance: f64) -> usize {
    if rows.nrows() == 0 || first_row_not_finite(rows).is_some() {
        return 0;
    }
    let centre = centre(rows);
    let mut centred = DMatrix::from_fn(rows.nrows(), 3, |i, axis| rows[(i, axis)] - centre[axis]);
    let largest = centred.amax();
    if largest == 0.0 || !largest.is_finite() {
        return 0;
    }
    centred /= largest;
    let singular = centred.singular_values();
    singular.iter().filter(|&&value| value > relative_tolerance * singular[0]).count()
}

/// Returns the mean of the rows, relative to the first row so that a swarm far from the origin loses no digits.
pub(super) fn centre(rows: &Rows) -> Vector3<f64> {
    let origin = row(rows, 0);
    let count = rows.nrows();
    origin + (1..count).map(|i| row(rows, i) - origin).sum::<Vector3<f64>>() / count as f64
}
