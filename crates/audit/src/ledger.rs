//! What has been found so far: times below a limit, times that cannot be decided, and what the second detector says.

use std::fmt;

use super::episodes::Episodes;
use super::exact::ExactMotion;
use super::outcome::{Disagreement, ParryEvidence, Undecided, Violation};
use super::parry::{CrossCheck, KeepOut};
use super::shortlist::{Finding, Tally};
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
    is_bounded: bool,
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

    fn start_s(&self) -> f64 {
        self.from_s
    }

    fn end_s(&self) -> f64 {
        self.to_s
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

    fn start_s(&self) -> f64 {
        self.from_s
    }

    fn end_s(&self) -> f64 {
        self.to_s
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
            is_bounded: false,
        }
    }
}

impl<P: Copy + Ord + fmt::Debug> Ledger<P> {
    /// One that counts what it finds, and lists the worst and the first of it.
    pub(super) fn bounded() -> Self {
        let (violations, undecided) = (Episodes::bounded(), Episodes::bounded());
        Self { violations, undecided, is_bounded: true, ..Self::default() }
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
        let (violations, violations_tally) = self.violations.finish(self.is_bounded);
        let (undecided, undecided_tally) = self.undecided.finish(self.is_bounded);
        let deciding_rate_hz = self.deciding_rate_hz.filter(|_| !undecided.is_empty());
        Lists { violations, undecided, violations_tally, undecided_tally, deciding_rate_hz }
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
}
