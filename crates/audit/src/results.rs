//! What has been found in segments of motion so far, and who came closest.

use super::error::Interruption;
use super::ledger::Ledger;
use super::outcome::{Approach, ObjectPair};

/// Approaches that are kept.
pub(super) const KEPT: usize = 10;

/// The closest approaches of different pairs.
#[derive(Clone, Debug)]
pub(super) struct ClosestPairs {
    pub(super) kept: Vec<Approach>,
    /// What a pair that is not among them must come below to be: a distance, or what it has beyond its limit.
    pub(super) threshold: f64,
    /// Whether they are the closest to their limits, which differ, and not to each other.
    beyond_limit: bool,
}

impl Default for ClosestPairs {
    fn default() -> Self {
        Self { kept: Vec::with_capacity(KEPT + 1), threshold: f64::INFINITY, beyond_limit: false }
    }
}

impl ClosestPairs {
    /// Those that are closest to their limits.
    pub(super) fn to_limits() -> Self {
        Self { beyond_limit: true, ..Self::default() }
    }

    /// What is compared of an approach.
    fn key(&self, approach: &Approach) -> f64 {
        if self.beyond_limit { approach.lower_m - approach.limit_m } else { approach.lower_m }
    }

    /// The distance that this pair must come below to change anything: where its distance is known by bounds that lie apart,
    /// the upper one can still fall.
    pub(super) fn cutoff(&self, pair: ObjectPair, limit_m: f64) -> f64 {
        let known = self.kept.iter().find(|kept| kept.pair == pair);
        let to_be_kept = if self.beyond_limit { self.threshold + limit_m } else { self.threshold };
        known.map_or(to_be_kept, |kept| if kept.is_known() { kept.lower_m } else { kept.upper_m })
    }

    /// Keeps the closer of two approaches of one pair, and the closest pairs.
    pub(super) fn offer(&mut self, approach: Approach) {
        let key = self.key(&approach);
        match self.kept.iter_mut().find(|kept| kept.pair == approach.pair) {
            Some(kept) => {
                let upper_m = kept.upper_m.min(approach.upper_m);
                if approach.lower_m < kept.lower_m {
                    *kept = approach;
                }
                kept.upper_m = upper_m;
            }
            None if key < self.threshold => self.kept.push(approach),
            None => return,
        }
        let mut kept = std::mem::take(&mut self.kept);
        kept.sort_by(|a, b| {
            self.key(a).total_cmp(&self.key(b)).then(a.upper_m.total_cmp(&b.upper_m)).then(a.pair.cmp(&b.pair))
        });
        kept.truncate(KEPT);
        self.kept = kept;
        if let [.., last] = self.kept[..]
            && self.kept.len() == KEPT
        {
            self.threshold = self.key(&last);
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
    /// Says whether the sweep is to stop.
    pub(super) interruption: Interruption,
}

impl Results {
    /// Of a recording: what is found is counted, and the worst and the first of it are listed.
    pub(super) fn bounded(interruption: Interruption) -> Self {
        Self { ledger: Ledger::bounded(), interruption, ..Self::default() }
    }

    /// Whether the sweep goes on with another pair; settles what was found of those before it.
    #[inline]
    pub(super) fn goes_on(&mut self) -> bool {
        self.ledger.settle();
        !self.interruption.is_set()
    }

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
    use tautline_core::swarm::Pair;

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
        assert_eq!(closest.cutoff(approach(11, 0.0).pair, 1.0), 8.0);
        assert_eq!(closest.cutoff(approach(0, 0.0).pair, 1.0), 18.0);
        let far = Approach { limit_m: 30.0, ..approach(50, 31.0) };
        closest.offer(far);
        assert!(!closest.kept.contains(&far), "others are closer to each other");
        let mut to_limits = ClosestPairs::to_limits();
        (0..12).for_each(|k| to_limits.offer(approach(k, 20.0 - k as f64)));
        assert_eq!((to_limits.threshold, to_limits.cutoff(far.pair, 30.0)), (17.0, 47.0));
        to_limits.offer(far);
        assert_eq!(to_limits.kept[0], far, "it is the closest to its limit");
        let kept: Vec<_> = closest.kept.iter().map(|kept| kept.lower_m).collect();
        assert_eq!(kept, [8.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0]);
    }
}
