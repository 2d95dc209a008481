//! State of a swarm: position and velocity of every vehicle.
//!
//! A row is a vehicle and a column is an axis, so each axis is contiguous in memory. Lengths are metres, times seconds,
//! in one inertial frame with z up. Vehicles count from 0 in code and from 1 in all output.

use std::fmt;

use nalgebra::{MatrixXx3, Vector3};
use serde::{Deserialize, Serialize};

/// N x 3 table of vectors, a row \[x, y, z\] per vehicle.
pub type Rows = MatrixXx3<f64>;

/// Positions \[m\] and velocities \[m/s\] of N vehicles.
#[derive(Clone, Debug, PartialEq)]
pub struct Swarm {
    /// N x 3 positions \[m\].
    pub positions_m: Rows,
    /// N x 3 velocities \[m/s\].
    pub velocities_m_s: Rows,
}

impl Swarm {
    /// Returns a swarm at rest at the given positions \[m\].
    #[must_use]
    pub fn at_rest(positions_m: Rows) -> Self {
        let velocities_m_s = Rows::zeros(positions_m.nrows());
        Self { positions_m, velocities_m_s }
    }

    /// Copies the state of `other` without allocation.
    ///
    /// # Panics
    /// If the two swarms have different numbers of vehicles.
    pub fn copy_from(&mut self, other: &Self) {
        self.positions_m.copy_from(&other.positions_m);
        self.velocities_m_s.copy_from(&other.velocities_m_s);
    }

    /// Returns the number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.positions_m.nrows()
    }

    /// Returns the mean velocity \[m/s\], zero for an empty swarm.
    #[must_use]
    pub fn mean_velocity_m_s(&self) -> Vector3<f64> {
        mean_row(&self.velocities_m_s)
    }

    /// Returns the largest speed of a vehicle relative to the mean velocity of the swarm \[m/s\].
    #[must_use]
    pub fn disagreement_m_s(&self) -> f64 {
        let mean = self.mean_velocity_m_s();
        (0..self.count()).map(|i| (row(&self.velocities_m_s, i) - mean).norm()).fold(0.0, f64::max)
    }

    /// Returns the first vehicle with a position or velocity that is not a finite number.
    #[must_use]
    pub fn first_not_finite(&self) -> Option<usize> {
        first_row_not_finite(&self.positions_m).into_iter().chain(first_row_not_finite(&self.velocities_m_s)).min()
    }
}

/// Returns row `i` as a vector.
#[inline]
#[must_use]
pub fn row(rows: &Rows, i: usize) -> Vector3<f64> {
    Vector3::new(rows[(i, 0)], rows[(i, 1)], rows[(i, 2)])
}

/// Writes a vector into row `i`.
#[inline]
pub fn set_row(rows: &mut Rows, i: usize, v: Vector3<f64>) {
    (rows[(i, 0)], rows[(i, 1)], rows[(i, 2)]) = (v.x, v.y, v.z);
}

/// Returns the columns x, y and z, each with one number per vehicle.
#[inline]
#[must_use]
pub fn columns(rows: &Rows) -> [&[f64]; 3] {
    let (x, rest) = rows.as_slice().split_at(rows.nrows());
    let (y, z) = rest.split_at(rows.nrows());
    [x, y, z]
}

/// Returns the columns x, y and z for writing.
#[inline]
#[must_use]
pub fn columns_mut(rows: &mut Rows) -> [&mut [f64]; 3] {
    let count = rows.nrows();
    let (x, rest) = rows.as_mut_slice().split_at_mut(count);
    let (y, z) = rest.split_at_mut(count);
    [x, y, z]
}

/// Returns the distance between rows `i` and `j` of a table of positions \[m\].
#[inline]
#[must_use]
pub fn separation(positions_m: &Rows, i: usize, j: usize) -> f64 {
    (row(positions_m, j) - row(positions_m, i)).norm()
}

/// Returns the mean of all rows, zero for an empty table.
#[must_use]
pub fn mean_row(rows: &Rows) -> Vector3<f64> {
    let n = rows.nrows().max(1) as f64;
    Vector3::new(rows.column(0).sum() / n, rows.column(1).sum() / n, rows.column(2).sum() / n)
}

/// Returns the largest Euclidean norm of a row: 0 for an empty table, NaN if a component is NaN.
#[must_use]
pub fn largest_row_norm(rows: &Rows) -> f64 {
    let squares = (0..rows.nrows()).map(|i| row(rows, i).norm_squared());
    squares.fold(0.0, |a: f64, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }).sqrt()
}

/// Returns the first row with a number that is not finite.
#[must_use]
pub fn first_row_not_finite(rows: &Rows) -> Option<usize> {
    first_row_beyond(rows, f64::MAX)
}

/// Returns the first row with a number whose absolute value exceeds `limit` or that is not finite.
#[must_use]
pub fn first_row_beyond(rows: &Rows, limit: f64) -> Option<usize> {
    let is_within = |x: &f64| x.abs() <= limit;
    // A fold without branches lets the compiler vectorize the comparison.
    let are_within = |some: &[f64]| some.iter().fold(true, |all, x| all & is_within(x));
    if rows.as_slice().chunks(256).all(are_within) {
        return None;
    }
    (0..rows.nrows()).find(|&i| !rows.row(i).iter().all(is_within))
}

/// Two different vehicles, the lower index first. Displayed with numbers from 1 as `2-3`, and in JSON as `[2, 3]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "[usize; 2]", try_from = "[usize; 2]")]
pub struct Pair {
    first: usize,
    second: usize,
}

impl Pair {
    /// Returns the pair of vehicles `i` and `j` (from 0), in either order.
    ///
    /// # Panics
    /// If `i == j`.
    #[must_use]
    pub fn new(i: usize, j: usize) -> Self {
        assert_ne!(i, j, "a pair needs two different vehicles");
        Self { first: i.min(j), second: i.max(j) }
    }

    /// Returns the lower index, from 0.
    #[must_use]
    pub fn first(self) -> usize {
        self.first
    }

    /// Returns the higher index, from 0.
    #[must_use]
    pub fn second(self) -> usize {
        self.second
    }

    /// Returns both vehicle numbers, from 1.
    #[must_use]
    pub fn numbers(self) -> [usize; 2] {
        [self.first + 1, self.second + 1]
    }
}

impl From<Pair> for [usize; 2] {
    fn from(pair: Pair) -> Self {
        pair.numbers()
    }
}

/// Accepts vehicle numbers from 1.
impl TryFrom<[usize; 2]> for Pair {
    type Error = &'static str;

    fn try_from([first, second]: [usize; 2]) -> Result<Self, Self::Error> {
        if first == second || first == 0 || second == 0 {
            return Err("a pair needs two different vehicles, counted from 1");
        }
        Ok(Self::new(first - 1, second - 1))
    }
}

/// Writes `4-5`, and `4 and 5` with the flag `#`.
impl fmt::Display for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let between = if f.alternate() { " and " } else { "-" };
        write!(f, "{}{between}{}", self.first + 1, self.second + 1)
    }
}

/// Collision of two hulls.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounce {
    /// The two vehicles.
    pub pair: Pair,
    /// Start of the step in which they collided \[s\].
    pub time_s: f64,
    /// Closing speed of their centres before the collision \[m/s\].
    pub closing_m_s: f64,
}

/// Closest approach of a pair of vehicles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestApproach {
    /// The pair.
    pub pair: Pair,
    /// Distance between the two centres \[m\].
    pub separation_m: f64,
    /// Time \[s\].
    pub time_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disagreement_ignores_the_common_velocity() {
        let mut swarm = Swarm::at_rest(Rows::zeros(2));
        set_row(&mut swarm.velocities_m_s, 0, Vector3::new(11.0, 0.0, 0.0));
        set_row(&mut swarm.velocities_m_s, 1, Vector3::new(9.0, 0.0, 0.0));
        assert_eq!(swarm.disagreement_m_s(), 1.0);
        assert_eq!(swarm.mean_velocity_m_s(), Vector3::new(10.0, 0.0, 0.0));
    }

    #[test]
    fn the_first_vehicle_that_is_not_finite_is_named() {
        let mut swarm = Swarm::at_rest(Rows::zeros(3));
        assert_eq!(swarm.first_not_finite(), None);
        swarm.velocities_m_s[(1, 2)] = f64::NAN;
        swarm.positions_m[(2, 0)] = f64::INFINITY;
        assert_eq!(swarm.first_not_finite(), Some(1));
        // Wherever it is among many, and whatever is not finite.
        for (row, axis) in [(0, 0), (255, 0), (256, 0), (99, 1), (299, 2)] {
            for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut rows = Rows::from_element(300, f64::MAX);
                assert_eq!(first_row_not_finite(&rows), None);
                rows[(row, axis)] = number;
                assert_eq!(first_row_not_finite(&rows), Some(row));
            }
        }
        assert_eq!(first_row_not_finite(&Rows::zeros(0)), None);
        let mut rows = Rows::from_element(300, -1e30);
        assert_eq!(first_row_beyond(&rows, 1e30), None);
        for number in [-1.1e30, f64::NAN] {
            rows[(256, 2)] = number;
            assert_eq!(first_row_beyond(&rows, 1e30), Some(256));
        }
    }

    #[test]
    fn a_pair_is_ordered_and_shown_from_one() {
        let pair = Pair::new(2, 1);
        assert_eq!((pair.first(), pair.second(), pair.numbers()), (1, 2, [2, 3]));
        assert_eq!(pair.to_string(), "2-3");
    }
}
