//! Motion of a vehicle over an interval of time: a [`Line`] between two samples, or a [`Curve`].

use std::sync::Arc;

use nalgebra::Vector3;

use super::double_double::{DoubleDouble, QUOTIENT};
use super::polynomial::{rescale, value};
use super::sweep::Interval;

/// What is known of a vehicle from one instant to a later one: a straight line between two points, or a [`Curve`].
///
/// A jump is a segment of no length whose ends differ, and a vehicle seen once is one whose ends do not.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
    /// Whether the vehicle counts as on the ground; `None` where that cannot be told.
    pub(super) grounded: Option<bool>,
    /// What it is a part of; `None` for a straight line between two samples.
    pub(super) whole: Option<Arc<Whole>>,
}

/// A motion that a segment is a part of.
#[derive(Clone, Debug)]
pub(super) enum Whole {
    /// A straight line between two samples: the ends of the part are rounded, and these are not.
    Line(Line),
    /// Where the segment is not a straight line known for certain.
    Curve(Curve),
}

/// The sum of `coefficients[k] (t - from_s)^k`, and how far the vehicle can be from it.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) coefficients: Vec<Vector3<f64>>,
    pub(super) deviation: Deviation,
}

/// How far a vehicle of bounded acceleration A can be from the curve drawn through two samples h apart, x being the
/// fraction of h that has passed.
///
/// Both bounds follow from Peano's form of the error, e(x) = h^2 * integral of K(x, s) p''(s) over s from 0 to 1, so that
/// |e(x)| <= A h^2 * integral of |K(x, s)|.
///
/// Samples of position alone are joined by the chord: K(x, s) is -s (1 - x) for s <= x and -x (1 - s) beyond, which
/// integrates to x (1 - x) / 2. At most A h^2 / 8, in the middle.
///
/// Samples of position and velocity are joined by the cubic of Hermite. For s > x
///
/// ```text
/// K(x, s) = -x^2 [(3 - 2 x) (1 - s) - (1 - x)]
/// ```
///
/// which changes its sign once, at 1 - s = (1 - x) / (3 - 2 x), and K(x, s) = K(1 - x, 1 - s) for s < x. With
/// y = 2 x - 1 the two integrals of |K| add up to (1 - y^2)^2 / (4 (4 - y^2)), which falls as |y| grows: at most
/// A h^2 / 16, in the middle. Half of what the chord allows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Deviation {
    /// The largest deviation, in the middle; 0 where the vehicle is on the curve.
    pub(super) peak: f64,
    /// Whether velocities shaped the curve.
    pub(super) hermite: bool,
}

impl Deviation {
    /// The largest deviation when a fraction `x` has passed.
    fn at(self, x: f64) -> f64 {
        let y = 2.0 * x.clamp(0.0, 1.0) - 1.0;
        let rest = (1.0 - y) * (1.0 + y);
        let of_chord = self.peak * rest;
        if self.hermite { of_chord * rest * 4.0 / (4.0 - y * y) } else { of_chord }
    }
}

impl Curve {
    /// Where the curve is at a time.
    pub(super) fn position(&self, time_s: f64) -> Vector3<f64> {
        value(&self.coefficients, time_s - self.from_s)
    }

    /// How far from there the vehicle can be.
    pub(super) fn deviation_at(&self, time_s: f64) -> f64 {
        self.deviation.at((time_s - self.from_s) / (self.to_s - self.from_s))
    }

    /// The curve over an interval as a polynomial of the fraction u of the interval.
    fn local(&self, over: Interval) -> Vec<Vector3<f64>> {
        let mut local = self.coefficients.clone();
        rescale(&mut local, over.from_s - self.from_s, over.to_s - over.from_s);
        local
    }

    /// Bound on the rounding of [`Curve::local`] and [`Curve::position`]: a few units in the last place of what is summed, and more
    /// where the coefficients are those of a cubic through positions and velocities, which are rounded themselves.
    pub(super) fn rounding(&self) -> f64 {
        let length = self.to_s - self.from_s;
        let magnitude = self.coefficients.iter().rev().fold(0.0, |sum, c| sum * length + c.norm());
        // Of a line: 7 u.
        let operations = match self.coefficients.len() {
            _ if self.deviation.hermite => 48.0,
            ..=2 => 4.0,
            count => 4.0 * count as f64,
        };
        operations * f64::EPSILON * magnitude
    }
}

impl Segment {
    /// A straight line.
    pub(super) fn straight(from_s: f64, to_s: f64, from: Vector3<f64>, to: Vector3<f64>) -> Self {
        Self { from_s, to_s, from, to, grounded: Some(false), whole: None }
    }

    /// A whole curve.
    pub(super) fn curved(curve: Curve) -> Self {
        let (from_s, to_s) = (curve.from_s, curve.to_s);
        let (from, to) = (curve.position(from_s), curve.position(to_s));
        Self { from_s, to_s, from, to, grounded: Some(false), whole: Some(Arc::new(Whole::Curve(curve))) }
    }

    /// The curve that it is a part of.
    #[inline]
    pub(super) fn curve(&self) -> Option<&Curve> {
        match self.whole.as_deref() {
            Some(Whole::Curve(curve)) => Some(curve),
            _ => None,
        }
    }

    /// The line between two samples that a straight segment is, or is a part of.
    #[inline]
    pub(super) fn line(&self) -> Line {
        match self.whole.as_deref() {
            Some(Whole::Line(line)) => *line,
            _ => Line { from_s: self.from_s, to_s: self.to_s, from: self.from, to: self.to },
        }
    }

    /// The part of a straight segment between two instants within it.
    fn part(&self, from_s: f64, to_s: f64) -> Self {
        let whole = self.whole.clone().or_else(|| Some(Arc::new(Whole::Line(self.line()))));
        let (from, to) = (self.position(from_s), self.position(to_s));
        Self { from_s, to_s, from, to, grounded: self.grounded, whole }
    }

    /// The part of it within an interval that it meets; a curve is left whole.
    pub(super) fn within(&self, over: Interval) -> Self {
        let (from_s, to_s) = (self.from_s.max(over.from_s), self.to_s.min(over.to_s));
        if self.curve().is_some() || self.to_s <= self.from_s || (from_s, to_s) == (self.from_s, self.to_s) {
            return self.clone();
        }
        self.part(from_s, to_s)
    }

    /// Whether the vehicle is at two places at one instant.
    pub(super) fn jumps(&self) -> bool {
        self.to_s <= self.from_s && self.from != self.to
    }

    /// How far the vehicle can be from the curve, anywhere on the segment.
    pub(super) fn deviation(&self) -> f64 {
        self.curve().map_or(0.0, |curve| curve.deviation.peak)
    }

    /// How far the vehicle can be from the curve at a time.
    pub(super) fn deviation_at(&self, time_s: f64) -> f64 {
        self.curve().map_or(0.0, |curve| curve.deviation_at(time_s))
    }

    /// Where the curve is at a time within the segment.
    #[inline]
    pub(super) fn position(&self, time_s: f64) -> Vector3<f64> {
        if time_s <= self.from_s {
            self.from
        } else if time_s >= self.to_s {
            self.to
        } else {
            match self.whole.as_deref() {
                Some(Whole::Curve(curve)) => curve.position(time_s),
                _ => self.line().about(time_s),
            }
        }
    }

    /// The part of the segment in an interval; `None` if there is none.
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

    /// The segment as a polynomial of the fraction u of an interval within it.
    pub(super) fn local(&self, over: Interval) -> Vec<Vector3<f64>> {
        match self.curve() {
            Some(curve) => curve.local(over),
            None if self.to_s <= self.from_s => vec![self.from, self.to - self.from],
            None => {
                let line = self.line();
                let rate = (over.to_s - over.from_s) / (line.to_s - line.from_s);
                vec![line.about(over.from_s), (line.to - line.from) * rate]
            }
        }
    }

    /// Bound on the rounding of positions, and of the ends of a part.
    pub(super) fn rounding(&self) -> f64 {
        match self.whole.as_deref() {
            Some(Whole::Curve(curve)) => curve.rounding(),
            _ => self.line().rounding(),
        }
    }
}

/// Error of an interpolated position, relative to the largest coordinate of its line: a quotient, a product of it, a sum, each
/// of three axes.
pub(super) const INTERPOLATION: f64 = 32.0 * QUOTIENT;

/// A vehicle on a straight line between two samples; a jump where they are at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Line {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
}

/// Where a vehicle is at an end of the shared time.
pub(super) enum Place {
    /// At a sample.
    Sample(Vector3<f64>),
    /// Between both.
    Between,
}

impl Line {
    /// The fraction that has passed at a time.
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

    /// The position at a time within the line, to within [`Line::rounding`].
    #[inline]
    pub(super) fn about(&self, time_s: f64) -> Vector3<f64> {
        self.from + (self.to - self.from) * self.fraction(time_s)
    }

    /// Bound on the rounding of [`Line::about`]: 4 eps of the way, and one of the place, for each coordinate.
    #[inline]
    pub(super) fn rounding(&self) -> f64 {
        8.0 * f64::EPSILON * (self.from.amax() + self.to.amax())
    }

    pub(super) fn place(&self, time_s: f64, is_end: bool) -> Place {
        let jumps = self.to_s <= self.from_s;
        if (jumps && !is_end) || (!jumps && time_s <= self.from_s) || self.from == self.to {
            Place::Sample(self.from)
        } else if jumps || time_s >= self.to_s {
            Place::Sample(self.to)
        } else {
            Place::Between
        }
    }

    /// The position within the line, to within [`INTERPOLATION`].
    pub(super) fn position(&self, time_s: f64) -> [DoubleDouble; 3] {
        let length = DoubleDouble::difference(self.to_s, self.from_s);
        let share = DoubleDouble::difference(time_s, self.from_s).over(length);
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
    fn a_part_of_a_curve_as_a_polynomial_of_its_fraction_is_the_same_curve() {
        let curve = curve(Deviation::default());
        let local = curve.local(Interval { from_s: 10.5, to_s: 11.75 });
        for u in [0.0, 0.2, 0.7, 1.0] {
            let there = local.iter().rev().fold(Vector3::zeros(), |sum, c| sum * u + c);
            assert!((there - curve.position(10.5 + 1.25 * u)).norm() < TOLERANCE);
        }
    }

    /// The motion of acceleration at most 1 that strays farthest at `x`: full thrust by the sign of Peano's kernel, found
    /// here by brute force over the time s at which each half changes its direction.
    #[test]
    fn the_deviation_from_chord_and_cubic_is_reached_by_some_motion_and_never_exceeded() {
        const CELLS: u32 = 4000;
        let cell = 1.0 / f64::from(CELLS);
        for x in [0.1, 0.25, 0.5, 0.8] {
            // p = (x - s)+ is the answer to an impulse of acceleration at s; what interpolation misses of it is K(x, s).
            let missed = |s: f64, with_velocity: bool| {
                let answer = (x - s).max(0.0);
                let drawn =
                    if with_velocity { (3.0 - 2.0 * x) * x * x * (1.0 - s) + x * x * (x - 1.0) } else { x * (1.0 - s) };
                answer - drawn
            };
            let reached = |with_velocity| {
                (0..CELLS).map(|k| missed((f64::from(k) + 0.5) * cell, with_velocity).abs() * cell).sum::<f64>()
            };
            let chord = Deviation { peak: 1.0 / 8.0, hermite: false };
            let cubic = Deviation { peak: 1.0 / 16.0, hermite: true };
            assert!((reached(false) - chord.at(x)).abs() < 1e-6, "{} {}", reached(false), chord.at(x));
            assert!((reached(true) - cubic.at(x)).abs() < 1e-6, "{} {}", reached(true), cubic.at(x));
            assert!(cubic.at(x) <= cubic.peak && chord.at(x) <= chord.peak);
        }
    }

    #[test]
    fn rounding_far_from_the_origin_is_bounded_and_by_no_more_than_it_takes() {
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
    fn a_clipped_segment_is_where_the_whole_one_is() {
        let line = Segment::straight(1.0, 3.0, Vector3::zeros(), Vector3::new(4.0, 0.0, 2.0));
        let part = line.clipped(Interval { from_s: 2.0, to_s: 9.0 }).unwrap();
        assert_eq!((part.from_s, part.to_s, part.from, part.to), (2.0, 3.0, Vector3::new(2.0, 0.0, 1.0), line.to));
        assert!(line.clipped(Interval { from_s: 3.5, to_s: 9.0 }).is_none());
        let whole = Segment::curved(curve(Deviation::default()));
        let part = whole.clipped(Interval { from_s: 10.5, to_s: 11.0 }).unwrap();
        assert_eq!(part.position(10.75), whole.position(10.75));
    }
}
