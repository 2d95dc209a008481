//! The flights that came nearest to a violation, or furthest into one.

use serde::Serialize;

use super::row::Row;
use crate::compare::Outcome;

/// How many are kept.
pub(super) const WORST: usize = 10;

/// A flight to look at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Number of the run.
    pub run: u64,
    /// How it went.
    pub outcome: Outcome,
    /// Smallest separation less delta \[m\].
    pub clearance_m: f64,
    /// Smallest separation \[m\].
    pub min_m: f64,
    /// When that was \[s\].
    pub min_at_s: Option<f64>,
    /// Which two.
    pub min_pair: Option<[usize; 2]>,
    /// Whether the formation was reached.
    pub reached: bool,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
}

/// The worst so far, the worst first; of equal ones the first flown.
#[derive(Clone, Debug, Default)]
pub(super) struct WorstList(Vec<Worst>);

impl WorstList {
    /// Takes a row, if it is among the worst.
    pub(super) fn take(&mut self, row: &Row) {
        let (Some(flight), Some(clearance_m)) = (&row.flight, row.clearance_m()) else { return };
        // One that violated, an obstacle's clearance it may be, is worse than any that did not.
        let rank = |outcome: Outcome| outcome != Outcome::Violated;
        let own = (rank(flight.outcome), clearance_m);
        let place = self.0.partition_point(|worse| (rank(worse.outcome), worse.clearance_m) <= own);
        if place >= WORST {
            return;
        }
        let worst = Worst {
            run: row.run,
            outcome: flight.outcome,
            clearance_m,
            min_m: flight.min_m.unwrap_or(f64::NAN),
            min_at_s: flight.min_at_s,
            min_pair: flight.min_pair,
            reached: flight.reached,
            state_hash: flight.state_hash.clone(),
        };
        self.0.insert(place, worst);
        self.0.truncate(WORST);
    }

    /// All of them.
    #[must_use]
    pub(super) fn finish(self) -> Vec<Worst> {
        self.0
    }
}
