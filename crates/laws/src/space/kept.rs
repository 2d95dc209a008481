//! Near pairs that are kept while points move little.

use std::ops::Range;

use super::near::NearPairs;
use tautline_core::swarm::{Rows, columns};

/// How much farther than the range is searched, as a part of the range: points may move half of that before a pair can be
/// missing.
const SKIN: f64 = 0.3;
/// Rounding of distances, as a part of the range.
const ROUNDING: f64 = 1e-9;
/// Points that are looked at together, without a branch for each.
const SIDE_BY_SIDE: usize = 128;

/// The pairs of points within a range of each other, and some that are up to 30 % farther apart.
///
/// They are searched anew only where a point has moved so far since the last search that a pair could be missing, so most
/// updates take O(N). Nothing is allocated once the lists have grown.
#[derive(Clone, Debug)]
pub struct KeptPairs {
    near: NearPairs,
    /// Where the points were when they were searched last, and within which range \[m\].
    searched_m: Rows,
    range_m: f64,
}

impl Default for KeptPairs {
    fn default() -> Self {
        Self { near: NearPairs::default(), searched_m: Rows::zeros(0), range_m: f64::NAN }
    }
}

impl KeptPairs {
    /// The pairs `(i, j)`, i < j, in ascending order: all that are within the range, and some that are a little farther.
    #[must_use]
    pub fn pairs(&self) -> &[(usize, usize)] {
        self.near.pairs()
    }

    /// Sees to it that every pair of rows whose separation is at most `range_m` \[m\] is there.
    pub fn update(&mut self, positions_m: &Rows, range_m: f64) {
        if !self.holds(positions_m, range_m) {
            self.near.update(positions_m, (1.0 + SKIN) * range_m);
            self.searched_m.clone_from(positions_m);
            self.range_m = range_m;
        }
    }

    /// Whether no pair can be missing: not where a number is none.
    fn holds(&self, positions_m: &Rows, range_m: f64) -> bool {
        let (count, free_m) = (positions_m.nrows(), (0.5 * SKIN - ROUNDING) * range_m);
        self.range_m == range_m
            && self.searched_m.nrows() == count
            && (0..count)
                .step_by(SIDE_BY_SIDE)
                .all(|first| self.stay_within(free_m, positions_m, first..count.min(first + SIDE_BY_SIDE)))
    }

    /// Whether these points, at most [`SIDE_BY_SIDE`], are no farther than that from where they were searched.
    fn stay_within(&self, free_m: f64, positions_m: &Rows, points: Range<usize>) -> bool {
        let mut squares_m2 = [0.0; SIDE_BY_SIDE];
        for (now_m, searched_m) in columns(positions_m).into_iter().zip(columns(&self.searched_m)) {
            let moved_m = now_m[points.clone()].iter().zip(&searched_m[points.clone()]).map(|(now, then)| now - then);
            squares_m2.iter_mut().zip(moved_m).for_each(|(square, moved)| *square += moved * moved);
        }
        squares_m2.iter().filter(|&&square_m2| square_m2 <= free_m * free_m).count() == SIDE_BY_SIDE
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use tautline_core::swarm::separation;

    proptest! {
        #[test]
        fn no_pair_within_the_range_is_ever_missing(
            start in prop::collection::vec(-4.0..4.0_f64, 90),
            steps in prop::collection::vec((prop::collection::vec(-1.0..1.0_f64, 90), 0.01..0.6_f64), 1..12),
            ranges_m in prop::collection::vec(prop::sample::select(vec![0.5, 1.5, 1.5, 1.5]), 12),
        ) {
            let mut kept = KeptPairs::default();
            let mut positions_m = Rows::from_column_slice(&start);
            for ((step, scale), range_m) in steps.into_iter().zip(ranges_m) {
                positions_m += Rows::from_column_slice(&step) * scale;
                kept.update(&positions_m, range_m);
                for i in 0..30 {
                    for j in i + 1..30 {
                        let is_near = separation(&positions_m, i, j) <= range_m;
                        prop_assert!(!is_near || kept.pairs().contains(&(i, j)));
                    }
                }
                prop_assert!(kept.pairs().is_sorted());
            }
        }
    }

    #[test]
    fn points_that_move_little_are_not_searched_anew_and_what_is_no_number_is() {
        let mut kept = KeptPairs::default();
        let mut positions_m = Rows::from_row_slice(&[0.0, 0.0, 0.0, 1.2, 0.0, 0.0]);
        kept.update(&positions_m, 1.0);
        assert_eq!(kept.pairs(), [(0, 1)], "it is within the skin");
        positions_m[(1, 0)] = 1.34;
        kept.update(&positions_m, 1.0);
        assert_eq!(kept.pairs(), [(0, 1)], "and still there");
        positions_m[(1, 0)] = 1.36;
        kept.update(&positions_m, 1.0);
        assert_eq!(kept.pairs(), []);
        positions_m[(1, 0)] = f64::NAN;
        assert!(!kept.holds(&positions_m, 1.0));
    }
}
