//! One flight of a campaign as one row.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::compare::{FlightRow, Outcome};
use crate::splitting::Splitting;

/// One flight: a run under a law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Number of the run, from 0.
    pub run: u64,
    /// Which of the campaign's laws, from 0.
    pub law: usize,
    /// What was drawn for it, in the order of the keys.
    pub drawn: Vec<Value>,
    /// Why it was not flown, where what was drawn cannot be, such as a start of two vehicles nearer than delta.
    pub not_flown: Option<String>,
    /// How it went.
    pub flight: Option<FlightRow>,
    /// What was estimated, where a run is no flight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splitting: Option<Splitting>,
}

/// What is known of a flight's separation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// No two vehicles came closer than delta, to the end.
    Clear,
    /// Two did.
    Violated,
    /// It ended early or the judge cannot tell.
    Unknown,
    /// What was drawn cannot be flown.
    NotFlown,
    /// It is no flight but an estimate.
    Estimated,
}

impl Row {
    /// What is known of its separation.
    #[must_use]
    pub fn known(&self) -> Known {
        match self.flight.as_ref().map(|flight| flight.outcome) {
            None if self.splitting.is_some() => Known::Estimated,
            None => Known::NotFlown,
            Some(Outcome::Clear) => Known::Clear,
            Some(Outcome::Violated) => Known::Violated,
            Some(Outcome::EndedEarly | Outcome::Undecided) => Known::Unknown,
        }
    }

    /// Smallest separation less delta \[m\].
    #[must_use]
    pub fn clearance_m(&self) -> Option<f64> {
        let flight = self.flight.as_ref()?;
        flight.min_m.map(|min_m| min_m - flight.delta_m)
    }

    /// Its place in the order of all rows.
    #[must_use]
    pub fn place(&self) -> (u64, usize) {
        (self.run, self.law)
    }
}
