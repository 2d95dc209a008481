//! Times during which vehicles were not seen.

use std::collections::{BTreeMap, BTreeSet};

use super::outcome::{Gap, Presence};
use crate::shortlist::{Finding, LISTED, Shortlist, Tally};

/// Gaps that are held before the longest and the first of each vehicle alone are kept.
const MOST_HELD: usize = 8 * LISTED;

impl Finding for Gap {
    type On = usize;

    fn on(&self) -> usize {
        self.vehicle
    }

    fn start_s(&self) -> f64 {
        self.from_s
    }

    fn end_s(&self) -> f64 {
        self.to_s
    }

    fn excess(&self) -> f64 {
        self.joined_by_s
    }
}

/// The gaps of all vehicles, as they are found.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    held: Vec<Gap>,
    /// Those of a vehicle that are no longer held: how many, and from the first of them to the last.
    dropped: BTreeMap<usize, (u64, Gap)>,
}

impl Gaps {
    pub(super) fn extend(&mut self, gap: Option<Gap>) {
        self.held.extend(gap);
        if self.held.len() > MOST_HELD {
            self.shorten();
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    /// Keeps the longest gaps, and the first of each vehicle.
    fn shorten(&mut self) {
        let mut list = Shortlist::new(LISTED);
        list.extend(self.held.iter().copied());
        let kept = list.into_list();
        let key = |gap: &Gap| (gap.vehicle, gap.from_s.to_bits());
        let is_kept: BTreeSet<_> = kept.iter().map(key).collect();
        for gap in self.held.drain(..).filter(|gap| !is_kept.contains(&key(gap))) {
            let (count, all) = self.dropped.entry(gap.vehicle).or_insert((0, gap));
            *count += 1;
            (all.from_s, all.to_s) = (all.from_s.min(gap.from_s), all.to_s.max(gap.to_s));
        }
        self.held = kept;
    }

    /// Those that matter, how many there are, and whether there is none of those that matter for pairs: during a gap in which no
    /// other vehicle is there and no obstacle is in the way nothing can come too close.
    pub(super) fn finish(
        mut self,
        presence: &[Option<Presence>],
        is_obstructed: bool,
        do_all_count: bool,
    ) -> (Vec<Gap>, Tally, bool) {
        let matters = |gap: &Gap| {
            let others = presence.iter().enumerate().filter(|(vehicle, _)| *vehicle != gap.vehicle);
            let meets = |other: &Presence| other.from_s < gap.to_s && gap.from_s < other.to_s;
            is_obstructed || others.filter_map(|(_, there)| there.as_ref()).any(meets)
        };
        let is_gapless = !self.held.iter().chain(self.dropped.values().map(|(_, all)| all)).any(matters);
        if !do_all_count {
            self.held.retain(matters);
            self.dropped.retain(|_, (_, all)| matters(all));
        }
        // Of those that are no longer held it is known that all matter where another vehicle is there throughout.
        let is_covered = |gap: &Gap| {
            let others = presence.iter().enumerate().filter(|(vehicle, _)| *vehicle != gap.vehicle);
            others.filter_map(|(_, there)| *there).any(|other| other.from_s <= gap.from_s && gap.to_s <= other.to_s)
        };
        let is_exact = do_all_count || is_obstructed || self.dropped.values().all(|(_, all)| is_covered(all));
        let dropped = if is_exact { self.dropped.values().map(|(count, _)| count).sum() } else { 0 };
        let count = self.held.len() as u64 + dropped;
        let in_order = |a: &Gap, b: &Gap| a.from_s.total_cmp(&b.from_s).then(a.vehicle.cmp(&b.vehicle));
        self.held.sort_by(in_order);
        if self.held.len() > LISTED {
            self.shorten();
        }
        self.held.sort_by(in_order);
        let tally = Tally { count, listed: self.held.len(), is_exact };
        (self.held, tally, is_gapless)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaps(count: u32) -> Gaps {
        let mut gaps = Gaps::default();
        for k in 0..count {
            let from_s = f64::from(2 * k);
            gaps.extend(Some(Gap::new(0, from_s, from_s + 1.0 + f64::from(k) / f64::from(count))));
        }
        gaps
    }

    #[test]
    fn many_gaps_are_counted_and_the_longest_are_listed_with_the_first() {
        let everywhere = Some(Presence { from_s: 0.0, to_s: 1e9 });
        let (listed, tally, is_gapless) = gaps(50_000).finish(&[everywhere; 2], false, false);
        assert_eq!((tally, is_gapless), (Tally { count: 50_000, listed: LISTED + 1, is_exact: true }, false));
        assert_eq!((listed[0].from_s, listed[1].from_s), (0.0, 98_000.0));
        let (few, tally, _) = gaps(3).finish(&[everywhere; 2], false, false);
        assert_eq!((few.len(), tally), (3, Tally::all(3)));
    }

    #[test]
    fn gaps_while_no_other_is_there_do_not_matter_however_many_they_are() {
        let (first, late) = (Presence { from_s: 0.0, to_s: 1e5 }, Presence { from_s: 2e5, to_s: 3e5 });
        let (listed, tally, is_gapless) = gaps(50_000).finish(&[Some(first), Some(late)], false, false);
        assert!(listed.is_empty() && is_gapless && tally.count == 0);
    }
}
