//! What an audit says.

use std::fmt;

use serde::{Deserialize, Serialize};

use tautline_core::swarm::{ClosestApproach, Pair};

/// Width of the interval in which the smallest distance on a curve is enclosed \[m\]; rounding widens it where coordinates
/// are large.
pub const WIDTH_M: f64 = 1e-9;

/// The verdict over everything that was judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// No pair came closer than it may, both detectors agree on it, and everything offered was judged.
    Clear,
    /// A pair was found closer than it may come, whatever else was found.
    Violation,
    /// No violation was found, yet it cannot be called clear: nothing was judged, something was refused or not seen, the
    /// two detectors disagree, or a separation could not be resolved. A flight in steps too long for its law is undecided with
    /// violations that integration may have made.
    #[default]
    Undecided,
}

impl Status {
    pub(super) fn new(violated: bool, decided: bool) -> Self {
        match (violated, decided) {
            (true, _) => Self::Violation,
            (false, true) => Self::Clear,
            (false, false) => Self::Undecided,
        }
    }

    /// Returns the verdict on two things together: the worse of the two.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        let has = |status: Self| self == status || other == status;
        Self::new(has(Self::Violation), !has(Self::Undecided))
    }

    /// Returns the name of the status in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Violation => "violation",
            Self::Undecided => "undecided",
        }
    }
}

/// A pair of objects that must keep a distance. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObjectPair {
    /// Two vehicles.
    Vehicles(Pair),
    /// A vehicle and an obstacle.
    Obstacle {
        /// The vehicle.
        vehicle: usize,
        /// The obstacle, an index into [`Settings::obstacles`](super::recorded::Settings::obstacles).
        obstacle: usize,
    },
}

impl ObjectPair {
    /// The two vehicles, if it is two.
    #[must_use]
    pub fn vehicles(self) -> Option<Pair> {
        match self {
            Self::Vehicles(pair) => Some(pair),
            Self::Obstacle { .. } => None,
        }
    }
}

/// The closest that two came.
///
/// Lengths are distances of two centres, or of a centre from an obstacle's surface, in metres; with an ellipsoid they are
/// scaled distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Approach {
    /// The pair.
    #[serde(skip)]
    pub pair: ObjectPair,
    /// It is at least this \[m\].
    pub lower_m: f64,
    /// It is at most this \[m\]; the same as `lower_m` where the motion is exact, and within [`WIDTH_M`] of it on curves.
    pub upper_m: f64,
    /// When the motion as drawn is closest \[s\].
    pub time_s: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
}

impl Approach {
    /// Whether both bounds are one number, to the width of the enclosure.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.upper_m - self.lower_m <= 2.0 * WIDTH_M
    }

    /// One number for the smallest distance \[m\]: what is reached where the motion is known, and what it is at least where
    /// it is not.
    #[must_use]
    pub fn certain_m(&self) -> f64 {
        if self.is_known() { self.upper_m } else { self.lower_m }
    }
}

/// A time during which a pair was closer than it may come, without a break.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Violation<P = Pair> {
    /// The pair.
    #[serde(skip)]
    pub pair: P,
    /// When the distance fell below the limit \[s\]; the start if it was below from the start.
    pub from_s: f64,
    /// When it was back at the limit \[s\]; the last instant judged while it still is below.
    pub to_s: f64,
    /// Smallest distance within \[m\]; under bounded acceleration an upper bound of it.
    pub min_m: f64,
    /// When that was \[s\], the earliest such instant.
    pub min_at_s: f64,
    /// What the distance must not fall below \[m\].
    pub limit_m: f64,
}

/// A time over which it cannot be told whether a pair came too close.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Undecided<P = Pair> {
    /// The pair.
    #[serde(skip)]
    pub pair: P,
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// Their distance is at least this \[m\].
    pub lower_m: f64,
    /// Its smallest value is at most this \[m\].
    pub upper_m: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
    /// The sampling rate that decides where the vehicles fly as drawn between samples \[Hz\]; `None` where the drawn motion
    /// meets the limit to the last digit, or the limit lies within the width or rounding of an exact motion.
    pub rate_hz: Option<f64>,
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
#[derive(Clone, Debug, Default, PartialEq)]
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
    /// Steps that are clear with less room than the paths of their vehicles may bend; 0 for straight steps, which are judged
    /// exactly.
    pub unresolved: u64,
    /// What the second detector says.
    pub parry: ParryEvidence,
}

/// What the second detector found on the pairs that it was asked about: parry's shape cast of keep-out balls, and parry's
/// distances from obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParryEvidence<P = Pair> {
    /// Earliest time of contact \[s\]; `None` when there never was one. Touching at exactly the limit is a contact to parry
    /// and not a violation.
    pub min_toi_s: Option<f64>,
    /// Answers that contradict those of the first detector by more than rounding explains: each is an error.
    pub disagreements: u64,
    /// The first of them.
    pub first_disagreement: Option<Disagreement<P>>,
}

impl<P> Default for ParryEvidence<P> {
    fn default() -> Self {
        Self { min_toi_s: None, disagreements: 0, first_disagreement: None }
    }
}

/// Two detectors, two answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement<P = Pair> {
    /// The pair.
    pub pair: P,
    /// Start of the segment of motion, for a flight the step \[s\].
    pub from_s: f64,
    /// Its end \[s\].
    pub to_s: f64,
    /// Smallest separation within it by the closed form \[m\].
    pub min_m: f64,
    /// When the pair falls below its limit by the closed form \[s\]; `None` when it does not.
    pub closed_form_s: Option<f64>,
    /// First contact by parry \[s\]; `None` when there is none, NaN when it could not tell.
    pub parry_s: Option<f64>,
}

impl fmt::Display for Disagreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let answer = |time_s: Option<f64>| time_s.map_or("none".into(), |time_s| format!("one at {time_s} s"));
        write!(
            f,
            "vehicles {} between {} s and {} s, smallest separation {} m: contact by the closed form {}, by parry {}",
            self.pair,
            self.from_s,
            self.to_s,
            self.min_m,
            answer(self.closed_form_s),
            answer(self.parry_s)
        )
    }
}
