//! Scaled lengths in which keep-out ellipsoids are balls.

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row, set_row};

/// Scaled lengths `l = |S (p_i - p_j)|` with S = diag(1, 1, 1/ratio). The keep-out region of each vehicle is an upright
/// ellipsoid, `ratio` times as high as it is wide. Two of them touch where l is their common width. With a ratio of 1
/// they are balls, and lengths are metres.
///
/// A force from a potential V(l) is `-V'(l) S^2 (p_i - p_j)/l`, the negative gradient of V. With S in place of `S^2`
/// the force would not be a gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metric {
    ratio: f64,
}

impl Default for Metric {
    /// Returns the metric in metres (ratio 1).
    fn default() -> Self {
        Self { ratio: 1.0 }
    }
}

impl Metric {
    /// Creates the metric of ellipsoids with this ratio of height to width, a positive finite number.
    #[must_use]
    pub fn of_ratio(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Returns height over width.
    #[must_use]
    pub fn ratio(self) -> f64 {
        self.ratio
    }

    /// Whether scaled lengths are metres.
    #[must_use]
    pub fn is_metres(self) -> bool {
        self.ratio == 1.0
    }

    /// Returns `S v`.
    #[must_use]
    pub fn scaled(self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(v.x, v.y, v.z / self.ratio)
    }

    /// Writes `S` times every row into `scaled`.
    pub fn scale(self, rows: &Rows, scaled: &mut Rows) {
        scaled.clone_from(rows);
        if !self.is_metres() {
            scaled.column_mut(2).iter_mut().for_each(|z| *z /= self.ratio);
        }
    }

    /// Returns `S` times every row.
    #[must_use]
    pub fn scaled_rows(self, rows: &Rows) -> Rows {
        let mut scaled = rows.clone();
        (0..rows.nrows()).for_each(|i| set_row(&mut scaled, i, self.scaled(row(rows, i))));
        scaled
    }

    /// Returns the largest distance in metres of a scaled length.
    #[must_use]
    pub fn longest_m(self, length: f64) -> f64 {
        length * self.ratio.max(1.0)
    }

    /// Returns the largest scaled length of a distance in metres.
    #[must_use]
    pub fn most_scaled(self, length_m: f64) -> f64 {
        length_m / self.ratio.min(1.0)
    }

    /// Returns the smallest distance in metres of a scaled length.
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
