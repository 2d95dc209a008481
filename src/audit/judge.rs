//! One step under judgement: what each pair's sweep and cast amount to.

use super::ledger::Below;
use super::outcome::{Disagreement, ParryEvidence, Violation};
use super::parry::KeepOut;
use super::sweep::{Approach, RESOLUTION, RelativeMotion};
use crate::swarm::{ClosestApproach, Pair};

/// Coarsest resolution, as a fraction of delta, at which a pair that seems clear by less than the resolution is still
/// called clear. Anything coarser is [`super::AuditOutcome::unresolved`].
pub(super) const NEGLIGIBLE_RESOLUTION: f64 = 1e-8;

/// The times of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
}

impl Step {
    /// The time at a fraction of the step, exact at both ends; no difference of times is formed that could overflow.
    fn at(self, fraction: f64) -> f64 {
        ((1.0 - fraction) * self.from_s + fraction * self.to_s).max(self.from_s).min(self.to_s)
    }
}

/// The closest approach of a step as pairs come in, in their order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Closest {
    pair: (usize, usize),
    approach: Approach,
}

impl Closest {
    pub(super) const NONE: Self = Self { pair: (0, 0), approach: Approach { squared: f64::INFINITY, at: 0.0 } };

    /// Keeps the closer one; of equal separations the one that came first.
    #[inline]
    pub(super) fn offer(&mut self, i: usize, j: usize, approach: Approach) {
        if approach.squared < self.approach.squared && approach.separation_m() < self.approach.separation_m() {
            *self = Self { pair: (i, j), approach };
        }
    }

    /// The closest approach, if there was a pair.
    pub(super) fn over(&self, step: Step) -> Option<ClosestApproach> {
        let (i, j) = self.pair;
        (i != j).then(|| ClosestApproach {
            pair: Pair::new(i, j),
            separation_m: self.approach.separation_m(),
            time_s: step.at(self.approach.at),
        })
    }
}

/// Where findings about pairs near delta go.
#[derive(Debug)]
pub(super) struct Findings<'a> {
    pub(super) below: &'a mut Vec<Below>,
    pub(super) parry: &'a mut ParryEvidence,
    pub(super) unresolved: &'a mut u64,
}

impl Findings<'_> {
    /// Enters a pair that is below delta, close to it, or in contact by the cast.
    #[cold]
    pub(super) fn enter(
        &mut self,
        keep_out: &KeepOut,
        step: Step,
        pair: Pair,
        motion: &RelativeMotion,
        approach: Approach,
        cast: Option<f64>,
    ) {
        let delta_m = keep_out.delta_m;
        let min_m = approach.separation_m();
        let span = (min_m < delta_m).then(|| motion.below(delta_m, approach));
        if let Some(span) = span {
            self.below.push(Below {
                violation: Violation {
                    pair,
                    from_s: step.at(span.enter),
                    to_s: step.at(span.exit),
                    min_m,
                    min_at_s: step.at(approach.at),
                },
                from_start: motion.from_squared.sqrt() < delta_m,
                to_end: motion.to_squared.sqrt() < delta_m,
            });
        } else {
            let resolution_m = RESOLUTION * motion.from_squared.sqrt();
            let coarse = resolution_m > NEGLIGIBLE_RESOLUTION * delta_m;
            *self.unresolved += u64::from(coarse && min_m - delta_m < resolution_m);
        }

        let parry_s = cast.map(|fraction| step.at(fraction));
        if let Some(toi_s) = parry_s {
            self.parry.min_toi_s = Some(self.parry.min_toi_s.map_or(toi_s, |earlier_s| earlier_s.min(toi_s)));
        }
        if !keep_out.agrees(motion, approach, span, cast) {
            self.parry.disagreements += 1;
            self.parry.first_disagreement.get_or_insert_with(|| Disagreement {
                pair,
                step_from_s: step.from_s,
                step_to_s: step.to_s,
                min_m,
                closed_form_s: span.map(|span| step.at(span.enter)),
                parry_s,
            });
        }
    }
}
