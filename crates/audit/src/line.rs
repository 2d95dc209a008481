//! A straight line between two samples.

use nalgebra::Vector3;

use super::double_double::{DoubleDouble, QUOTIENT};

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
