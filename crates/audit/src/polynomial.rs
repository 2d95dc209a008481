//! Polynomials of vectors and their enclosures by Bernstein coefficients.
//!
//! Coefficients are those of the powers, the constant first. A polynomial over the fractions from 0 to 1 lies within
//! the convex hull of its Bernstein coefficients.

use nalgebra::Vector3;

/// Returns the value at `u`, by Horner's rule.
#[inline]
pub(super) fn value(c: &[Vector3<f64>], u: f64) -> Vector3<f64> {
    c.iter().rev().fold(Vector3::zeros(), |sum, c| sum * u + c)
}

/// Returns the derivative at `u`, by Horner's rule.
pub(super) fn derivative(c: &[Vector3<f64>], u: f64) -> Vector3<f64> {
    (1..c.len()).rev().fold(Vector3::zeros(), |sum, k| sum * u + c[k] * k as f64)
}

/// Turns a polynomial in t into one in (t - start) / length, by Horner's shift of the origin.
pub(super) fn rescale(c: &mut [Vector3<f64>], start: f64, length: f64) {
    let degree = c.len().saturating_sub(1);
    if start != 0.0 {
        for lowest in 0..degree {
            for k in (lowest..degree).rev() {
                let higher = c[k + 1];
                c[k] += higher * start;
            }
        }
    }
    let mut power = 1.0;
    for c in c {
        *c *= power;
        power *= length;
    }
}

/// Lower triangle of C(j, k) / C(n, k), row by row. Its product with the coefficients of the powers gives the Bernstein
/// coefficients of degree n.
#[derive(Debug)]
pub(super) struct BernsteinBasis(Vec<f64>);

impl BernsteinBasis {
    pub(super) fn of_degree(n: usize) -> Self {
        let mut table = Vec::with_capacity((n + 1) * (n + 2) / 2);
        for j in 0..=n {
            // C(j, k) / C(n, k) = product over m < k of (j - m) / (n - m).
            let mut entry = 1.0;
            for k in 0..=j {
                table.push(entry);
                entry *= (j - k) as f64 / (n - k).max(1) as f64;
            }
        }
        Self(table)
    }

    fn rows(&self, count: usize) -> impl Iterator<Item = &[f64]> {
        (0..count).map(|j| &self.0[j * (j + 1) / 2..(j + 1) * (j + 2) / 2])
    }

    /// Returns the least and the greatest Bernstein coefficient of a polynomial of this degree.
    pub(super) fn range(&self, c: &[f64]) -> (f64, f64) {
        let coefficients = self.rows(c.len()).map(|row| row.iter().zip(c).map(|(b, c)| b * c).sum::<f64>());
        coefficients.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), b| (low.min(b), high.max(b)))
    }

    /// Returns the Bernstein coefficients, or control points, of a polynomial of this degree.
    pub(super) fn points(&self, c: &[Vector3<f64>]) -> impl Iterator<Item = Vector3<f64>> {
        self.rows(c.len()).map(move |row| row.iter().zip(c).fold(Vector3::zeros(), |sum, (b, c)| sum + c * *b))
    }
}

/// Bisects the interval from 0 to 1 until each part is classified, has at most the length `shortest`, or at least
/// `max_parts` parts were examined. `classify` gets the start and the length of a part. Adjacent parts of one class are
/// merged; each part is its start, its end and its class.
pub(super) fn classify_parts(
    shortest: f64,
    max_parts: usize,
    mut classify: impl FnMut(f64, f64) -> Option<bool>,
) -> Vec<(f64, f64, Option<bool>)> {
    let (mut parts, mut open, mut length, mut examined) = (Vec::new(), vec![0.0], 1.0, 0);
    while !open.is_empty() {
        examined += open.len();
        let is_last = length <= shortest || examined >= max_parts;
        for start in std::mem::take(&mut open) {
            match classify(start, length) {
                None if !is_last => open.extend([start, start + 0.5 * length]),
                class => parts.push((start, start + length, class)),
            }
        }
        length *= 0.5;
    }
    parts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    parts.dedup_by(|later, part| {
        let same = later.2 == part.2;
        part.1 = if same { later.1 } else { part.1 };
        same
    });
    parts
}

/// Returns a bound on the distance of a polynomial from the uniform motion between its ends, by its control points.
pub(super) fn motion_deviation(c: &[Vector3<f64>]) -> f64 {
    let n = c.len();
    let Some(from) = c.first().filter(|_| n > 2) else { return 0.0 };
    let by: Vector3<f64> = c[1..].iter().sum();
    let deviations = |(k, point): (usize, Vector3<f64>)| (point - from - by * (k as f64 / (n - 1) as f64)).norm();
    BernsteinBasis::of_degree(n - 1).points(c).enumerate().map(deviations).fold(0.0, f64::max)
}

/// Returns a bound on the distance of a polynomial from the straight line between its ends, by its control points.
/// Unlike [`motion_deviation`] it compares no times. The distance from a line is a convex function of the position.
pub(super) fn chord_deviation(c: &[Vector3<f64>]) -> f64 {
    let n = c.len();
    let Some(from) = c.first().filter(|_| n > 2) else { return 0.0 };
    let by: Vector3<f64> = c[1..].iter().sum();
    let squared = by.norm_squared();
    let across = |point: Vector3<f64>| {
        let along = if squared > 0.0 { ((point - from).dot(&by) / squared).clamp(0.0, 1.0) } else { 0.0 };
        (point - from - by * along).norm()
    };
    BernsteinBasis::of_degree(n - 1).points(c).map(across).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviation_of_a_curve_is_bounded_by_its_control_points() {
        let r = [Vector3::zeros(), Vector3::new(1.0, 4.0, 0.0), Vector3::new(0.0, -4.0, 0.0)];
        // The parabola rises by 1; its one inner control point by 2.
        assert_eq!(motion_deviation(&r), 2.0);
        assert_eq!(motion_deviation(&r[..2]), 0.0);
        assert_eq!((chord_deviation(&r), chord_deviation(&r[..2])), (2.0, 0.0));
        // An eased motion on a straight line never leaves the line. A motion past its end leaves it by its control
        // points.
        let eased = [0.0, 0.0, 3.0, -2.0].map(|x| Vector3::new(x, 2.0 * x, 0.0));
        assert!(chord_deviation(&eased) < 1e-15 && motion_deviation(&eased) > 0.5);
        let back = [0.0, 4.0, -3.0].map(|x| Vector3::new(x, 0.0, 0.0));
        assert_eq!(chord_deviation(&back), 1.0);
        assert_eq!(BernsteinBasis::of_degree(2).range(&[0.0, 4.0, -4.0]), (0.0, 2.0));
    }

    #[test]
    fn unclassified_parts_are_bisected_to_the_shortest_length_or_the_allowed_number() {
        // Crossing at 0.3: a part that contains it has no class.
        let classify = |start: f64, length: f64| match 0.3 {
            crossing if start + length <= crossing => Some(true),
            crossing if start >= crossing => Some(false),
            _ => None,
        };
        assert_eq!(
            classify_parts(0.25, 99, classify),
            [(0.0, 0.25, Some(true)), (0.25, 0.5, None), (0.5, 1.0, Some(false))]
        );
        assert_eq!(classify_parts(1e-9, 3, classify), [(0.0, 0.5, None), (0.5, 1.0, Some(false))]);
        assert_eq!(classify_parts(1e-9, 1, classify), [(0.0, 1.0, None)]);
    }
}
