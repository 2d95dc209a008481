//! What has been found in segments of motion so far, and who came closest.

use super::ledger::Ledger;
use super::outcome::{Approach, ObjectPair};

/// Approaches that are kept.
pub(super) const KEPT: usize = 10;

/// The closest approaches of different pairs.
#[derive(Clone, Debug)]
pub(super) struct ClosestPairs {
    pub(super) kept: Vec<Approach>,
    /// What a pair that is not among them must come below to be.
    pub(super) threshold: f64,
}

impl Default for ClosestPairs {
    fn default() -> Self {
        Self { kept: Vec::with_capacity(KEPT + 1), threshold: f64::INFINITY }
    }
}

impl ClosestPairs {
    /// What this pair must come below to change anything: where its distance is known by bounds that lie apart, the upper
    /// one can still fall.
    pub(super) fn cutoff(&self, pair: ObjectPair) -> f64 {
        let known = self.kept.iter().find(|kept| kept.pair == pair);
        known.map_or(self.threshold, |kept| if kept.is_known() { kept.lower_m } else { kept.upper_m })
    }

    /// Keeps those of which something holds; from then on any pair can be among the closest.
    pub(super) fn retain(&mut self, holds: impl FnMut(&Approach) -> bool) {
        self.kept.retain(holds);
        self.threshold = f64::INFINITY;
    }

    /// Keeps the closer of two approaches of one pair, and the closest pairs.
    pub(super) fn offer(&mut self, approach: Approach) {
        match self.kept.iter_mut().find(|kept| kept.pair == approach.pair) {
            Some(kept) => {
                let upper_m = kept.upper_m.min(approach.upper_m);
                if approach.lower_m < kept.lower_m {
                    *kept = approach;
                }
                kept.upper_m = upper_m;
            }
            None if approach.lower_m < self.threshold => self.kept.push(approach),
            None => return,
        }
        self.kept.sort_by(|a, b| {
            a.lower_m.total_cmp(&b.lower_m).then(a.upper_m.total_cmp(&b.upper_m)).then(a.pair.cmp(&b.pair))
        });
        self.kept.truncate(KEPT);
        if let [.., last] = self.kept[..]
            && self.kept.len() == KEPT
        {
            self.threshold = last.lower_m;
        }
    }
}

/// Everything found so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Results {
    pub(super) ledger: Ledger<ObjectPair>,
    pub(super) closest: ClosestPairs,
    pub(super) obstacles: ClosestPairs,
    /// Segments of pairs that were swept.
    pub(super) swept: u64,
}

impl Results {
    /// The table that an approach belongs to.
    pub(super) fn table(&mut self, pair: ObjectPair) -> &mut ClosestPairs {
        match pair {
            ObjectPair::Vehicles(_) => &mut self.closest,
            ObjectPair::Obstacle { .. } => &mut self.obstacles,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swarm::Pair;

    fn approach(first: usize, lower_m: f64) -> Approach {
        let pair = ObjectPair::Vehicles(Pair::new(first, 99));
        Approach { pair, lower_m, upper_m: lower_m, time_s: 0.0, limit_m: 1.0 }
    }

    #[test]
    fn the_ten_closest_pairs_are_kept_each_at_its_closest() {
        let mut closest = ClosestPairs::default();
        for k in 0..12 {
            closest.offer(approach(k, 20.0 - k as f64));
        }
        assert_eq!(closest.threshold, 18.0);
        closest.offer(approach(11, 8.0));
        closest.offer(approach(11, 8.5));
        closest.offer(approach(0, 19.0));
        assert_eq!(closest.cutoff(approach(11, 0.0).pair), 8.0);
        assert_eq!(closest.cutoff(approach(0, 0.0).pair), 18.0);
        let kept: Vec<_> = closest.kept.iter().map(|kept| kept.lower_m).collect();
        assert_eq!(kept, [8.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0]);
    }
}
