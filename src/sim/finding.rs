//! What the judge found in a sweep, kept for the next sample.

use crate::audit::{StepFinding, Violation};
use crate::record::Event;
use crate::swarm::{ClosestApproach, Pair};

/// Keeps what the judge found in a sweep.
pub(super) fn note(
    finding: StepFinding<'_>,
    closest: &mut Option<ClosestApproach>,
    nearest_m: &mut f64,
    events: &mut Vec<Event>,
) {
    if let Some(new) = finding.closest {
        *nearest_m = new.separation_m;
        *closest = closest.filter(|before| before.separation_m <= new.separation_m).or(Some(new));
    }
    for violation in finding.began {
        events.push(Event::ViolationBegan { pair: violation.pair, time_s: violation.from_s });
    }
    for violation in finding.ended {
        let &Violation { pair, to_s, min_m, .. } = violation;
        events.push(Event::ViolationEnded { pair, time_s: to_s, min_m });
    }
}

/// Keeps the pairs whose keep-out balls the engine sees overlap for the first time, in index order.
pub(super) fn note_contacts(now: &[Pair], known: &mut Vec<Pair>, time_s: f64, events: &mut Vec<Event>) {
    for &pair in now {
        if let Err(place) = known.binary_search(&pair) {
            known.insert(place, pair);
            events.push(Event::EngineContact { pair, time_s });
        }
    }
}
