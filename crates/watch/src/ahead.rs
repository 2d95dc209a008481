//! Search of all pairs for the closest one, the time until which all are clear, and the first violation ahead.

use nalgebra::Vector3;

use crate::event::{Pair, Separation};
use crate::pair::{Prediction, RelativeMotion};
use crate::settings::Settings;

/// Result of a search. Times count from the present \[s\].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Found {
    pub(crate) closest: Option<Separation>,
    /// Pair that may be closer than delta at the present, with its smallest possible separation \[m\].
    pub(crate) uncertain: Option<(Pair, f64)>,
    /// Time until which all pairs are clear.
    pub(crate) clear: Option<(Pair, f64)>,
    pub(crate) nominal_violation: Option<(Pair, f64)>,
    pub(crate) last_brake: Option<(Pair, f64)>,
}

/// Predictions of the vehicles, with memory that is used again.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    of: Vec<(u32, Prediction)>,
}

impl Scratch {
    pub(crate) fn clear(&mut self) {
        self.of.clear();
    }

    pub(crate) fn reserve(&mut self, vehicles: usize) {
        self.of.reserve(vehicles.saturating_sub(self.of.len()));
    }

    pub(crate) fn capacity(&self) -> usize {
        self.of.capacity()
    }

    pub(crate) fn push(&mut self, vehicle: u32, prediction: Prediction) {
        self.of.push((vehicle, prediction));
    }

    /// Searches all pairs.
    ///
    /// The vehicles are sorted along the axis on which they are spread widest. A pair is skipped if its distance along
    /// this axis is too large to change any result. The limit shrinks as results are found.
    pub(crate) fn search(&mut self, settings: &Settings) -> Found {
        let mut found = Found::default();
        let axis = widest_axis(self.of.iter().map(|(_, of)| of.position_m));
        self.of.sort_unstable_by(|a, b| a.1.position_m[axis].total_cmp(&b.1.position_m[axis]).then(a.0.cmp(&b.0)));
        let fold = |by: fn(&Prediction) -> f64| self.of.iter().map(|(_, of)| by(of)).fold(0.0, f64::max);
        let fastest_m_s = fold(|of| of.velocity_m_s.norm());
        let error_m = fold(|of| of.error_m);
        let error_m_s = fold(|of| of.error_m_s);
        let error_m_s2 = fold(|of| of.error_m_s2);
        let (delta_m, horizon_s) = (settings.delta_m, settings.horizon_s);
        // Distance of two vehicles beyond which they stay apart by delta for a time.
        let reach_m = |time_s: f64| {
            let errors_m = error_m + time_s * (error_m_s + time_s * error_m_s2);
            delta_m + 1e-3 + 2.0 * (fastest_m_s * time_s + errors_m)
        };
        let mut clear_s = horizon_s;
        let straight_m = delta_m + 1e-3 + 2.0 * fastest_m_s * horizon_s;
        let mut far_m = f64::INFINITY;
        for a in 0..self.of.len() {
            let (first, motion) = &self.of[a];
            for (second, other) in &self.of[a + 1..] {
                let apart_m = other.position_m[axis] - motion.position_m[axis];
                if apart_m > far_m {
                    break;
                }
                let pair = [*first.min(second), *first.max(second)];
                let relative = RelativeMotion::new(motion, other);
                let nominal_m = relative.nominal_m();
                if found.closest.is_none_or(|near: Separation| (nominal_m, pair) < (near.nominal_m, near.pair)) {
                    found.closest = Some(Separation { pair, nominal_m, least_m: relative.least_m() });
                    far_m = straight_m.max(nominal_m).max(reach_m(clear_s));
                }
                if let Some(time_s) = relative.nominal_violation_s(delta_m, horizon_s) {
                    first_of(&mut found.nominal_violation, pair, time_s);
                    if let Some(moment_s) = relative.last_brake_s(delta_m, settings.brake_m_s2, horizon_s) {
                        first_of(&mut found.last_brake, pair, moment_s);
                    }
                }
                if relative.is_clear_for(clear_s, delta_m) {
                    continue;
                }
                match relative.clear_for_s(delta_m, horizon_s) {
                    None => {
                        let least_m = relative.least_m();
                        if found.uncertain.is_none_or(|(_, of)| least_m < of) {
                            found.uncertain = Some((pair, least_m));
                        }
                        clear_s = 0.0;
                    }
                    Some(time_s) if time_s < clear_s => (clear_s, found.clear) = (time_s, Some((pair, time_s))),
                    Some(_) => {}
                }
            }
        }
        if found.clear.is_none() {
            found.clear = found.closest.map(|near| (near.pair, clear_s));
        }
        found
    }

    /// Returns the `count` closest pairs at the present, the closest one first. Call after [`Scratch::search`], which
    /// sorts the vehicles.
    pub(crate) fn closest_pairs(&self, count: usize) -> Vec<Separation> {
        let mut closest: Vec<Separation> = Vec::new();
        if count == 0 {
            return closest;
        }
        let axis = widest_axis(self.of.iter().map(|(_, of)| of.position_m));
        for (a, (first, motion)) in self.of.iter().enumerate() {
            for (second, other) in &self.of[a + 1..] {
                let farthest_m = closest.get(count - 1).map_or(f64::INFINITY, |near| near.nominal_m);
                if other.position_m[axis] - motion.position_m[axis] > farthest_m {
                    break;
                }
                let relative = RelativeMotion::new(motion, other);
                let pair = [*first.min(second), *first.max(second)];
                let near = Separation { pair, nominal_m: relative.nominal_m(), least_m: relative.least_m() };
                let place =
                    closest.partition_point(|other| (other.nominal_m, other.pair) < (near.nominal_m, near.pair));
                closest.insert(place, near);
                closest.truncate(count);
            }
        }
        closest
    }
}

/// Replaces the best time by an earlier one. Of equal times, the time of the lower pair is kept.
fn first_of(best: &mut Option<(Pair, f64)>, pair: Pair, time_s: f64) {
    if best.is_none_or(|of| (time_s, pair) < (of.1, of.0)) {
        *best = Some((pair, time_s));
    }
}

/// Returns the axis along which positions are spread widest.
pub(crate) fn widest_axis(positions_m: impl Iterator<Item = Vector3<f64>>) -> usize {
    let start = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    let (low, high) = positions_m.fold(start, |(low, high), at| (low.inf(&at), high.sup(&at)));
    (high - low).imax()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::Scratch;
    use crate::pair::{Prediction, RelativeMotion};
    use crate::settings::Settings;

    #[test]
    fn closest_pairs_are_those_of_all_pairs() {
        // A low-discrepancy sequence: golden ratio of three dimensions.
        let place = |k: u32| Vector3::new(0.819_172_513, 0.671_043_607, 0.549_700_478) * f64::from(k);
        let motion = |k: u32| Prediction::new(place(k).map(f64::fract) * 50.0, Vector3::x(), 0.1, 0.05, 0.1, 1.0);
        for vehicles in [0, 1, 2, 5, 60] {
            let mut scratch = Scratch::default();
            (0..vehicles).for_each(|k| scratch.push(k, motion(k)));
            scratch.search(&Settings::default());
            let pairs = (0..vehicles).flat_map(|a| (a + 1..vehicles).map(move |b| [a, b]));
            let nominal_m = |[a, b]: [u32; 2]| RelativeMotion::new(&motion(a), &motion(b)).nominal_m();
            let mut all: Vec<_> = pairs.map(|pair| (nominal_m(pair), pair)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for count in [0, 1, 8, 5000] {
                let found: Vec<_> =
                    scratch.closest_pairs(count).iter().map(|near| (near.nominal_m, near.pair)).collect();
                assert_eq!(found, all[..count.min(all.len())], "{vehicles} vehicles, {count} pairs");
            }
        }
    }
}
