//! How near any two were over time, by the judge.

use crate::swarm::ClosestApproach;

/// Most that are kept.
const MOST: usize = 1000;

/// The closest approaches of one slice of time after the other. Beyond a thousand, the closer of two neighbours stands for both:
/// the closest of all is never lost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nearest(Vec<ClosestApproach>);

impl Nearest {
    /// Takes the next one; what is no number is passed over.
    pub fn take(&mut self, next: ClosestApproach) {
        if !(next.time_s.is_finite() && next.separation_m.is_finite()) {
            return;
        }
        self.0.push(next);
        if self.0.len() > 2 * MOST {
            self.halve();
        }
    }

    fn halve(&mut self) {
        let closer =
            |two: &[ClosestApproach]| two.iter().copied().min_by(|a, b| a.separation_m.total_cmp(&b.separation_m));
        self.0 = self.0.chunks(2).filter_map(closer).collect();
    }

    /// At most a thousand, in the order in which they were taken.
    #[must_use]
    pub fn finish(mut self) -> Vec<ClosestApproach> {
        while self.0.len() > MOST {
            self.halve();
        }
        self.0
    }

    /// The closest of all.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        self.0.iter().copied().min_by(|a, b| a.separation_m.total_cmp(&b.separation_m))
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
        let nearest: Nearest = (0..50_000).map(at).collect();
        assert_eq!(nearest.closest(), Some(at(12_345)));
        let kept = nearest.finish();
        assert!(kept.len() <= MOST && kept.contains(&at(12_345)) && kept.is_sorted_by(|a, b| a.time_s < b.time_s));
        let odd = ClosestApproach { separation_m: f64::NAN, ..at(0) };
        assert_eq!([odd].into_iter().collect::<Nearest>(), Nearest::default());
    }
}
