//! What a recording itself says of the time between its instants.

use super::outcome::Told;
use super::settings::Settings;
use crate::audit::outcome::{Approach, ObjectPair, Violation};
use crate::audit::results::Results;

/// Relative rounding of a distance that was computed again.
const ROUNDING: f64 = 1e-9;

/// Everything that was told, in order of time.
#[derive(Clone, Debug, Default)]
pub(super) struct AllTold(Vec<Told>);

impl AllTold {
    pub(super) fn push(&mut self, told: Told) {
        self.0.push(told);
    }

    /// Whether what was drawn between two instants comes closer than anybody did. What is so at an instant itself no word of
    /// the recording takes back.
    fn refutes(&self, pair: ObjectPair, from_s: f64, to_s: f64, drawn_m: f64) -> bool {
        let within = self.0.get(self.0.partition_point(|told| told.to_s <= to_s));
        let refutes = |told: &Told| told.from_s < from_s && drawn_m < told.closest.separation_m * (1.0 - ROUNDING);
        pair.vehicles().is_some() && within.is_some_and(refutes)
    }

    /// Puts what was told in the place of what was drawn: leaves out what nobody did, and enters who came closest of those
    /// that are asked for, in the time that is asked for.
    pub(super) fn correct(&self, results: &mut Results, settings: &Settings, counts: impl Fn(usize) -> Option<f64>) {
        let Results { ledger, closest, .. } = results;
        closest.retain(|kept| !self.refutes(kept.pair, kept.time_s, kept.time_s, kept.lower_m));
        ledger.retain_violations(|v| !self.refutes(v.pair, v.from_s, v.to_s, v.min_m));
        let (window, limits) = (settings.window(), settings.limits());
        for Told { closest: told, .. } in &self.0 {
            let (lower_m, time_s) = (told.separation_m, told.time_s);
            let is_asked = window.from_s <= time_s && time_s <= window.to_s && settings.above_m.is_none();
            let radii = counts(told.pair.first()).zip(counts(told.pair.second())).filter(|_| is_asked);
            let Some((first_m, second_m)) = radii else { continue };
            let (pair, limit_m) = (ObjectPair::Vehicles(told.pair), limits.of_vehicles(first_m, second_m));
            closest.offer(Approach { pair, lower_m, upper_m: lower_m, time_s, limit_m });
            if lower_m < limit_m {
                let (from_s, to_s) = (time_s, time_s);
                let violation = Violation { pair, from_s, to_s, min_m: lower_m, min_at_s: time_s, limit_m };
                ledger.violated(violation, false);
            }
        }
    }
}
