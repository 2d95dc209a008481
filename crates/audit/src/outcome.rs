//! Results of an audit: the verdict, approaches, violations, and undecided times.

use std::fmt;

use serde::{Deserialize, Serialize};

use tautline_core::swarm::{ClosestApproach, Pair};

/// Width of the interval in which the smallest distance on a curve is enclosed \[m\]; rounding widens it where
/// coordinates are large.
pub const WIDTH_M: f64 = 1e-9;

/// Verdict of an audit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// No pair came below its limit, both detectors agree, and all input was judged.
    Clear,
    /// At least one pair came below its limit.
    Violation,
    /// No violation was found, but the motion is not proved clear. Reasons: nothing was judged, input was refused or
    /// missing, the two detectors disagree, or a separation could not be resolved. A flight whose steps are too long
    /// for its law is undecided if its violations may come from integration errors.
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

    /// Returns the combined verdict: the worse of the two.
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

/// Pair of objects that must keep a distance. Indices count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObjectPair {
    /// Two vehicles.
    Vehicles(Pair),
    /// A vehicle and an obstacle.
    Obstacle {
        /// Index of the vehicle.
        vehicle: usize,
        /// Index of the obstacle in [`Settings::obstacles`](super::recorded::Settings::obstacles).
        obstacle: usize,
    },
}

impl ObjectPair {
    /// Returns the two vehicles, or `None` if one of the objects is an obstacle.
    #[must_use]
    pub fn vehicles(self) -> Option<Pair> {
        match self {
            Self::Vehicles(pair) => Some(pair),
            Self::Obstacle { .. } => None,
        }
    }
}

impl From<Pair> for ObjectPair {
    fn from(pair: Pair) -> Self {
        Self::Vehicles(pair)
    }
}

/// Closest approach of a pair.
///
/// Distances are between two centres, or from a centre to an obstacle's surface \[m\]. With an ellipsoid they are
/// scaled distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Approach {
    /// Pair of objects.
    #[serde(skip)]
    pub pair: ObjectPair,
    /// Lower bound of the smallest distance \[m\].
    pub lower_m: f64,
    /// Upper bound of the smallest distance \[m\]; equal to `lower_m` where the motion is exact, and within [`WIDTH_M`]
    /// of it on curves.
    pub upper_m: f64,
    /// Time at which the interpolated motion is closest \[s\].
    pub time_s: f64,
    /// Limit: the distance must not fall below it \[m\].
    pub limit_m: f64,
}

impl Approach {
    /// Returns whether both bounds agree to within the width of the enclosure.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.upper_m - self.lower_m <= 2.0 * WIDTH_M
    }

    /// Returns the smallest distance \[m\] if it is known, else its lower bound.
    #[must_use]
    pub fn certain_m(&self) -> f64 {
        if self.is_known() { self.upper_m } else { self.lower_m }
    }
}

/// Uninterrupted time during which a pair was below its limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Violation<P = Pair> {
    /// Pair of objects.
    #[serde(skip)]
    pub pair: P,
    /// Time at which the distance fell below the limit \[s\]; the start of the motion if it began below.
    pub from_s: f64,
    /// Time at which the distance was back at the limit \[s\]; the last judged instant if it is still below.
    pub to_s: f64,
    /// Smallest distance within this time \[m\]; an upper bound of it under bounded acceleration.
    pub min_m: f64,
    /// Earliest time of the smallest distance \[s\].
    pub min_at_s: f64,
    /// Limit: the distance must not fall below it \[m\].
    pub limit_m: f64,
}

/// Time during which it is not decided whether a pair is below its limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Undecided<P = Pair> {
    /// Pair of objects.
    #[serde(skip)]
    pub pair: P,
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\].
    pub to_s: f64,
    /// Lower bound of the distance \[m\].
    pub lower_m: f64,
    /// Upper bound of the smallest distance \[m\].
    pub upper_m: f64,
    /// Limit: the distance must not fall below it \[m\].
    pub limit_m: f64,
    /// Sampling rate at which the verdict on the interpolated motion would be certain \[Hz\]. `None` if the
    /// interpolated distance equals the limit to the last digit, or if an exact motion is within rounding of the limit.
    pub rate_hz: Option<f64>,
}

/// Findings of one step, or of the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepFinding<'a> {
    /// Closest approach of all pairs over this step; `None` with fewer than two vehicles. Of equal separations, the
    /// lowest pair at its earliest time.
    pub closest: Option<ClosestApproach>,
    /// Violations that began in this step, as known at its end, ordered by pair.
    pub began: &'a [Violation],
    /// Violations that ended in this step, complete, ordered by pair. A violation that began and ended in this step is
    /// in both lists.
    pub ended: &'a [Violation],
}

/// Verdict on a flight, with its evidence.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AuditOutcome {
    /// Verdict.
    pub status: Status,
    /// Closest approach of all pairs over the flight. Of equal separations, that of the earliest step, there of the
    /// lowest pair, at its earliest time.
    pub closest: Option<ClosestApproach>,
    /// All violations, ordered by their start and then by pair.
    pub violations: Vec<Violation>,
    /// Number of judged steps, without the start.
    pub steps: u64,
    /// Number of pairs swept in closed form and cast by parry, summed over the start and all steps.
    pub pairs_checked: u64,
    /// Number of pairs that were proved, by a bound on their motion, to stay farther apart than delta and than the
    /// closest pair of the step; summed likewise. `pairs_checked + pairs_excluded` = (steps + 1) N (N - 1) / 2.
    pub pairs_excluded: u64,
    /// Number of calls that returned an error. Their input was not judged.
    pub refused: u64,
    /// Number of clear steps whose margin is smaller than the possible bend of the paths; 0 for straight steps, which
    /// are judged exactly.
    pub unresolved: u64,
    /// Result of the second detector.
    pub parry: ParryEvidence,
}

/// Result of the second detector: parry's shape cast of keep-out balls, and parry's distances from obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParryEvidence<P = Pair> {
    /// Earliest time of contact \[s\]; `None` without contact. Contact at exactly the limit is reported by parry and is
    /// no violation.
    pub min_toi_s: Option<f64>,
    /// Number of results that contradict the first detector by more than rounding; each is an error.
    pub disagreements: u64,
    /// First disagreement.
    pub first_disagreement: Option<Disagreement<P>>,
}

impl<P> Default for ParryEvidence<P> {
    fn default() -> Self {
        Self { min_toi_s: None, disagreements: 0, first_disagreement: None }
    }
}

/// Contradicting results of the two detectors for one segment of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Disagreement<P = Pair> {
    /// Pair of objects.
    pub pair: P,
    /// Start of the segment of motion \[s\]. The segments of a flight are its steps.
    pub from_s: f64,
    /// End of the segment \[s\].
    pub to_s: f64,
    /// Smallest separation within the segment by the closed form \[m\].
    pub min_m: f64,
    /// Time at which the pair falls below its limit by the closed form \[s\]; `None` if it does not.
    pub closed_form_s: Option<f64>,
    /// First contact by parry \[s\]; `None` without contact, NaN if parry failed.
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
