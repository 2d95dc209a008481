//! What an audit says of single vehicles.

use serde::Serialize;

use super::limit::Limit;
use crate::outcome::Status;
use crate::shortlist::Tally;

/// What was found of all that is asked of each vehicle by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvelopeOutcome {
    /// Limit by limit, in the order in which they were given; that of the fence last.
    pub limits: Vec<LimitOutcome>,
}

/// What was found of one limit.
#[derive(Clone, Debug, PartialEq)]
pub struct LimitOutcome {
    /// What was asked.
    pub limit: Limit,
    /// The verdict.
    pub status: Status,
    /// The value that came nearest to the limit, or went farthest beyond it; none where nothing tells any.
    pub extreme: Option<Exceeding>,
    /// Times that a vehicle was beyond it, in order of time; of many the worst, and the first of each vehicle.
    pub violations: Vec<Exceeding>,
    /// Times of which it cannot be told, likewise.
    pub undecided: Vec<Exceeding>,
    /// How many times a vehicle was beyond it.
    pub violations_tally: Tally,
    /// How many times it cannot be told.
    pub undecided_tally: Tally,
    /// Vehicles of which nothing tells it at all.
    pub unknown: Vec<usize>,
    /// What was taken for granted to tell it, beyond what happens between samples.
    pub assumes: Option<String>,
    /// Corners of curves, which are not held against it; none where there are none.
    pub corners: Option<Corners>,
}

/// Instants at which the velocity of a recorded curve jumps: no vehicle flies them as they are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// How many there are, of all vehicles.
    pub count: u64,
    /// The one at which the velocity jumps most.
    pub largest: Corner,
}

/// An instant at which a velocity jumps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Corner {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// When \[s\].
    pub at_s: f64,
    /// By how much \[m/s\].
    pub by_m_s: f64,
}

/// A vehicle over a time. The time is that of the samples or pieces around.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exceeding {
    /// The vehicle.
    #[serde(skip)]
    pub vehicle: usize,
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// The worst value within is at least this, in the unit of its limit.
    pub lower: f64,
    /// And at most this.
    pub upper: f64,
    /// When the worst that is certain is reached \[s\].
    pub at_s: f64,
}

impl EnvelopeOutcome {
    /// Whether some limit is exceeded.
    #[must_use]
    pub fn is_exceeded(&self) -> bool {
        self.limits.iter().any(|limit| limit.status == Status::Violation)
    }

    /// Whether everything is known of every limit but for what it lists as undecided.
    #[must_use]
    pub fn is_else_known(&self) -> bool {
        let is_listed = |limit: &LimitOutcome| {
            let is_whole = !limit.violations_tally.is_shortened() && !limit.undecided_tally.is_shortened();
            is_whole && (limit.status != Status::Undecided || !limit.undecided.is_empty())
        };
        self.limits.iter().all(|limit| limit.unknown.is_empty() && is_listed(limit))
    }

    /// Whether every limit is known to be kept, or nothing is asked.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.limits.iter().all(|limit| limit.status == Status::Clear)
    }
}
