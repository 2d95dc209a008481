//! Agreement of three detectors: closed form, shape casts of parry, and contacts of Rapier.

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated};
use super::flights::{builtin, engine, separation_m};
use tautline_audit::Status;
use tautline_core::swarm::Pair;
use tautline_report::flight_log::FlightLog;
use tautline_sim::metrics::Metrics;
use tautline_sim::sim::Flight;

/// Largest difference of the times of first contact between closed form and parry \[s\].
const CONTACT_TOLERANCE_S: f64 = 1e-9;

/// Smallest separations in continuous time by an independent integrator \[m\].
const PENTAGON_MIN_M: f64 = 2.460_353;
const CIRCLE_MIN_M: f64 = 1.238_135;

/// Flight of a built-in scenario with the settings of `tautline run`.
#[derive(Debug)]
pub(super) struct BuiltinFlight {
    pub(super) delta_m: f64,
    pub(super) flight: Flight,
    pub(super) log: FlightLog,
    /// Time to reach the formation \[s\]; NaN if never reached.
    reached_at_s: f64,
}

/// The paper's three flights: Figs. 2, 3 and 4.
#[derive(Debug)]
pub(super) struct Flights {
    pub(super) pentagon: BuiltinFlight,
    pub(super) circle: BuiltinFlight,
    pub(super) baseline: BuiltinFlight,
}

fn fly(name: &str, progress: &Progress<'_>) -> Result<BuiltinFlight, MeasureError> {
    let scenario = builtin(name)?;
    let freedom = scenario.law()?.capabilities().controls.freedom();
    let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival)
        .with_freedom(freedom)
        .with_reference(scenario.reference.as_ref());
    let mut log = FlightLog::of(&scenario);
    let flight = engine(&scenario, progress, |sample| {
        metrics.observe(sample);
        log.take(sample);
    })?;
    progress.advance(1);
    let reached_at_s = metrics.finish().reached_at_s.unwrap_or(f64::NAN);
    Ok(BuiltinFlight { delta_m: scenario.delta_m, reached_at_s, flight, log })
}

/// Returns the pairs in violation by the closed form, in order of their indices.
fn violating(flight: &Flight) -> Vec<Pair> {
    let mut pairs: Vec<Pair> = flight.audit.violations.iter().map(|violation| violation.pair).collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

fn names(pairs: &[Pair]) -> String {
    let names = pairs.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if names.is_empty() { "none".to_owned() } else { names }
}

/// Flies the three flights.
pub(super) fn flights(progress: &Progress<'_>) -> Result<Flights, MeasureError> {
    let fly = |name| fly(name, progress);
    let (pentagon, (circle, baseline)) =
        rayon::join(|| fly("pentagon"), || rayon::join(|| fly("circle"), || fly("pentagon-laplacian")));
    Ok(Flights { pentagon: pentagon?, circle: circle?, baseline: baseline? })
}

/// Returns the claims about the flights.
pub(super) fn claims(flights: &Flights) -> ClaimsResult {
    Ok(vec![
        flown_clear("figure-2-in-the-engine", &flights.pentagon, PENTAGON_MIN_M)?,
        flown_clear("figure-3-in-the-engine", &flights.circle, CIRCLE_MIN_M)?,
        agree_on_clear(&flights.pentagon.flight)?,
        agree_on_violation(&flights.baseline.flight)?,
    ])
}

fn flown_clear(id: &str, flown: &BuiltinFlight, expected_m: f64) -> Result<Claim, MeasureError> {
    let (min_m, reached_at_s) = (separation_m(flown.flight.audit.closest), flown.reached_at_s);
    let clear = flown.flight.audit.status == Status::Clear;
    let not = if clear { "" } else { "not " };
    let claim = stated(id)?;
    let pass = clear && reached_at_s.is_finite() && (min_m - expected_m).abs() <= claim.limit();
    let words = format!("{not}clear, reached at {reached_at_s:.1} s, closest {min_m:.4} m");
    Ok(claim.measured(words, [("min_m", min_m), ("reached_at_s", reached_at_s)]).pass(pass))
}

fn agree_on_clear(flight: &Flight) -> Result<Claim, MeasureError> {
    let (found, contacts) = (violating(flight), &flight.engine_contacts);
    let (parry, disagreements) = (flight.audit.parry.min_toi_s, flight.audit.parry.disagreements);
    let words = format!(
        "violations: {}; contacts of parry: {}; overlaps of Rapier: {}; {disagreements} disagreements in {} casts",
        names(&found),
        parry.map_or("none".to_owned(), |time_s| format!("from {time_s:.3} s")),
        names(contacts),
        flight.audit.pairs_checked
    );
    let pass = found.is_empty() && parry.is_none() && contacts.is_empty() && disagreements == 0;
    let values = [("pairs_checked", flight.audit.pairs_checked as f64), ("disagreements", disagreements as f64)];
    Ok(stated("detectors-on-a-clear-flight")?.measured(words, values).pass(pass))
}

fn agree_on_violation(flight: &Flight) -> Result<Claim, MeasureError> {
    let (found, contacts) = (violating(flight), &flight.engine_contacts);
    let disagreements = flight.audit.parry.disagreements;
    let first_s = flight.audit.violations.iter().map(|violation| violation.from_s).fold(f64::INFINITY, f64::min);
    let contact_s = flight.audit.parry.min_toi_s.unwrap_or(f64::NAN);
    let words = format!(
        "violations: {}; overlaps of Rapier: {}; first contact at {first_s:.3} s (closed form) and {contact_s:.3} s \
         (parry); {disagreements} disagreements in {} casts",
        names(&found),
        names(contacts),
        flight.audit.pairs_checked
    );
    let values = [
        ("violating_pairs", found.len() as f64),
        ("closed_form_from_s", first_s),
        ("parry_from_s", contact_s),
        ("disagreements", disagreements as f64),
    ];
    let same = !found.is_empty() && found == *contacts && disagreements == 0;
    let pass = same && (first_s - contact_s).abs() <= CONTACT_TOLERANCE_S;
    Ok(stated("detectors-on-a-violation")?.measured(words, values).pass(pass))
}
