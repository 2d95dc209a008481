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
