//! What a recording of `tautline run` says of the obstacles that were flown past.

use crate::audit::recorded::{Approach, ObjectPair, Outcome, Settings};
use crate::audit::{self, Obstacle, Status, Undecided, Violation};
use crate::record::Event;
use crate::scenario::Scenario;
use crate::sim;

/// Obstacles of a recording, and the times that the run saw a vehicle too near to one of them.
#[derive(Default)]
pub(super) struct OwnObstacles {
    /// As its scenario has them.
    pub(super) obstacles: Vec<Obstacle>,
    told: Vec<Violation<ObjectPair>>,
}

impl OwnObstacles {
    pub(super) fn of(scenario: &Scenario) -> Self {
        Self { obstacles: scenario.obstacles.iter().map(sim::judged).collect(), told: Vec::new() }
    }

    /// Takes note of what the run saw.
    pub(super) fn note(&mut self, event: &Event) {
        match *event {
            Event::ObstacleViolationBegan { vehicle, obstacle, time_s } => {
                let limit_m = self.obstacles.get(obstacle).and_then(|of| of.clearance_m).unwrap_or(f64::MAX);
                self.told.push(Violation {
                    pair: ObjectPair::Obstacle { vehicle, obstacle },
                    from_s: time_s,
                    to_s: f64::INFINITY,
                    min_m: limit_m.next_down(),
                    min_at_s: time_s,
                    limit_m,
                });
            }
            Event::ObstacleViolationEnded { vehicle, obstacle, time_s, min_m } => {
                let pair = ObjectPair::Obstacle { vehicle, obstacle };
                if let Some(told) = self.told.iter_mut().rev().find(|told| told.pair == pair) {
                    (told.to_s, told.min_m) = (time_s, told.min_m.min(min_m));
                }
            }
            _ => {}
        }
    }

    /// Nothing between samples counts where every step is a sample.
    pub(super) fn forget_what_was_seen(&mut self) {
        self.told.clear();
    }

    /// Adds to what was found in a recording what the run saw between its samples: a violation, or a time that cannot be
    /// told where heights count and are not known.
    pub(super) fn bind(&self, outcome: &mut Outcome, settings: &Settings) {
        let Some(&(first_s, last_s)) = outcome.span_s.as_ref() else { return };
        for told in &self.told {
            let ObjectPair::Obstacle { vehicle, .. } = told.pair else { continue };
            if outcome.presence.get(vehicle).copied().flatten().is_none() {
                continue;
            }
            let offset_s = settings.vehicles.get(&outcome.name(vehicle)).map_or(0.0, |of| of.offset_s);
            let (from_s, to_s) = ((told.from_s + offset_s).max(first_s), (told.to_s + offset_s).min(last_s));
            let is_found =
                |found: &Violation<ObjectPair>| found.pair == told.pair && found.from_s <= to_s && from_s <= found.to_s;
            if from_s > to_s || outcome.violations.iter().any(is_found) {
                continue;
            }
            let &Violation { pair, min_m, limit_m, .. } = told;
            if settings.above_m.is_some() {
                let (lower_m, upper_m, rate_hz) = (min_m, f64::INFINITY, None);
                outcome.undecided.push(Undecided { pair, from_s, to_s, lower_m, upper_m, limit_m, rate_hz });
                if outcome.status == Status::Clear {
                    outcome.status = Status::Undecided;
                }
                continue;
            }
            outcome.violations.push(Violation { from_s, to_s, min_at_s: from_s, ..*told });
            let approach = Approach { pair, lower_m: min_m, upper_m: min_m, time_s: from_s, limit_m };
            let known = outcome.obstacles.iter_mut().find(|known| known.pair == pair);
            match known {
                Some(known) if known.lower_m > min_m => *known = approach,
                Some(_) => {}
                None => outcome.obstacles.push(approach),
            }
            outcome.status = Status::Violation;
        }
        outcome.violations.sort_by(|a, b| a.from_s.total_cmp(&b.from_s).then(a.pair.cmp(&b.pair)));
        outcome.obstacles.sort_by(|a: &audit::Approach, b| a.lower_m.total_cmp(&b.lower_m));
    }
}
