//! What a recording itself says of the time between its instants.

use super::outcome::{Told, ToldViolation};
use super::settings::Settings;
use crate::audit::outcome::{Approach, ObjectPair, Violation};
use crate::audit::results::Results;
use crate::swarm::Pair;

/// Relative rounding of a distance that was computed again.
const ROUNDING: f64 = 1e-9;

/// Everything that was told, in order of time.
#[derive(Clone, Debug, Default)]
pub(super) struct AllTold {
    closest: Vec<Told>,
    violations: Vec<ToldViolation>,
}

impl AllTold {
    pub(super) fn push(&mut self, told: Told) {
        self.closest.push(told);
    }

    pub(super) fn push_violation(&mut self, told: ToldViolation) {
        self.violations.push(told);
    }

    /// Whether what was drawn between two instants comes closer than anybody did. What is so at an instant itself no word of
    /// the recording takes back.
    fn refutes(&self, pair: ObjectPair, from_s: f64, to_s: f64, drawn_m: f64) -> bool {
        let within = self.closest.get(self.closest.partition_point(|told| told.to_s <= to_s));
        let refutes = |told: &Told| told.from_s < from_s && drawn_m < told.closest.separation_m * (1.0 - ROUNDING);
        pair.vehicles().is_some() && within.is_some_and(refutes)
    }

    /// When a pair was said to be as near as this, where it was the closest then.
    fn time_of(&self, pair: ObjectPair, min_m: f64) -> Option<f64> {
        let same = |told: &&Told| ObjectPair::Vehicles(told.closest.pair) == pair && told.closest.separation_m == min_m;
        self.closest.iter().find(same).map(|told| told.closest.time_s)
    }

    /// Puts what was told in the place of what was drawn: leaves out what nobody did, and enters who came closest of those
    /// that are asked for, in the time that is asked for.
    pub(super) fn correct(&self, results: &mut Results, settings: &Settings, counts: impl Fn(usize) -> Option<f64>) {
        let Results { ledger, closest, .. } = results;
        closest.retain(|kept| !self.refutes(kept.pair, kept.time_s, kept.time_s, kept.lower_m));
        ledger.retain_violations(|v| !self.refutes(v.pair, v.from_s, v.to_s, v.min_m));
        let (window, limits) = (settings.window(), settings.limits());
        let limit_m = |pair: Pair, from_s: f64, to_s: f64| {
            let is_asked = window.from_s <= from_s && to_s <= window.to_s && settings.above_m.is_none();
            let (first_m, second_m) = counts(pair.first()).zip(counts(pair.second())).filter(|_| is_asked)?;
            Some(limits.of_vehicles(first_m, second_m))
        };
        for &ToldViolation { pair, from_s, to_s, min_m } in &self.violations {
            let Some(limit_m) = limit_m(pair, from_s, to_s).filter(|&limit_m| from_s <= to_s && min_m < limit_m) else {
                continue;
            };
            let pair = ObjectPair::Vehicles(pair);
            // What is drawn of the same time is the same violation.
            ledger.retain_violations(|v| v.pair != pair || v.to_s < from_s || to_s < v.from_s);
            let min_at_s = self.time_of(pair, min_m).unwrap_or(f64::midpoint(from_s, to_s));
            closest.offer(Approach { pair, lower_m: min_m, upper_m: min_m, time_s: min_at_s, limit_m });
            ledger.violated(Violation { pair, from_s, to_s, min_m, min_at_s, limit_m }, false);
        }
        for Told { closest: told, .. } in &self.closest {
            let (lower_m, time_s) = (told.separation_m, told.time_s);
            let Some(limit_m) = limit_m(told.pair, time_s, time_s) else { continue };
            let pair = ObjectPair::Vehicles(told.pair);
            closest.offer(Approach { pair, lower_m, upper_m: lower_m, time_s, limit_m });
            if lower_m < limit_m {
                let (from_s, to_s) = (time_s, time_s);
                let violation = Violation { pair, from_s, to_s, min_m: lower_m, min_at_s: time_s, limit_m };
                ledger.violated(violation, false);
            }
        }
    }
}
