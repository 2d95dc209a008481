//! Selection of the pairs that a step must sweep.
//!
//! Up to [`SMALL_SWARM`] vehicles all pairs are swept. Larger swarms use a list of near pairs after L. Verlet (Physical
//! Review 159, 98, 1967), with a motion budget for each vehicle. The list is made from reference positions x. Vehicle i
//! gets a budget b(i), and a pair is left out only if |x(j) - x(i)| > R + b(i) + b(j). While every vehicle stays within
//! its budget of its reference position, a pair that is left out stays farther apart than R. The distance from a fixed
//! point is convex along a straight line, so only the ends of each step are checked.

use std::ops::Range;

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row, separation};

/// Largest number of vehicles for which a list costs more than it saves.
const SMALL_SWARM: usize = 32;
/// R over the distance that the list must cover: room for the closest pair to part before a new list is due. A larger
/// value makes lists last longer and grow longer.
const RADIUS_OVER_BOUND: f64 = 1.25;
/// Budget beyond the current step, as a fraction of R. A larger value makes lists last longer and grow longer.
const SPARE_OVER_RADIUS: f64 = 0.125;
/// Relative widening of every reach: far above rounding (1e-16) and too small to list more pairs.
const ROUNDING: f64 = 1e-9;
/// Width of a column over half the mean reach of a vehicle. Wider columns hold more pairs that are not near; narrower
/// columns split more reaches.
const COLUMN_OVER_REACH: f64 = 6.0;
/// Largest number of strips per axis: column numbers fit in 32 bits.
const MAX_STRIPS: f64 = 30_000.0;
/// Largest mean number of columns per vehicle; beyond, one column is used.
const MAX_MEAN_ENTRIES: usize = 4;

/// List of near pairs, with the conditions under which it is valid.
#[derive(Clone, Debug)]
pub(super) struct Candidates {
    /// R \[m\]; `None` without a list.
    radius_m: Option<f64>,
    reference_m: Rows,
    budget_m: Vec<f64>,
    pairs: Vec<[u32; 2]>,
    columns: Columns,
    reaches: Vec<Reach>,
}

/// Reach of a vehicle (half of the condition for listing a pair) in one of the columns that it extends into.
#[derive(Clone, Copy, Debug)]
struct Reach {
    column: u32,
    /// Ends of the reach along the column \[m\].
    low: f64,
    high: f64,
    across_m: f64,
    half_m: f64,
    /// Numbers of the first column that the reach extends into, along both axes across.
    first: [u32; 2],
    vehicle: u32,
}

/// Iterates in order over the listed pairs, or over all pairs of `n` vehicles without a list.
#[inline]
pub(super) fn pairs(listed: Option<&[[u32; 2]]>, n: usize) -> impl Iterator<Item = (usize, usize)> {
    let (mut k, mut next) = (0, (0, 1));
    // One closure for both cases, so that the caller's loop is inlined once.
    std::iter::from_fn(move || {
        if let Some(pairs) = listed {
            let &[i, j] = pairs.get(k)?;
            k += 1;
            return Some((i as usize, j as usize));
        }
        let (i, j) = next;
        next = if j + 1 < n { (i, j + 1) } else { (i + 1, i + 2) };
        (j < n).then_some((i, j))
    })
}

/// Returns the number of listed pairs, or of all pairs of `n` vehicles without a list.
pub(super) fn pairs_of(listed: Option<&[[u32; 2]]>, n: usize) -> u64 {
    listed.map_or_else(|| pair_count(n), |pairs| pairs.len() as u64)
}

/// Returns N (N - 1) / 2.
pub(super) fn pair_count(n: usize) -> u64 {
    n as u64 * (n as u64).saturating_sub(1) / 2
}

impl Candidates {
    /// Creates an empty list for `n` vehicles.
    pub(super) fn new(n: usize) -> Self {
        let reference_m = Rows::zeros(n);
        let columns = Columns::default();
        Self { radius_m: None, reference_m, budget_m: Vec::new(), pairs: Vec::new(), columns, reaches: Vec::new() }
    }

    /// Returns the pairs to sweep for the straight motion between two instants, or `None` for all pairs. Every pair
    /// that is not returned stays farther apart than `bound_m` throughout.
    ///
    /// `from` must be the `to` of the previous call. The list takes at most 8 bytes for half of all pairs; if more
    /// pairs are near, all are swept and no list is kept.
    pub(super) fn cover(&mut self, from: &Rows, to: &Rows, bound_m: f64) -> Option<&[[u32; 2]]> {
        if to.nrows() <= SMALL_SWARM {
            return None;
        }
        if !self.still_covers(to, bound_m) {
            self.list(from, to, bound_m);
        }
        self.radius_m.is_some().then_some(&self.pairs)
    }

    fn still_covers(&self, to: &Rows, bound_m: f64) -> bool {
        self.radius_m.is_some_and(|radius_m| bound_m <= radius_m)
            && self
                .budget_m
                .iter()
                .enumerate()
                .all(|(i, &budget_m)| (row(to, i) - row(&self.reference_m, i)).norm_squared() <= budget_m * budget_m)
    }

    fn list(&mut self, from: &Rows, to: &Rows, bound_m: f64) {
        let radius_m = RADIUS_OVER_BOUND * bound_m;
        self.reference_m.copy_from(from);
        self.budget_m.clear();
        self.budget_m.extend((0..to.nrows()).map(|i| {
            let needed_m = (row(to, i) - row(from, i)).norm();
            needed_m * (1.0 + ROUNDING) + SPARE_OVER_RADIUS * radius_m
        }));
        self.sort_reaches(radius_m);
        self.radius_m = self.collect_pairs().then_some(radius_m);
    }

    /// Enters each vehicle in the columns that its reach extends into, ordered by lower end along the column.
    fn sort_reaches(&mut self, radius_m: f64) {
        let columns =
            Columns::covering(&self.reference_m, self.budget_m.iter().map(|budget_m| half_m(radius_m, *budget_m)));
        self.reaches.clear();
        for (i, &budget_m) in self.budget_m.iter().enumerate() {
            let (half_m, position_m) = (half_m(radius_m, budget_m), row(&self.reference_m, i));
            let (low, high) = ends(position_m[columns.axes[0]], half_m);
            let (across_m, [across, deep]) = (position_m[columns.axes[1]], columns.touched(position_m, half_m));
            let first = [across.start, deep.start];
            #[expect(clippy::cast_possible_truncation, reason = "the auditor has fewer than 2^32 vehicles")]
            let vehicle = i as u32;
            for deep in deep {
                let column = |across: u32| columns.number([across, deep]);
                let reach = |column| Reach { column, low, high, across_m, half_m, first, vehicle };
                self.reaches.extend(across.clone().map(column).map(reach));
            }
        }
        self.reaches.sort_unstable_by(|a, b| a.column.cmp(&b.column).then(a.low.total_cmp(&b.low)));
        self.columns = columns;
    }

    /// Lists the pairs within reach of each other, in order; returns `false` if they are more than half of all pairs.
    fn collect_pairs(&mut self) -> bool {
        let limit = pair_count(self.budget_m.len()) / 2;
        self.pairs.clear();
        for (k, a) in self.reaches.iter().enumerate() {
            for b in self.reaches[k + 1..].iter().take_while(|b| b.column == a.column && b.low <= a.high) {
                let reach_m = a.half_m + b.half_m;
                // Two vehicles that share several columns are compared only in the first of these.
                if (a.across_m - b.across_m).abs() > reach_m || self.columns.shared(a.first, b.first) != a.column {
                    continue;
                }
                let (i, j) = (a.vehicle.min(b.vehicle), a.vehicle.max(b.vehicle));
                if separation(&self.reference_m, i as usize, j as usize) <= reach_m {
                    self.pairs.push([i, j]);
                }
            }
            if self.pairs.len() as u64 > limit {
                return false;
            }
        }
        self.pairs.sort_unstable();
        true
    }
}

fn half_m(radius_m: f64, budget_m: f64) -> f64 {
    (radius_m / 2.0 + budget_m) * (1.0 + ROUNDING)
}

/// Returns both ends of a reach along an axis \[m\].
fn ends(at_m: f64, half_m: f64) -> (f64, f64) {
    let rounding_m = 4.0 * f64::EPSILON * (at_m.abs() + half_m);
    (at_m - half_m - rounding_m, at_m + half_m + rounding_m)
}

/// Division of the space of a swarm into columns along its longest axis.
#[derive(Clone, Copy, Debug, Default)]
struct Columns {
    /// Axis along the columns, then the two axes across them.
    axes: [usize; 3],
    /// Lower end of the first column along both axes across, and width of a column \[m\].
    low_m: [f64; 2],
    width_m: f64,
    counts: [u32; 2],
}

impl Columns {
    /// Creates columns for vehicles of these reaches: wide enough that few vehicles reach into several columns, and a
    /// single column where many would.
    fn covering(positions_m: &Rows, half_m: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let count = half_m.len();
        let mut axes = [0, 1, 2];
        let extent_m = [0, 1, 2].map(|axis: usize| {
            let column = positions_m.column(axis);
            column.max() - column.min()
        });
        axes.sort_by(|&a, &b| extent_m[b].total_cmp(&extent_m[a]));
        let low_m = [axes[1], axes[2]].map(|axis| positions_m.column(axis).min());
        let width_m = COLUMN_OVER_REACH * half_m.clone().sum::<f64>() / count.max(1) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by both")]
        let strips = |axis: usize| (extent_m[axis] / width_m).clamp(1.0, MAX_STRIPS) as u32;
        let columns = Self { axes, low_m, width_m, counts: [strips(axes[1]), strips(axes[2])] };
        let entries = half_m.enumerate().map(|(i, half_m)| {
            let [across, deep] = columns.touched(row(positions_m, i), half_m);
            across.len() * deep.len()
        });
        if entries.sum::<usize>() > MAX_MEAN_ENTRIES * count { Self { counts: [1, 1], ..columns } } else { columns }
    }

    /// Returns the range of columns that a reach touches, along both axes across. The column number is a monotonic
    /// function of the rounded position, so two reaches that overlap share a column.
    fn touched(&self, position_m: Vector3<f64>, half_m: f64) -> [Range<u32>; 2] {
        [0, 1].map(|k| {
            let (low_m, high_m) = ends(position_m[self.axes[k + 1]], half_m);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
            let strip = |at_m: f64| (((at_m - self.low_m[k]) / self.width_m) as u32).min(self.counts[k] - 1);
            strip(low_m)..strip(high_m) + 1
        })
    }

    fn number(&self, [across, deep]: [u32; 2]) -> u32 {
        deep * self.counts[0] + across
    }

    /// Returns the first column shared by two reaches with these first columns.
    fn shared(&self, a: [u32; 2], b: [u32; 2]) -> u32 {
        self.number([a[0].max(b[0]), a[1].max(b[1])])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACING_M: f64 = 3.0;

    fn line(n: usize, offset: impl Fn(usize) -> f64) -> Rows {
        Rows::from_fn(n, |i, axis| if axis == 0 { i as f64 * SPACING_M + offset(i) } else { 0.0 })
    }

    fn listed(candidates: &mut Candidates, from: &Rows, to: &Rows, bound_m: f64) -> Option<Vec<[usize; 2]>> {
        let pairs = candidates.cover(from, to, bound_m)?;
        Some(pairs.iter().map(|pair| pair.map(|vehicle| vehicle as usize)).collect())
    }

    #[test]
    fn a_small_swarm_is_swept_pair_by_pair_in_order() {
        let rows = line(4, |_| 0.0);
        let mut candidates = Candidates::new(4);
        let listed = candidates.cover(&rows, &rows, 1.0);
        assert_eq!(pairs_of(listed, 4), 6);
        assert_eq!(pairs(listed, 4).collect::<Vec<_>>(), [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]);
        assert_eq!(pairs(Some(&[[0, 3], [2, 3]]), 4).collect::<Vec<_>>(), [(0, 3), (2, 3)]);
        for n in 0..6 {
            assert_eq!(pairs(None, n).count() as u64, pair_count(n));
        }
    }

    #[test]
    fn a_list_is_kept_until_a_budget_is_exceeded() {
        let start = line(100, |_| 0.0);
        let mut candidates = Candidates::new(100);
        let neighbours: Vec<_> = (0..99).map(|i| [i, i + 1]).collect();
        assert_eq!(listed(&mut candidates, &start, &start, SPACING_M).as_ref(), Some(&neighbours));
        let spare_m = SPARE_OVER_RADIUS * RADIUS_OVER_BOUND * SPACING_M;

        let within = line(100, |i| if i == 7 { 0.9 * spare_m } else { 0.0 });
        assert_eq!(listed(&mut candidates, &start, &within, SPACING_M).as_ref(), Some(&neighbours));
        assert_eq!(candidates.reference_m, start, "the list is kept");
        let beyond = line(100, |i| if i == 7 { 1.1 * spare_m } else { 0.0 });
        listed(&mut candidates, &within, &beyond, SPACING_M);
        assert_eq!(candidates.reference_m, within, "a new list");
        listed(&mut candidates, &beyond, &beyond, 2.0 * SPACING_M);
        assert_eq!(candidates.reference_m, beyond, "a wider bound needs a new list");
    }

    #[test]
    fn a_vehicle_that_crosses_the_swarm_in_one_step_is_paired_with_every_vehicle() {
        let start = line(100, |_| 0.0);
        let crossed = line(100, |i| if i == 0 { 600.0 } else { 0.0 });
        let pairs = listed(&mut Candidates::new(100), &start, &crossed, SPACING_M).unwrap();
        assert!((1..100).all(|j| pairs.contains(&[0, j])));
        assert_eq!(pairs.len(), 99 + 98);
    }

    #[test]
    fn columns_find_the_same_pairs_as_a_full_comparison() {
        for (axes, crossed_m) in [(2, 0.0), (3, 0.0), (3, 40.0), (3, 1e6)] {
            let place = |k: usize, axis: usize| {
                let step = [0.754_877_666, 0.569_840_290, 0.819_172_513][axis];
                if axis < axes { 50.0 * (step * k as f64).fract() } else { 0.0 }
            };
            let start = Rows::from_fn(900, place);
            let end = Rows::from_fn(900, |k, axis| {
                place(k, axis) + if k == 7 { crossed_m } else { 0.3 * (k as f64 + axis as f64).sin() }
            });
            let mut candidates = Candidates::new(900);
            candidates.cover(&start, &end, 1.5).expect("a list");
            let found = candidates.pairs.clone();
            assert!(candidates.columns.counts[0] > 3 || crossed_m > 1e3, "{:?}", candidates.columns);
            let radius_m = candidates.radius_m.expect("a list");
            let halves: Vec<_> = candidates.budget_m.iter().map(|&budget_m| half_m(radius_m, budget_m)).collect();
            let near = |i: usize, j: usize| separation(&start, i, j) <= halves[i] + halves[j];
            let pairs = (0..900_u32).flat_map(|i| (i + 1..900).map(move |j| [i, j]));
            let expected: Vec<_> = pairs.filter(|&[i, j]| near(i as usize, j as usize)).collect();
            assert_eq!(found, expected, "{axes} {crossed_m}");
        }
    }

    #[test]
    fn a_dense_swarm_has_no_list() {
        let rows = Rows::zeros(100);
        assert_eq!(listed(&mut Candidates::new(100), &rows, &rows, 1.0), None);
    }
}
