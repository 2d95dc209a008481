//! Which pairs a step must be judged by.
//!
//! Up to [`SMALL_SWARM`] vehicles: all of them. Beyond, a list of near pairs in the manner of L. Verlet (Physical Review
//! 159, 98, 1967), with a budget of motion for each vehicle. When the list is made, from reference positions x, vehicle i
//! gets a budget b(i), and a pair is left out only if |x(j) - x(i)| > R + b(i) + b(j). As long as every vehicle stays
//! within its budget of its reference position, a pair left out stays farther apart than R. The distance from a fixed point is
//! convex along a straight line, so it is enough to look at the ends of each step.

use std::ops::Range;

use nalgebra::Vector3;

use tautline_core::swarm::{Rows, row, separation};

/// Up to this many vehicles a list costs more than it saves.
const SMALL_SWARM: usize = 32;
/// R over the distance that must be covered when a list is made: room for the closest pair to part before a new list is
/// due. More makes lists last longer and grow longer.
const RADIUS_OVER_BOUND: f64 = 1.25;
/// Budget beyond the step at hand, as a fraction of R. More makes lists last longer and grow longer.
const SPARE_OVER_RADIUS: f64 = 0.125;
/// Relative widening of every reach, far above rounding (1e-16) and far below what costs anything.
const ROUNDING: f64 = 1e-9;
/// Width of a column over half of what a vehicle reaches on average: wider ones hold more that is not near, narrower ones are
/// shared by more.
const COLUMN_OVER_REACH: f64 = 6.0;
/// Most strips that an axis is divided into: numbers of columns fit in 32 bits.
const MOST_STRIPS: f64 = 30_000.0;
/// Most columns that a vehicle reaches into on average; where it would be more, there is one column.
const MOST_ENTRIES: usize = 4;

/// The list of near pairs and what it is good for.
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

/// Half of the condition for two vehicles to be listed, in one of the columns that it extends into.
#[derive(Clone, Copy, Debug)]
struct Reach {
    column: u32,
    /// Its ends along the column \[m\].
    low: f64,
    high: f64,
    across_m: f64,
    half_m: f64,
    /// The first of its columns along both axes across.
    first: [u32; 2],
    vehicle: u32,
}

/// Iterates over the listed pairs, or over all pairs of `n` vehicles without a list, in the order of pairs.
#[inline]
pub(super) fn pairs(listed: Option<&[[u32; 2]]>, n: usize) -> impl Iterator<Item = (usize, usize)> {
    let (mut k, mut next) = (0, (0, 1));
    // One loop for both: whoever judges a pair is then a part of it.
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

/// Returns the number of the listed pairs, or of all pairs of `n` vehicles without a list.
pub(super) fn pairs_of(listed: Option<&[[u32; 2]]>, n: usize) -> u64 {
    listed.map_or_else(|| pair_count(n), |pairs| pairs.len() as u64)
}

/// N (N - 1) / 2.
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

    /// The pairs to be swept for the straight motion between two instants, `None` for all: every pair that is not among
    /// them stays farther apart than `bound_m` throughout.
    ///
    /// `from` must be the `to` of the call before. Memory is at most 8 bytes for half of all pairs; where more than that
    /// are near, all are swept and no list is kept.
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

    /// Enters the vehicles in the columns that they reach into, in order of their lower ends along the columns.
    fn sort_reaches(&mut self, radius_m: f64) {
        let columns = Columns::of(&self.reference_m, self.budget_m.iter().map(|budget_m| half_m(radius_m, *budget_m)));
        self.reaches.clear();
        for (i, &budget_m) in self.budget_m.iter().enumerate() {
            let (half_m, position_m) = (half_m(radius_m, budget_m), row(&self.reference_m, i));
            let (low, high) = ends(position_m[columns.axes[0]], half_m);
            let (across_m, [across, deep]) = (position_m[columns.axes[1]], columns.span(position_m, half_m));
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

    /// Lists the pairs within reach of each other in the order of pairs; `false` if that is more than half of all.
    fn collect_pairs(&mut self) -> bool {
        let limit = pair_count(self.budget_m.len()) / 2;
        self.pairs.clear();
        for (k, a) in self.reaches.iter().enumerate() {
            for b in self.reaches[k + 1..].iter().take_while(|b| b.column == a.column && b.low <= a.high) {
                let reach_m = a.half_m + b.half_m;
                // Two vehicles that share columns are compared in the first shared column.
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

/// Where a reach begins and ends along an axis \[m\].
fn ends(at_m: f64, half_m: f64) -> (f64, f64) {
    let rounding_m = 4.0 * f64::EPSILON * (at_m.abs() + half_m);
    (at_m - half_m - rounding_m, at_m + half_m + rounding_m)
}

/// The space of a swarm in columns along the axis on which it is longest.
#[derive(Clone, Copy, Debug, Default)]
struct Columns {
    /// Along the columns, across them, and across both.
    axes: [usize; 3],
    /// Where the first column begins across, and how wide columns are \[m\].
    low_m: [f64; 2],
    width_m: f64,
    counts: [u32; 2],
}

impl Columns {
    /// Columns for vehicles that reach so far: wide enough that few reach into several, and only one where many do.
    fn of(positions_m: &Rows, half_m: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
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
        let strips = |axis: usize| (extent_m[axis] / width_m).clamp(1.0, MOST_STRIPS) as u32;
        let columns = Self { axes, low_m, width_m, counts: [strips(axes[1]), strips(axes[2])] };
        let entries = half_m.enumerate().map(|(i, half_m)| {
            let [across, deep] = columns.span(row(positions_m, i), half_m);
            across.len() * deep.len()
        });
        if entries.sum::<usize>() > MOST_ENTRIES * count { Self { counts: [1, 1], ..columns } } else { columns }
    }

    /// The columns that a reach touches, along both axes across. Which one a place is in grows with the place, rounded as it
    /// may be, so two reaches that overlap share one.
    fn span(&self, position_m: Vector3<f64>, half_m: f64) -> [Range<u32>; 2] {
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

    /// The first column that two share whose first ones are these.
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
    fn a_small_swarm_is_swept_whole_and_in_the_order_of_pairs() {
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
    fn a_list_is_kept_while_its_budget_lasts_and_made_anew_after() {
        let start = line(100, |_| 0.0);
        let mut candidates = Candidates::new(100);
        let neighbours: Vec<_> = (0..99).map(|i| [i, i + 1]).collect();
        assert_eq!(listed(&mut candidates, &start, &start, SPACING_M).as_ref(), Some(&neighbours));
        let spare_m = SPARE_OVER_RADIUS * RADIUS_OVER_BOUND * SPACING_M;

        let within = line(100, |i| if i == 7 { 0.9 * spare_m } else { 0.0 });
        assert_eq!(listed(&mut candidates, &start, &within, SPACING_M).as_ref(), Some(&neighbours));
        assert_eq!(candidates.reference_m, start, "kept");
        let beyond = line(100, |i| if i == 7 { 1.1 * spare_m } else { 0.0 });
        listed(&mut candidates, &within, &beyond, SPACING_M);
        assert_eq!(candidates.reference_m, within, "made anew");
        listed(&mut candidates, &beyond, &beyond, 2.0 * SPACING_M);
        assert_eq!(candidates.reference_m, beyond, "made anew for a wider bound");
    }

    #[test]
    fn a_vehicle_that_crosses_the_swarm_in_one_step_is_paired_with_all_it_could_meet() {
        let start = line(100, |_| 0.0);
        let thrown = line(100, |i| if i == 0 { 600.0 } else { 0.0 });
        let pairs = listed(&mut Candidates::new(100), &start, &thrown, SPACING_M).unwrap();
        assert!((1..100).all(|j| pairs.contains(&[0, j])));
        assert_eq!(pairs.len(), 99 + 98);
    }

    #[test]
    fn columns_find_whoever_one_sweep_finds_in_the_plane_in_space_and_around_one_that_flies_far() {
        for (axes, thrown_m) in [(2, 0.0), (3, 0.0), (3, 40.0), (3, 1e6)] {
            let place = |k: usize, axis: usize| {
                let step = [0.754_877_666, 0.569_840_290, 0.819_172_513][axis];
                if axis < axes { 50.0 * (step * k as f64).fract() } else { 0.0 }
            };
            let start = Rows::from_fn(900, place);
            let end = Rows::from_fn(900, |k, axis| {
                place(k, axis) + if k == 7 { thrown_m } else { 0.3 * (k as f64 + axis as f64).sin() }
            });
            let mut candidates = Candidates::new(900);
            candidates.cover(&start, &end, 1.5).expect("a list");
            let found = candidates.pairs.clone();
            assert!(candidates.columns.counts[0] > 3 || thrown_m > 1e3, "{:?}", candidates.columns);
            let radius_m = candidates.radius_m.expect("a list");
            let halves: Vec<_> = candidates.budget_m.iter().map(|&budget_m| half_m(radius_m, budget_m)).collect();
            let near = |i: usize, j: usize| separation(&start, i, j) <= halves[i] + halves[j];
            let pairs = (0..900_u32).flat_map(|i| (i + 1..900).map(move |j| [i, j]));
            let expected: Vec<_> = pairs.filter(|&[i, j]| near(i as usize, j as usize)).collect();
            assert_eq!(found, expected, "{axes} {thrown_m}");
        }
    }

    #[test]
    fn a_crowd_has_no_list() {
        let rows = Rows::zeros(100);
        assert_eq!(listed(&mut Candidates::new(100), &rows, &rows, 1.0), None);
    }
}
