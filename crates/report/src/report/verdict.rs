//! Verdict on a flight and its reasons.

use serde::{Deserialize, Serialize};

use super::flight::{FailedVehicle, FlightResult, Report};
use super::hulls::vehicles;
use super::legs;
use super::obstacles::Obstacles;
use super::shield::ShieldNumbers;
use tautline_audit::Status;
use tautline_core::record::EnergyRise;
use tautline_core::text::{below_bound, beside_limit, counted, exact, metres, seconds};
use tautline_sim::metrics::Summary;
use tautline_sim::scenario::TimeSpec;
use tautline_sim::sim::Ending;

/// Verdict on a flight.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// Whether the flight is clear, reached its formation, was flown to its end and was not refused by the check.
    pub pass: bool,
    /// Stable names of the warnings that refuse the flight, such as `start-on-line`.
    pub refused: Vec<String>,
    /// Reasons against a pass, a sentence each.
    pub reasons: Vec<String>,
}

impl Verdict {
    /// Returns the verdict. A flight passes if the check does not refuse it, the audit is clear and both detectors
    /// agree. The certificate and the energy bound must hold, every leg must be reached, and the run must be flown to
    /// its end.
    pub(super) fn of(report: &Report, result: &FlightResult<'_>) -> Self {
        let reasons: Vec<_> = [
            refused(result),
            violation(report, result),
            unresolved_by_step(result),
            report.obstacles.as_ref().and_then(Obstacles::reason),
            report.hulls.reason(),
            disagreement(result),
            undecided(result),
            broken_certificate(report),
            report.shield.as_ref().and_then(ShieldNumbers::reason),
            report.shield.as_ref().and_then(ShieldNumbers::failed_law),
            steps_too_long(result),
            risen_energy(result),
            ended_early(report),
            not_reached(report, result),
            legs::reason(&report.legs),
            too_flat(result),
        ]
        .into_iter()
        .flatten()
        .collect();
        let refused = result.preflight.refusing().into_iter().map(str::to_owned).collect();
        Self { pass: reasons.is_empty(), refused, reasons }
    }
}

/// Criterion that keeps a formation from being reached, by its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnmetCriterion {
    /// The formation was reached, but the flight ended early.
    EndedEarly,
    /// All errors were within their limits at the end, but for too short a time.
    HeldS,
    /// The state at the end is unknown.
    Unknown,
    /// Largest error of a desired distance.
    MaxEdgeErrorM,
    /// Largest distance of a vehicle from its slot: all edges have their length, but the shape or its place is another
    /// one.
    #[serde(alias = "rms_position_error_m")]
    MaxPositionErrorM,
    /// Largest speed relative to the mean velocity.
    #[serde(rename = "disagreement_m_s")]
    Disagreement,
}

impl UnmetCriterion {
    pub(super) fn of(result: &FlightResult<'_>) -> Option<Self> {
        let (summary, judge) = (result.summary, result.scenario.arrival);
        if summary.reached_at_s.is_some() {
            (result.flight.ending != Ending::Completed).then_some(Self::EndedEarly)
        } else if summary.held_s.is_some() {
            Some(Self::HeldS)
        } else if !summary.max_edge_error_m.is_finite() {
            Some(Self::Unknown)
        } else if summary.max_edge_error_m > judge.edge_error_m {
            Some(Self::MaxEdgeErrorM)
        } else if summary.max_position_error_m > judge.edge_error_m {
            Some(Self::MaxPositionErrorM)
        } else {
            Some(Self::Disagreement)
        }
    }
}

/// Vehicles are at rest if this many durations of the flight would not suffice to cover the remaining error.
const REST_DURATIONS: f64 = 10.0;
/// Time over which a commanded acceleration adds to the speed \[s\].
const COMMANDED_S: f64 = 1.0;

/// Returns whether the vehicles of a formation that is not reached have come to rest elsewhere. At their final speeds v
/// and commanded accelerations u, ten times the duration T would not cover the excess of the position error e:
///
/// ```text
/// (v + u 1 s) H < e - edge_error_m,    H = 10 T
/// ```
///
/// Laws damp relative velocities at about 1/s, so a command counts as its acceleration over one second.
///
/// Returns `None` if the flight ended early, or if a disturbance may hold vehicles at rest that are commanded to move.
pub(super) fn at_rest(result: &FlightResult<'_>) -> Option<bool> {
    let (summary, judge) = (result.summary, result.scenario.arrival);
    let (speed_m_s, command_m_s2) = (summary.disagreement_m_s, summary.final_control_m_s2);
    let lacking_m = summary.max_edge_error_m.max(summary.max_position_error_m) - judge.edge_error_m;
    let is_void = result.reached_at_s().is_some() || result.flight.ending != Ending::Completed;
    if is_void || ![speed_m_s, command_m_s2, lacking_m].iter().all(|x| x.is_finite()) {
        return None;
    }
    let horizon_s = REST_DURATIONS * summary.end_s;
    let stands = speed_m_s * horizon_s < lacking_m;
    let is_left_alone = (speed_m_s + command_m_s2 * COMMANDED_S) * horizon_s < lacking_m;
    if stands && !is_left_alone && result.is_disturbed() { None } else { Some(is_left_alone) }
}

fn refused(result: &FlightResult<'_>) -> Option<String> {
    let codes = result.preflight.refusing().join(", ");
    (!codes.is_empty()).then(|| format!("The check refuses the flight: {codes}."))
}

fn violation(report: &Report, result: &FlightResult<'_>) -> Option<String> {
    if result.flight.audit.status != Status::Violation {
        return None;
    }
    let others = match report.audit.violations.len().saturating_sub(1) {
        0 => String::new(),
        1 => " There is 1 other violation.".to_owned(),
        n => format!(" There are {n} other violations."),
    };
    Some(report.deepest_violation() + &others)
}

impl Report {
    /// Returns the reasons without the deepest violation of two vehicles, which the headline has.
    pub(super) fn reasons_beside_headline(&self) -> Vec<String> {
        let deepest = self.deepest_violation();
        let rest = self.verdict.reasons.iter().map(|reason| reason.strip_prefix(&deepest).unwrap_or(reason).trim());
        rest.filter(|reason| !reason.is_empty()).map(str::to_owned).collect()
    }

    /// Returns the violation of two vehicles with the smallest separation, in a sentence.
    fn deepest_violation(&self) -> String {
        let delta_m = self.separation.delta_m;
        match self.audit.violations.iter().min_by(|a, b| a.min_m.total_cmp(&b.min_m)) {
            None => format!("Two vehicles came closer than {} m.", exact(delta_m)),
            Some(deepest) => format!(
                "Vehicles {} came to {} m at {}; the safety distance is {} m.",
                deepest.pair,
                beside_limit(deepest.min_m, delta_m, 3),
                seconds(deepest.min_at_s),
                exact(delta_m),
            ),
        }
    }
}

/// Returns whether integration may have caused all violations: a step was too long for the law before or within the
/// first one.
pub(super) fn is_unresolved_by_step(status: Status, overlong_steps: u64, violations: usize) -> bool {
    status == Status::Undecided && overlong_steps > 0 && violations > 0
}

fn unresolved_by_step(result: &FlightResult<'_>) -> Option<String> {
    let audit = &result.flight.audit;
    if !is_unresolved_by_step(audit.status, result.flight.overlong_steps, audit.violations.len()) {
        return None;
    }
    let deepest = audit.violations.iter().min_by(|a, b| a.min_m.total_cmp(&b.min_m))?;
    let [first, second] = deepest.pair.numbers();
    Some(format!(
        "The step cannot resolve whether the safety distance of {} m is kept. In the flown motion vehicles {first} and \
         {second} came to {} m at {}, but the integration error of steps that are too long for the law may be larger.",
        exact(result.scenario.delta_m),
        beside_limit(deepest.min_m, result.scenario.delta_m, 3),
        seconds(deepest.min_at_s),
    ))
}

fn disagreement(result: &FlightResult<'_>) -> Option<String> {
    let parry = &result.flight.audit.parry;
    let first = parry.first_disagreement.as_ref().map(|first| format!(" First: {first}.")).unwrap_or_default();
    let count = parry.disagreements;
    let times = if count == 1 { "once".to_owned() } else { format!("{count} times") };
    (count > 0).then(|| format!("The two detectors of the audit disagree {times}, so one of them is wrong.{first}"))
}

fn undecided(result: &FlightResult<'_>) -> Option<String> {
    if !result.flight.audit.violations.is_empty() {
        return None;
    }
    if result.flight.audit.status == Status::Undecided && result.flight.audit.unresolved > 0 {
        return Some(
            "Two vehicles came so close to delta that the audit cannot decide: the bound on the bend of their paths \
             within a step exceeds their distance from delta."
                .to_owned(),
        );
    }
    (result.flight.audit.status == Status::Undecided && result.flight.audit.parry.disagreements == 0)
        .then(|| "The audit could not judge every pair and step, so it does not exclude a violation.".to_owned())
}

fn ended_early(report: &Report) -> Option<String> {
    let why = report.run.ended_early.as_deref()?.trim_end_matches('.');
    Some(format!("The run ended early, at {}: {why}.", seconds(report.run.duration_s)))
}

/// Returns whether a separation is below the certified one by more than the integration error. The error is relative to
/// the certified clearance above delta. Near the barrier the energy of a pair is inversely proportional to its
/// clearance, so both have the same relative error.
pub(super) fn breaks_certificate(separation_m: f64, certified_m: f64, delta_m: f64) -> bool {
    separation_m - delta_m < (certified_m - delta_m) * (1.0 - INTEGRATION)
}

/// Returns whether the energy rose although it is proved never to grow. A rise shows a step that is too long for the
/// law, or loss of digits.
pub(super) fn energy_rises(result: &FlightResult<'_>) -> bool {
    risen_energy(result).is_some()
}

fn risen_energy(result: &FlightResult<'_>) -> Option<String> {
    let (summary, vehicles) = (result.summary, result.scenario.count());
    let EnergyRise { from: initial, to: most } = result.flight.energy_rise?;
    let allowed = largest_explained_energy(initial, summary, vehicles);
    (result.energy_falls() && most > allowed).then(|| {
        format!(
            "The energy rose from {initial:.4e} to {most:.4e} m^2/s^2, although the law never lets it grow. \
             Integration and rounding explain {allowed:.4e}. The flown motion is not that of the law. Shorten \
             time.dt_s, or raise time.max_halvings.",
        )
    })
}

/// Returns the reason of a broken certificate. The proof is of continuous time: a separation below the certified one
/// shows a step that is too long for the law's barrier, or loss of digits.
fn broken_certificate(report: &Report) -> Option<String> {
    let (certified_m, closest) = (report.separation.certified_m?, report.separation.closest()?);
    report.breaks_certificate().then(|| {
        let [min, certified] = below_bound(closest.separation_m, certified_m);
        if report.shield.is_some() {
            return format!(
                "The assumptions of the shield held and imply {certified} m, but {} came to {min} m: the flown motion \
                 is not the one that the proof covers.",
                vehicles(closest.pair),
            );
        }
        format!(
            "The law certifies {certified} m in continuous time, but {} came to {min} m: the flown motion is not the \
             one that the proof covers. Shorten time.dt_s, and look for positions so large that their differences lose \
             digits.",
            vehicles(closest.pair),
        )
    })
}

/// Returns the reason of steps whose shortest part is too long for the law. From there on the motion is not that of the
/// law.
fn steps_too_long(result: &FlightResult<'_>) -> Option<String> {
    let overlong = result.flight.overlong_steps;
    (overlong > 0).then(|| {
        format!(
            "{} longer than the law allows, even after all halvings: the flown motion is not that of the law. Shorten \
             time.dt_s, raise time.max_halvings, leave time.max_rate_dt at no more than {}, or make the law \
             gentler.",
            counted(overlong, "step was", "steps were"),
            TimeSpec::DEFAULT_MAX_RATE_DT
        )
    })
}

fn not_reached(report: &Report, result: &FlightResult<'_>) -> Option<String> {
    let (summary, judge) = (result.summary, result.scenario.arrival);
    let why = match report.formation.fails? {
        // The early end has a reason of its own.
        UnmetCriterion::EndedEarly => return None,
        UnmetCriterion::HeldS => format!(
            "it was kept for the last {} only; {} is required",
            seconds(summary.held_s.unwrap_or_default()),
            seconds(judge.hold_s)
        ),
        UnmetCriterion::Unknown => "no state at the end is known".to_owned(),
        UnmetCriterion::MaxEdgeErrorM => format!(
            "at the end the largest edge error is {} m (limit {} m)",
            metres(summary.max_edge_error_m),
            judge.edge_error_m
        ),
        UnmetCriterion::MaxPositionErrorM => format!(
            "at the end every edge error is within its limit, but the shape, its attitude or its place is another \
             one: the largest position error is {} m (limit {} m)",
            metres(summary.max_position_error_m),
            judge.edge_error_m
        ),
        UnmetCriterion::Disagreement => format!(
            "at the end the largest speed relative to the mean velocity, or to that of the reference, is {} m/s \
             (limit {} m/s)",
            metres(summary.disagreement_m_s),
            judge.disagreement_m_s
        ),
    };
    let failed = (!report.failures.is_empty()).then(|| format!(" Failed: {}.", FailedVehicle::line(&report.failures)));
    let then = match report.formation.at_rest {
        _ if failed.is_some() => "",
        Some(true) if summary.held_s.is_none() => {
            " The vehicles have come to rest elsewhere: ten times the duration would not suffice."
        }
        Some(false) if summary.held_s.is_none() && !result.preflight.refuses() => {
            " The vehicles are still moving: more time may help."
        }
        Some(false) if summary.held_s.is_none() => " The vehicles are still moving.",
        _ => "",
    };
    Some(format!("The formation was not reached: {why}.{then}{}", failed.unwrap_or_default()))
}

/// Returns the reason of a start of fewer dimensions than the formation: forces along the lines between vehicles never
/// leave it.
fn too_flat(result: &FlightResult<'_>) -> Option<String> {
    if result.reached_at_s().is_some() {
        return None;
    }
    let (start, trap) = match result.preflight.trap_dimension()? {
        0 => ("at one point", "point"),
        1 => ("on a line", "line"),
        _ => ("in a plane", "plane"),
    };
    let formation = match result.preflight.formation_dimension {
        1 => "a line",
        2 => "a plane",
        _ => "space",
    };
    Some(format!(
        "The start lies {start}, but the formation needs {formation}: a law that acts along the lines between vehicles \
         never leaves that {trap}."
    ))
}

/// Largest error of integration, relative to an energy or to a clearance that the energy keeps.
pub(super) const INTEGRATION: f64 = EnergyRise::INTEGRATION;

/// Returns the largest energy \[m^2/s^2\] of a motion that gains no energy, from the energy `initial` on:
///
/// ```text
/// (1 + 1e-3) E(0) + N [ u r + (epsilon v)^2 ],    r = epsilon x,    epsilon = 2^-52
/// ```
///
/// Here u is the largest command, v the speed of the fastest vehicle and x the largest distance from the start of the
/// swarm. Rounding moves a vehicle by r against a force of u, and changes its velocity by epsilon v.
pub(super) fn largest_explained_energy(initial: f64, summary: &Summary, vehicles: usize) -> f64 {
    let resolution_m = f64::EPSILON * summary.extent_m;
    let rounding = summary.peak_control_m_s2 * resolution_m + (f64::EPSILON * summary.fastest_m_s).powi(2);
    (1.0 + INTEGRATION) * initial + vehicles as f64 * rounding
}
