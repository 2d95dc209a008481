//! What the judge says of recorded motion.

use super::history::{PICTURED, Timeline, nearer};
use tautline_audit::recorded::{Approach, ObjectPair, Outcome, RecordedError, Settings, TrackAuditor};
use tautline_audit::{Status, Violation};
use tautline_core::swarm::ClosestApproach;
use tautline_core::track::Item;

/// Safety distance of a recording that is to be drawn and not judged \[m\]: the closest approach is asked for alone.
const NO_DELTA_M: f64 = 1e-9;

/// The judge of recordings, as it reads on; what it refuses is drawn all the same, and said to be not judged.
pub(super) struct Judge {
    auditor: Result<TrackAuditor, RecordedError>,
}

impl Judge {
    pub(super) fn new(delta_m: Option<f64>) -> Self {
        let settings = Settings::delta(delta_m.unwrap_or(NO_DELTA_M));
        Self { auditor: TrackAuditor::new(settings).map(TrackAuditor::with_smallest) }
    }

    pub(super) fn push(&mut self, names: &[String], items: &[Item]) {
        if let Ok(auditor) = &mut self.auditor
            && let Err(refused) = auditor.push(names, items)
        {
            self.auditor = Err(refused);
        }
    }

    pub(super) fn finish(self) -> Result<Outcome, RecordedError> {
        self.auditor?.finish()
    }
}

/// When the closest approach was, and the first violations were worst \[s\].
pub(super) fn moments_s(judged: &Result<Outcome, RecordedError>) -> Vec<f64> {
    let worst = |outcome: &Outcome| outcome.violations.iter().take(PICTURED).map(|found| found.min_at_s).collect();
    let mut moments: Vec<f64> = judged.as_ref().map_or_else(|_| Vec::new(), worst);
    moments.extend(judged.iter().filter_map(|outcome| outcome.closest.first()).map(|closest| closest.time_s));
    moments
}

impl Timeline {
    /// Takes what the judge says of the motion whose keyframes are there.
    pub(super) fn take_outcome(&mut self, judged: Result<Outcome, RecordedError>) {
        let outcome = match judged {
            Ok(outcome) => outcome,
            Err(refused) => {
                self.notes.push(format!("it was not judged: {refused}"));
                self.refused = true;
                return;
            }
        };
        let mut closest = outcome
            .smallest
            .iter()
            .map(|slice| &slice.closest)
            .chain(outcome.closest.first())
            .filter_map(approach)
            .collect::<Vec<_>>();
        closest.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let mut closest = closest.into_iter().peekable();
        let mut so_far = None;
        let last_s = self.range_s()[1];
        for keyframe in &mut self.keyframes {
            let until_s = if keyframe.time_s < last_s { keyframe.time_s } else { f64::INFINITY };
            while let Some(approach) = closest.next_if(|approach| approach.time_s <= until_s) {
                keyframe.closest = nearer(keyframe.closest, Some(approach));
            }
            so_far = nearer(so_far, keyframe.closest);
            keyframe.so_far = so_far;
        }
        if self.delta_m.is_some() || self.by_radii {
            let of_two = |violation: Violation<ObjectPair>| {
                let Violation { pair, from_s, to_s, min_m, min_at_s, limit_m } = violation;
                Some(Violation { pair: pair.vehicles()?, from_s, to_s, min_m, min_at_s, limit_m })
            };
            self.violations = outcome.violations.into_iter().filter_map(of_two).collect();
            let undecided = outcome.undecided.iter().map(|undecided| undecided.from_s);
            let open_s = undecided.chain(outcome.gaps.iter().map(|gap| gap.from_s)).reduce(f64::min);
            let open_s = open_s.or((outcome.status == Status::Undecided).then_some(f64::NEG_INFINITY));
            self.undecided_s = open_s.filter(|_| outcome.status != Status::Clear);
        }
    }
}

fn approach(found: &Approach) -> Option<ClosestApproach> {
    let (pair, separation_m, time_s) = (found.pair.vehicles()?, found.certain_m(), found.time_s);
    Some(ClosestApproach { pair, separation_m, time_s })
}
