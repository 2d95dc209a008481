//! Polynomials, and what their Bernstein coefficients enclose.
//!
//! Coefficients are those of the powers, the constant one first. A polynomial over the fractions from 0 to 1 lies within
//! the hull of its Bernstein coefficients.

use nalgebra::Vector3;

/// The value at `u`, by Horner's rule.
#[inline]
pub(super) fn value(c: &[Vector3<f64>], u: f64) -> Vector3<f64> {
    c.iter().rev().fold(Vector3::zeros(), |sum, c| sum * u + c)
}

/// Makes a polynomial in t one in (t - start) / length, by Horner's shift of the origin.
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

/// The lower triangle of C(j, k) / C(n, k), row by row: the Bernstein coefficients of degree n are its product with the
/// coefficients of the powers.
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

    /// Least and greatest Bernstein coefficient of a polynomial of this degree.
    pub(super) fn range(&self, c: &[f64]) -> (f64, f64) {
        let coefficients = self.rows(c.len()).map(|row| row.iter().zip(c).map(|(b, c)| b * c).sum::<f64>());
        coefficients.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), b| (low.min(b), high.max(b)))
    }

    /// The Bernstein coefficients, or control points, of a polynomial of this degree.
    pub(super) fn points(&self, c: &[Vector3<f64>]) -> impl Iterator<Item = Vector3<f64>> {
        self.rows(c.len()).map(move |row| row.iter().zip(c).fold(Vector3::zeros(), |sum, (b, c)| sum + c * *b))
    }
}

/// Halves the fractions from 0 to 1 until each part is told a yes or a no, is as short as asked, or so many parts were looked
/// at; `tell` is given the start and the length of a part. Neighbours that are told the same are one part: its start, its end
/// and what it is told.
pub(super) fn parts_told(
    shortest: f64,
    most: usize,
    mut tell: impl FnMut(f64, f64) -> Option<bool>,
) -> Vec<(f64, f64, Option<bool>)> {
    let (mut parts, mut open, mut length, mut looked_at) = (Vec::new(), vec![0.0], 1.0, 0);
    while !open.is_empty() {
        looked_at += open.len();
        let is_last = length <= shortest || looked_at >= most;
        for start in std::mem::take(&mut open) {
            match tell(start, length) {
                None if !is_last => open.extend([start, start + 0.5 * length]),
                told => parts.push((start, start + length, told)),
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

/// Farthest that a polynomial strays from the straight way between its ends, by its control points.
pub(super) fn stray(c: &[Vector3<f64>]) -> f64 {
    let n = c.len();
    let Some(from) = c.first().filter(|_| n > 2) else { return 0.0 };
    let by: Vector3<f64> = c[1..].iter().sum();
    let strays = |(k, point): (usize, Vector3<f64>)| (point - from - by * (k as f64 / (n - 1) as f64)).norm();
    BernsteinBasis::of_degree(n - 1).points(c).enumerate().map(strays).fold(0.0, f64::max)
}

/// Farthest that a polynomial gets from the straight line between its ends, however it flies along it, by its control points:
/// the distance from a line is a convex function of a place.
pub(super) fn stray_across(c: &[Vector3<f64>]) -> f64 {
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
    fn a_curve_strays_from_its_chord_at_most_as_far_as_its_control_points() {
        let r = [Vector3::zeros(), Vector3::new(1.0, 4.0, 0.0), Vector3::new(0.0, -4.0, 0.0)];
        // The parabola rises by 1; its one inner control point by 2.
        assert_eq!(stray(&r), 2.0);
        assert_eq!(stray(&r[..2]), 0.0);
        assert_eq!((stray_across(&r), stray_across(&r[..2])), (2.0, 0.0));
        // Eased from rest to rest on a straight line it is never off that, and past its end as far as its control points are.
        let eased = [0.0, 0.0, 3.0, -2.0].map(|x| Vector3::new(x, 2.0 * x, 0.0));
        assert!(stray_across(&eased) < 1e-15 && stray(&eased) > 0.5);
        let back = [0.0, 4.0, -3.0].map(|x| Vector3::new(x, 0.0, 0.0));
        assert_eq!(stray_across(&back), 1.0);
        assert_eq!(BernsteinBasis::of_degree(2).range(&[0.0, 4.0, -4.0]), (0.0, 2.0));
    }

    #[test]
    fn what_cannot_be_told_is_halved_down_to_the_shortest_part_or_as_often_as_allowed() {
        // Below and above 0.3, which no part that holds it can be told.
        let tell = |start: f64, length: f64| match 0.3 {
            crossing if start + length <= crossing => Some(true),
            crossing if start >= crossing => Some(false),
            _ => None,
        };
        assert_eq!(parts_told(0.25, 99, tell), [(0.0, 0.25, Some(true)), (0.25, 0.5, None), (0.5, 1.0, Some(false))]);
        assert_eq!(parts_told(1e-9, 3, tell), [(0.0, 0.5, None), (0.5, 1.0, Some(false))]);
        assert_eq!(parts_told(1e-9, 1, tell), [(0.0, 1.0, None)]);
    }
}
