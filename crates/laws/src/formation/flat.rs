//! The smallest flat that holds a set of points.

use nalgebra::{DMatrix, Vector3};

use tautline_core::swarm::{Rows, first_row_not_finite, row};

/// Dimension of the smallest flat that holds all rows: 0 a point, 1 a line, 2 a plane, 3 space.
///
/// Counts the singular values of the centred table above `relative_tolerance` times the largest one. An empty table
/// and one with a number that is not finite have dimension 0.
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

/// Mean of the rows, taken about the first one so that a swarm far from the origin loses no digits.
pub(super) fn centre(rows: &Rows) -> Vector3<f64> {
    let origin = row(rows, 0);
    let count = rows.nrows();
    origin + (1..count).map(|i| row(rows, i) - origin).sum::<Vector3<f64>>() / count as f64
}
