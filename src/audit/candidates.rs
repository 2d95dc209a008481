//! Which pairs a step must be judged by.
//!
//! Up to [`SMALL_SWARM`] vehicles: all of them. Beyond, a list of near pairs in the manner of L. Verlet (Physical Review
//! 159, 98, 1967), with a budget of motion for each vehicle. When the list is made, from reference positions x, vehicle i
//! gets a budget b(i), and a pair is left out only if |x(j) - x(i)| > R + b(i) + b(j). As long as every vehicle stays
//! within its budget of its reference position, a pair left out stays farther apart than R. The distance from a fixed point is
//! convex along a straight line, so it is enough to look at the ends of each step.

use nalgebra::Vector3;

use crate::swarm::{Rows, row, separation};

/// Up to this many vehicles a list costs more than it saves.
const SMALL_SWARM: usize = 32;
/// R over the distance that must be covered when a list is made: room for the closest pair to part before a new list is
/// due. More makes lists last longer and grow longer.
const RADIUS_OVER_BOUND: f64 = 1.25;
/// Budget beyond the step at hand, as a fraction of R. More makes lists last longer and grow longer.
const SPARE_OVER_RADIUS: f64 = 0.125;
/// Relative widening of every reach, far above rounding (1e-16) and far below what costs anything.
const ROUNDING: f64 = 1e-9;

/// The list of near pairs and what it is good for.
#[derive(Clone, Debug)]
pub(super) struct Candidates {
    /// R \[m\]; `None` without a list.
    radius_m: Option<f64>,
    reference_m: Rows,
    budget_m: Vec<f64>,
    pairs: Vec<[u32; 2]>,
    reaches: Vec<Reach>,
}

/// Half of the condition for two vehicles to be listed, and its extent along the axis of the sort.
#[derive(Clone, Copy, Debug)]
struct Reach {
    low: f64,
    high: f64,
    half_m: f64,
    vehicle: u32,
}

/// Calls `f` with each of these pairs, or with all of so many vehicles where none are listed, in the order of pairs; returns
/// their number.
#[inline]
pub(super) fn for_each_pair(listed: Option<&[[u32; 2]]>, n: usize, mut f: impl FnMut(usize, usize)) -> u64 {
    if let Some(pairs) = listed {
        for &[i, j] in pairs {
            f(i as usize, j as usize);
        }
        return pairs.len() as u64;
    }
    for i in 0..n {
        for j in i + 1..n {
            f(i, j);
        }
    }
    pair_count(n)
}

/// N (N - 1) / 2.
pub(super) fn pair_count(n: usize) -> u64 {
    n as u64 * (n as u64).saturating_sub(1) / 2
}

impl Candidates {
    /// Of so many vehicles.
    pub(super) fn new(n: usize) -> Self {
        let reference_m = Rows::zeros(n);
        Self { radius_m: None, reference_m, budget_m: Vec::new(), pairs: Vec::new(), reaches: Vec::new() }
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

    /// Sorts the vehicles by the lower end of their reach along the axis on which the swarm is longest.
    fn sort_reaches(&mut self, radius_m: f64) {
        let extents = self.reference_m.column_iter().map(|column| column.max() - column.min());
        let axis = Vector3::from_iterator(extents).imax();
        let along = self.reference_m.column(axis);
        self.reaches.clear();
        self.reaches.extend(along.iter().zip(&self.budget_m).zip(0..).map(|((&x, &budget_m), vehicle)| {
            let half_m = (radius_m / 2.0 + budget_m) * (1.0 + ROUNDING);
            let rounding_m = 4.0 * f64::EPSILON * (x.abs() + half_m);
            Reach { low: x - half_m - rounding_m, high: x + half_m + rounding_m, half_m, vehicle }
        }));
        self.reaches.sort_unstable_by(|a, b| a.low.total_cmp(&b.low));
    }

    /// Lists the pairs within reach of each other in the order of pairs; `false` if that is more than half of all.
    fn collect_pairs(&mut self) -> bool {
        let limit = pair_count(self.reaches.len()) / 2;
        self.pairs.clear();
        for (k, a) in self.reaches.iter().enumerate() {
            for b in self.reaches[k + 1..].iter().take_while(|b| b.low <= a.high) {
                let (i, j) = (a.vehicle.min(b.vehicle), a.vehicle.max(b.vehicle));
                if separation(&self.reference_m, i as usize, j as usize) <= a.half_m + b.half_m {
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
        let mut pairs = vec![];
        let count = for_each_pair(Candidates::new(4).cover(&rows, &rows, 1.0), 4, |i, j| pairs.push((i, j)));
        assert_eq!((count, pairs), (6, vec![(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]));
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
    fn a_crowd_has_no_list() {
        let rows = Rows::zeros(100);
        assert_eq!(listed(&mut Candidates::new(100), &rows, &rows, 1.0), None);
    }
}
