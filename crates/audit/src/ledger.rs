//! Findings so far: times below a limit, times that cannot be decided, the answers of the second detector, and the closest
//! approaches.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::cross_check::{CrossCheck, KeepOut};
use super::exact::ExactMotion;
use super::findings::{Episodes, Finding, Tally};
use super::outcome::{Approach, Disagreement, ObjectPair, ParryEvidence, Undecided, Violation};
use super::sweep::{Interval, RelativeMotion};

/// The findings on pairs that are named by `P`.
#[derive(Clone, Debug)]
pub(super) struct Ledger<P: Copy + Ord + fmt::Debug> {
    /// In the order in which they were found.
    pub(super) violations: Episodes<Violation<P>>,
    undecided: Episodes<Undecided<P>>,
    /// The sampling rate that would decide all that is undecided \[Hz\]; none where there is none that would.
    deciding_rate_hz: Option<f64>,
    pub(super) parry: ParryEvidence<P>,
}

/// Every violation and every undecided time, or the worst and the first of them, and how many there are.
pub(super) struct Lists<P: Copy + Ord + fmt::Debug> {
    pub(super) violations: Vec<Violation<P>>,
    pub(super) undecided: Vec<Undecided<P>>,
    pub(super) violations_tally: Tally,
    pub(super) undecided_tally: Tally,
    pub(super) deciding_rate_hz: Option<f64>,
}

impl<P: Copy + Ord + fmt::Debug> Finding for Violation<P> {
    type On = P;

    fn on(&self) -> P {
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
    type On = P;

    fn on(&self) -> P {
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
    /// One that counts what it finds, and lists the worst and the first of it.
    pub(super) fn bounded() -> Self {
        let (violations, undecided) = (Episodes::bounded(), Episodes::bounded());
        Self { violations, undecided, ..Self::default() }
    }

    /// The window that is swept from now on, behind all that were.
    pub(super) fn begin(&mut self, window: Interval) {
        self.violations.begin(window);
        self.undecided.begin(window);
    }

    /// Settles, now and then, what nothing that is still to be swept can continue. Is called between two pairs.
    pub(super) fn settle(&mut self) {
        self.violations.settle();
        self.undecided.settle();
    }

    /// Judges a straight motion that is below the limit, close to it, or in contact by the cast; returns the index of its
    /// violation, if it is one. `least_m` gives the smallest separation of a violation.
    #[cold]
    pub(super) fn near(
        &mut self,
        pair: P,
        keep_out: &KeepOut,
        motion: &RelativeMotion,
        contact: Option<f64>,
        exact: &ExactMotion,
        least_m: impl FnOnce() -> f64,
    ) -> Option<usize> {
        let (limit_m, over, approach) = (keep_out.delta_m, exact.over, motion.closest());
        let resolution_m = motion.resolution_m();
        let is_surely_below = approach.separation_m() + resolution_m < limit_m;
        let is_below = is_surely_below || exact.is_below(limit_m);
        let (span, check) = keep_out.compare(motion, approach, is_below, contact);
        self.cross_check(pair, over, approach.separation_m(), span.map(|span| span.enter), check);
        let span = span?;
        let (from_s, to_s, min_at_s) = (over.at(span.enter), over.at(span.exit), over.at(approach.at));
        if self.violations.is_of_before(to_s) {
            return None;
        }
        let violation = Violation { pair, from_s, to_s, min_m: least_m(), min_at_s, limit_m };
        let start_m = motion.from_squared.sqrt();
        let is_near = (start_m - limit_m).abs() <= resolution_m;
        let from_start = if is_near { exact.starts_below(limit_m) } else { start_m < limit_m };
        Some(self.violated(violation, from_start))
    }

    /// Enters a time below the limit, and says whether it is below from the very start of a segment; returns the index of
    /// the violation that it is a part of. Those of one pair come in order of time, but may come again.
    pub(super) fn violated(&mut self, new: Violation<P>, from_start: bool) -> usize {
        let (all, known) = (&self.violations, self.violations.of(new.pair));
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

    /// Enters a time that cannot be decided; adjacent ones of a pair become one.
    pub(super) fn undecided(&mut self, new: Undecided<P>) {
        self.deciding_rate_hz = self.deciding_rate_hz.zip(new.rate_hz).map(|(a, b)| a.max(b));
        let last = self.undecided.of(new.pair).last().copied();
        match last.and_then(|last| self.undecided.get_mut(last)) {
            Some(last) if new.from_s <= last.to_s && last.from_s <= new.to_s => {
                last.to_s = last.to_s.max(new.to_s);
                last.lower_m = last.lower_m.min(new.lower_m);
                last.upper_m = last.upper_m.min(new.upper_m);
                last.rate_hz = last.rate_hz.zip(new.rate_hz).map(|(a, b)| a.max(b));
            }
            _ => {
                self.undecided.add(new);
            }
        }
    }

    /// Enters what the second detector says of an interval, where the first finds this smallest distance and, at this
    /// fraction, the first contact.
    pub(super) fn cross_check(&mut self, pair: P, over: Interval, min_m: f64, enter: Option<f64>, check: CrossCheck) {
        let [closed_form_s, parry_s] = [enter, check.contact].map(|fraction| fraction.map(|u| over.at(u)));
        let earlier_s = self.parry.min_toi_s;
        self.parry.min_toi_s = earlier_s.into_iter().chain(parry_s.filter(|time_s| !time_s.is_nan())).reduce(f64::min);
        if !check.agrees {
            let Interval { from_s, to_s } = over;
            self.parry.disagreements += 1;
            let new = Disagreement { pair, from_s, to_s, min_m, closed_form_s, parry_s };
            self.parry.first_disagreement.get_or_insert(new);
        }
    }

    /// Whether every time is decided and the two detectors agree.
    pub(super) fn is_decided(&self) -> bool {
        self.undecided.is_empty() && self.parry.disagreements == 0
    }

    /// What was found, in the order of its beginning and then by pair.
    pub(super) fn into_lists(self) -> Lists<P> {
        let (violations, violations_tally) = self.violations.finish();
        let (undecided, undecided_tally) = self.undecided.finish();
        let deciding_rate_hz = self.deciding_rate_hz.filter(|_| !undecided.is_empty());
        Lists { violations, undecided, violations_tally, undecided_tally, deciding_rate_hz }
    }
}

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

/// Flag that stops the work. Long loops check the flag and return an incomplete result. The caller that started the work
/// checks the flag too and drops the result.
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
    fn pairs_that_go_on_are_merged_and_those_that_begin_between_them_are_not() {
        let (a, b, c) = (Pair::new(0, 1), Pair::new(0, 2), Pair::new(1, 2));
        let mut ledger = Ledger::default();
        for (pair, span_s, min_m, from_start, index) in [
            (a, [0.5, 1.0], 1.0, false, 0),
            (c, [0.2, 1.0], 1.5, false, 1),
            (a, [1.0, 1.5], 1.2, true, 0),
            (b, [1.3, 1.4], 0.5, false, 2),
            (c, [1.0, 2.0], 0.1, true, 1),
        ] {
            assert_eq!(ledger.violated(below(pair, span_s, min_m), from_start), index);
        }
        let found: Vec<_> =
            ledger.into_lists().violations.iter().map(|v| (v.pair, v.from_s, v.to_s, v.min_m, v.min_at_s)).collect();
        assert_eq!(found, [(c, 0.2, 2.0, 0.1, 1.0), (a, 0.5, 1.5, 1.0, 0.5), (b, 1.3, 1.4, 0.5, 1.3)]);
    }

    #[test]
    fn a_pair_that_left_and_came_back_at_the_same_instant_is_two_violations() {
        let pair = Pair::new(0, 1);
        let mut ledger = Ledger::default();
        ledger.violated(below(pair, [0.5, 1.0], 1.0), false);
        ledger.violated(below(pair, [1.0, 1.5], 1.0), false);
        assert_eq!(ledger.violations.len(), 2);
    }

    #[test]
    fn segments_of_one_violation_are_one_and_a_return_is_another() {
        let pair = Pair::new(0, 1);
        let mut ledger = Ledger::default();
        ledger.violated(below(pair, [0.5, 1.0], 1.5), false);
        ledger.violated(below(pair, [1.0, 1.5], 1.2), true);
        ledger.violated(below(pair, [1.0, 1.5], 1.2), true);
        ledger.violated(below(pair, [1.5, 1.75], 1.9), false);
        // The border of two windows: what touches it comes again.
        ledger.violated(below(pair, [1.0, 1.5], 1.2), true);
        let found: Vec<_> = ledger.violations.iter().map(|v| (v.from_s, v.to_s, v.min_m)).collect();
        assert_eq!(found, [(0.5, 1.5, 1.2), (1.5, 1.75, 1.9)]);
    }

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
