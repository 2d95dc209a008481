//! Legs of a flight with several formations.

use serde::Serialize;

use super::flight::{FlightResult, finite};
use tautline_core::text::{at_least, seconds};
use tautline_sim::metrics::LegSummary;

/// Numbers of a leg, the flight to one of several formations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LegNumbers {
    /// Number of the leg, from 1.
    pub leg: usize,
    /// Start \[s\]; null if the leg never began.
    pub from_s: Option<f64>,
    /// Start of the next leg, or end of the flight \[s\].
    pub to_s: Option<f64>,
    /// Time at which its formation was reached and kept to the end of the leg \[s\].
    pub reached_at_s: Option<f64>,
    /// Separation certified for the leg, before the first step or after slots were spread \[m\].
    pub certified_m: Option<f64>,
    /// Bound on the energy of the leg \[m^2/s^2\].
    pub energy_bound: Option<f64>,
}

impl LegNumbers {
    /// Returns the legs of a flight; empty for a flight of one leg.
    pub(super) fn of(result: &FlightResult<'_>) -> Vec<Self> {
        let (ended, last, count) = (result.ended_legs, result.ended_legs.len(), result.scenario.legs.len());
        if count < 2 {
            return Vec::new();
        }
        let number = |leg: usize| {
            let began = |leg: usize| leg.checked_sub(1).map_or(Some(0.0), |before| Some(ended.get(before)?.ended_at_s));
            let LegSummary { ended_at_s, reached_at_s } = ended.get(leg).copied().unwrap_or(LegSummary {
                ended_at_s: result.flight.duration_s,
                reached_at_s: result.reached_at_s().filter(|_| leg == last),
            });
            let bound = result.flight.certificate.legs.get(leg);
            Self {
                leg: leg + 1,
                from_s: began(leg).filter(|_| leg <= last),
                to_s: Some(ended_at_s).filter(|_| leg <= last),
                reached_at_s,
                certified_m: bound.and_then(|bound| bound.certified_m).and_then(finite),
                energy_bound: bound.and_then(|bound| finite(bound.energy)),
            }
        };
        (0..count).map(number).collect()
    }
}

/// Returns the number of reached legs in a few words; `None` for a flight of one leg.
pub(super) fn brief(legs: &[LegNumbers]) -> Option<String> {
    let reached = legs.iter().filter(|leg| leg.reached_at_s.is_some()).count();
    (!legs.is_empty()).then(|| format!("{reached} of {} legs reached", legs.len()))
}

/// Returns a name and a line for each leg: start, arrival and certified separation.
pub(super) fn lines(legs: &[LegNumbers]) -> Vec<(String, String)> {
    let line = |leg: &LegNumbers| {
        let said = match (leg.from_s, leg.reached_at_s) {
            (None, _) => "never began".to_owned(),
            (Some(from_s), Some(at_s)) => format!("from {}, reached at {}", seconds(from_s), seconds(at_s)),
            (Some(from_s), None) => format!("from {}, not reached", seconds(from_s)),
        };
        let certified = leg.certified_m.map(|certified_m| format!(", certified {} m", at_least(certified_m, 6)));
        (format!("leg {}", leg.leg), said + &certified.unwrap_or_default())
    };
    legs.iter().map(line).collect()
}
