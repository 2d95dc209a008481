//! The closest pair.

use tautline_core::swarm::{Pair, Rows, first_row_not_finite, separation};

/// The two nearest rows of a table of positions and their distance \[m\]; the first such pair in index order, and none
/// for fewer than two rows or where a number is not finite.
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

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            20 => (0..6_i32).prop_map(f64::from),
            10 => -4.0..4.0,
            1 => prop::sample::select(vec![1e300, -1e300, f64::INFINITY, f64::NAN]),
        ]
    }

    proptest! {
        #[test]
        fn the_closest_pair_is_that_of_the_full_search(
            points in prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..30),
        ) {
            let positions_m = Rows::from_row_slice(&points.concat());
            let distances = (0..points.len()).flat_map(|i| (i + 1..points.len()).map(move |j| Pair::new(i, j)));
            let distances = distances.map(|pair| (separation(&positions_m, pair.first(), pair.second()), pair));
            let is_finite = points.iter().flatten().all(|x| x.is_finite());
            let expected = distances.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).filter(|_| is_finite).map(|(distance_m, pair)| (pair, distance_m));
            prop_assert_eq!(closest_pair(&positions_m), expected);
        }
    }

    #[test]
    fn the_closest_pair_of_less_than_two_or_not_finite_positions_is_none() {
        let rows = |points: &[[f64; 3]]| Rows::from_row_slice(&points.concat());
        assert_eq!(closest_pair(&Rows::zeros(1)), None);
        assert_eq!(closest_pair(&rows(&[[0.0; 3], [f64::NAN; 3], [1.0; 3]])), None);
        assert_eq!(closest_pair(&rows(&[[2.0; 3], [1.0; 3], [2.0; 3]])), Some((Pair::new(0, 2), 0.0)));
    }
}
