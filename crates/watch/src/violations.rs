//! Measured violations that are present, in bounded memory.

use crate::event::{Event, Pair};
use tautline_audit::{Sweep, Violation};

/// Largest number of violations that are present at the same time and have a record each.
pub const MOST_OPEN: usize = 4096;

/// Violations that are present, in order of their pairs.
#[derive(Clone, Debug)]
pub(crate) struct OpenViolations {
    open: Vec<Record>,
    /// Number of violations without a record.
    unlisted: u64,
    /// Number of violations so far.
    total: u64,
}

#[derive(Clone, Copy, Debug)]
struct Record {
    of: Violation<Pair>,
    /// Number of the judgement that examined the pair last.
    judged: u64,
}

impl OpenViolations {
    pub(crate) fn new() -> Self {
        Self { open: Vec::with_capacity(MOST_OPEN), unlisted: 0, total: 0 }
    }

    pub(crate) fn total(&self) -> u64 {
        self.total + self.unlisted
    }

    /// Returns the present violation with the smallest distance.
    pub(crate) fn worst(&self) -> Option<Violation<Pair>> {
        self.open().min_by(|a, b| a.min_m.total_cmp(&b.min_m))
    }

    /// Returns a pair that judgement `number` has not examined.
    pub(crate) fn unexamined(&self, number: u64) -> Option<Pair> {
        self.open.iter().find(|record| record.judged < number).map(|record| record.of.pair)
    }

    /// Notes that a judgement examined a pair.
    pub(crate) fn examined(&mut self, pair: Pair, number: u64) {
        if let Ok(k) = self.find(pair) {
            self.open[k].judged = number;
        }
    }

    /// Takes the sweep of a pair from `from_s` to `to_s` with a limit \[m\].
    pub(crate) fn take(
        &mut self,
        pair: Pair,
        [from_s, to_s]: [f64; 2],
        sweep: &Sweep,
        limit_m: f64,
        number: u64,
    ) -> [Option<Event>; 2] {
        let time_s = |share: f64| from_s + (to_s - from_s) * share;
        let found = self.find(pair);
        let Some([enter, leave]) = sweep.below else {
            return [found.ok().map(|k| Event::Ended(self.open.remove(k).of)), None];
        };
        let mut events = [None, None];
        let k = match found {
            Ok(k) => {
                let of = &mut self.open[k].of;
                of.to_s = time_s(leave);
                if sweep.min_m < of.min_m {
                    (of.min_m, of.min_at_s) = (sweep.min_m, time_s(sweep.at));
                }
                k
            }
            Err(_) if self.open.len() == MOST_OPEN => {
                self.unlisted += 1;
                return events;
            }
            Err(k) => {
                let of = Violation {
                    pair,
                    from_s: time_s(enter),
                    to_s: time_s(leave),
                    min_m: sweep.min_m,
                    min_at_s: time_s(sweep.at),
                    limit_m,
                };
                self.total += 1;
                self.open.insert(k, Record { of, judged: number });
                events[0] = Some(Event::Began(of));
                k
            }
        };
        if leave < 1.0 {
            events[1] = Some(Event::Ended(self.open.remove(k).of));
        }
        events
    }

    /// Returns the present violations.
    pub(crate) fn open(&self) -> impl Iterator<Item = Violation<Pair>> + '_ {
        self.open.iter().map(|record| record.of)
    }

    /// Removes and returns a violation whose pair fulfils a condition.
    pub(crate) fn close(&mut self, is_over: impl Fn(Pair) -> bool) -> Option<Violation<Pair>> {
        let k = self.open.iter().position(|record| is_over(record.of.pair))?;
        Some(self.open.remove(k).of)
    }

    fn find(&self, pair: Pair) -> Result<usize, usize> {
        self.open.binary_search_by(|record| record.of.pair.cmp(&pair))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::OpenViolations;
    use crate::event::Event;
    use tautline_audit::sweep;

    #[test]
    fn a_violation_over_two_sweeps_is_one() {
        let mut open = OpenViolations::new();
        let at = |x| Vector3::new(x, 0.5, 0.0);
        let first = open.take([0, 1], [0.0, 1.0], &sweep(at(-2.0), at(0.2), 1.0), 1.0, 1);
        assert!(matches!(first, [Some(Event::Began(_)), None]), "{first:?}");
        let second = open.take([0, 1], [1.0, 2.0], &sweep(at(0.2), at(2.4), 1.0), 1.0, 2);
        let [Some(Event::Ended(of)), None] = [second[1], second[0]] else { panic!("{second:?}") };
        let half_s = 0.75_f64.sqrt() / 2.2;
        assert!((of.from_s - (2.0 / 2.2 - half_s)).abs() < 1e-12, "{of:?}");
        assert!((of.to_s - (2.0 / 2.2 + half_s)).abs() < 1e-12, "{of:?}");
        assert!((of.min_m - 0.5).abs() < 1e-12 && (of.min_at_s - 2.0 / 2.2).abs() < 1e-12, "{of:?}");
        assert_eq!((open.total(), open.worst()), (1, None));
    }
}
