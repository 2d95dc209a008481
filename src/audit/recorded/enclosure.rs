//! Certified minima on curves: branch and bound with Bernstein coefficients.
//!
//! Over a stretch the relative position is a polynomial r(u), u from 0 to 1. A polynomial lies between its least and its
//! greatest Bernstein coefficient, so those of |r|^2 enclose the squared distance; for an obstacle the control points of r
//! enclose the distance from their chord. Halving the stretch makes both bounds tight to second order. What rounding adds
//! is bounded from the magnitudes that are summed, and widens the bounds.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::obstacle::Shape;

/// Parts that a search looks at before it gives up and answers with the interval it has.
const MOST_PARTS: usize = 20_000;
/// Shortest part of a stretch, as a fraction of it, that is looked at for when a distance is passed.
const SHORTEST_PART: f64 = 1e-10;

/// What a moving point keeps a distance from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target<'a> {
    /// The other vehicle: the origin of relative positions.
    Origin,
    /// An obstacle, relative to its place.
    Shape(&'a Shape),
}

impl Target<'_> {
    /// The distance of a point from it.
    pub(super) fn distance(self, point: Vector3<f64>) -> f64 {
        match self {
            Self::Origin => point.norm(),
            Self::Shape(shape) => shape.distance(point),
        }
    }
}

/// The smallest distance over a stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Minimum {
    /// It is at least this.
    pub(super) lower: f64,
    /// And at most this, which is reached,
    pub(super) upper: f64,
    /// at this fraction of the stretch.
    pub(super) at: f64,
}

/// A part of a stretch that could hold the minimum.
#[derive(Clone, Copy, Debug)]
struct Part {
    low: f64,
    start: f64,
    length: f64,
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Part {
    /// The greatest part is the one with the lowest bound, and of those the earliest.
    fn cmp(&self, other: &Self) -> Ordering {
        other.low.total_cmp(&self.low).then(other.start.total_cmp(&self.start))
    }
}

/// A relative position over a stretch, and where it is close to a target.
#[derive(Debug)]
pub(super) struct Search<'a> {
    target: Target<'a>,
    r: &'a [Vector3<f64>],
    basis: Vec<f64>,
    part: Vec<Vector3<f64>>,
    norms: Vec<f64>,
    squared: Vec<f64>,
}

impl<'a> Search<'a> {
    /// A search along the polynomial with coefficients `r`, at least one.
    pub(super) fn new(target: Target<'a>, r: &'a [Vector3<f64>]) -> Self {
        let degree = r.len().saturating_sub(1);
        let wanted = if matches!(target, Target::Origin) { 2 * degree } else { degree };
        let (part, norms, squared) = (Vec::with_capacity(r.len()), Vec::new(), Vec::new());
        Self { target, r, basis: basis(wanted), part, norms, squared }
    }

    /// The smallest distance, to within `width`; `None` if it is not below `cutoff`.
    pub(super) fn minimum(&mut self, cutoff: f64, width: f64) -> Option<Minimum> {
        self.minimum_within((0.0, 1.0), cutoff, width)
    }

    /// The smallest distance between two fractions of the stretch, likewise.
    pub(super) fn minimum_within(&mut self, (from, to): (f64, f64), cutoff: f64, width: f64) -> Option<Minimum> {
        let (low, _) = self.enclose(from, to - from);
        if low >= cutoff {
            return None;
        }
        let (start, end) = (self.distance(from), self.distance(to));
        let (mut upper, mut at) = if end < start { (end, to) } else { (start, from) };
        let mut parts = BinaryHeap::from([Part { low, start: from, length: to - from }]);
        let mut looked_at = 0;
        let mut lower = f64::INFINITY;
        while let Some(part) = parts.pop() {
            lower = part.low;
            if part.low >= cutoff || part.low >= upper - width || looked_at > MOST_PARTS {
                break;
            }
            let half = 0.5 * part.length;
            let middle = part.start + half;
            let there = self.distance(middle);
            if there < upper || (there == upper && middle < at) {
                (upper, at) = (there, middle);
            }
            for start in [part.start, middle] {
                let (low, _) = self.enclose(start, half);
                parts.push(Part { low: low.max(part.low), start, length: half });
            }
            looked_at += 2;
        }
        let lower = lower.min(upper);
        (lower < cutoff).then_some(Minimum { lower, upper, at })
    }

    /// The parts of the stretch that are spent below a distance, given that it is below at the fraction `at`; each to
    /// within [`SHORTEST_PART`], rather too long than too short.
    pub(super) fn below(&mut self, distance: f64, at: f64) -> Vec<(f64, f64)> {
        // An unbroken run of parts, and whether some of it is below for certain.
        let mut runs: Vec<(f64, f64, bool)> = Vec::new();
        let mut stack = vec![(0.0, 1.0)];
        let mut looked_at = 0;
        while let Some((start, length)) = stack.pop() {
            let (low, high) = self.enclose(start, length);
            looked_at += 1;
            if low >= distance {
                continue;
            }
            let certain = high < distance;
            if !certain && length > SHORTEST_PART && looked_at < MOST_PARTS {
                let half = 0.5 * length;
                stack.extend([(start + half, half), (start, half)]);
                continue;
            }
            match runs.last_mut() {
                Some(run) if run.1 >= start => *run = (run.0, start + length, run.2 || certain),
                _ => runs.push((start, start + length, certain)),
            }
        }
        let holds = |run: &(f64, f64, bool)| run.2 || (run.0 <= at && at <= run.1);
        let spans: Vec<_> = runs.into_iter().filter(holds).map(|(from, to, _)| (from, to)).collect();
        if spans.is_empty() { vec![(at, at)] } else { spans }
    }

    /// The distance at a fraction of the stretch.
    pub(super) fn distance(&self, u: f64) -> f64 {
        self.target.distance(self.position(u))
    }

    pub(super) fn position(&self, u: f64) -> Vector3<f64> {
        self.r.iter().rev().fold(Vector3::zeros(), |sum, c| sum * u + c)
    }

    /// Lower and upper bound of the distance over a part of the stretch.
    fn enclose(&mut self, start: f64, length: f64) -> (f64, f64) {
        self.expand(start, length);
        match self.target {
            Target::Origin => self.enclose_norm(),
            Target::Shape(shape) => self.enclose_shape(shape),
        }
    }

    /// Expands r about the start of a part, in fractions of the part.
    fn expand(&mut self, start: f64, length: f64) {
        self.part.clear();
        self.part.extend_from_slice(self.r);
        let degree = self.part.len() - 1;
        if start != 0.0 {
            for lowest in 0..degree {
                for k in (lowest..degree).rev() {
                    let higher = self.part[k + 1];
                    self.part[k] += higher * start;
                }
            }
        }
        let mut power = 1.0;
        for c in &mut self.part {
            *c *= power;
            power *= length;
        }
    }

    fn enclose_norm(&mut self) -> (f64, f64) {
        let n = self.part.len();
        self.norms.clear();
        self.norms.extend(self.part.iter().map(Vector3::norm));
        self.squared.clear();
        self.squared.resize(2 * n - 1, 0.0);
        for a in 0..n {
            self.squared[2 * a] += self.part[a].norm_squared();
            for b in a + 1..n {
                self.squared[a + b] += 2.0 * self.part[a].dot(&self.part[b]);
            }
        }
        let magnitude = self.norms.iter().sum::<f64>().powi(2);
        let rounding = 2.0 * self.squared.len() as f64 * f64::EPSILON * magnitude;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for row in rows(&self.basis, self.squared.len()) {
            let coefficient: f64 = row.iter().zip(&self.squared).map(|(b, c)| b * c).sum();
            (low, high) = (low.min(coefficient), high.max(coefficient));
        }
        ((low - rounding).max(0.0).sqrt(), (high + rounding).max(0.0).sqrt())
    }

    /// The distance from a convex set, below zero within, changes no faster than the point moves, and is greatest at a
    /// corner of what encloses the point.
    fn enclose_shape(&self, shape: &Shape) -> (f64, f64) {
        let n = self.part.len();
        let from = self.part[0];
        let to: Vector3<f64> = self.part.iter().sum();
        let last = (n - 1).max(1) as f64;
        let (mut stray, mut high) = (0.0_f64, f64::NEG_INFINITY);
        for (k, row) in rows(&self.basis, n).enumerate() {
            let control = row.iter().zip(&self.part).fold(Vector3::zeros(), |sum, (b, c)| sum + c * *b);
            stray = stray.max((control - (from + (to - from) * (k as f64 / last))).norm());
            high = high.max(shape.distance(control));
        }
        let magnitude: f64 = self.part.iter().map(Vector3::norm).sum();
        let rounding = 4.0 * n as f64 * f64::EPSILON * magnitude;
        (shape.closest(from, to).0 - stray - rounding, high + rounding)
    }
}

/// Farthest that a polynomial strays from the straight way between its ends, by its control points.
pub(super) fn stray(r: &[Vector3<f64>]) -> f64 {
    let n = r.len();
    let Some(from) = r.first() else { return 0.0 };
    if n <= 2 {
        return 0.0;
    }
    let by: Vector3<f64> = r[1..].iter().sum();
    let basis = basis(n - 1);
    rows(&basis, n)
        .enumerate()
        .map(|(k, row)| {
            let control = row.iter().zip(r).fold(Vector3::zeros(), |sum, (b, c)| sum + c * *b);
            (control - from - by * (k as f64 / (n - 1) as f64)).norm()
        })
        .fold(0.0, f64::max)
}

/// Least and greatest Bernstein coefficient of a polynomial with numbers for coefficients.
pub(super) fn range(c: &[f64]) -> (f64, f64) {
    let basis = basis(c.len().saturating_sub(1));
    rows(&basis, c.len())
        .map(|row| row.iter().zip(c).map(|(b, c)| b * c).sum::<f64>())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), b| (low.min(b), high.max(b)))
}

/// The lower triangle of C(j, k) / C(n, k), row by row: the Bernstein coefficients of degree n are its product with the
/// coefficients of the powers.
fn basis(n: usize) -> Vec<f64> {
    let mut table = Vec::with_capacity((n + 1) * (n + 2) / 2);
    for j in 0..=n {
        // C(j, k) / C(n, k) = product over m < k of (j - m) / (n - m).
        let mut entry = 1.0;
        for k in 0..=j {
            table.push(entry);
            entry *= (j - k) as f64 / (n - k).max(1) as f64;
        }
    }
    table
}

/// The rows of a [`basis`] of so many coefficients.
fn rows(table: &[f64], count: usize) -> impl Iterator<Item = &[f64]> {
    (0..count).map(|j| &table[j * (j + 1) / 2..(j + 1) * (j + 2) / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: f64 = 1e-9;

    /// A curve of degree 7 that comes to exactly `miss` from the origin at u = 1/3: its distance is the root of
    /// miss^2 + (3 u - 1)^2 (1 + u^2)^2 ... by construction of its two parts at right angles.
    fn pass(miss: f64) -> Vec<Vector3<f64>> {
        // x = (3 u - 1)(1 + u^2)^3 = (3 u - 1)(1 + 3 u^2 + 3 u^4 + u^6)
        let x = [-1.0, 3.0, -3.0, 9.0, -3.0, 9.0, -1.0, 3.0];
        x.iter().enumerate().map(|(k, x)| Vector3::new(*x, if k == 0 { miss } else { 0.0 }, 0.0)).collect()
    }

    #[test]
    fn the_minimum_of_a_curve_is_enclosed_to_the_width() {
        for miss in [0.0, 1e-6, 0.3, 5.0] {
            let r = pass(miss);
            let found = Search::new(Target::Origin, &r).minimum(f64::INFINITY, WIDTH).unwrap();
            assert!(found.lower <= miss && miss <= found.upper + 1e-15, "{miss}: {found:?}");
            assert!(found.upper - found.lower <= WIDTH, "{miss}: {found:?}");
            // At 0.3 m the distance is flat to the root of its width.
            assert!((found.at - 1.0 / 3.0).abs() < 1e-4, "{found:?}");
        }
    }

    #[test]
    fn a_minimum_that_is_not_below_the_cutoff_is_not_looked_for() {
        let r = pass(0.3);
        assert!(Search::new(Target::Origin, &r).minimum(0.29, WIDTH).is_none());
        assert!(Search::new(Target::Origin, &r).minimum(0.31, WIDTH).is_some());
    }

    #[test]
    fn the_time_below_a_distance_ends_where_the_distance_is_reached() {
        let r = pass(0.3);
        let mut search = Search::new(Target::Origin, &r);
        let found = search.minimum(f64::INFINITY, WIDTH).unwrap();
        let spans = search.below(0.5, found.at);
        let [(from, to)] = spans[..] else { panic!("{spans:?}") };
        assert!((search.distance(from) - 0.5).abs() < 1e-8 && (search.distance(to) - 0.5).abs() < 1e-8);
        assert!(from < 1.0 / 3.0 && to > 1.0 / 3.0);
    }

    #[test]
    fn two_dips_are_two_times() {
        // x = 4 (u - 1/4)(u - 3/4): below 0.1 around both roots.
        let r = [0.75, -4.0, 4.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let mut search = Search::new(Target::Origin, &r);
        assert_eq!(search.below(0.1, 0.25).len(), 2);
        assert_eq!(search.below(2.0, 0.25), [(0.0, 1.0)]);
    }

    #[test]
    fn the_distance_of_a_curve_from_an_obstacle_is_enclosed_too() {
        let shape = Shape::Box { half_m: Vector3::repeat(0.25), yaw_rad: 0.0 };
        // A parabola over the box: z = 1 + (u - 1/2)^2, x from -1 to 1.
        let r = [Vector3::new(-1.0, 0.0, 1.25), Vector3::new(2.0, 0.0, -1.0), Vector3::new(0.0, 0.0, 1.0)];
        let found = Search::new(Target::Shape(&shape), &r).minimum(f64::INFINITY, WIDTH).unwrap();
        assert!((found.upper - 0.75).abs() <= WIDTH && found.lower <= 0.75 && found.upper - found.lower <= WIDTH);
    }

    #[test]
    fn a_curve_strays_from_its_chord_at_most_as_far_as_its_control_points() {
        let r = [Vector3::zeros(), Vector3::new(1.0, 4.0, 0.0), Vector3::new(0.0, -4.0, 0.0)];
        // The parabola rises by 1; its one inner control point by 2.
        assert_eq!(stray(&r), 2.0);
        assert_eq!(stray(&r[..2]), 0.0);
        assert_eq!(range(&[0.0, 4.0, -4.0]), (0.0, 2.0));
    }
}
