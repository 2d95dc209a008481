//! Lengths in which the safe sets of vehicles are balls.

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row, set_row};

/// Scaled lengths `l = |S (p_i - p_j)|` with S = diag(1, 1, 1/ratio): around each vehicle lies an upright ellipsoid, `ratio` times
/// as high as it is wide, and two of them touch where l is their common width. With a ratio of 1 they are balls, and lengths
/// are metres.
///
/// A force from a potential V(l) is `-V'(l) S^2 (p_i - p_j)/l`: its work is what V loses. With S in the place of `S^2` it would
/// be no gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metric {
    ratio: f64,
}

impl Default for Metric {
    /// Metres.
    fn default() -> Self {
        Self { ratio: 1.0 }
    }
}

impl Metric {
    /// Of ellipsoids so many times as high as they are wide: a positive finite number.
    #[must_use]
    pub fn of_ratio(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Height over width.
    #[must_use]
    pub fn ratio(self) -> f64 {
        self.ratio
    }

    /// Whether lengths are metres.
    #[must_use]
    pub fn is_metres(self) -> bool {
        self.ratio == 1.0
    }

    /// `S v`.
    #[must_use]
    pub fn scaled(self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(v.x, v.y, v.z / self.ratio)
    }

    /// `S` of every row.
    pub fn scale(self, rows: &Rows, scaled: &mut Rows) {
        scaled.clone_from(rows);
        if !self.is_metres() {
            scaled.column_mut(2).iter_mut().for_each(|z| *z /= self.ratio);
        }
    }

    /// `S` of every row.
    #[must_use]
    pub fn scaled_rows(self, rows: &Rows) -> Rows {
        let mut scaled = rows.clone();
        (0..rows.nrows()).for_each(|i| set_row(&mut scaled, i, self.scaled(row(rows, i))));
        scaled
    }

    /// The most metres that a scaled length may be.
    #[must_use]
    pub fn longest_m(self, length: f64) -> f64 {
        length * self.ratio.max(1.0)
    }

    /// The most that so many metres may be in scaled lengths.
    #[must_use]
    pub fn most_scaled(self, length_m: f64) -> f64 {
        length_m / self.ratio.min(1.0)
    }

    /// The fewest metres that a scaled length may be.
    #[must_use]
    pub fn shortest_m(self, length: f64) -> f64 {
        length * self.ratio.min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ellipsoids_touch_at_a_scaled_length_of_their_width() {
        let metric = Metric::of_ratio(3.0);
        let width = 0.25;
        for touching in [Vector3::new(0.25, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.75), Vector3::new(0.15, 0.0, 0.6)] {
            assert!((metric.scaled(touching).norm() - width).abs() < 1e-15);
            assert!((metric.shortest_m(width)..=metric.longest_m(width)).contains(&touching.norm()));
        }
        let rows = Rows::from_row_slice(&[1.0, 2.0, 3.0, -4.0, 5.0, -6.0]);
        let mut scaled = Rows::zeros(0);
        metric.scale(&rows, &mut scaled);
        assert_eq!((&scaled, row(&scaled, 1)), (&metric.scaled_rows(&rows), Vector3::new(-4.0, 5.0, -2.0)));
        let flat = Metric::of_ratio(0.5);
        assert_eq!((flat.longest_m(2.0), flat.shortest_m(2.0)), (2.0, 1.0));
        assert!(Metric::default().is_metres() && Metric::default().scaled_rows(&rows) == rows);
    }
}
