//! Point sets with a minimum spacing, and the closest pair of a table.

use std::collections::HashMap;

use nalgebra::Vector3;

use tautline_core::swarm::{Pair, Rows, first_row_not_finite, separation};

/// Set of points in which every two are farther apart than a given distance. Insertion takes constant time.
///
/// Points lie in cubic cells of twice the distance. Points within the distance are therefore in the same or adjacent
/// cells, rounding of the cell number included. A cell holds few points because of the spacing.
#[derive(Clone, Debug)]
pub struct SpacedPoints {
    distance_m: f64,
    cells: HashMap<[i64; 3], Vec<(usize, Vector3<f64>)>>,
    count: usize,
}

impl SpacedPoints {
    /// Creates an empty set; `distance_m` must be positive.
    #[must_use]
    pub fn new(distance_m: f64) -> Self {
        Self { distance_m, cells: HashMap::new(), count: 0 }
    }

    /// Adds a point, unless an earlier one is at the distance or nearer. Points are numbered from 0 in order of
    /// insertion.
    ///
    /// # Errors
    /// Returns the lowest such point and its separation \[m\]; the new point is not added.
    pub fn insert(&mut self, point: Vector3<f64>) -> Result<(), (usize, f64)> {
        let cell = self.cell(point);
        let mut nearest: Option<(usize, f64)> = None;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    let neighbour = [cell[0] + dx, cell[1] + dy, cell[2] + dz];
                    for &(other, position) in self.cells.get(&neighbour).into_iter().flatten() {
                        let separation_m = (point - position).norm();
                        if separation_m <= self.distance_m && nearest.is_none_or(|(lowest, _)| other < lowest) {
                            nearest = Some((other, separation_m));
                        }
                    }
                }
            }
        }
        if let Some(near) = nearest {
            return Err(near);
        }
        self.cells.entry(cell).or_default().push((self.count, point));
        self.count += 1;
        Ok(())
    }

    /// Returns the cell of a point; coordinates beyond 2^62 cells share the last one.
    fn cell(&self, point: Vector3<f64>) -> [i64; 3] {
        const LAST: f64 = (1_i64 << 62) as f64;
        #[expect(clippy::cast_possible_truncation, reason = "clamped to what an i64 holds")]
        let number = |x: f64| (x / (2.0 * self.distance_m)).floor().clamp(-LAST, LAST) as i64;
        [number(point.x), number(point.y), number(point.z)]
    }
}

/// Returns the two nearest rows of a table of positions and their distance \[m\]. Ties go to the first pair in index
/// order. `None` for fewer than two rows or a value that is not finite.
///
/// Sweeps along the axis of the greatest extent: O(N log N) for spread-out positions, O(N^2) at worst.
#[must_use]
pub fn closest_pair(positions_m: &Rows) -> Option<(Pair, f64)> {
    if positions_m.nrows() < 2 || first_row_not_finite(positions_m).is_some() {
        return None;
    }
    let extent = |axis: &usize| {
        let column = positions_m.column(*axis);
        column.max() / 2.0 - column.min() / 2.0
    };
    let axis = (0..3).max_by(|a, b| extent(a).total_cmp(&extent(b)))?;
    let along = positions_m.column(axis);
    let mut order: Vec<_> = (0..positions_m.nrows()).collect();
    order.sort_by(|&i, &j| along[i].total_cmp(&along[j]));

    let mut closest: Option<(Pair, f64)> = None;
    for (place, &i) in order.iter().enumerate() {
        for &j in &order[place + 1..] {
            if closest.is_some_and(|(_, distance)| along[j] - along[i] > distance) {
                break;
            }
            let found = (Pair::new(i, j), separation(positions_m, i, j));
            if closest.is_none_or(|best| (found.1, found.0) < (best.1, best.0)) {
                closest = Some(found);
            }
        }
    }
    closest
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_point_at_the_minimum_spacing_is_rejected() {
        let mut spaced = SpacedPoints::new(2.0);
        assert_eq!(spaced.insert(Vector3::zeros()), Ok(()));
        assert_eq!(spaced.insert(Vector3::new(2.0, 0.0, 0.0)), Err((0, 2.0)));
        assert_eq!(spaced.insert(Vector3::new(2.0_f64.next_up(), 0.0, 0.0)), Ok(()));
    }

    proptest! {
        #[test]
        fn cells_find_the_same_pairs_as_a_full_search(
            points in prop::collection::vec([-3.0..3.0, -3.0..3.0, -0.5..0.5], 1..40),
            distance_m in 0.05..1.5,
            far in prop::sample::select(vec![0.0, 1e3, -1e9]),
        ) {
            let points: Vec<_> = points.iter().map(|&[x, y, z]| Vector3::new(x + far, y, z)).collect();
            let mut spaced = SpacedPoints::new(distance_m);
            let found = points.iter().enumerate().find_map(|(j, &p)| spaced.insert(p).err().map(|(i, l)| (i, j, l)));
            let expected = points.iter().enumerate().find_map(|(j, &p)| {
                let near = |&i: &usize| (p - points[i]).norm() <= distance_m;
                (0..j).find(near).map(|i| (i, j, (p - points[i]).norm()))
            });
            prop_assert_eq!(found, expected);
        }
    }

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            20 => (0..6_i32).prop_map(f64::from),
            10 => -4.0..4.0,
            1 => prop::sample::select(vec![1e300, -1e300, f64::INFINITY, f64::NAN]),
        ]
    }

    proptest! {
        #[test]
        fn the_closest_pair_matches_a_full_search(
            points in prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..30),
        ) {
            let positions_m = Rows::from_row_slice(&points.concat());
            let distances = (0..points.len()).flat_map(|i| (i + 1..points.len()).map(move |j| Pair::new(i, j)));
            let distances = distances.map(|pair| (separation(&positions_m, pair.first(), pair.second()), pair));
            let is_finite = points.iter().flatten().all(|x| x.is_finite());
            let least = distances.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).filter(|_| is_finite);
            let expected = least.map(|(distance_m, pair)| (pair, distance_m));
            prop_assert_eq!(closest_pair(&positions_m), expected);
        }
    }

    #[test]
    fn the_closest_pair_needs_two_finite_positions() {
        let rows = |points: &[[f64; 3]]| Rows::from_row_slice(&points.concat());
        assert_eq!(closest_pair(&Rows::zeros(1)), None);
        assert_eq!(closest_pair(&rows(&[[0.0; 3], [f64::NAN; 3], [1.0; 3]])), None);
        assert_eq!(closest_pair(&rows(&[[2.0; 3], [1.0; 3], [2.0; 3]])), Some((Pair::new(0, 2), 0.0)));
    }
}
