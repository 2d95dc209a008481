//! What has been found so far: the closest, the violations, what could not be decided.

use std::collections::BTreeMap;

use super::WIDTH_M;
use super::outcome::{Approach, Disagreement, Undecided, Violation, Who};

/// Approaches that are kept.
pub(super) const KEPT: usize = 10;

/// The closest approaches of different pairs.
#[derive(Clone, Debug)]
pub(super) struct Closest {
    kept: Vec<Approach>,
    /// What a pair that is not among them must come below to be.
    threshold: f64,
}

impl Default for Closest {
    fn default() -> Self {
        Self { kept: Vec::with_capacity(KEPT + 1), threshold: f64::INFINITY }
    }
}

impl Closest {
    /// What any pair must come below to change anything.
    pub(super) fn threshold(&self) -> f64 {
        self.threshold
    }

    /// What this pair must come below to change anything: where its distance is known by bounds that lie apart, the upper
    /// one can still fall.
    pub(super) fn cutoff(&self, who: Who) -> f64 {
        let known = self.kept.iter().find(|kept| kept.who == who);
        known.map_or(self.threshold, |kept| {
            if kept.upper_m - kept.lower_m > 2.0 * WIDTH_M { kept.upper_m } else { kept.lower_m }
        })
    }

    /// Keeps the closer of two approaches of one pair, and the closest pairs.
    pub(super) fn offer(&mut self, approach: Approach) {
        match self.kept.iter_mut().find(|kept| kept.who == approach.who) {
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
        self.kept.sort_by(|a, b| a.lower_m.total_cmp(&b.lower_m).then(a.who.cmp(&b.who)));
        self.kept.truncate(KEPT);
        if let [.., last] = self.kept[..]
            && self.kept.len() == KEPT
        {
            self.threshold = last.lower_m;
        }
    }

    pub(super) fn into_vec(self) -> Vec<Approach> {
        self.kept
    }
}

/// A stretch of a violation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Below {
    pub(super) violation: Violation,
    /// Whether it is below at the very start of the stretch.
    pub(super) from_start: bool,
}

/// Everything found so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Findings {
    pub(super) closest: Closest,
    pub(super) obstacles: Closest,
    /// Of each pair in order of time.
    pub(super) violations: BTreeMap<Who, Vec<Violation>>,
    pub(super) undecided: BTreeMap<Who, Vec<Undecided>>,
    pub(super) swept: u64,
    pub(super) min_toi_s: Option<f64>,
    pub(super) disagreements: u64,
    pub(super) first_disagreement: Option<Disagreement>,
}

impl Findings {
    /// The table that an approach belongs to.
    pub(super) fn table(&mut self, who: Who) -> &mut Closest {
        match who {
            Who::Pair(_) => &mut self.closest,
            Who::Obstacle { .. } => &mut self.obstacles,
        }
    }

    /// Enters a stretch below the limit. Stretches of one pair come in order of time, but those that touch the border of
    /// two windows come twice.
    pub(super) fn violated(&mut self, below: Below) {
        let new = below.violation;
        let known = self.violations.entry(new.who).or_default();
        let mut touching = (0..known.len()).rev().take_while(|&k| known[k].to_s >= new.from_s);
        let repeated = touching.find(|&k| known[k].from_s <= new.from_s && new.to_s <= known[k].to_s);
        let continued = || known.len().checked_sub(1).filter(|&k| below.from_start && new.from_s <= known[k].to_s);
        match repeated.or_else(continued) {
            Some(k) => {
                let old = &mut known[k];
                old.to_s = old.to_s.max(new.to_s);
                if new.min_m < old.min_m {
                    (old.min_m, old.min_at_s) = (new.min_m, new.min_at_s);
                }
            }
            None => known.push(new),
        }
    }

    /// Enters a stretch that cannot be decided; adjacent ones of a pair become one.
    pub(super) fn unknown(&mut self, new: Undecided) {
        let known = self.undecided.entry(new.who).or_default();
        match known.last_mut() {
            Some(last) if new.from_s <= last.to_s && last.from_s <= new.to_s => {
                last.to_s = last.to_s.max(new.to_s);
                last.lower_m = last.lower_m.min(new.lower_m);
                last.upper_m = last.upper_m.min(new.upper_m);
                last.rate_hz = last.rate_hz.zip(new.rate_hz).map(|(a, b)| a.max(b));
            }
            _ => known.push(new),
        }
    }

    pub(super) fn contact(&mut self, time_s: f64) {
        self.min_toi_s = Some(self.min_toi_s.map_or(time_s, |earlier_s| earlier_s.min(time_s)));
    }

    pub(super) fn disagree(&mut self, disagreement: Disagreement) {
        self.disagreements += 1;
        self.first_disagreement.get_or_insert(disagreement);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swarm::Pair;

    fn approach(first: usize, lower_m: f64) -> Approach {
        let who = Who::Pair(Pair::new(first, 99));
        Approach { who, lower_m, upper_m: lower_m, time_s: 0.0, limit_m: 1.0 }
    }

    #[test]
    fn the_ten_closest_pairs_are_kept_each_at_its_closest() {
        let mut closest = Closest::default();
        for k in 0..12 {
            closest.offer(approach(k, 20.0 - k as f64));
        }
        assert_eq!(closest.threshold(), 18.0);
        closest.offer(approach(11, 8.0));
        closest.offer(approach(11, 8.5));
        closest.offer(approach(0, 19.0));
        assert_eq!(closest.cutoff(approach(11, 0.0).who), 8.0);
        assert_eq!(closest.cutoff(approach(0, 0.0).who), 18.0);
        let kept: Vec<_> = closest.into_vec().iter().map(|kept| kept.lower_m).collect();
        assert_eq!(kept, [8.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0]);
    }

    #[test]
    fn stretches_of_one_violation_are_one_and_a_return_is_another() {
        let who = Who::Pair(Pair::new(0, 1));
        let below = |from_s, to_s, min_m, from_start| Below {
            violation: Violation { who, from_s, to_s, min_m, min_at_s: from_s, limit_m: 2.0 },
            from_start,
        };
        let mut findings = Findings::default();
        findings.violated(below(0.5, 1.0, 1.5, false));
        findings.violated(below(1.0, 1.5, 1.2, true));
        findings.violated(below(1.0, 1.5, 1.2, true));
        findings.violated(below(1.5, 1.75, 1.9, false));
        // The border of two windows: what touches it comes again.
        findings.violated(below(1.0, 1.5, 1.2, true));
        let found: Vec<_> = findings.violations[&who].iter().map(|v| (v.from_s, v.to_s, v.min_m)).collect();
        assert_eq!(found, [(0.5, 1.5, 1.2), (1.5, 1.75, 1.9)]);
    }
}
