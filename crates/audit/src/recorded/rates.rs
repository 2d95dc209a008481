//! How often vehicles are usually seen.

use tautline_core::track::Item;

/// Items that are looked at.
const OPENING: usize = 65_536;
/// Intervals of one vehicle that are looked at.
const MOST_INTERVALS: usize = 64;
/// Fewest intervals of a vehicle that make a rate of its own; with fewer, all vehicles' intervals do.
const FEWEST_INTERVALS: usize = 3;
/// An interval longer than so many usual ones misses a sample.
const GAP_OVER_USUAL: f64 = 1.5;

/// Longest interval without a gap, for each vehicle and for those that are not known yet \[s\].
#[derive(Clone, Debug, Default)]
pub(super) struct Rates {
    own_s: Vec<Option<f64>>,
    common_s: Option<f64>,
    curves: Vec<bool>,
}

impl Rates {
    /// Learns from the opening of a recording of so many vehicles.
    pub(super) fn learn(items: &[Item], vehicles: usize) -> Self {
        let mut last_s: Vec<Option<f64>> = vec![None; vehicles];
        let mut intervals_s: Vec<Vec<f64>> = vec![Vec::new(); vehicles];
        let mut curves = vec![false; vehicles];
        let mut known = 0;
        for item in items.iter().take(OPENING) {
            if known == vehicles {
                break;
            }
            let vehicle = item.vehicle();
            let Some(intervals_s) = intervals_s.get_mut(vehicle) else { continue };
            match item {
                Item::Piece(_) => curves[vehicle] = true,
                Item::Sample(_) if intervals_s.len() == MOST_INTERVALS => {}
                Item::Sample(sample) => {
                    let last_s = last_s[vehicle].replace(sample.time_s);
                    intervals_s.extend(last_s.map(|last_s| sample.time_s - last_s));
                    known += usize::from(intervals_s.len() == MOST_INTERVALS);
                }
            }
        }
        let mut all_s = intervals_s.concat();
        let own_s = intervals_s
            .iter_mut()
            .map(|intervals_s| if intervals_s.len() < FEWEST_INTERVALS { None } else { median(intervals_s) })
            .collect();
        Self { own_s, common_s: median(&mut all_s), curves }
    }

    /// Longest interval of a vehicle without a gap \[s\].
    pub(super) fn max_gap_s(&self, vehicle: usize) -> f64 {
        if self.curves.get(vehicle).copied().unwrap_or(false) {
            return 0.0;
        }
        let usual_s = self.own_s.get(vehicle).copied().flatten().or(self.common_s);
        usual_s.map_or(f64::INFINITY, |usual_s| GAP_OVER_USUAL * usual_s)
    }
}

/// The lower median.
fn median(numbers: &mut [f64]) -> Option<f64> {
    let middle = numbers.len().checked_sub(1)? / 2;
    Some(*numbers.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use tautline_core::track::Sample;

    fn seen(vehicle: usize, time_s: f64) -> Item {
        let position_m = Vector3::zeros();
        Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
    }

    #[test]
    fn every_vehicle_has_its_own_rate_and_one_seen_too_seldom_that_of_all() {
        let mut items: Vec<_> = (0..20).map(|k| seen(0, 0.1 * f64::from(k))).collect();
        items.extend((0..5).map(|k| seen(1, f64::from(k))));
        items.extend([seen(2, 0.0), seen(2, 2.0)]);
        let rates = Rates::learn(&items, 3);
        let gaps: Vec<_> = (0..4).map(|vehicle| (rates.max_gap_s(vehicle) * 1e3).round()).collect();
        assert_eq!(gaps, [150.0, 1500.0, 150.0, 150.0]);
        // One that is known well leaves those still to be known.
        items = (0..100).map(|k| seen(0, 0.1 * f64::from(k))).collect();
        items.extend((0..5).map(|k| seen(1, 10.0 + f64::from(k))));
        assert!((Rates::learn(&items, 2).max_gap_s(1) - 1.5).abs() < 1e-9);
        assert_eq!(Rates::learn(&[], 0).max_gap_s(0), f64::INFINITY);
    }
}
