//! Search of pairs within a range, by sorted cells.

use std::ops::{ControlFlow, Range};

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, columns, row};

/// Bits of a cell number along one axis.
const BITS: u32 = 21;
/// Largest number of cells along an axis, so that their numbers and those of adjacent cells fit in [`BITS`].
const MOST_CELLS: f64 = (1_u64 << (BITS - 1)) as f64;
/// Ratio of cell size to range: exceeds the rounding of up to [`MOST_CELLS`] cells, so that points within the range are
/// in the same or adjacent cells.
const CELL_MARGIN: f64 = 1.0 + 1e-6;
/// Factor for the comparison of squared distances: exceeds the rounding of a square.
const SQUARE_MARGIN: f64 = 1.0 + 1e-12;
const ALONG_Y: u64 = 1 << BITS;
const ALONG_Z: u64 = 1 << (2 * BITS);
/// Offsets from a cell to the later rows of cells that touch it.
const LATER_ROWS: [u64; 4] = [ALONG_Y, ALONG_Z - ALONG_Y, ALONG_Z, ALONG_Z + ALONG_Y];

/// Search of the pairs of points within a range of each other.
///
/// Points are sorted by cell, and cells are as wide as the range. The points near a given point are therefore in five
/// contiguous runs, which move on with the point. A search takes O(N log N + pairs) for spread-out points, and
/// allocates nothing once its lists have grown.
#[derive(Clone, Debug, Default)]
pub struct CellList {
    cells: Vec<(u64, usize)>,
    points: Vec<Vector3<f64>>,
    found: Vec<(usize, usize)>,
    /// End of the pairs of each point in `pairs`.
    ends: Vec<usize>,
    pairs: Vec<(usize, usize)>,
}

impl CellList {
    /// Returns the pairs `(i, j)` of the last search, i < j, in ascending order.
    #[must_use]
    pub fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }

    /// Finds every pair of rows whose [separation](tautline_core::swarm::separation) is at most `range_m` \[m\]. A row
    /// that is not finite is in no pair.
    pub fn update(&mut self, positions_m: &Rows, range_m: f64) {
        let mut found = std::mem::take(&mut self.found);
        found.clear();
        let _ = self.search(positions_m, range_m, |i, j, _| {
            found.push((i, j));
            ControlFlow::Continue(())
        });
        self.found = found;
        self.order(positions_m.nrows());
    }

    /// Calls `visit` for each pair of [`CellList::update`], in any order, until it breaks. Returns whether it did. The
    /// arguments are i < j and the square of the distance \[m^2\]. [`CellList::pairs`] remains unchanged.
    pub fn search(
        &mut self,
        positions_m: &Rows,
        range_m: f64,
        visit: impl FnMut(usize, usize, f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.sort(positions_m, range_m);
        self.sweep(range_m, visit)
    }

    /// Sorts the finite points by cell, and within a cell by index.
    fn sort(&mut self, positions_m: &Rows, range_m: f64) {
        let finite = || (0..positions_m.nrows()).map(|i| (i, row(positions_m, i))).filter(|(_, p)| is_finite(p));
        let none = Vector3::repeat(f64::INFINITY);
        let (low, high) = finite().fold((none, -none), |(low, high), (_, p)| (low.inf(&p), high.sup(&p)));
        let cell_m = (range_m * CELL_MARGIN).max((high - low).max() / MOST_CELLS);
        // With a cell width of 0 or infinity all points are in one cell.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most MOST_CELLS, and from 1")]
        let number = |offset_m: f64| (offset_m / cell_m) as u64 + 1;
        self.cells.clear();
        self.cells.extend(finite().map(|(i, p)| {
            let [x, y, z] = (p - low).map(number).into();
            (x + y * ALONG_Y + z * ALONG_Z, i)
        }));
        self.cells.sort_unstable();
        self.points.clear();
        self.points.extend(self.cells.iter().map(|&(_, i)| row(positions_m, i)));
    }

    /// Compares each point with later points in its own row of cells and in the four later rows that touch its cell.
    fn sweep(&self, range_m: f64, mut visit: impl FnMut(usize, usize, f64) -> ControlFlow<()>) -> ControlFlow<()> {
        let Self { cells, points, .. } = self;
        let squared = range_m * range_m * SQUARE_MARGIN;
        let mut starts = [0; LATER_ROWS.len()];
        for (place, (&(cell, i), &point)) in cells.iter().zip(points.iter()).enumerate() {
            let mut compare = |from: usize, last_cell: u64| {
                for (&(other, j), &position) in cells[from..].iter().zip(&points[from..]) {
                    if other > last_cell {
                        break;
                    }
                    let apart = (position - point).norm_squared();
                    if apart <= squared && apart.sqrt() <= range_m {
                        visit(i.min(j), i.max(j), apart)?;
                    }
                }
                ControlFlow::Continue(())
            };
            compare(place + 1, cell + 1)?;
            for (start, row) in starts.iter_mut().zip(LATER_ROWS) {
                let first_cell = cell + row - 1;
                *start += cells[*start..].iter().take_while(|(other, _)| *other < first_cell).count();
                compare(*start, first_cell + 2)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Sorts the found pairs by counting.
    fn order(&mut self, count: usize) {
        let Self { found, ends, pairs, .. } = self;
        ends.clear();
        ends.resize(count + 1, 0);
        for &(i, _) in found.iter() {
            ends[i + 1] += 1;
        }
        for i in 0..count {
            ends[i + 1] += ends[i];
        }
        pairs.clear();
        pairs.resize(found.len(), (0, 0));
        for &pair in found.iter() {
            pairs[ends[pair.0]] = pair;
            ends[pair.0] += 1;
        }
        let mut start = 0;
        for &end in &ends[..count] {
            pairs[start..end].sort_unstable();
            start = end;
        }
    }
}

fn is_finite(point: &Vector3<f64>) -> bool {
    point.iter().all(|x| x.is_finite())
}

/// Additional search range, as a fraction of the range. Points may move half of it before a pair can be missing.
const SKIN: f64 = 0.3;
/// Rounding of distances, as a fraction of the range.
const ROUNDING: f64 = 1e-9;
/// Number of points compared together without branches.
const SIDE_BY_SIDE: usize = 128;

/// Pairs of points within a range of each other, and some pairs that are up to 30 % farther apart.
///
/// The search is repeated only if a point has moved so far that a pair could be missing, so most updates take O(N).
/// Allocates nothing once the lists have grown.
#[derive(Clone, Debug)]
pub struct VerletList {
    near: CellList,
    /// Positions of the last search, and its range \[m\].
    searched_m: Rows,
    range_m: f64,
}

impl Default for VerletList {
    fn default() -> Self {
        Self { near: CellList::default(), searched_m: Rows::zeros(0), range_m: f64::NAN }
    }
}

impl VerletList {
    /// Returns the pairs `(i, j)`, i < j, in ascending order: all within the range, and some slightly farther apart.
    #[must_use]
    pub fn pairs(&self) -> &[(usize, usize)] {
        self.near.pairs()
    }

    /// Updates the pairs so that they contain every pair of rows with a separation of at most `range_m` \[m\].
    pub fn update(&mut self, positions_m: &Rows, range_m: f64) {
        if !self.holds(positions_m, range_m) {
            self.near.update(positions_m, (1.0 + SKIN) * range_m);
            self.searched_m.clone_from(positions_m);
            self.range_m = range_m;
        }
    }

    /// Whether no pair can be missing; false if a value is NaN.
    fn holds(&self, positions_m: &Rows, range_m: f64) -> bool {
        let (count, free_m) = (positions_m.nrows(), (0.5 * SKIN - ROUNDING) * range_m);
        self.range_m == range_m
            && self.searched_m.nrows() == count
            && (0..count)
                .step_by(SIDE_BY_SIDE)
                .all(|first| self.stay_within(free_m, positions_m, first..count.min(first + SIDE_BY_SIDE)))
    }

    /// Whether these points, at most [`SIDE_BY_SIDE`], are within `free_m` of their positions at the last search.
    fn stay_within(&self, free_m: f64, positions_m: &Rows, points: Range<usize>) -> bool {
        let mut squares_m2 = [0.0; SIDE_BY_SIDE];
        for (now_m, searched_m) in columns(positions_m).into_iter().zip(columns(&self.searched_m)) {
            let moved_m = now_m[points.clone()].iter().zip(&searched_m[points.clone()]).map(|(now, then)| now - then);
            squares_m2.iter_mut().zip(moved_m).for_each(|(square, moved)| *square += moved * moved);
        }
        squares_m2.iter().filter(|&&square_m2| square_m2 <= free_m * free_m).count() == SIDE_BY_SIDE
    }
}

/// Near vehicles of each vehicle, in index order. Allocates nothing once the lists have grown.
#[derive(Clone, Debug, Default)]
pub(crate) struct NearLists {
    /// End of the list of each vehicle in `others`.
    ends: Vec<usize>,
    others: Vec<usize>,
}

impl NearLists {
    /// Builds the lists of `count` vehicles from pairs i < j in ascending order.
    pub(crate) fn update(&mut self, count: usize, pairs: &[(usize, usize)]) {
        let Self { ends, others } = self;
        ends.clear();
        ends.resize(count + 1, 0);
        for &(i, j) in pairs {
            ends[i + 1] += 1;
            ends[j + 1] += 1;
        }
        for i in 0..count {
            ends[i + 1] += ends[i];
        }
        others.clear();
        others.resize(2 * pairs.len(), 0);
        for &(i, j) in pairs {
            for (vehicle, other) in [(i, j), (j, i)] {
                others[ends[vehicle]] = other;
                ends[vehicle] += 1;
            }
        }
    }

    /// Returns the near vehicles of vehicle `i`.
    pub(crate) fn of(&self, i: usize) -> &[usize] {
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.others[start..self.ends[i]]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use tautline_core::swarm::separation;

    fn all_pairs(positions_m: &Rows, range_m: f64) -> Vec<(usize, usize)> {
        let count = positions_m.nrows();
        let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
        pairs.filter(|&(i, j)| separation(positions_m, i, j) <= range_m).collect()
    }

    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            6 => -4.0..4.0,
            3 => (-4..4_i32).prop_map(f64::from),
            1 => prop::sample::select(vec![0.0, -0.0, 1e9, -1e9, 1e300, -1e300, f64::MAX, f64::INFINITY, f64::NAN]),
        ]
    }

    fn points() -> impl Strategy<Value = Vec<[f64; 3]>> {
        prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..60)
    }

    /// Ranges with extreme and invalid values.
    const RANGES_M: [f64; 8] = [0.0, 1.0, 1e-9, 1e3, 1e10, f64::MAX, -1.0, f64::NAN];

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        #[test]
        fn cells_find_the_same_pairs_as_a_full_search(
            tables in prop::collection::vec(points(), 1..4),
            range_m in prop_oneof![0.0..3.0, prop::sample::select(RANGES_M.to_vec())],
            far in prop::sample::select(vec![0.0, 1e3, -1e9]),
        ) {
            let mut near = CellList::default();
            for points in tables {
                let points: Vec<f64> = points.iter().flat_map(|&[x, y, z]| [x + far, y, z]).collect();
                let positions_m = Rows::from_row_slice(&points);
                near.update(&positions_m, range_m);
                let expected = all_pairs(&positions_m, range_m);
                prop_assert_eq!(near.pairs(), expected);
            }
        }
    }

    #[test]
    fn all_near_pairs_of_a_large_swarm_are_found() {
        for (count, depth) in [(1500_u32, 0.0), (1500, 1.0)] {
            let place = |k: u32| {
                let [x, y, z] =
                    [0.754_877_666, 0.569_840_290, 0.819_172_513].map(|step| 20.0 * (step * f64::from(k)).fract());
                [x, y, depth * z]
            };
            let positions_m = Rows::from_row_slice(&(0..count).flat_map(place).collect::<Vec<_>>());
            let mut near = CellList::default();
            for range_m in [1.5, 2.5, 5.0] {
                near.update(&positions_m, range_m);
                let expected = all_pairs(&positions_m, range_m);
                assert!(!expected.is_empty());
                assert_eq!(near.pairs(), expected);
            }
        }
    }

    proptest! {
        #[test]
        fn kept_pairs_contain_every_pair_within_the_range(
            start in prop::collection::vec(-4.0..4.0_f64, 90),
            steps in prop::collection::vec((prop::collection::vec(-1.0..1.0_f64, 90), 0.01..0.6_f64), 1..12),
            ranges_m in prop::collection::vec(prop::sample::select(vec![0.5, 1.5, 1.5, 1.5]), 12),
        ) {
            let mut kept = VerletList::default();
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
    fn the_search_repeats_after_large_moves_and_for_nan() {
        let mut kept = VerletList::default();
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

    #[test]
    fn near_lists_are_in_index_order() {
        let mut lists = NearLists::default();
        for (pairs, expected) in [
            (&[(0, 2), (0, 3), (1, 2), (2, 4)][..], [&[2, 3][..], &[2], &[0, 1, 4], &[0], &[2]]),
            (&[], [&[][..]; 5]),
            (&[(3, 4)], [&[], &[], &[], &[4], &[3]]),
        ] {
            lists.update(5, pairs);
            (0..5).for_each(|i| assert_eq!(lists.of(i), expected[i], "{pairs:?}"));
        }
    }
}
