//! Closest approach in each slice of time, with a bounded number of slices.

use super::outcome::Approach;

/// Largest gap between two slices that are merged, as a fraction of the width of the merged slice.
const GAP_SHARE: f64 = 1.0 / 16.0;

/// Closest approach of all pairs in a slice of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slice {
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Closest approach: pair, distance and time.
    pub closest: Approach,
    /// Whether at least two vehicles are present during the whole slice. If not, the distance is known only for a part
    /// of it.
    pub is_whole: bool,
}

/// Slices in order of time; between two slices that do not touch nothing is known.
///
/// Above the largest number, neighbours are merged until all slices have similar widths. The smallest distance of all
/// is never lost. Two slices that do not touch are merged only if the gap between them is small, into a slice that is
/// not whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Slices {
    all: Vec<Slice>,
    most: usize,
    /// Width up to which two neighbours are merged \[s\].
    width_s: f64,
}

/// Default of the largest number of slices.
const MOST: usize = 2000;

impl Default for Slices {
    fn default() -> Self {
        Self::new(MOST)
    }
}

impl Slice {
    /// Returns the interval \[s\] for which the smallest distance is known: the whole slice if it is whole, else the
    /// instant of the closest approach.
    #[must_use]
    pub fn known_s(&self) -> [f64; 2] {
        let at_s = self.closest.time_s.max(self.from_s).min(self.to_s);
        if self.is_whole { [self.from_s, self.to_s] } else { [at_s; 2] }
    }

    /// Returns the width \[s\] from which this slice and the next are merged.
    fn merge_width_s(&self, next: &Self) -> f64 {
        (next.to_s - self.from_s).max((next.from_s - self.to_s) / GAP_SHARE)
    }

    fn merge(self, next: Self) -> Self {
        Self {
            to_s: next.to_s,
            closest: closer(self.closest, next.closest),
            is_whole: self.is_whole && next.is_whole && next.from_s <= self.to_s,
            ..self
        }
    }
}

impl Slices {
    /// Creates an empty list of at most `most` slices, at least two.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self { all: Vec::new(), most: most.max(2), width_s: 0.0 }
    }

    /// Adds the next slice, which must not begin before the last one ends. A slice with a number that is not finite is
    /// ignored.
    pub fn take(&mut self, next: Slice) {
        let numbers = [next.from_s, next.to_s, next.closest.time_s, next.closest.certain_m()];
        if !numbers.iter().all(|number| number.is_finite()) {
            return;
        }
        match self.all.last_mut() {
            Some(last) if last.merge_width_s(&next) <= self.width_s => *last = last.merge(next),
            _ => self.all.push(next),
        }
        if self.all.len() > self.most {
            self.merge_neighbours(self.most / 2);
        }
    }

    fn merge_neighbours(&mut self, most: usize) {
        let known_s: f64 = self.all.iter().map(|slice| slice.to_s - slice.from_s).sum();
        self.width_s = self.width_s.max(known_s / most as f64);
        loop {
            let mut wider: Vec<Slice> = Vec::new();
            for next in self.all.drain(..) {
                match wider.last_mut() {
                    Some(last) if last.merge_width_s(&next) <= self.width_s => *last = last.merge(next),
                    _ => wider.push(next),
                }
            }
            self.all = wider;
            if self.all.len() <= most {
                return;
            }
            let needed_s = self.all.windows(2).map(|two| two[0].merge_width_s(&two[1])).fold(f64::INFINITY, f64::min);
            self.width_s = needed_s.max(2.0 * self.width_s);
        }
    }

    /// Returns at most `most` slices, at least one, in order of time.
    #[must_use]
    pub fn finish(mut self, most: usize) -> Vec<Slice> {
        if self.all.len() > most.max(1) {
            self.merge_neighbours(most.max(1));
        }
        self.all
    }

    /// Returns the closest approach of all slices.
    #[must_use]
    pub fn closest(&self) -> Option<Approach> {
        self.all.iter().map(|slice| slice.closest).reduce(closer)
    }
}

/// Returns the closer of two approaches; of equal ones a known one, then the first.
fn closer(a: Approach, b: Approach) -> Approach {
    let order = b.certain_m().total_cmp(&a.certain_m()).then(a.is_known().cmp(&b.is_known()));
    if order.is_lt() { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::ObjectPair;
    use tautline_core::swarm::Pair;

    fn approach(time_s: f64, distance_m: f64) -> Approach {
        let pair = ObjectPair::Vehicles(Pair::new(0, 1));
        Approach { pair, lower_m: distance_m, upper_m: distance_m, time_s, limit_m: 1.0 }
    }

    fn slice(k: u32) -> Slice {
        let distance_m = if k == 12_345 { 0.5 } else { 2.0 + f64::from(k % 7) };
        let from_s = f64::from(k);
        Slice { from_s, to_s: from_s + 1.0, closest: approach(from_s + 0.5, distance_m), is_whole: true }
    }

    #[test]
    fn slices_have_similar_widths_and_keep_the_smallest_distance() {
        let mut slices = Slices::new(4096);
        (0..100_000).for_each(|k| slices.take(slice(k)));
        assert_eq!(slices.closest(), Some(slice(12_345).closest));
        for most in [4096, 1000, 3, 1] {
            let kept = slices.clone().finish(most);
            assert!(kept.len() <= most && kept.iter().any(|part| part.closest == slice(12_345).closest));
            assert!(kept.windows(2).all(|two| two[0].to_s == two[1].from_s), "the slices touch");
            let widest_s = kept.iter().map(|part| part.to_s - part.from_s).fold(0.0, f64::max);
            assert!(most < 4 || widest_s <= 4.0 * 100_000.0 / most as f64, "{most}: {widest_s}");
        }
    }

    #[test]
    fn no_slice_spans_a_gap() {
        let mut slices = Slices::new(4096);
        (0..50_000).filter(|k| !(30_000..30_400).contains(k)).for_each(|k| slices.take(slice(k)));
        let kept = slices.finish(1000);
        let gaps: Vec<_> = kept.windows(2).filter(|two| two[0].to_s < two[1].from_s).collect();
        assert!(gaps.len() == 1 && gaps[0][0].to_s == 30_000.0 && gaps[0][1].from_s == 30_400.0, "{gaps:?}");
        assert!(kept.iter().all(|part| part.is_whole));
    }

    #[test]
    fn a_single_late_sample_does_not_widen_slices() {
        let mut slices = Slices::new(4096);
        (0..6000).for_each(|k| slices.take(slice(k)));
        slices.take(Slice { to_s: 2e8, ..slice(200_000_000) });
        let kept = slices.finish(2000);
        let widest_s = kept.iter().map(|part| part.to_s - part.from_s).fold(0.0, f64::max);
        assert!(kept.len() > 1000 && widest_s <= 6.0, "{} of {widest_s} s", kept.len());
    }

    #[test]
    fn a_slice_merged_across_a_gap_is_known_only_at_its_closest_approach() {
        let mut slices = Slices::new(4096);
        (0..200).filter(|k| *k != 90).for_each(|k| slices.take(slice(k)));
        let kept = slices.finish(4);
        let of_gap: Vec<_> = kept.iter().filter(|part| part.from_s < 90.0 && 91.0 < part.to_s).collect();
        assert!(of_gap.len() == 1 && !of_gap[0].is_whole, "{kept:?}");
        assert_eq!(of_gap[0].known_s(), [of_gap[0].closest.time_s; 2]);
        let others = kept.iter().filter(|part| !(part.from_s..part.to_s).contains(&90.0));
        assert!(
            others.clone().count() > 1 && others.clone().all(|part| part.known_s() == [part.from_s, part.to_s]),
            "{kept:?}"
        );
    }

    #[test]
    fn slices_with_many_gaps_are_bounded() {
        let mut slices = Slices::new(100);
        (0..10_000).map(|k| 2 * k).for_each(|k| slices.take(slice(k)));
        assert!(slices.all.len() <= 100 && slices.finish(7).len() <= 7);
        let mut instants = Slices::new(100);
        (0..10_000).map(slice).for_each(|part| instants.take(Slice { to_s: part.from_s, ..part }));
        assert!(instants.all.len() <= 100 && instants.finish(7).len() <= 7);
    }

    #[test]
    fn of_equal_distances_the_known_one_is_kept() {
        let bound = Approach { upper_m: 5.0, ..approach(0.5, 2.0) };
        let known = approach(0.7, 2.0);
        assert_eq!((closer(bound, known), closer(known, bound)), (known, known));
        assert_eq!((closer(known, approach(0.9, 2.0)), closer(known, approach(0.9, 1.0))), (known, approach(0.9, 1.0)));
    }
}
