//! What the judge says.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::swarm::{ClosestApproach, Pair};

/// The verdict over everything that was judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// No pair came closer than delta, both detectors agree on it, and every instant offered was judged.
    Clear,
    /// The closed form found a pair closer than delta, whatever else was found.
    Violation,
    /// No violation was found, yet it cannot be called clear: nothing was judged, an instant was refused, the two
    /// detectors disagree, or a separation could not be resolved.
    Undecided,
}

/// A time during which a pair was closer than delta without a break.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Violation {
    /// The pair.
    pub pair: Pair,
    /// When the separation fell below delta \[s\]; the start if it was below from the start.
    pub from_s: f64,
    /// When it was delta again \[s\]; the last instant judged while it still is below.
    pub to_s: f64,
    /// Smallest separation within \[m\].
    pub min_m: f64,
    /// When that was \[s\], the earliest such instant.
    pub min_at_s: f64,
}

/// What one step (or the start) brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepFinding<'a> {
    /// Closest approach of all pairs over this step; `None` with fewer than two vehicles. Among equals the lowest pair,
    /// and its earliest time.
    pub closest: Option<ClosestApproach>,
    /// Violations that began in this step, as far as known at its end, by pair.
    pub began: &'a [Violation],
    /// Violations that ended in this step, complete, by pair. One that began and ended within is in both lists.
    pub ended: &'a [Violation],
}

/// The verdict and what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditOutcome {
    /// The verdict.
    pub status: Status,
    /// Closest approach of all pairs from the start to the end; among equals that of the earliest step, there the
    /// lowest pair, at its earliest time.
    pub closest: Option<ClosestApproach>,
    /// Every violation, in the order of their beginning and then by pair.
    pub violations: Vec<Violation>,
    /// Steps judged, the start not counted.
    pub steps: u64,
    /// Pairs swept in closed form (and cast by parry), summed over the start and all steps.
    pub pairs_checked: u64,
    /// Pairs proved, by a bound on how far vehicles moved, to stay farther apart than delta and than the closest pair of
    /// the step; summed likewise. Together with `pairs_checked` this is (steps + 1) N (N - 1) / 2.
    pub pairs_excluded: u64,
    /// Calls answered by an error: what they offered was not judged.
    pub refused: u64,
    /// Sweeps that seem clear with less room than the rounding of the closed form, where that rounding is no longer
    /// negligible against delta (vehicles some ten million delta apart at one end of a step).
    pub unresolved: u64,
    /// What the second detector says.
    pub parry: ParryEvidence,
}

/// What parry's shape cast found on keep-out balls of radius delta/2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ParryEvidence {
    /// Earliest time of contact \[s\]; `None` when there never was one. Touching at exactly delta is a contact to parry and
    /// not a violation.
    pub min_toi_s: Option<f64>,
    /// Casts that contradict the closed form by more than rounding explains: each is an error.
    pub disagreements: u64,
    /// The first of them.
    pub first_disagreement: Option<Disagreement>,
}

/// Two detectors, two answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// The pair.
    pub pair: Pair,
    /// Start of the step \[s\].
    pub step_from_s: f64,
    /// End of the step \[s\].
    pub step_to_s: f64,
    /// Smallest separation in the step by the closed form \[m\].
    pub min_m: f64,
    /// When the pair falls below delta by the closed form \[s\]; `None` when it does not.
    pub closed_form_s: Option<f64>,
    /// When the keep-out balls touch by parry \[s\]; `None` when they do not, NaN when it could not tell.
    pub parry_s: Option<f64>,
}

impl fmt::Display for Disagreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let answer = |time_s: Option<f64>| time_s.map_or("none".into(), |time_s| format!("one at {time_s} s"));
        write!(
            f,
            "vehicles {} between {} s and {} s, smallest separation {} m: contact by the closed form {}, by parry {}",
            self.pair,
            self.step_from_s,
            self.step_to_s,
            self.min_m,
            answer(self.closed_form_s),
            answer(self.parry_s)
        )
    }
}

/// Why something could not be judged. Nothing changes then, except that the outcome is no longer clear.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AuditError {
    /// The safety distance is not a positive number within range.
    #[error("the safety distance must be between {min_m:e} m and {max_m:e} m, not {delta_m} m")]
    Delta {
        /// The safety distance offered \[m\].
        delta_m: f64,
        /// Smallest that is accepted \[m\].
        min_m: f64,
        /// Largest that is accepted \[m\].
        max_m: f64,
    },
    /// More vehicles than can be numbered.
    #[error("{vehicles} vehicles are more than can be judged ({max})", max = u32::MAX)]
    TooManyVehicles {
        /// How many were asked for.
        vehicles: usize,
    },
    /// A step came before the start.
    #[error("a step was offered before the start")]
    NotStarted,
    /// A second start came.
    #[error("a second start was offered")]
    AlreadyStarted,
    /// Positions of another number of vehicles.
    #[error("expected the positions of {expected} vehicles, found {found}")]
    WrongCount {
        /// Vehicles that are judged.
        expected: usize,
        /// Vehicles offered.
        found: usize,
    },
    /// A time that is not a finite number.
    #[error("the time {time_s} s is not a finite number")]
    TimeNotFinite {
        /// The time offered \[s\].
        time_s: f64,
    },
    /// A time not later than the one before.
    #[error("the time {time_s} s is not later than the time before, {previous_s} s")]
    TimeNotIncreasing {
        /// The time before \[s\].
        previous_s: f64,
        /// The time offered \[s\].
        time_s: f64,
    },
    /// A position that is not a finite number.
    #[error("the position of vehicle {} at {time_s} s is not a finite number", vehicle + 1)]
    NotFinite {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The time \[s\].
        time_s: f64,
    },
    /// A position whose square could overflow.
    #[error("the position of vehicle {} at {time_s} s is beyond {limit_m:e} m, too far to judge", vehicle + 1)]
    TooFar {
        /// The vehicle, from 0.
        vehicle: usize,
        /// The time \[s\].
        time_s: f64,
        /// Largest coordinate that is accepted \[m\].
        limit_m: f64,
    },
}
