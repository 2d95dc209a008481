//! What a recording itself says of the time between its instants.

use super::outcome::{Told, ToldViolation};
use super::settings::Settings;
use crate::audit::outcome::{Approach, ObjectPair, Undecided, Violation};
use crate::audit::results::Results;
use crate::audit::sweep::Interval;
use crate::swarm::{ClosestApproach, Pair};

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

    /// The closest of a pair that was told within a time, and when that was: known where they were the closest of all.
    fn nearest(&self, pair: Pair, from_s: f64, to_s: f64) -> Option<(f64, f64)> {
        let known = self.closest.iter().map(|told| told.closest);
        let known = known.filter(|at| at.pair == pair && from_s <= at.time_s && at.time_s <= to_s);
        known.map(|at| (at.separation_m, at.time_s)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Puts what was told in the place of what was drawn: leaves out what nobody did, and enters who came closest of those
    /// that are asked for, in the time that is asked for.
    pub(super) fn correct(&self, results: &mut Results, settings: &Settings, counts: impl Fn(usize) -> Option<f64>) {
        results.closest.retain(|kept| !self.refutes(kept.pair, kept.time_s, kept.time_s, kept.lower_m));
        results.ledger.retain_violations(|v| !self.refutes(v.pair, v.from_s, v.to_s, v.min_m));
        if settings.above_m.is_some() {
            return;
        }
        let (window, limits) = (settings.window(), settings.limits());
        let limit_m = |pair: Pair| {
            let (first_m, second_m) = counts(pair.first()).zip(counts(pair.second()))?;
            Some(limits.of_vehicles(first_m, second_m))
        };
        for told in &self.violations {
            let (from_s, to_s) = (told.from_s.max(window.from_s), told.to_s.min(window.to_s));
            if let Some(limit_m) = limit_m(told.pair).filter(|_| from_s <= to_s) {
                self.enter(told, Interval { from_s, to_s }, limit_m, results);
            }
        }
        let told_too = |told: &Told| {
            let (pair, time_s) = (told.closest.pair, told.closest.time_s);
            self.violations.iter().any(|v| v.pair == pair && v.from_s <= time_s && time_s <= v.to_s)
        };
        for told in self.closest.iter().filter(|told| !told_too(told)) {
            let ClosestApproach { pair, separation_m: lower_m, time_s } = told.closest;
            let is_asked = window.from_s <= time_s && time_s <= window.to_s;
            let Some(limit_m) = limit_m(pair).filter(|_| is_asked) else { continue };
            let pair = ObjectPair::Vehicles(pair);
            results.closest.offer(Approach { pair, lower_m, upper_m: lower_m, time_s, limit_m });
            if lower_m < limit_m {
                let (from_s, to_s) = (time_s, time_s);
                let violation = Violation { pair, from_s, to_s, min_m: lower_m, min_at_s: time_s, limit_m };
                results.ledger.violated(violation, false);
            }
        }
    }

    /// Enters the part of a told violation that is asked about. All along it the two were nearer than the limit of the
    /// recording; how near is known for the whole, and for a part only where they were the closest of all.
    fn enter(&self, told: &ToldViolation, part: Interval, limit_m: f64, results: &mut Results) {
        let Interval { from_s, to_s } = part;
        let is_whole = from_s == told.from_s && to_s == told.to_s;
        let seen = self.nearest(told.pair, from_s, to_s);
        let below_m = told.limit_m.next_down();
        let upper_m = if is_whole { told.min_m } else { seen.map_or(below_m, |(nearest_m, _)| nearest_m.min(below_m)) };
        let time_s = seen.map_or(f64::midpoint(from_s, to_s), |(_, at_s)| at_s);
        let pair = ObjectPair::Vehicles(told.pair);
        results.closest.offer(Approach { pair, lower_m: told.min_m, upper_m, time_s, limit_m });
        if limit_m >= told.limit_m {
            // What is drawn of the same time is a part of the same violation.
            let (mut from_s, mut to_s) = (from_s, to_s);
            results.ledger.retain_violations(|v| {
                let is_other = v.pair != pair || v.to_s < from_s || to_s < v.from_s;
                if !is_other && limit_m > told.limit_m {
                    (from_s, to_s) = (from_s.min(v.from_s), to_s.max(v.to_s));
                }
                is_other
            });
            let violation = Violation { pair, from_s, to_s, min_m: upper_m, min_at_s: time_s, limit_m };
            results.ledger.violated(violation, false);
        } else if upper_m < limit_m {
            // Below a smaller limit they were at one instant for certain, and nothing is told of when they went below it.
            let (from_s, to_s) = (time_s, time_s);
            let violation = Violation { pair, from_s, to_s, min_m: upper_m, min_at_s: time_s, limit_m };
            results.ledger.violated(violation, false);
        } else if told.min_m < limit_m {
            let (lower_m, rate_hz) = (told.min_m, None);
            results.ledger.undecided(Undecided { pair, from_s, to_s, lower_m, upper_m, limit_m, rate_hz });
        }
    }
}
