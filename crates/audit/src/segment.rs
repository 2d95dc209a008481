//! Motion of a vehicle over an interval of time: a [`Line`] between two samples, or a [`Curve`].

use std::sync::Arc;

use nalgebra::Vector3;

use super::double_double::{DoubleDouble, QUOTIENT};
use super::polynomial::{rescale, value};
use super::sweep::Interval;

/// Motion of a vehicle from one instant to a later one: a straight line between two points, or a [`Curve`].
///
/// A jump is a segment of zero length whose ends differ. A vehicle with a single sample is a segment of zero length
/// whose ends are equal.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
    /// Whether the vehicle counts as on the ground; `None` if that is unknown.
    pub(super) grounded: Option<bool>,
    /// Motion that this segment is a part of; `None` for a straight line between two samples.
    pub(super) parent: Option<Arc<ParentMotion>>,
}

/// Motion that a segment is a part of.
#[derive(Clone, Debug)]
pub(super) enum ParentMotion {
    /// Straight line between two samples. Its ends are exact; the ends of the part are rounded.
    Line(Line),
    /// Curve, with or without a deviation.
    Curve(Curve),
}

/// Curve r(t) = sum of `coefficients[k] (t - from_s)^k`, with a bound on the distance of the vehicle from it.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) coefficients: Vec<Vector3<f64>>,
    pub(super) deviation: Deviation,
}

/// Bound on the distance of a vehicle of bounded acceleration A from the curve through two samples h apart; x is the
/// elapsed fraction of h.
///
/// Both bounds follow from Peano's form of the error, e(x) = h^2 * integral of K(x, s) p''(s) over s from 0 to 1. Hence
/// |e(x)| <= A h^2 * integral of |K(x, s)|.
///
/// Samples of position alone are joined by the chord. K(x, s) is -s (1 - x) for s <= x and -x (1 - s) beyond. Its
/// integral is x (1 - x) / 2. The bound is at most A h^2 / 8, in the middle.
///
/// Samples of position and velocity are joined by the Hermite cubic. For s > x
///
/// ```text
/// K(x, s) = -x^2 [(3 - 2 x) (1 - s) - (1 - x)]
/// ```
///
/// which changes its sign once, at 1 - s = (1 - x) / (3 - 2 x), and K(x, s) = K(1 - x, 1 - s) for s < x. With y = 2 x -
/// 1 the two integrals of |K| add up to (1 - y^2)^2 / (4 (4 - y^2)), which falls as |y| grows. The bound is at most A
/// h^2 / 16, in the middle: half of that of the chord.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Deviation {
    /// Largest deviation, in the middle of the interval; 0 if the vehicle is on the curve.
    pub(super) peak: f64,
    /// Whether the curve is a Hermite cubic through velocities.
    pub(super) hermite: bool,
}

impl Deviation {
    /// Returns the bound at the elapsed fraction `x`.
    fn at(self, x: f64) -> f64 {
        let y = 2.0 * x.clamp(0.0, 1.0) - 1.0;
        let rest = (1.0 - y) * (1.0 + y);
        let of_chord = self.peak * rest;
        if self.hermite { of_chord * rest * 4.0 / (4.0 - y * y) } else { of_chord }
    }
}

impl Curve {
    /// Returns the position on the curve at a time.
    pub(super) fn position(&self, time_s: f64) -> Vector3<f64> {
        value(&self.coefficients, time_s - self.from_s)
    }

    /// Returns the bound on the distance of the vehicle from the curve at a time.
    pub(super) fn deviation_at(&self, time_s: f64) -> f64 {
        self.deviation.at((time_s - self.from_s) / (self.to_s - self.from_s))
    }

    /// Returns the curve over an interval as a polynomial of the fraction u of the interval.
    fn local(&self, over: Interval) -> Vec<Vector3<f64>> {
        let mut local = self.coefficients.clone();
        rescale(&mut local, over.from_s - self.from_s, over.to_s - over.from_s);
        local
    }

    /// Returns a bound on the rounding of [`Curve::local`] and [`Curve::position`]: a few units in the last place of
    /// the summed terms. It is larger for a Hermite cubic, whose coefficients are rounded themselves.
    pub(super) fn rounding(&self) -> f64 {
        let length = self.to_s - self.from_s;
        let magnitude = self.coefficients.iter().rev().fold(0.0, |sum, c| sum * length + c.norm());
        // For a line: 7 u.
        let operations = match self.coefficients.len() {
            _ if self.deviation.hermite => 48.0,
            ..=2 => 4.0,
            count => 4.0 * count as f64,
        };
        operations * f64::EPSILON * magnitude
    }
}

impl Segment {
    /// Creates a straight segment.
    pub(super) fn straight(from_s: f64, to_s: f64, from: Vector3<f64>, to: Vector3<f64>) -> Self {
        Self { from_s, to_s, from, to, grounded: Some(false), parent: None }
    }

    /// Creates a segment of a whole curve.
    pub(super) fn curved(curve: Curve) -> Self {
        let (from_s, to_s) = (curve.from_s, curve.to_s);
        let (from, to) = (curve.position(from_s), curve.position(to_s));
        Self { from_s, to_s, from, to, grounded: Some(false), parent: Some(Arc::new(ParentMotion::Curve(curve))) }
    }

    /// Returns the curve that the segment is a part of, if any.
    #[inline]
    pub(super) fn curve(&self) -> Option<&Curve> {
        match self.parent.as_deref() {
            Some(ParentMotion::Curve(curve)) => Some(curve),
            _ => None,
        }
    }

    /// Returns the line between two samples that a straight segment is, or is a part of.
    #[inline]
    pub(super) fn line(&self) -> Line {
        match self.parent.as_deref() {
            Some(ParentMotion::Line(line)) => *line,
            _ => Line { from_s: self.from_s, to_s: self.to_s, from: self.from, to: self.to },
        }
    }

    /// Returns the part of a straight segment between two instants within it.
    fn part(&self, from_s: f64, to_s: f64) -> Self {
        let parent = self.parent.clone().or_else(|| Some(Arc::new(ParentMotion::Line(self.line()))));
        let (from, to) = (self.position(from_s), self.position(to_s));
        Self { from_s, to_s, from, to, grounded: self.grounded, parent }
    }

    /// Returns the part of the segment within an interval that it meets; a curve is returned whole.
    pub(super) fn within(&self, over: Interval) -> Self {
        let (from_s, to_s) = (self.from_s.max(over.from_s), self.to_s.min(over.to_s));
        if self.curve().is_some() || self.to_s <= self.from_s || (from_s, to_s) == (self.from_s, self.to_s) {
            return self.clone();
        }
        self.part(from_s, to_s)
    }

    /// Returns whether the vehicle has two positions at one instant.
    pub(super) fn jumps(&self) -> bool {
        self.to_s <= self.from_s && self.from != self.to
    }

    /// Returns the largest distance of the vehicle from the curve over the segment.
    pub(super) fn deviation(&self) -> f64 {
        self.curve().map_or(0.0, |curve| curve.deviation.peak)
    }

    /// Returns the largest distance of the vehicle from the curve at a time.
    pub(super) fn deviation_at(&self, time_s: f64) -> f64 {
        self.curve().map_or(0.0, |curve| curve.deviation_at(time_s))
    }

    /// Returns the position on the segment at a time.
    #[inline]
    pub(super) fn position(&self, time_s: f64) -> Vector3<f64> {
        if time_s <= self.from_s {
            self.from
        } else if time_s >= self.to_s {
            self.to
        } else {
            match self.parent.as_deref() {
                Some(ParentMotion::Curve(curve)) => curve.position(time_s),
                _ => self.line().rounded_position(time_s),
            }
        }
    }

    /// Returns the part of the segment in an interval, if any.
    pub(super) fn clipped(&self, to: Interval) -> Option<Self> {
        let (start_s, end_s) = (self.from_s.max(to.from_s), self.to_s.min(to.to_s));
        if start_s > end_s {
            return None;
        }
        if start_s == self.from_s && end_s == self.to_s {
            return Some(self.clone());
        }
        if self.curve().is_none() {
            return Some(self.part(start_s, end_s));
        }
        let (from, to) = (self.position(start_s), self.position(end_s));
        Some(Self { from_s: start_s, to_s: end_s, from, to, ..self.clone() })
    }

    /// Returns the segment as a polynomial of the fraction u of an interval within it.
    pub(super) fn local(&self, over: Interval) -> Vec<Vector3<f64>> {
        match self.curve() {
            Some(curve) => curve.local(over),
            None if self.to_s <= self.from_s => vec![self.from, self.to - self.from],
            None => {
                let line = self.line();
                let rate = (over.to_s - over.from_s) / (line.to_s - line.from_s);
                vec![line.rounded_position(over.from_s), (line.to - line.from) * rate]
            }
        }
    }

    /// Returns a bound on the rounding of positions, and of the ends of a part.
    pub(super) fn rounding(&self) -> f64 {
        match self.parent.as_deref() {
            Some(ParentMotion::Curve(curve)) => curve.rounding(),
            _ => self.line().rounding(),
        }
    }
}

/// Bound on the rounding error of an interpolated position, relative to the largest coordinate of its line. It covers
/// a quotient, a product and a sum on each of three axes.
pub(super) const INTERPOLATION: f64 = 32.0 * QUOTIENT;

/// Straight motion between two samples; a jump if both samples have one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
}

/// Position of a vehicle at an end of the shared time.
pub(super) enum EndPosition {
    /// At a sample.
    Sample(Vector3<f64>),
    /// Between the two samples.
    Interpolated,
}

impl Line {
    /// Returns the elapsed fraction at a time.
    #[inline]
    pub(super) fn fraction(&self, time_s: f64) -> f64 {
        if time_s <= self.from_s {
            0.0
        } else if time_s >= self.to_s {
            1.0
        } else {
            (time_s - self.from_s) / (self.to_s - self.from_s)
        }
    }

    /// Returns the position at a time within the line, to within [`Line::rounding`].
    #[inline]
    pub(super) fn rounded_position(&self, time_s: f64) -> Vector3<f64> {
        self.from + (self.to - self.from) * self.fraction(time_s)
    }

    /// Returns a bound on the rounding of [`Line::rounded_position`]: for each coordinate 4 eps of the displacement and
    /// one of the position.
    #[inline]
    pub(super) fn rounding(&self) -> f64 {
        8.0 * f64::EPSILON * (self.from.amax() + self.to.amax())
    }

    pub(super) fn place(&self, time_s: f64, is_end: bool) -> EndPosition {
        let jumps = self.to_s <= self.from_s;
        if (jumps && !is_end) || (!jumps && time_s <= self.from_s) || self.from == self.to {
            EndPosition::Sample(self.from)
        } else if jumps || time_s >= self.to_s {
            EndPosition::Sample(self.to)
        } else {
            EndPosition::Interpolated
        }
    }

    /// Returns the position at a time within the line, to within [`INTERPOLATION`].
    pub(super) fn position(&self, time_s: f64) -> [DoubleDouble; 3] {
        let length = DoubleDouble::difference(self.to_s, self.from_s);
        let share = DoubleDouble::difference(time_s, self.from_s).divided_by(length);
        [0, 1, 2].map(|axis| {
            let by = DoubleDouble::difference(self.to[axis], self.from[axis]);
            DoubleDouble::from(self.from[axis]) + by * share
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: f64 = 1e-12;

    fn curve(deviation: Deviation) -> Curve {
        let coefficients = (0..8).map(|k| Vector3::new(1.0, -2.0, 0.5) / f64::from(1 + k * k)).collect();
        Curve { from_s: 10.0, to_s: 12.0, coefficients, deviation }
    }

    #[test]
    fn a_local_polynomial_equals_its_part_of_the_curve() {
        let curve = curve(Deviation::default());
        let local = curve.local(Interval { from_s: 10.5, to_s: 11.75 });
        for u in [0.0, 0.2, 0.7, 1.0] {
            let there = local.iter().rev().fold(Vector3::zeros(), |sum, c| sum * u + c);
            assert!((there - curve.position(10.5 + 1.25 * u)).norm() < TOLERANCE);
        }
    }

    /// Compares with the motion of acceleration at most 1 that deviates most at `x`: full thrust with the sign of
    /// Peano's kernel. The integral is computed numerically over the time s of an impulse.
    #[test]
    fn the_deviations_of_chord_and_cubic_are_tight_bounds() {
        const CELLS: u32 = 4000;
        let cell = 1.0 / f64::from(CELLS);
        for x in [0.1, 0.25, 0.5, 0.8] {
            // p = (x - s)+ is the response to an impulse of acceleration at s; the error of its interpolation is K(x,
            // s).
            let interpolation_error = |s: f64, with_velocity: bool| {
                let response = (x - s).max(0.0);
                let interpolated =
                    if with_velocity { (3.0 - 2.0 * x) * x * x * (1.0 - s) + x * x * (x - 1.0) } else { x * (1.0 - s) };
                response - interpolated
            };
            let reached = |with_velocity| {
                (0..CELLS)
                    .map(|k| interpolation_error((f64::from(k) + 0.5) * cell, with_velocity).abs() * cell)
                    .sum::<f64>()
            };
            let chord = Deviation { peak: 1.0 / 8.0, hermite: false };
            let cubic = Deviation { peak: 1.0 / 16.0, hermite: true };
            assert!((reached(false) - chord.at(x)).abs() < 1e-6, "{} {}", reached(false), chord.at(x));
            assert!((reached(true) - cubic.at(x)).abs() < 1e-6, "{} {}", reached(true), cubic.at(x));
            assert!(cubic.at(x) <= cubic.peak && chord.at(x) <= chord.peak);
        }
    }

    #[test]
    fn the_bound_on_rounding_far_from_the_origin_holds_and_is_tight() {
        let (from, to) = (Vector3::new(1e8 / 3.0, -2e8 / 3.0, 0.1), Vector3::new(1e8 / 7.0, 1e8, 0.7));
        let line = Segment::straight(1.0, 4.0, from, to);
        let coefficients = vec![from, (to - from) / 3.0];
        let curve = Curve { from_s: 1.0, to_s: 4.0, coefficients, deviation: Deviation::default() };
        let over = Interval { from_s: 1.3, to_s: 3.1 };
        let (straight, curved) = (line.local(over), Segment::curved(curve.clone()).local(over));
        let mut largest = 0.0_f64;
        for k in 0..=100 {
            let u = f64::from(k) / 100.0;
            let places = [&straight, &curved].map(|local| local[0] + local[1] * u);
            let there = line.position(1.3 + 1.8 * u);
            largest = places.iter().map(|place| (place - there).amax()).fold(largest, f64::max);
        }
        for bound in [line.rounding(), Segment::curved(curve).rounding()] {
            assert!(0.0 < largest && largest <= bound && bound < 1e-6, "{largest} {bound}");
        }
    }

    #[test]
    fn a_clipped_segment_has_the_positions_of_the_whole_segment() {
        let line = Segment::straight(1.0, 3.0, Vector3::zeros(), Vector3::new(4.0, 0.0, 2.0));
        let part = line.clipped(Interval { from_s: 2.0, to_s: 9.0 }).unwrap();
        assert_eq!((part.from_s, part.to_s, part.from, part.to), (2.0, 3.0, Vector3::new(2.0, 0.0, 1.0), line.to));
        assert!(line.clipped(Interval { from_s: 3.5, to_s: 9.0 }).is_none());
        let parent = Segment::curved(curve(Deviation::default()));
        let part = parent.clipped(Interval { from_s: 10.5, to_s: 11.0 }).unwrap();
        assert_eq!(part.position(10.75), parent.position(10.75));
    }
}
