//! Findings so far: times below a limit, undecided times, results of the second detector, and closest approaches.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::cross_check::{CrossCheck, KeepOut};
use super::exact::ExactMotion;
use super::findings::{Episodes, Finding, Tally};
use super::outcome::{Approach, Disagreement, ObjectPair, ParryEvidence, Undecided, Violation};
use super::sweep::{Interval, RelativeMotion};

/// Findings of pairs identified by `P`.
#[derive(Clone, Debug)]
pub(super) struct Ledger<P: Copy + Ord + fmt::Debug> {
    /// Violations in the order in which they were found.
    pub(super) violations: Episodes<Violation<P>>,
    undecided: Episodes<Undecided<P>>,
    /// Sampling rate that would decide all undecided times \[Hz\]; `None` if no rate would.
    deciding_rate_hz: Option<f64>,
    pub(super) parry: ParryEvidence<P>,
}

/// All violations and undecided times, or the worst and first of them, with their numbers.
pub(super) struct Lists<P: Copy + Ord + fmt::Debug> {
    pub(super) violations: Vec<Violation<P>>,
    pub(super) undecided: Vec<Undecided<P>>,
    pub(super) violations_tally: Tally,
    pub(super) undecided_tally: Tally,
    pub(super) deciding_rate_hz: Option<f64>,
}

impl<P: Copy + Ord + fmt::Debug> Finding for Violation<P> {
    type Subject = P;

    fn subject(&self) -> P {
        self.pair
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        self.limit_m - self.min_m
    }
}

impl<P: Copy + Ord + fmt::Debug> Finding for Undecided<P> {
    type Subject = P;

    fn subject(&self) -> P {
        self.pair
    }

    fn span_s(&self) -> [f64; 2] {
        [self.from_s, self.to_s]
    }

    fn excess(&self) -> f64 {
        self.limit_m - self.lower_m
    }
}

impl<P: Copy + Ord + fmt::Debug> Default for Ledger<P> {
    fn default() -> Self {
        Self {
            violations: Episodes::default(),
            undecided: Episodes::default(),
            deciding_rate_hz: Some(0.0),
            parry: ParryEvidence::default(),
        }
    }
}

impl<P: Copy + Ord + fmt::Debug> Ledger<P> {
    /// Creates a ledger that counts its findings and lists the worst and first of them.
    pub(super) fn bounded() -> Self {
        let (violations, undecided) = (Episodes::bounded(), Episodes::bounded());
        Self { violations, undecided, ..Self::default() }
    }

    /// Begins a new window, later than all earlier ones.
    pub(super) fn begin_window(&mut self, window: Interval) {
        self.violations.begin_window(window);
        self.undecided.begin_window(window);
    }

    /// Settles finished findings if many are held. Called between two pairs.
    pub(super) fn settle(&mut self) {
        self.violations.settle();
        self.undecided.settle();
    }

    /// Judges a straight motion that is below the limit, close to it, or in contact by the cast; returns the index of
    /// its violation, if any. `least_m` computes the smallest separation of a violation.
    #[cold]
    pub(super) fn judge_straight(
        &mut self,
        pair: P,
        keep_out: &KeepOut,
        motion: &RelativeMotion,
        contact: Option<f64>,
        exact: &ExactMotion,
        least_m: impl FnOnce() -> f64,
    ) -> Option<usize> {
        let (limit_m, interval, approach) = (keep_out.delta_m, exact.interval, motion.closest());
        let resolution_m = motion.resolution_m();
        let is_surely_below = approach.separation_m() + resolution_m < limit_m;
        let is_below = is_surely_below || exact.is_below(limit_m);
        let (span, check) = keep_out.compare(motion, approach, is_below, contact);
        self.add_cross_check(pair, interval, approach.separation_m(), span.map(|span| span.enter), check);
        let span = span?;
        let (from_s, to_s, min_at_s) = (interval.at(span.enter), interval.at(span.exit), interval.at(approach.at));
        if self.violations.is_from_earlier_window(to_s) {
            return None;
        }
        let violation = Violation { pair, from_s, to_s, min_m: least_m(), min_at_s, limit_m };
        let start_m = motion.from_squared.sqrt();
        let is_near = (start_m - limit_m).abs() <= resolution_m;
        let from_start = if is_near { exact.starts_below(limit_m) } else { start_m < limit_m };
        Some(self.add_violation(violation, from_start))
    }

    /// Adds a time below the limit; returns the index of the violation that contains it. `from_start` states that the
    /// segment is below the limit from its first instant. Times of one pair come in order, and may come twice.
    pub(super) fn add_violation(&mut self, new: Violation<P>, from_start: bool) -> usize {
        let (all, known) = (&self.violations, self.violations.indices_of(new.pair));
        let mut touching = known.iter().rev().copied().take_while(|&k| all[k].to_s >= new.from_s);
        let repeated = touching.find(|&k| all[k].from_s <= new.from_s && new.to_s <= all[k].to_s);
        let continued = || known.last().copied().filter(|&k| from_start && new.from_s <= all[k].to_s);
        let found = repeated.or_else(continued);
        if let Some((k, old)) = found.and_then(|k| Some((k, self.violations.get_mut(k)?))) {
            old.to_s = old.to_s.max(new.to_s);
            if new.min_m < old.min_m {
                (old.min_m, old.min_at_s) = (new.min_m, new.min_at_s);
            }
            return k;
        }
        self.violations.add(new)
    }

    /// Adds an undecided time; adjacent undecided times of a pair are merged. Returns whether it continues none.
    fn add_undecided(&mut self, new: Undecided<P>) -> bool {
        self.deciding_rate_hz = self.deciding_rate_hz.zip(new.rate_hz).map(|(a, b)| a.max(b));
        let last = self.undecided.indices_of(new.pair).last().copied();
        match last.and_then(|last| self.undecided.get_mut(last)) {
            Some(last) if new.from_s <= last.to_s && last.from_s <= new.to_s => {
                last.to_s = last.to_s.max(new.to_s);
                last.lower_m = last.lower_m.min(new.lower_m);
                last.upper_m = last.upper_m.min(new.upper_m);
                last.rate_hz = last.rate_hz.zip(new.rate_hz).map(|(a, b)| a.max(b));
                false
            }
            _ => {
                self.undecided.add(new);
                true
            }
        }
    }

    /// Adds the result of the second detector for an interval. `min_m` and `enter` are the smallest distance and the
    /// fraction of the first contact by the first detector.
    pub(super) fn add_cross_check(
        &mut self,
        pair: P,
        interval: Interval,
        min_m: f64,
        enter: Option<f64>,
        check: CrossCheck,
    ) {
        let [closed_form_s, parry_s] = [enter, check.contact].map(|fraction| fraction.map(|u| interval.at(u)));
        let earlier_s = self.parry.min_toi_s;
        self.parry.min_toi_s = earlier_s.into_iter().chain(parry_s.filter(|time_s| !time_s.is_nan())).reduce(f64::min);
        if !check.agrees {
            let Interval { from_s, to_s } = interval;
            self.parry.disagreements += 1;
            let new = Disagreement { pair, from_s, to_s, min_m, closed_form_s, parry_s };
            self.parry.first_disagreement.get_or_insert(new);
        }
    }

    /// Returns whether every time is decided and the two detectors agree.
    pub(super) fn is_decided(&self) -> bool {
        self.undecided.is_empty() && self.parry.disagreements == 0
    }

    /// Returns the findings, ordered by start and then by pair.
    pub(super) fn into_lists(self) -> Lists<P> {
        let (violations, violations_tally) = self.violations.finish();
        let (undecided, undecided_tally) = self.undecided.finish();
        let deciding_rate_hz = self.deciding_rate_hz.filter(|_| !undecided.is_empty());
        Lists { violations, undecided, violations_tally, undecided_tally, deciding_rate_hz }
    }
}

/// Largest number of approaches that are kept.
pub(super) const MAX_KEPT: usize = 10;

/// Closest approaches of different pairs.
#[derive(Clone, Debug)]
pub(super) struct ClosestPairs {
    pub(super) kept: Vec<Approach>,
    /// Value that another pair must come below to be added: a distance, or a distance beyond its limit.
    pub(super) threshold: f64,
    /// Whether pairs are ordered by distance beyond their limits instead of by distance.
    beyond_limit: bool,
}

impl Default for ClosestPairs {
    fn default() -> Self {
        Self { kept: Vec::with_capacity(MAX_KEPT + 1), threshold: f64::INFINITY, beyond_limit: false }
    }
}

impl ClosestPairs {
    /// Creates a table of the pairs that are closest to their limits.
    pub(super) fn to_limits() -> Self {
        Self { beyond_limit: true, ..Self::default() }
    }

    /// Returns the number by which approaches are ordered.
    fn order_key(&self, approach: &Approach) -> f64 {
        if self.beyond_limit { approach.lower_m - approach.limit_m } else { approach.lower_m }
    }

    /// Returns the distance that this pair must come below to change the table. If the pair is known by separate
    /// bounds, the upper bound can still fall.
    pub(super) fn cutoff(&self, pair: ObjectPair, limit_m: f64) -> f64 {
        let known = self.kept.iter().find(|kept| kept.pair == pair);
        let to_be_kept = if self.beyond_limit { self.threshold + limit_m } else { self.threshold };
        known.map_or(to_be_kept, |kept| if kept.is_known() { kept.lower_m } else { kept.upper_m })
    }

    /// Adds an approach: keeps the closer of two approaches of one pair, and the closest pairs.
    pub(super) fn offer(&mut self, approach: Approach) {
        let key = self.order_key(&approach);
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
            self.order_key(a)
                .total_cmp(&self.order_key(b))
                .then(a.upper_m.total_cmp(&b.upper_m))
                .then(a.pair.cmp(&b.pair))
        });
        kept.truncate(MAX_KEPT);
        self.kept = kept;
        if let [.., last] = self.kept[..]
            && self.kept.len() == MAX_KEPT
        {
            self.threshold = self.order_key(&last);
        }
    }
}

/// All findings so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Results {
    pub(super) ledger: Ledger<ObjectPair>,
    pub(super) closest: ClosestPairs,
    pub(super) obstacles: ClosestPairs,
    /// Number of pairs of segments that were swept.
    pub(super) swept: u64,
    /// Number of undecided times of obstacles.
    pub(super) undecided_of_obstacles: u64,
    /// Flag that stops the sweep.
    pub(super) interruption: Interruption,
}

impl Results {
    /// Creates empty results with a bounded ledger. It counts all findings and lists only the worst and the first.
    pub(super) fn bounded(interruption: Interruption) -> Self {
        Self { ledger: Ledger::bounded(), interruption, ..Self::default() }
    }

    /// Settles the findings of earlier pairs and returns whether the sweep continues.
    #[inline]
    pub(super) fn settle_and_continue(&mut self) -> bool {
        self.ledger.settle();
        !self.interruption.is_set()
    }

    /// Adds an undecided time of a pair.
    pub(super) fn add_undecided(&mut self, new: Undecided<ObjectPair>) {
        let is_new = self.ledger.add_undecided(new);
        self.undecided_of_obstacles += u64::from(is_new && new.pair.vehicles().is_none());
    }

    /// Returns the table of closest approaches that a pair belongs to.
    pub(super) fn closest_pairs_mut(&mut self, pair: ObjectPair) -> &mut ClosestPairs {
        match pair {
            ObjectPair::Vehicles(_) => &mut self.closest,
            ObjectPair::Obstacle { .. } => &mut self.obstacles,
        }
    }
}

/// Flag that stops the work. Long loops check the flag and return an incomplete result. The caller checks the flag too
/// and drops that result.
#[derive(Clone, Debug, Default)]
pub(super) struct Interruption(Option<Arc<AtomicBool>>);

impl Interruption {
    pub(super) fn new(flag: Arc<AtomicBool>) -> Self {
        Self(Some(flag))
    }

    #[inline]
    pub(super) fn is_set(&self) -> bool {
        self.0.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Pair;

    fn below(pair: Pair, span_s: [f64; 2], min_m: f64) -> Violation {
        let [from_s, to_s] = span_s;
        Violation { pair, from_s, to_s, min_m, min_at_s: from_s, limit_m: 2.0 }
    }

    #[test]
    fn continued_violations_are_merged_and_new_ones_are_not() {
        let (a, b, c) = (Pair::new(0, 1), Pair::new(0, 2), Pair::new(1, 2));
        let mut ledger = Ledger::default();
        for (pair, span_s, min_m, from_start, index) in [
            (a, [0.5, 1.0], 1.0, false, 0),
            (c, [0.2, 1.0], 1.5, false, 1),
            (a, [1.0, 1.5], 1.2, true, 0),
            (b, [1.3, 1.4], 0.5, false, 2),
            (c, [1.0, 2.0], 0.1, true, 1),
        ] {
            assert_eq!(ledger.add_violation(below(pair, span_s, min_m), from_start), index);
        }
        let found: Vec<_> =
            ledger.into_lists().violations.iter().map(|v| (v.pair, v.from_s, v.to_s, v.min_m, v.min_at_s)).collect();
        assert_eq!(found, [(c, 0.2, 2.0, 0.1, 1.0), (a, 0.5, 1.5, 1.0, 0.5), (b, 1.3, 1.4, 0.5, 1.3)]);
    }

    #[test]
    fn a_violation_that_ends_and_restarts_at_one_instant_is_two() {
        let pair = Pair::new(0, 1);
        let mut ledger = Ledger::default();
        ledger.add_violation(below(pair, [0.5, 1.0], 1.0), false);
        ledger.add_violation(below(pair, [1.0, 1.5], 1.0), false);
        assert_eq!(ledger.violations.len(), 2);
    }

    #[test]
    fn consecutive_segments_are_one_violation_and_a_later_entry_is_another() {
        let pair = Pair::new(0, 1);
        let mut ledger = Ledger::default();
        ledger.add_violation(below(pair, [0.5, 1.0], 1.5), false);
        ledger.add_violation(below(pair, [1.0, 1.5], 1.2), true);
        ledger.add_violation(below(pair, [1.0, 1.5], 1.2), true);
        ledger.add_violation(below(pair, [1.5, 1.75], 1.9), false);
        // The border of two windows: a segment that touches it comes again.
        ledger.add_violation(below(pair, [1.0, 1.5], 1.2), true);
        let found: Vec<_> = ledger.violations.iter().map(|v| (v.from_s, v.to_s, v.min_m)).collect();
        assert_eq!(found, [(0.5, 1.5, 1.2), (1.5, 1.75, 1.9)]);
    }

    fn approach(first: usize, lower_m: f64) -> Approach {
        let pair = ObjectPair::Vehicles(Pair::new(first, 99));
        Approach { pair, lower_m, upper_m: lower_m, time_s: 0.0, limit_m: 1.0 }
    }

    #[test]
    fn the_ten_closest_pairs_are_kept_each_at_its_smallest_distance() {
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
        assert!(!closest.kept.contains(&far), "ten other pairs are closer");
        let mut to_limits = ClosestPairs::to_limits();
        (0..12).for_each(|k| to_limits.offer(approach(k, 20.0 - k as f64)));
        assert_eq!((to_limits.threshold, to_limits.cutoff(far.pair, 30.0)), (17.0, 47.0));
        to_limits.offer(far);
        assert_eq!(to_limits.kept[0], far, "this pair is the closest to its limit");
        let kept: Vec<_> = closest.kept.iter().map(|kept| kept.lower_m).collect();
        assert_eq!(kept, [8.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0]);
    }
}
