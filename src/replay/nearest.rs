//! How near any two were over time, by the judge.

use crate::swarm::ClosestApproach;

/// Most that are kept.
const MOST: usize = 1000;

/// The closest approaches of one slice of time after the other. Beyond a thousand, the closer of two neighbours stands for both:
/// the closest of all is never lost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nearest {
    slices: Vec<Slice>,
    gap: bool,
    /// One slice stands for two to the power of this many that were taken, and how many the last one stands for.
    halved: u32,
    filled: u64,
}

/// The closest approach of a slice of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slice {
    /// Who, how near and when.
    pub closest: ClosestApproach,
    /// Nothing is known of some of the time since the slice before.
    pub after_gap: bool,
}

impl Nearest {
    /// Takes the next one; what is no number is passed over.
    pub fn take(&mut self, next: ClosestApproach) {
        if !(next.time_s.is_finite() && next.separation_m.is_finite()) {
            return;
        }
        let slice = Slice { closest: next, after_gap: std::mem::take(&mut self.gap) };
        match self.slices.last_mut() {
            Some(last) if self.filled < 1 << self.halved => {
                *last = last.and(slice);
                self.filled += 1;
            }
            _ => {
                if self.slices.len() == 2 * MOST {
                    self.halve();
                    self.halved += 1;
                }
                self.slices.push(slice);
                self.filled = 1;
            }
        }
    }

    /// Nothing is known of the time from here to the next one.
    pub fn break_off(&mut self) {
        self.gap = true;
    }

    fn halve(&mut self) {
        self.slices = self.slices.chunks(2).filter_map(|two| two.iter().copied().reduce(Slice::and)).collect();
    }

    /// At most so many, and at most a thousand, in the order in which they were taken.
    #[must_use]
    pub fn finish(mut self, most: usize) -> Vec<Slice> {
        while self.slices.len() > most.clamp(1, MOST) {
            self.halve();
        }
        self.slices
    }

    /// The closest of all.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        let all = self.slices.iter().map(|slice| slice.closest);
        all.min_by(|a, b| a.separation_m.total_cmp(&b.separation_m))
    }
}

impl Slice {
    /// The closer of two neighbours, which stands for both.
    fn and(self, next: Self) -> Self {
        let closest = if next.closest.separation_m < self.closest.separation_m { next.closest } else { self.closest };
        Self { closest, after_gap: self.after_gap || next.after_gap }
    }
}

impl FromIterator<ClosestApproach> for Nearest {
    fn from_iter<I: IntoIterator<Item = ClosestApproach>>(all: I) -> Self {
        let mut nearest = Self::default();
        all.into_iter().for_each(|next| nearest.take(next));
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swarm::Pair;

    #[test]
    fn the_closest_of_all_is_kept_however_many_there_are() {
        let at = |k: u32| ClosestApproach {
            pair: Pair::new(0, 1),
            separation_m: if k == 12_345 { 0.5 } else { 2.0 + f64::from(k % 7) },
            time_s: f64::from(k),
        };
        let mut nearest = Nearest::default();
        for k in 0..50_000 {
            if k == 30_000 {
                nearest.break_off();
            }
            nearest.take(at(k));
        }
        assert_eq!(nearest.closest(), Some(at(12_345)));
        let kept = nearest.finish(MOST);
        assert!(kept.len() <= MOST && kept.iter().any(|slice| slice.closest == at(12_345)));
        assert!(kept.is_sorted_by(|a, b| a.closest.time_s < b.closest.time_s));
        let widest_s = kept.windows(2).map(|two| two[1].closest.time_s - two[0].closest.time_s).fold(0.0, f64::max);
        assert!(kept.len() > MOST / 3 && widest_s < 300.0, "evenly: {} and {widest_s}", kept.len());
        let gaps: Vec<_> = kept.iter().filter(|slice| slice.after_gap).map(|slice| slice.closest.time_s).collect();
        assert!(gaps.len() == 1 && (29_900.0..30_100.0).contains(&gaps[0]), "{gaps:?}");
        let odd = ClosestApproach { separation_m: f64::NAN, ..at(0) };
        assert_eq!([odd].into_iter().collect::<Nearest>(), Nearest::default());
    }
}
