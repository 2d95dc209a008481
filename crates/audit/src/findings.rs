//! Findings in a bounded list: the worst ones, and the first one on each pair or vehicle. All are counted. Consecutive
//! findings on one pair become one [`Episodes`] entry.

use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;

use serde::Serialize;

use super::sweep::Interval;

/// Most findings of one kind in a list by their excess, and as many as the first on its pair or vehicle.
pub const LISTED: usize = 1000;

/// A finding over a time, on a pair or on a vehicle.
pub(super) trait Finding: Copy {
    /// What it is on.
    type On: Copy + Ord + std::fmt::Debug;

    fn on(&self) -> Self::On;

    /// When it begins and ends \[s\].
    fn span_s(&self) -> [f64; 2];

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
        let (begin, on) = ((Ordered(finding.span_s()[0]), finding.on()), finding.on());
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
        let key = |of: &T| (Ordered(of.span_s()[0]), of.on(), Ordered(of.span_s()[1]), Ordered(of.excess()));
        both.map(|of| (key(&of), of)).collect::<BTreeMap<_, _>>().into_values().collect()
    }
}

/// Findings that are held before those that nothing can continue are settled.
const FEWEST_HELD: usize = 1 << 14;
/// Findings that may still be continued, at most: beyond, the least of them are settled where they are cut.
const MOST_OPEN: usize = 1 << 16;

/// Findings in the order in which they were found; dereferences to their list.
///
/// Where their number is bounded, motion is swept window after window, and in a window pair after pair. A finding that ended
/// before what is still to be swept of its pair is settled: it is counted, and kept only among the worst ones and the first ones
/// of their pairs.
#[derive(Clone, Debug)]
pub(super) struct Episodes<T: Finding> {
    all: Vec<T>,
    /// Indices of each pair's findings, in order of time.
    of_pair: BTreeMap<T::On, Vec<usize>>,
    settled: Option<Settled<T>>,
    is_exact: bool,
}

#[derive(Clone, Debug)]
struct Settled<T: Finding> {
    list: Shortlist<T>,
    count: u64,
    /// The window that is swept.
    window: Interval,
    /// Findings from this one on are of pairs that were swept over the window.
    swept_from: usize,
    /// How many are held before the next look.
    most_held: usize,
}

impl<T: Finding> Default for Episodes<T> {
    fn default() -> Self {
        Self { all: Vec::new(), of_pair: BTreeMap::new(), settled: None, is_exact: true }
    }
}

impl<T: Finding> Deref for Episodes<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.all
    }
}

impl<T: Finding> Episodes<T> {
    /// A bounded number of them.
    pub(super) fn bounded() -> Self {
        let window = Interval { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY };
        let list = Shortlist::new(LISTED);
        let settled = Settled { list, count: 0, window, swept_from: 0, most_held: FEWEST_HELD };
        Self { settled: Some(settled), ..Self::default() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty() && self.settled.as_ref().is_none_or(|settled| settled.list.is_empty())
    }

    /// Whether a finding was found over the window before: straight motion is judged whole, wherever windows end.
    pub(super) fn is_of_before(&self, to_s: f64) -> bool {
        self.settled.as_ref().is_some_and(|settled| to_s < settled.window.from_s)
    }

    /// The findings of a pair that may be continued, and those around them, by their indices in order of time.
    pub(super) fn of(&self, pair: T::On) -> &[usize] {
        self.of_pair.get(&pair).map_or(&[], Vec::as_slice)
    }

    pub(super) fn get_mut(&mut self, index: usize) -> Option<&mut T> {
        self.all.get_mut(index)
    }

    /// Enters a finding that continues none; returns its index.
    pub(super) fn add(&mut self, new: T) -> usize {
        self.of_pair.entry(new.on()).or_default().push(self.all.len());
        self.all.push(new);
        self.all.len() - 1
    }

    fn index(&mut self) {
        self.of_pair.clear();
        for (index, of) in self.all.iter().enumerate() {
            self.of_pair.entry(of.on()).or_default().push(index);
        }
    }

    /// The window that is swept from now on, behind all that were.
    pub(super) fn begin(&mut self, window: Interval) {
        if let Some(settled) = &mut self.settled {
            (settled.window, settled.swept_from) = (window, self.all.len());
        }
    }

    /// Settles, now and then, what nothing can continue. Is called between two pairs.
    #[inline]
    pub(super) fn settle(&mut self) {
        if self.settled.as_ref().is_some_and(|settled| self.all.len() >= settled.most_held) {
            self.settle_all();
        }
    }

    #[cold]
    fn settle_all(&mut self) {
        let Some(settled) = &mut self.settled else { return };
        let Interval { from_s, to_s } = settled.window;
        let (mut open, mut swept_from) = (Vec::new(), 0);
        for (k, of) in self.all.drain(..).enumerate() {
            let is_swept = k >= settled.swept_from;
            // What is swept next ends at the end of this window, or later.
            if of.span_s()[1] < if is_swept { to_s } else { from_s } {
                settled.list.offer(of);
                settled.count += 1;
            } else {
                swept_from += usize::from(!is_swept);
                open.push(of);
            }
        }
        if open.len() > MOST_OPEN {
            // Those that were swept and go on: what continues them is found again, and counted then.
            let mut going_on = open.split_off(swept_from);
            going_on.sort_by(|a, b| b.excess().total_cmp(&a.excess()).then(a.on().cmp(&b.on())));
            let cut = going_on.split_off(going_on.len().min(MOST_OPEN / 2));
            self.is_exact &= cut.is_empty();
            settled.list.extend(cut);
            open.extend(going_on);
        }
        settled.swept_from = swept_from;
        settled.most_held = (2 * open.len()).max(FEWEST_HELD);
        self.all = open;
        self.index();
    }

    /// Returns the findings in the order of their beginning and then by pair, shortened where the list is long, and their
    /// number.
    pub(super) fn finish(self) -> (Vec<T>, Tally) {
        let is_bounded = self.settled.is_some();
        let (mut list, settled) = self.settled.map_or((Vec::new(), 0), |of| (of.list.into_list(), of.count));
        let count = settled + self.all.len() as u64;
        list.extend(self.all);
        // The first of each pair comes first.
        list.sort_by(|a, b| a.span_s()[0].total_cmp(&b.span_s()[0]).then(a.on().cmp(&b.on())));
        if is_bounded && list.len() > LISTED {
            let mut shortlist = Shortlist::new(LISTED);
            shortlist.extend(list);
            list = shortlist.into_list();
        }
        let tally = Tally { count, listed: list.len(), is_exact: self.is_exact };
        (list, tally)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Found {
        pair: u32,
        span_s: [f64; 2],
        excess: f64,
    }

    /// A finding over half a second.
    fn found(pair: u32, from_s: f64, excess: f64) -> Found {
        Found { pair, span_s: [from_s, from_s + 0.5], excess }
    }

    impl Finding for Found {
        type On = u32;

        fn on(&self) -> u32 {
            self.pair
        }

        fn span_s(&self) -> [f64; 2] {
            self.span_s
        }

        fn excess(&self) -> f64 {
            self.excess
        }
    }

    fn kept(findings: &[Found]) -> Vec<Found> {
        let mut list = Shortlist::new(2);
        list.extend(findings.iter().copied());
        list.into_list()
    }

    #[test]
    fn the_worst_and_the_first_of_each_are_kept_in_any_order_of_pairs() {
        // On 0 at 0, 1 and 2 s, on 1 at 0.5 and 1.5 s, on 2 at 3 s.
        let of = [
            vec![found(0, 0.0, 1.0), found(0, 1.0, 5.0), found(0, 2.0, 2.0)],
            vec![found(1, 0.5, 0.1), found(1, 1.5, 4.0)],
            vec![found(2, 3.0, 3.0)],
        ];
        let expected = [found(0, 0.0, 1.0), found(1, 0.5, 0.1), found(0, 1.0, 5.0), found(1, 1.5, 4.0)];
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            assert_eq!(kept(&order.map(|k: usize| of[k].clone()).concat()), expected, "{order:?}");
        }
    }

    #[test]
    fn one_that_is_the_worst_and_the_first_is_listed_once() {
        assert_eq!(kept(&[found(7, 1.0, 2.0)]), [found(7, 1.0, 2.0)]);
        assert!(Shortlist::<Found>::new(2).is_empty() && kept(&[]).is_empty());
    }

    /// Sweeps a window in which `pairs` pairs have a finding over one interval. A finding continues an open one.
    fn sweep(episodes: &mut Episodes<Found>, window: [f64; 2], pairs: u32, [from_s, to_s]: [f64; 2]) -> usize {
        let mut most = 0;
        episodes.begin(Interval { from_s: window[0], to_s: window[1] });
        for pair in 0..pairs {
            let open = episodes.of(pair).last().copied().filter(|&k| episodes[k].span_s[1] >= from_s);
            match open.and_then(|open| episodes.get_mut(open)) {
                Some(open) => open.span_s[1] = to_s,
                None => {
                    episodes.add(Found { pair, span_s: [from_s, to_s], excess: f64::from(pair) });
                }
            }
            episodes.settle();
            most = most.max(episodes.len());
        }
        most
    }

    #[test]
    fn what_ended_is_settled_and_what_goes_on_is_one_finding() {
        let mut episodes = Episodes::bounded();
        let most = (0..40).map(|k| {
            let from_s = f64::from(k);
            sweep(&mut episodes, [from_s, from_s + 1.0], 5000, [from_s + 0.25, from_s + 0.5])
        });
        assert!(most.max().is_some_and(|most| most <= FEWEST_HELD), "they are not all held");
        let (list, tally) = episodes.finish();
        assert_eq!((tally.count, tally.is_exact), (200_000, true));
        // The worst thousand are of pair 4999 down to 4975, and the first thousand pairs begin first.
        assert_eq!((list.len(), list[0].pair), (2 * LISTED, 0));
        let mut going_on = Episodes::bounded();
        for k in 0..40 {
            let from_s = f64::from(k);
            sweep(&mut going_on, [from_s, from_s + 1.0], 5000, [from_s, from_s + 1.0]);
        }
        let (list, tally) = going_on.finish();
        assert_eq!((tally.count, tally.is_exact), (5000, true));
        assert!(list.iter().all(|of| of.span_s == [0.0, 40.0]));
    }

    #[test]
    fn more_that_goes_on_than_is_held_is_counted_once_at_most_and_said_to_be_inexact() {
        let mut episodes = Episodes::bounded();
        let pairs = 140_000;
        let most =
            [0.0, 1.0, 2.0].map(|from_s| sweep(&mut episodes, [from_s, from_s + 1.0], pairs, [from_s, from_s + 1.0]));
        assert!(most.into_iter().all(|most| most <= 4 * MOST_OPEN), "{most:?}");
        let (list, tally) = episodes.finish();
        assert!(!tally.is_exact && list.len() <= 2 * LISTED);
        assert!(tally.count <= u64::from(pairs) && tally.count > u64::from(pairs / 2), "{tally:?}");
    }
}
