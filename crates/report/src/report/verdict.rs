//! The judgement and its reasons.

use serde::{Deserialize, Serialize};

use super::flight::{FailedVehicle, FlightResult, Report};
use super::hulls::vehicles;
use super::legs;
use super::obstacles::Obstacles;
use tautline_audit::Status;
use tautline_core::record::EnergyRise;
use tautline_core::text::{counted, metres, metres_below, seconds};
use tautline_sim::metrics::Summary;
use tautline_sim::scenario::TimeSpec;
use tautline_sim::sim::Ending;

/// The judgement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// Clear, reached, flown to its end, and not refused before the first step.
    pub pass: bool,
    /// Stable names of what refused the flight before the first step, such as `start-on-line`.
    pub refused: Vec<String>,
    /// Why it did not pass, a sentence each; empty where it did.
    pub reasons: Vec<String>,
}

impl Verdict {
    /// Passes where nothing refused the flight, the audit is clear, both detectors agree, the formation is reached and the
    /// run was flown to its end.
    pub(super) fn of(report: &Report, result: &FlightResult<'_>) -> Self {
        let reasons: Vec<_> = [
            refused(result),
            violation(result),
            unresolved_by_step(result),
            report.obstacles.as_ref().and_then(Obstacles::reason),
            report.hulls.reason(),
            disagreement(result),
            undecided(result),
            broken_certificate(report),
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

/// The number that keeps a formation from being reached, by its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fails {
    /// The formation was reached, and the flight ended early.
    EndedEarly,
    /// Everything was within the limits at the end, for too short a time.
    HeldS,
    /// No state at the end is known.
    Unknown,
    /// The largest error of a desired distance.
    MaxEdgeErrorM,
    /// The distance of a vehicle from its slot: every edge has its length, and the shape is another one, or elsewhere.
    #[serde(alias = "rms_position_error_m")]
    MaxPositionErrorM,
    /// The largest speed relative to the mean.
    #[serde(rename = "disagreement_m_s")]
    Disagreement,
}

impl Fails {
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

/// Vehicles are at rest if what they still lack is farther than they would get in this many times the flight's duration.
const REST_DURATIONS: f64 = 10.0;
/// Time over which a commanded acceleration adds to the speed \[s\].
const COMMANDED_S: f64 = 1.0;

/// Whether the vehicles of a formation that is not reached have come to rest elsewhere: at the speeds and commanded
/// accelerations of the end, ten times the flight's duration would not cover the position error that is too much,
///
/// ```text
/// (v + u 1 s) H < e - edge_error_m,    H = 10 T
/// ```
///
/// where laws damp relative velocities at about 1/s, so that a command is worth its acceleration over a second.
///
/// Returns `None` if this is unknown: the flight ended early, or a disturbance may hold vehicles that stand while they are
/// commanded.
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
    (!codes.is_empty()).then(|| format!("The flight was refused before its first step: {codes}."))
}

fn violation(result: &FlightResult<'_>) -> Option<String> {
    if result.flight.audit.status != Status::Violation {
        return None;
    }
    let delta_m = result.scenario.delta_m;
    let violations = &result.flight.audit.violations;
    let Some(deepest) = violations.iter().min_by(|a, b| a.min_m.total_cmp(&b.min_m)) else {
        return Some(format!("Two vehicles came closer than {} m.", metres(delta_m)));
    };
    let [first, second] = deepest.pair.numbers();
    let others = match violations.len() - 1 {
        0 => String::new(),
        1 => " There is 1 other violation.".to_owned(),
        n => format!(" There are {n} other violations."),
    };
    Some(format!(
        "Vehicles {first} and {second} came to {} m of each other at {}; the safety distance is {} m.{others}",
        metres_below(deepest.min_m, delta_m),
        seconds(deepest.min_at_s),
        metres(delta_m),
    ))
}

/// Whether violations were found that integration may have made: a step was too long for the law before, or in, the first of them.
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
        "The step cannot resolve whether the safety distance of {} m is kept: vehicles {first} and {second} came to {} m of each \
         other at {} as flown, and after steps that are too long for the law integration may err by more than that.",
        metres(result.scenario.delta_m),
        metres_below(deepest.min_m, result.scenario.delta_m),
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
            "Two vehicles came so near to delta that the audit cannot tell whether they kept it: paths that bend within a \
             step leave more room than there was."
                .to_owned(),
        );
    }
    (result.flight.audit.status == Status::Undecided && result.flight.audit.parry.disagreements == 0).then(|| {
        "The audit could not judge everything it was shown, so it cannot say that no two vehicles came too close."
            .to_owned()
    })
}

fn ended_early(report: &Report) -> Option<String> {
    let why = report.run.ended_early.as_deref()?.trim_end_matches('.');
    Some(format!("The run ended early, at {}: {why}.", seconds(report.run.duration_s)))
}

/// Whether a separation is below what was certified, by more of the certified clearance above delta than integration may
/// cost: near the barrier the energy of a pair is in inverse proportion to its clearance, so the part is that of the energy.
pub(super) fn breaks_certificate(separation_m: f64, certified_m: f64, delta_m: f64) -> bool {
    separation_m - delta_m < (certified_m - delta_m) * (1.0 - INTEGRATION)
}

/// The proof says that the energy never grows: one that did was not flown by the law, but by a step too long for it or by
/// numbers that ran out of digits.
pub(super) fn rises(result: &FlightResult<'_>) -> bool {
    risen_energy(result).is_some()
}

fn risen_energy(result: &FlightResult<'_>) -> Option<String> {
    let (summary, vehicles) = (result.summary, result.scenario.count());
    let EnergyRise { from: initial, to: most } = result.flight.energy_rise?;
    let allowed = highest_honest(initial, summary, vehicles);
    (result.energy_falls() && most > allowed).then(|| {
        format!(
            "The law's energy never grows in continuous time, and here it rose from {initial:.4e} to {most:.4e} m^2/s^2, \
             where integration and rounding explain {allowed:.4e}: what was flown is not the motion of the law. Shorten \
             time.dt_s, or raise time.max_halvings.",
        )
    })
}

/// The proof is of continuous time: a separation below what it certifies shows a step too long for the law's barrier, or
/// numbers that ran out of digits.
fn broken_certificate(report: &Report) -> Option<String> {
    let (certified_m, closest) = (report.separation.certified_m?, report.separation.closest()?);
    report.breaks_certificate().then(|| {
        format!(
            "The law certifies {} m in continuous time, and {} came to {} m: what was flown is not the motion that \
             the proof is about. Shorten time.dt_s, and look for positions so large that their differences lose digits.",
            metres(certified_m),
            vehicles(closest.pair),
            metres_below(closest.separation_m, certified_m),
        )
    })
}

/// Where even the shortest part of a step is too long for the law, nothing that is flown from there on is its motion.
fn steps_too_long(result: &FlightResult<'_>) -> Option<String> {
    let overlong = result.flight.overlong_steps;
    (overlong > 0).then(|| {
        format!(
            "{} longer than the law allows in the state that it was in, and halved no further: what was flown is not the motion of \
             the law. Shorten time.dt_s, raise time.max_halvings, leave time.max_rate_dt at no more than {}, or make the law gentler.",
            counted(overlong, "step was", "steps were"),
            TimeSpec::DEFAULT_MAX_RATE_DT
        )
    })
}

fn not_reached(report: &Report, result: &FlightResult<'_>) -> Option<String> {
    let (summary, judge) = (result.summary, result.scenario.arrival);
    let why = match report.formation.fails? {
        // The reason is that of the early end.
        Fails::EndedEarly => return None,
        Fails::HeldS => format!(
            "it was kept for the last {} only, and {} are asked for",
            seconds(summary.held_s.unwrap_or_default()),
            seconds(judge.hold_s)
        ),
        Fails::Unknown => "no state at the end is known".to_owned(),
        Fails::MaxEdgeErrorM => format!(
            "at the end a distance is still wrong by {} m, and {} m are allowed",
            metres(summary.max_edge_error_m),
            judge.edge_error_m
        ),
        Fails::MaxPositionErrorM => format!(
            "at the end every edge has its length within what is allowed and the shape is another one all the same, or it is turned \
             or elsewhere where it may not be: a vehicle is {} m from its slot, and {} m are allowed",
            metres(summary.max_position_error_m),
            judge.edge_error_m
        ),
        Fails::Disagreement => format!(
            "at the end vehicles still differ by {} m/s from their mean velocity, or from that of the reference they follow, and \
             {} m/s are allowed",
            metres(summary.disagreement_m_s),
            judge.disagreement_m_s
        ),
    };
    let failed = (!report.failures.is_empty()).then(|| format!(" Failed: {}.", FailedVehicle::line(&report.failures)));
    let then = match report.formation.at_rest {
        _ if failed.is_some() => "",
        Some(true) if summary.held_s.is_none() => {
            " The vehicles have come to rest elsewhere: ten times the duration would not be enough."
        }
        Some(false) if summary.held_s.is_none() && !result.preflight.refuses() => {
            " The vehicles are still moving: more time may help."
        }
        Some(false) if summary.held_s.is_none() => " The vehicles are still moving.",
        _ => "",
    };
    Some(format!("The formation was not reached: {why}.{then}{}", failed.unwrap_or_default()))
}

/// A start flatter than the formation: forces along the lines between vehicles never leave it.
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
        "The start lies {start} and the formation needs {formation}: a law that acts along the lines between vehicles \
         never leaves that {trap}."
    ))
}

/// Part of an energy, and of what it keeps apart, that the error of integration stays below.
pub(super) const INTEGRATION: f64 = EnergyRise::INTEGRATION;

/// The largest energy \[m^2/s^2\] that a motion without gain may show, from an energy `initial` on:
///
/// ```text
/// (1 + 1e-3) E(0) + N [ u r + (epsilon v)^2 ],    r = epsilon x,    epsilon = 2^-52
/// ```
///
/// with the largest command u, the fastest vehicle v and the largest distance x from where the swarm began. Rounding moves a
/// vehicle by r against a force of u, and changes its velocity by epsilon v.
pub(super) fn highest_honest(initial: f64, summary: &Summary, vehicles: usize) -> f64 {
    let resolution_m = f64::EPSILON * summary.extent_m;
    let rounding = summary.peak_control_m_s2 * resolution_m + (f64::EPSILON * summary.fastest_m_s).powi(2);
    (1.0 + INTEGRATION) * initial + vehicles as f64 * rounding
}
