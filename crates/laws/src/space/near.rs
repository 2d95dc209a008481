//! Pairs within a range, by cells in sorted order.

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row};

/// Bits of a cell's number along one axis.
const BITS: u32 = 21;
/// Most cells along an axis: their numbers, those of the cells around them included, fit in [`BITS`].
const MOST_CELLS: f64 = (1_u64 << (BITS - 1)) as f64;
/// How much wider than the range a cell is: more than the rounding of up to [`MOST_CELLS`] cells, so that whatever is
/// within the range of a point is in its cell or in one that touches it.
const WIDER: f64 = 1.0 + 1e-6;
/// Distances are compared by their squares first: more than the rounding of a square.
const SQUARED: f64 = 1.0 + 1e-12;
const ALONG_Y: u64 = 1 << BITS;
const ALONG_Z: u64 = 1 << (2 * BITS);
/// From a cell to the rows of cells after its own that touch it.
const LATER_ROWS: [u64; 4] = [ALONG_Y, ALONG_Z - ALONG_Y, ALONG_Z, ALONG_Z + ALONG_Y];

/// The pairs of points within a range of each other.
///
/// Points are sorted by the cell that they lie in, and cells are a range wide, so the points near another are in five
/// runs of that order, which move on as the point does. A search takes O(N log N + pairs) where points are spread out,
/// and allocates nothing once its lists have grown.
#[derive(Clone, Debug, Default)]
pub struct NearPairs {
    cells: Vec<(u64, usize)>,
    points: Vec<Vector3<f64>>,
    found: Vec<(usize, usize)>,
    /// For each point the end of its pairs in `pairs`.
    ends: Vec<usize>,
    pairs: Vec<(usize, usize)>,
}

impl NearPairs {
    /// The pairs `(i, j)` found last, i < j, in ascending order.
    #[must_use]
    pub fn pairs(&self) -> &[(usize, usize)] {
        &self.pairs
    }

    /// Finds every pair of rows whose [separation](tautline_core::swarm::separation) is at most `range_m` \[m\]. A row that is not finite is in no pair.
    pub fn update(&mut self, positions_m: &Rows, range_m: f64) {
        self.sort(positions_m, range_m);
        self.sweep(range_m);
        self.order(positions_m.nrows());
    }

    /// Sorts the finite points by cell, those of a cell by index.
    fn sort(&mut self, positions_m: &Rows, range_m: f64) {
        let finite = || (0..positions_m.nrows()).map(|i| (i, row(positions_m, i))).filter(|(_, p)| is_finite(p));
        let none = Vector3::repeat(f64::INFINITY);
        let (low, high) = finite().fold((none, -none), |(low, high), (_, p)| (low.inf(&p), high.sup(&p)));
        let cell_m = (range_m * WIDER).max((high - low).max() / MOST_CELLS);
        // A cell without width holds all points, as one without bound does.
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

    /// Compares each point with those after it in its own row of cells and in the four later rows that touch its cell.
    fn sweep(&mut self, range_m: f64) {
        let Self { cells, points, found, .. } = self;
        let squared = range_m * range_m * SQUARED;
        let mut starts = [0; LATER_ROWS.len()];
        found.clear();
        for (place, (&(cell, i), &point)) in cells.iter().zip(points.iter()).enumerate() {
            let mut compare = |from: usize, last_cell: u64| {
                for (&(other, j), &at) in cells[from..].iter().zip(&points[from..]) {
                    if other > last_cell {
                        break;
                    }
                    let apart = (at - point).norm_squared();
                    if apart <= squared && apart.sqrt() <= range_m {
                        found.push((i.min(j), i.max(j)));
                    }
                }
            };
            compare(place + 1, cell + 1);
            for (start, row) in starts.iter_mut().zip(LATER_ROWS) {
                let first_cell = cell + row - 1;
                *start += cells[*start..].iter().take_while(|(other, _)| *other < first_cell).count();
                compare(*start, first_cell + 2);
            }
        }
    }

    /// Puts what was found in order, by counting.
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]

        #[test]
        fn cells_find_what_comparing_all_pairs_finds(
            tables in prop::collection::vec(prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..60), 1..4),
            range_m in prop_oneof![0.0..3.0, prop::sample::select(vec![0.0, 1.0, 1e-9, 1e3, 1e10, f64::MAX, -1.0, f64::NAN])],
            far in prop::sample::select(vec![0.0, 1e3, -1e9]),
        ) {
            let mut near = NearPairs::default();
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
    fn a_large_swarm_in_the_plane_and_in_space_is_searched_whole() {
        for (count, depth) in [(1500_u32, 0.0), (1500, 1.0)] {
            let place = |k: u32| {
                let [x, y, z] =
                    [0.754_877_666, 0.569_840_290, 0.819_172_513].map(|step| 20.0 * (step * f64::from(k)).fract());
                [x, y, depth * z]
            };
            let positions_m = Rows::from_row_slice(&(0..count).flat_map(place).collect::<Vec<_>>());
            let mut near = NearPairs::default();
            for range_m in [1.5, 2.5, 5.0] {
                near.update(&positions_m, range_m);
                let expected = all_pairs(&positions_m, range_m);
                assert!(!expected.is_empty());
                assert_eq!(near.pairs(), expected);
            }
        }
    }
}
