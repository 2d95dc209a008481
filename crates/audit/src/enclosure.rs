//! Certified minima on curves: branch and bound with Bernstein coefficients.
//!
//! Over a segment the relative position is a polynomial r(u), u from 0 to 1. A polynomial lies between its least and
//! its greatest Bernstein coefficient. Those of |r|^2 enclose the squared distance between vehicles. For an obstacle
//! the control points of r bound the distance of the curve from its chord. Bisecting the segment makes both bounds
//! tight to second order. Rounding is bounded from the magnitudes that are summed, and widens the bounds.

use nalgebra::Vector3;

use super::cylinder::Cylinder;
use super::obstacle;
use super::outcome::WIDTH_M;
use super::polynomial::{BernsteinBasis, classify_parts, rescale, value};
use super::sweep::{RelativeMotion, Span};
use tautline_core::obstacle::Shape;

/// Largest number of parts that a search examines before it returns the interval reached so far.
const MAX_PARTS: usize = 20_000;
/// Largest number of products of Bernstein coefficients in a search: those of [`MAX_PARTS`] parts of degree seven.
const MAX_PRODUCTS: usize = MAX_PARTS * 15 * 15;
/// Shortest part of a segment, as a fraction of it, to which the crossing of a distance is narrowed.
const SHORTEST_PART: f64 = 1e-10;

/// Object whose distance from a moving point is searched.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target<'a> {
    /// Other vehicle: the origin of relative positions.
    Origin,
    /// Other vehicle, with the scaled distance of a cylinder.
    Cylinder(Cylinder),
    /// Obstacle, relative to its position.
    Shape(&'a Shape),
}

impl Target<'_> {
    /// Returns the distance of a point.
    pub(super) fn distance(self, point: Vector3<f64>) -> f64 {
        match self {
            Self::Origin => point.norm(),
            Self::Cylinder(cylinder) => cylinder.distance(point),
            Self::Shape(shape) => obstacle::distance(shape, point),
        }
    }

    /// Returns whether the target is another vehicle.
    pub(super) fn is_vehicle(self) -> bool {
        !matches!(self, Self::Shape(_))
    }

    /// Returns the largest change of the distance by a displacement of 1 m.
    pub(super) fn per_metre(self) -> f64 {
        if let Self::Cylinder(cylinder) = self { cylinder.per_metre() } else { 1.0 }
    }
}

/// Enclosure of the smallest distance over a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Minimum {
    /// Lower bound.
    pub(super) lower: f64,
    /// Upper bound, which is reached at the fraction `at`.
    pub(super) upper: f64,
    /// Fraction of the segment at which the upper bound is reached.
    pub(super) at: f64,
}

/// Enclosure of the largest distance over a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Maximum {
    /// Lower bound, which is reached at the fraction `at`.
    pub(super) lower: f64,
    /// Upper bound.
    pub(super) upper: f64,
    /// Fraction of the segment at which the lower bound is reached.
    pub(super) at: f64,
}

/// Search for a relative position close to a target, over a segment.
#[derive(Debug)]
pub(super) struct Search<'a> {
    pub(super) target: Target<'a>,
    pub(super) r: &'a [Vector3<f64>],
    basis: BernsteinBasis,
    /// Basis of the degree of the position, for the heights of a cylinder.
    position_basis: Option<BernsteinBasis>,
    part: Vec<Vector3<f64>>,
    squared: Vec<f64>,
    /// Number of parts that may still be examined.
    left: usize,
}

impl<'a> Search<'a> {
    /// Creates a search along the polynomial with coefficients `r`, at least one.
    pub(super) fn new(target: Target<'a>, r: &'a [Vector3<f64>]) -> Self {
        let degree = r.len().saturating_sub(1);
        let squared_degree = if target.is_vehicle() { 2 * degree } else { degree };
        let position_basis = matches!(target, Target::Cylinder(_)).then(|| BernsteinBasis::of_degree(degree));
        let basis = BernsteinBasis::of_degree(squared_degree);
        let left = MAX_PARTS.min(MAX_PRODUCTS / (squared_degree + 1).pow(2));
        Self { target, r, basis, position_basis, part: Vec::with_capacity(r.len()), squared: Vec::new(), left }
    }

    /// Returns the motion if it is straight.
    pub(super) fn straight(&self) -> Option<RelativeMotion> {
        match *self.r {
            [from] => Some(RelativeMotion::new(from, from)),
            [from, by] => Some(RelativeMotion::new(from, from + by)),
            _ => None,
        }
    }

    /// Returns the motion if it is straight and its distance has a closed form.
    pub(super) fn exact(&self) -> Option<RelativeMotion> {
        self.straight().filter(|_| matches!(self.target, Target::Origin))
    }

    /// Returns the smallest distance, in closed form or to within [`WIDTH_M`]; `None` if it is not below `cutoff`.
    pub(super) fn minimum(&mut self, cutoff: f64) -> Option<Minimum> {
        let (lower, fraction) = match (self.straight(), self.target) {
            (Some(motion), Target::Origin) => {
                let approach = motion.closest();
                (approach.separation_m(), approach.at)
            }
            (Some(motion), Target::Shape(shape)) => obstacle::closest(shape, motion.from, motion.to),
            (None, _) | (_, Target::Cylinder(_)) => return self.minimum_within((0.0, 1.0), cutoff),
        };
        (lower < cutoff).then_some(Minimum { lower, upper: lower, at: fraction })
    }

    /// Returns the smallest distance between two fractions of the segment, to within [`WIDTH_M`]; `None` if it is not
    /// below `cutoff`.
    pub(super) fn minimum_within(&mut self, (from, to): (f64, f64), cutoff: f64) -> Option<Minimum> {
        let (mut length, mut open) = (to - from, vec![(self.enclose(from, to - from).0, from)]);
        let (start, end) = (self.distance(from), self.distance(to));
        let (mut upper, mut fraction) = if end < start { (end, to) } else { (start, from) };
        let mut lower = upper;
        loop {
            // A part that cannot improve the result is dropped; its lower bound is kept.
            let enough = cutoff.min(upper - self.width(upper));
            let give_up = self.left == 0;
            open.retain(|&(low, _)| {
                let goes_on = low < enough && !give_up;
                lower = if goes_on { lower } else { lower.min(low) };
                goes_on
            });
            if open.is_empty() {
                break;
            }
            length *= 0.5;
            for (low, start) in std::mem::take(&mut open) {
                let middle = start + length;
                let there = self.distance(middle);
                if there < upper || (there == upper && middle < fraction) {
                    (upper, fraction) = (there, middle);
                }
                open.extend([start, middle].map(|start| (self.enclose(start, length).0.max(low), start)));
            }
        }
        let lower = lower.min(upper);
        (lower < cutoff).then_some(Minimum { lower, upper, at: fraction })
    }

    /// Returns the largest distance to within [`WIDTH_M`]; the upper bound is not below `floor` if no larger distance
    /// is searched. A straight motion is farthest at one of its ends.
    pub(super) fn maximum(&mut self, floor: f64) -> Maximum {
        let (start, end) = (self.distance(0.0), self.distance(1.0));
        let (mut lower, mut fraction) = if end > start { (end, 1.0) } else { (start, 0.0) };
        if self.straight().is_some() {
            let rounding = 4.0 * self.r.len() as f64 * f64::EPSILON * self.r.iter().map(Vector3::norm).sum::<f64>();
            return Maximum { lower, upper: (lower + rounding).next_up(), at: fraction };
        }
        let (mut length, mut open) = (1.0, vec![(self.enclose(0.0, 1.0).1, 0.0)]);
        let mut upper = lower;
        loop {
            // A part that cannot improve the result is dropped; its upper bound is kept.
            let enough = floor.max(lower + self.width(lower));
            let give_up = self.left == 0;
            open.retain(|&(high, _)| {
                let goes_on = high > enough && !give_up;
                upper = if goes_on { upper } else { upper.max(high) };
                goes_on
            });
            if open.is_empty() {
                return Maximum { lower, upper: upper.max(lower), at: fraction };
            }
            length *= 0.5;
            for (high, start) in std::mem::take(&mut open) {
                let middle = start + length;
                let there = self.distance(middle);
                if there > lower || (there == lower && middle < fraction) {
                    (lower, fraction) = (there, middle);
                }
                open.extend([start, middle].map(|start| (self.enclose(start, length).1.min(high), start)));
            }
        }
    }

    /// Returns the parts of the segment below a distance, given that the distance at the fraction `at` is. Each part is
    /// exact to within [`SHORTEST_PART`], rather too long than too short.
    pub(super) fn below(&mut self, distance: f64, fraction: f64) -> Vec<(f64, f64)> {
        if let Some(motion) = self.exact() {
            let Span { enter, exit } = motion.below(distance, motion.closest());
            return vec![(enter, exit)];
        }
        let parts = classify_parts(SHORTEST_PART, self.left, |start, length| match self.enclose(start, length) {
            (low, _) if low >= distance => Some(false),
            (_, high) if high < distance => Some(true),
            _ => None,
        });
        // Runs of adjacent parts that are not certainly above; a run is kept if it is below or contains `at`.
        let runs = parts.chunk_by(|a, b| a.2 != Some(false) && b.2 != Some(false));
        let spans = runs.filter_map(|run| {
            let (from, to) = (run.first()?.0, run.last()?.1);
            let has = |class| run.iter().any(|part| part.2 == Some(class));
            (has(true) || !has(false) && from <= fraction && fraction <= to).then_some((from, to))
        });
        let spans: Vec<_> = spans.collect();
        if spans.is_empty() { vec![(fraction, fraction)] } else { spans }
    }

    /// Returns the distance at a fraction of the segment.
    pub(super) fn distance(&self, u: f64) -> f64 {
        self.target.distance(self.position(u))
    }

    pub(super) fn position(&self, u: f64) -> Vector3<f64> {
        value(self.r, u)
    }

    /// Returns a lower and an upper bound of the distance over a part of the segment.
    fn enclose(&mut self, start: f64, length: f64) -> (f64, f64) {
        self.left = self.left.saturating_sub(1);
        self.part.clear();
        self.part.extend_from_slice(self.r);
        rescale(&mut self.part, start, length);
        match self.target {
            Target::Origin => self.enclose_norm(),
            Target::Cylinder(cylinder) => self.enclose_cylinder(cylinder),
            Target::Shape(shape) => self.enclose_shape(shape),
        }
    }

    /// Bounds the scaled distance of a cylinder: the larger of the bounds of its two parts.
    fn enclose_cylinder(&mut self, cylinder: Cylinder) -> (f64, f64) {
        let heights: Vec<_> = self.part.iter().map(|c| c.z).collect();
        let rounding = 4.0 * heights.len() as f64 * f64::EPSILON * heights.iter().map(|z| z.abs()).sum::<f64>();
        let (lowest, highest) = self.position_basis.as_ref().map_or((0.0, 0.0), |basis| basis.range(&heights));
        self.part.iter_mut().for_each(|c| c.z = 0.0);
        let (near, far) = self.enclose_norm();
        let low = (near / cylinder.horizontal_m).max((lowest.max(-highest) - rounding) / cylinder.vertical_m);
        let high = (far / cylinder.horizontal_m).max((highest.max(-lowest) + rounding) / cylinder.vertical_m);
        (low.next_down().max(0.0), high.next_up())
    }

    fn enclose_norm(&mut self) -> (f64, f64) {
        let n = self.part.len();
        self.squared.clear();
        self.squared.resize(2 * n - 1, 0.0);
        for a in 0..n {
            self.squared[2 * a] += self.part[a].norm_squared();
            for b in a + 1..n {
                self.squared[a + b] += 2.0 * self.part[a].dot(&self.part[b]);
            }
        }
        let rounding = 4.0 * self.squared.len() as f64 * f64::EPSILON * self.magnitude().powi(2);
        let (low, high) = self.basis.range(&self.squared);
        ((low - rounding).max(0.0).sqrt().next_down().max(0.0), (high + rounding).max(0.0).sqrt().next_up())
    }

    /// Bounds the distance from a convex set, negative inside. It changes no faster than the point moves, and it is
    /// greatest at a control point.
    fn enclose_shape(&self, shape: &Shape) -> (f64, f64) {
        let n = self.part.len();
        let from = self.part[0];
        let to: Vector3<f64> = self.part.iter().sum();
        let last = (n - 1).max(1) as f64;
        let (mut motion_deviation, mut high) = (0.0_f64, f64::NEG_INFINITY);
        for (k, control) in self.basis.points(&self.part).enumerate() {
            motion_deviation = motion_deviation.max((control - (from + (to - from) * (k as f64 / last))).norm());
            high = high.max(obstacle::distance(shape, control));
        }
        let rounding = 4.0 * n as f64 * f64::EPSILON * self.magnitude();
        (obstacle::closest(shape, from, to).0 - motion_deviation - rounding, high + rounding)
    }

    /// Returns a bound on the sum of the terms of a position.
    fn magnitude(&self) -> f64 {
        self.part.iter().map(Vector3::norm).sum()
    }

    /// Returns the width to which the bounds of a distance are brought; rounding limits it.
    fn width(&self, distance: f64) -> f64 {
        let scale = match self.target {
            Target::Origin => distance,
            Target::Cylinder(cylinder) => self.r.iter().map(Vector3::norm).sum::<f64>() * cylinder.per_metre(),
            Target::Shape(_) => self.r.iter().map(Vector3::norm).sum(),
        };
        WIDTH_M.max(8.0 * self.r.len() as f64 * f64::EPSILON * scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a curve of degree 7 whose smallest distance from the origin is exactly `miss`, at u = 1/3.
    fn pass(miss: f64) -> Vec<Vector3<f64>> {
        // x = (3 u - 1)(1 + u^2)^3 = (3 u - 1)(1 + 3 u^2 + 3 u^4 + u^6)
        let x = [-1.0, 3.0, -3.0, 9.0, -3.0, 9.0, -1.0, 3.0];
        x.iter().enumerate().map(|(k, x)| Vector3::new(*x, if k == 0 { miss } else { 0.0 }, 0.0)).collect()
    }

    #[test]
    fn the_minimum_of_a_curve_is_enclosed_to_the_width() {
        for miss in [0.0, 1e-6, 0.3, 5.0] {
            let r = pass(miss);
            let found = Search::new(Target::Origin, &r).minimum(f64::INFINITY).unwrap();
            assert!(found.lower <= miss && miss <= found.upper + 1e-15, "{miss}: {found:?}");
            assert!(found.upper - found.lower <= WIDTH_M, "{miss}: {found:?}");
            // At 0.3 m the distance is flat to the root of its width.
            assert!((found.at - 1.0 / 3.0).abs() < 1e-4, "{found:?}");
        }
    }

    #[test]
    fn the_maximum_of_a_curve_is_enclosed_to_the_width() {
        // x = 4 u (1 - u) rises to 1 between two ends at the origin.
        let r = [0.0, 4.0, -4.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let found = Search::new(Target::Origin, &r).maximum(0.0);
        assert!(found.lower <= 1.0 && 1.0 <= found.upper && found.upper - found.lower <= WIDTH_M, "{found:?}");
        assert!((found.at - 0.5).abs() < 1e-4, "{found:?}");
        // Without a larger distance to look for, the bound stays coarse and valid.
        let coarse = Search::new(Target::Origin, &r).maximum(5.0);
        assert!(coarse.upper >= 1.0 && coarse.lower <= 1.0, "{coarse:?}");
        let line = [1.0, -3.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let found = Search::new(Target::Origin, &line).maximum(0.0);
        assert!(found.lower == 2.0 && found.at == 1.0 && found.upper >= 2.0 && found.upper < 2.0 + 1e-12, "{found:?}");
    }

    #[test]
    fn a_minimum_above_the_cutoff_is_not_searched() {
        let r = pass(0.3);
        assert!(Search::new(Target::Origin, &r).minimum(0.29).is_none());
        assert!(Search::new(Target::Origin, &r).minimum(0.31).is_some());
    }

    #[test]
    fn the_time_below_a_distance_ends_where_the_distance_is_reached() {
        let r = pass(0.3);
        let mut search = Search::new(Target::Origin, &r);
        let found = search.minimum(f64::INFINITY).unwrap();
        let spans = search.below(0.5, found.at);
        let [(from, to)] = spans[..] else { panic!("{spans:?}") };
        assert!((search.distance(from) - 0.5).abs() < 1e-8 && (search.distance(to) - 0.5).abs() < 1e-8);
        assert!(from < 1.0 / 3.0 && to > 1.0 / 3.0);
    }

    #[test]
    fn two_dips_are_two_intervals() {
        // x = 4 (u - 1/4)(u - 3/4): below 0.1 around both roots.
        let r = [0.75, -4.0, 4.0].map(|x| Vector3::new(x, 0.0, 0.0));
        let mut search = Search::new(Target::Origin, &r);
        assert_eq!(search.below(0.1, 0.25).len(), 2);
        assert_eq!(search.below(2.0, 0.25), [(0.0, 1.0)]);
    }

    #[test]
    fn the_distance_of_a_curve_from_an_obstacle_is_enclosed() {
        let shape = Shape::Box { half_m: Vector3::repeat(0.25), yaw_deg: 0.0 };
        // A parabola over the box: z = 1 + (u - 1/2)^2, x from -1 to 1.
        let r = [Vector3::new(-1.0, 0.0, 1.25), Vector3::new(2.0, 0.0, -1.0), Vector3::new(0.0, 0.0, 1.0)];
        let found = Search::new(Target::Shape(&shape), &r).minimum(f64::INFINITY).unwrap();
        assert!((found.upper - 0.75).abs() <= WIDTH_M && found.lower <= 0.75 && found.upper - found.lower <= WIDTH_M);
    }
}
