//! Findings in a bounded list: the worst ones, and the first one on each pair or vehicle. All are counted.

use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

/// Most findings of one kind in a list by their excess, and as many as the first on its pair or vehicle.
pub const LISTED: usize = 1000;

/// A finding over a time, on a pair or on a vehicle.
pub(super) trait Finding: Copy {
    /// What it is on.
    type On: Copy + Ord + std::fmt::Debug;

    fn on(&self) -> Self::On;

    /// When it begins \[s\].
    fn start_s(&self) -> f64;

    /// When it ends \[s\].
    fn end_s(&self) -> f64;

    /// By how much it exceeds what is allowed: the larger, the worse.
    fn excess(&self) -> f64;
}

/// How many findings of one kind there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// How many there are; at least as many where `is_exact` is false.
    pub count: u64,
    /// How many of them are listed.
    pub listed: usize,
    /// Whether `count` is their exact number.
    pub is_exact: bool,
}

impl Tally {
    /// Of findings that are all listed.
    #[must_use]
    pub fn all(listed: usize) -> Self {
        Self { count: listed as u64, listed, is_exact: true }
    }

    /// Whether the list is shorter than what was found.
    #[must_use]
    pub fn is_shortened(&self) -> bool {
        self.count > self.listed as u64 || !self.is_exact
    }
}

/// A number in its total order.
#[derive(Clone, Copy, Debug)]
struct Ordered(f64);

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ordered {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ordered {}

/// The excess of a finding, and when it begins on what.
type Rank<On> = (Ordered, Reverse<(Ordered, On)>);

/// The worst findings, and the first on each pair or vehicle. What is kept does not depend on the order in which findings of
/// different pairs come; those of one pair come in order of time.
#[derive(Clone, Debug)]
pub(super) struct Shortlist<T: Finding> {
    /// Most findings that are kept for their excess, and most that are kept as the first on something.
    capacity: usize,
    /// By excess, the least first; of equal ones the latest first.
    worst: BTreeMap<Rank<T::On>, T>,
    firsts: BTreeMap<T::On, T>,
    /// When each of the firsts begins.
    begins: BTreeSet<(Ordered, T::On)>,
}

impl<T: Finding> Shortlist<T> {
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, worst: BTreeMap::new(), firsts: BTreeMap::new(), begins: BTreeSet::new() }
    }

    pub(super) fn offer(&mut self, finding: T) {
        let (begin, on) = ((Ordered(finding.start_s()), finding.on()), finding.on());
        let key = (Ordered(finding.excess()), Reverse(begin));
        let is_full = self.worst.len() >= self.capacity;
        if !is_full || self.worst.first_key_value().is_some_and(|(least, _)| *least < key) {
            self.worst.insert(key, finding);
            if self.worst.len() > self.capacity {
                self.worst.pop_first();
            }
        }
        let is_full = self.begins.len() >= self.capacity;
        if (!is_full || self.begins.last().is_some_and(|last| begin < *last)) && !self.firsts.contains_key(&on) {
            self.begins.insert(begin);
            self.firsts.insert(on, finding);
            if self.begins.len() > self.capacity
                && let Some((_, last)) = self.begins.pop_last()
            {
                self.firsts.remove(&last);
            }
        }
    }

    pub(super) fn extend(&mut self, findings: impl IntoIterator<Item = T>) {
        for finding in findings {
            self.offer(finding);
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.worst.is_empty()
    }

    /// Every finding that is kept, once, in the order of their beginning and then by what they are on.
    pub(super) fn into_list(self) -> Vec<T> {
        let both = self.worst.into_values().chain(self.firsts.into_values());
        let key = |of: &T| (Ordered(of.start_s()), of.on(), Ordered(of.end_s()), Ordered(of.excess()));
        both.map(|of| (key(&of), of)).collect::<BTreeMap<_, _>>().into_values().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Found(u32, f64, f64);

    impl Finding for Found {
        type On = u32;

        fn on(&self) -> u32 {
            self.0
        }

        fn start_s(&self) -> f64 {
            self.1
        }

        fn end_s(&self) -> f64 {
            self.1 + 0.5
        }

        fn excess(&self) -> f64 {
            self.2
        }
    }

    fn kept(found: &[Found]) -> Vec<Found> {
        let mut list = Shortlist::new(2);
        list.extend(found.iter().copied());
        list.into_list()
    }

    #[test]
    fn the_worst_and_the_first_of_each_are_kept_in_any_order_of_pairs() {
        // On 0 at 0, 1 and 2 s, on 1 at 0.5 and 1.5 s, on 2 at 3 s.
        let of = [
            vec![Found(0, 0.0, 1.0), Found(0, 1.0, 5.0), Found(0, 2.0, 2.0)],
            vec![Found(1, 0.5, 0.1), Found(1, 1.5, 4.0)],
            vec![Found(2, 3.0, 3.0)],
        ];
        let expected = [Found(0, 0.0, 1.0), Found(1, 0.5, 0.1), Found(0, 1.0, 5.0), Found(1, 1.5, 4.0)];
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            assert_eq!(kept(&order.map(|k: usize| of[k].clone()).concat()), expected, "{order:?}");
        }
    }

    #[test]
    fn one_that_is_the_worst_and_the_first_is_listed_once() {
        assert_eq!(kept(&[Found(7, 1.0, 2.0)]), [Found(7, 1.0, 2.0)]);
        assert!(Shortlist::<Found>::new(2).is_empty() && kept(&[]).is_empty());
    }
}
