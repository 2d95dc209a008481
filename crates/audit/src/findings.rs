//! Bounded lists of findings: the worst findings, and the first finding of each pair or vehicle. All findings are
//! counted. Consecutive findings of one pair become one [`Episodes`] entry.

use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;

use serde::Serialize;

use super::sweep::Interval;

/// Largest number of findings of one kind that a list holds for their excess, and largest number that it holds as first
/// findings of their pair or vehicle.
pub const LISTED: usize = 1000;

/// Finding over an interval of time, for a pair or a vehicle.
pub(super) trait Finding: Copy {
    /// Pair or vehicle.
    type Subject: Copy + Ord + std::fmt::Debug;

    fn subject(&self) -> Self::Subject;

    /// Returns the start and end \[s\].
    fn span_s(&self) -> [f64; 2];

    /// Returns the amount beyond the limit: the larger, the worse.
    fn excess(&self) -> f64;
}

/// Number of findings of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Number of findings; a lower bound if `is_exact` is false.
    pub count: u64,
    /// Number of listed findings.
    pub listed: usize,
    /// Whether `count` is exact.
    pub is_exact: bool,
}

impl Tally {
    /// Returns the tally of findings that are all listed.
    #[must_use]
    pub fn all(listed: usize) -> Self {
        Self { count: listed as u64, listed, is_exact: true }
    }

    /// Returns whether the list holds fewer findings than were found.
    #[must_use]
    pub fn is_shortened(&self) -> bool {
        self.count > self.listed as u64 || !self.is_exact
    }
}

/// Number with the total order of `f64::total_cmp`.
#[derive(Clone, Copy, Debug)]
struct TotalOrder(f64);

impl Ord for TotalOrder {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for TotalOrder {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for TotalOrder {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for TotalOrder {}

/// Excess of a finding, then its start and its subject.
type Rank<Subject> = (TotalOrder, Reverse<(TotalOrder, Subject)>);

/// The worst findings, and the first of each pair or vehicle. The content does not depend on the order in which
/// findings of different pairs are added. Findings of one pair are added in order of time.
#[derive(Clone, Debug)]
pub(super) struct Shortlist<T: Finding> {
    /// Largest number of worst findings, and largest number of first findings.
    capacity: usize,
    /// Worst findings by excess, the least first; of equal ones the latest first.
    worst: BTreeMap<Rank<T::Subject>, T>,
    firsts: BTreeMap<T::Subject, T>,
    /// Start of each first finding.
    begins: BTreeSet<(TotalOrder, T::Subject)>,
}

impl<T: Finding> Shortlist<T> {
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, worst: BTreeMap::new(), firsts: BTreeMap::new(), begins: BTreeSet::new() }
    }

    pub(super) fn offer(&mut self, finding: T) {
        let (begin, subject) = ((TotalOrder(finding.span_s()[0]), finding.subject()), finding.subject());
        let key = (TotalOrder(finding.excess()), Reverse(begin));
        let is_full = self.worst.len() >= self.capacity;
        if !is_full || self.worst.first_key_value().is_some_and(|(least, _)| *least < key) {
            self.worst.insert(key, finding);
            if self.worst.len() > self.capacity {
                self.worst.pop_first();
            }
        }
        let is_full = self.begins.len() >= self.capacity;
        if (!is_full || self.begins.last().is_some_and(|last| begin < *last)) && !self.firsts.contains_key(&subject) {
            self.begins.insert(begin);
            self.firsts.insert(subject, finding);
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

    /// Returns every kept finding once, ordered by start and then by subject.
    pub(super) fn into_list(self) -> Vec<T> {
        let both = self.worst.into_values().chain(self.firsts.into_values());
        let key = |finding: &T| {
            (
                TotalOrder(finding.span_s()[0]),
                finding.subject(),
                TotalOrder(finding.span_s()[1]),
                TotalOrder(finding.excess()),
            )
        };
        both.map(|finding| (key(&finding), finding)).collect::<BTreeMap<_, _>>().into_values().collect()
    }
}

/// Number of held findings below which none are settled.
const MIN_HELD: usize = 1 << 14;
/// Largest number of findings that stay open. Beyond, the least severe are settled with the end that they have so far.
const MAX_OPEN: usize = 1 << 16;

/// Findings in the order in which they were found; dereferences to their list.
///
/// A bounded list sweeps motion window after window, and in a window pair after pair. A finding is settled if it ended
/// before the remaining motion of its pair. It is counted then, and kept only if it is among the worst or the first of
/// its pair.
#[derive(Clone, Debug)]
pub(super) struct Episodes<T: Finding> {
    all: Vec<T>,
    /// Indices of each pair's findings, in order of time.
    of_pair: BTreeMap<T::Subject, Vec<usize>>,
    settled: Option<SettledFindings<T>>,
    is_exact: bool,
}

#[derive(Clone, Debug)]
struct SettledFindings<T: Finding> {
    list: Shortlist<T>,
    count: u64,
    /// Window that is being swept.
    window: Interval,
    /// Index of the first finding of a pair that was already swept over the window.
    swept_from: usize,
    /// Number of held findings that triggers the next settlement.
    settle_at: usize,
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
    /// Creates a bounded list.
    pub(super) fn bounded() -> Self {
        let window = Interval { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY };
        let list = Shortlist::new(LISTED);
        let settled = SettledFindings { list, count: 0, window, swept_from: 0, settle_at: MIN_HELD };
        Self { settled: Some(settled), ..Self::default() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty() && self.settled.as_ref().is_none_or(|settled| settled.list.is_empty())
    }

    /// Returns whether a finding with this end was already found in an earlier window. Straight segments are judged
    /// whole, so they appear in every window that they meet.
    pub(super) fn is_from_earlier_window(&self, to_s: f64) -> bool {
        self.settled.as_ref().is_some_and(|settled| to_s < settled.window.from_s)
    }

    /// Returns the indices of the findings of a pair that may be continued, in order of time.
    pub(super) fn indices_of(&self, pair: T::Subject) -> &[usize] {
        self.of_pair.get(&pair).map_or(&[], Vec::as_slice)
    }

    pub(super) fn get_mut(&mut self, index: usize) -> Option<&mut T> {
        self.all.get_mut(index)
    }

    /// Adds a finding that continues none; returns its index.
    pub(super) fn add(&mut self, new: T) -> usize {
        self.of_pair.entry(new.subject()).or_default().push(self.all.len());
        self.all.push(new);
        self.all.len() - 1
    }

    fn index(&mut self) {
        self.of_pair.clear();
        for (index, finding) in self.all.iter().enumerate() {
            self.of_pair.entry(finding.subject()).or_default().push(index);
        }
    }

    /// Begins a new window, later than all earlier ones.
    pub(super) fn begin_window(&mut self, window: Interval) {
        if let Some(settled) = &mut self.settled {
            (settled.window, settled.swept_from) = (window, self.all.len());
        }
    }

    /// Settles finished findings if many are held. Called between two pairs.
    #[inline]
    pub(super) fn settle(&mut self) {
        if self.settled.as_ref().is_some_and(|settled| self.all.len() >= settled.settle_at) {
            self.settle_all();
        }
    }

    #[cold]
    fn settle_all(&mut self) {
        let Some(settled) = &mut self.settled else { return };
        let Interval { from_s, to_s } = settled.window;
        let (mut open, mut swept_from) = (Vec::new(), 0);
        for (k, finding) in self.all.drain(..).enumerate() {
            let is_swept = k >= settled.swept_from;
            // The next swept motion of a pair begins at the end of this window if the pair was swept, else at its
            // start.
            if finding.span_s()[1] < if is_swept { to_s } else { from_s } {
                settled.list.offer(finding);
                settled.count += 1;
            } else {
                swept_from += usize::from(!is_swept);
                open.push(finding);
            }
        }
        if open.len() > MAX_OPEN {
            // Findings of swept pairs that continue: their continuation is found again in the next window, and counted
            // then.
            let mut going_on = open.split_off(swept_from);
            going_on.sort_by(|a, b| b.excess().total_cmp(&a.excess()).then(a.subject().cmp(&b.subject())));
            let cut = going_on.split_off(going_on.len().min(MAX_OPEN / 2));
            self.is_exact &= cut.is_empty();
            settled.list.extend(cut);
            open.extend(going_on);
        }
        settled.swept_from = swept_from;
        settled.settle_at = (2 * open.len()).max(MIN_HELD);
        self.all = open;
        self.index();
    }

    /// Returns the findings ordered by start and then by pair, shortened if the list is long, and their number.
    pub(super) fn finish(self) -> (Vec<T>, Tally) {
        let is_bounded = self.settled.is_some();
        let (mut list, settled) =
            self.settled.map_or((Vec::new(), 0), |settled| (settled.list.into_list(), settled.count));
        let count = settled + self.all.len() as u64;
        list.extend(self.all);
        // The first finding of each pair comes first.
        list.sort_by(|a, b| a.span_s()[0].total_cmp(&b.span_s()[0]).then(a.subject().cmp(&b.subject())));
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

    /// Returns a finding that lasts half a second.
    fn found(pair: u32, from_s: f64, excess: f64) -> Found {
        Found { pair, span_s: [from_s, from_s + 0.5], excess }
    }

    impl Finding for Found {
        type Subject = u32;

        fn subject(&self) -> u32 {
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
    fn the_worst_and_first_findings_are_kept_in_any_order_of_pairs() {
        // Subject 0 at 0, 1 and 2 s; subject 1 at 0.5 and 1.5 s; subject 2 at 3 s.
        let findings = [
            vec![found(0, 0.0, 1.0), found(0, 1.0, 5.0), found(0, 2.0, 2.0)],
            vec![found(1, 0.5, 0.1), found(1, 1.5, 4.0)],
            vec![found(2, 3.0, 3.0)],
        ];
        let expected = [found(0, 0.0, 1.0), found(1, 0.5, 0.1), found(0, 1.0, 5.0), found(1, 1.5, 4.0)];
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            assert_eq!(kept(&order.map(|k: usize| findings[k].clone()).concat()), expected, "{order:?}");
        }
    }

    #[test]
    fn a_finding_that_is_worst_and_first_is_listed_once() {
        assert_eq!(kept(&[found(7, 1.0, 2.0)]), [found(7, 1.0, 2.0)]);
        assert!(Shortlist::<Found>::new(2).is_empty() && kept(&[]).is_empty());
    }

    /// Sweeps a window in which each of `pairs` pairs has a finding over the given interval. A finding continues an
    /// open one. Returns the largest number of held findings.
    fn sweep(episodes: &mut Episodes<Found>, window: [f64; 2], pairs: u32, [from_s, to_s]: [f64; 2]) -> usize {
        let mut most = 0;
        episodes.begin_window(Interval { from_s: window[0], to_s: window[1] });
        for pair in 0..pairs {
            let open = episodes.indices_of(pair).last().copied().filter(|&k| episodes[k].span_s[1] >= from_s);
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
    fn ended_findings_are_settled_and_continued_findings_are_merged() {
        let mut episodes = Episodes::bounded();
        let most = (0..40).map(|k| {
            let from_s = f64::from(k);
            sweep(&mut episodes, [from_s, from_s + 1.0], 5000, [from_s + 0.25, from_s + 0.5])
        });
        assert!(most.max().is_some_and(|most| most <= MIN_HELD), "most findings are settled");
        let (list, tally) = episodes.finish();
        assert_eq!((tally.count, tally.is_exact), (200_000, true));
        // The worst thousand are those of pairs 4999 down to 4975, and the first thousand pairs begin first.
        assert_eq!((list.len(), list[0].pair), (2 * LISTED, 0));
        let mut going_on = Episodes::bounded();
        for k in 0..40 {
            let from_s = f64::from(k);
            sweep(&mut going_on, [from_s, from_s + 1.0], 5000, [from_s, from_s + 1.0]);
        }
        let (list, tally) = going_on.finish();
        assert_eq!((tally.count, tally.is_exact), (5000, true));
        assert!(list.iter().all(|finding| finding.span_s == [0.0, 40.0]));
    }

    #[test]
    fn too_many_open_findings_make_the_count_inexact() {
        let mut episodes = Episodes::bounded();
        let pairs = 140_000;
        let most =
            [0.0, 1.0, 2.0].map(|from_s| sweep(&mut episodes, [from_s, from_s + 1.0], pairs, [from_s, from_s + 1.0]));
        assert!(most.into_iter().all(|most| most <= 4 * MAX_OPEN), "{most:?}");
        let (list, tally) = episodes.finish();
        assert!(!tally.is_exact && list.len() <= 2 * LISTED);
        assert!(tally.count <= u64::from(pairs) && tally.count > u64::from(pairs / 2), "{tally:?}");
    }
}
