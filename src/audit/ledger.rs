//! Violation intervals, merged from step to step.

use super::outcome::Violation;
use crate::swarm::Pair;

/// What one step adds for a pair that was below delta in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Below {
    /// The interval within the step.
    pub(super) violation: Violation,
    /// Whether it is below at the very start of the step.
    pub(super) from_start: bool,
    /// Whether it is still below at the very end.
    pub(super) to_end: bool,
}

/// All violations so far, and which of them go on.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger {
    pub(super) violations: Vec<Violation>,
    pub(super) began: Vec<Violation>,
    pub(super) ended: Vec<Violation>,
    /// Indices of the violations that go on, by pair.
    open: Vec<usize>,
    still_open: Vec<usize>,
}

impl Ledger {
    /// Enters the findings of one step, which must be in the order of pairs.
    pub(super) fn enter(&mut self, step: &[Below]) {
        self.began.clear();
        self.ended.clear();
        self.still_open.clear();
        let mut open = self.open.iter().copied().peekable();
        for below in step {
            let pair: Pair = below.violation.pair;
            while let Some(index) = open.next_if(|&index| self.violations[index].pair < pair) {
                self.ended.push(self.violations[index]);
            }
            let goes_on = |index: &usize| below.from_start && self.violations[*index].pair == pair;
            let index = if let Some(index) = open.next_if(goes_on) {
                self.violations[index].extend(&below.violation);
                index
            } else {
                self.violations.push(below.violation);
                self.began.push(below.violation);
                self.violations.len() - 1
            };
            if below.to_end {
                self.still_open.push(index);
            } else {
                self.ended.push(self.violations[index]);
            }
        }
        self.ended.extend(open.map(|index| self.violations[index]));
        std::mem::swap(&mut self.open, &mut self.still_open);
    }

    /// All violations, in the order of their beginning and then by pair.
    pub(super) fn into_violations(mut self) -> Vec<Violation> {
        self.violations.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.pair.cmp(&b.pair)));
        self.violations
    }
}

impl Violation {
    fn extend(&mut self, later: &Violation) {
        self.to_s = later.to_s;
        if later.min_m < self.min_m {
            (self.min_m, self.min_at_s) = (later.min_m, later.min_at_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn below(pair: Pair, span_s: [f64; 2], min_m: f64, from_start: bool, to_end: bool) -> Below {
        let [from_s, to_s] = span_s;
        Below { violation: Violation { pair, from_s, to_s, min_m, min_at_s: from_s }, from_start, to_end }
    }

    #[test]
    fn pairs_that_go_on_are_merged_and_those_that_begin_between_them_are_not() {
        let (a, b, c) = (Pair::new(0, 1), Pair::new(0, 2), Pair::new(1, 2));
        let mut ledger = Ledger::default();
        ledger.enter(&[below(a, [0.5, 1.0], 1.0, false, true), below(c, [0.2, 1.0], 1.5, false, true)]);
        ledger.enter(&[
            below(a, [1.0, 1.5], 1.2, true, false),
            below(b, [1.3, 1.4], 0.5, false, false),
            below(c, [1.0, 2.0], 0.1, true, true),
        ]);
        assert_eq!(ledger.began.iter().map(|v| v.pair).collect::<Vec<_>>(), [b]);
        assert_eq!(ledger.ended.iter().map(|v| v.pair).collect::<Vec<_>>(), [a, b]);
        ledger.enter(&[]);
        assert_eq!(ledger.ended.iter().map(|v| v.pair).collect::<Vec<_>>(), [c]);
        let found: Vec<_> =
            ledger.into_violations().iter().map(|v| (v.pair, v.from_s, v.to_s, v.min_m, v.min_at_s)).collect();
        assert_eq!(found, [(c, 0.2, 2.0, 0.1, 1.0), (a, 0.5, 1.5, 1.0, 0.5), (b, 1.3, 1.4, 0.5, 1.3)]);
    }

    #[test]
    fn a_pair_that_left_and_came_back_at_the_same_instant_is_two_violations() {
        let pair = Pair::new(0, 1);
        let mut ledger = Ledger::default();
        ledger.enter(&[below(pair, [0.5, 1.0], 1.0, false, false)]);
        ledger.enter(&[below(pair, [1.0, 1.5], 1.0, false, false)]);
        assert_eq!(ledger.violations.len(), 2);
    }
}
