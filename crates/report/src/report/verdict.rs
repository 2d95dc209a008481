//! Verdict on a flight and its reasons, as data. [`super::words`] turns reasons into sentences.

use serde::{Serialize, Serializer};

use super::answer::{Finding, Objects};
use super::flight::{FailedVehicle, FlightResult, Report};
use super::hulls::PassedThrough;
use super::legs::LegNumbers;
use tautline_audit::{Disagreement, ObjectPair, Status};
use tautline_core::fact::Coded;
use tautline_core::impl_coded;
use tautline_core::record::EnergyRise;
use tautline_core::swarm::{Bounce, Pair};
use tautline_sim::metrics::Summary;
use tautline_sim::sim::Ending;

/// Verdict on a flight.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Verdict {
    /// Whether the flight is clear, reached its formation, was flown to its end and was not refused by the check: there
    /// is no reason against a pass.
    pub pass: bool,
    /// Reasons against a pass.
    pub reasons: Vec<Reason>,
}

/// Reason against a pass. In JSON an object with `code`, `text` and `data`, the fields of the variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(remote = "Self", untagged)]
#[non_exhaustive]
pub enum Reason {
    /// The check refuses the flight.
    Refused {
        /// Codes of its warnings, such as `start-on-line`.
        warnings: Vec<String>,
    },
    /// A pair came below delta.
    Violation {
        /// Deepest violation.
        #[serde(flatten, serialize_with = "serialize_approach")]
        deepest: Finding,
        /// Number of violations of pairs.
        violations: usize,
    },
    /// A pair came below delta in the flown motion, and integration may have caused it.
    UnresolvedByStep(#[serde(serialize_with = "serialize_approach")] Finding),
    /// A vehicle came below the clearance of an obstacle.
    ObstacleViolation {
        /// Deepest violation.
        #[serde(flatten, serialize_with = "serialize_approach")]
        deepest: Finding,
        /// Number of violations of obstacles.
        violations: usize,
    },
    /// A vehicle came nearer to an obstacle than certified.
    ObstacleCertificateBroken {
        /// The approach.
        #[serde(flatten, serialize_with = "serialize_approach")]
        approach: Finding,
        /// Certified distance beyond every clearance \[m\].
        certified_clearance_margin_m: f64,
    },
    /// The two detectors disagree on the distance from an obstacle.
    ObstacleDetectorsDisagree {
        /// Number of disagreements.
        disagreements: u64,
    },
    /// A vehicle came below a clearance in the flown motion, and integration may have caused it.
    ObstacleUnresolvedByStep(#[serde(serialize_with = "serialize_approach")] Finding),
    /// Not every distance from an obstacle is decided.
    ObstacleUndecided {
        /// Number of undecided times.
        undecided: u64,
    },
    /// Two hulls passed through each other.
    PassedThrough {
        /// The pair.
        #[serde(flatten)]
        through: PassedThrough,
        /// Whether the vehicles are points; otherwise a step skipped the collision.
        are_points: bool,
    },
    /// Hulls collided. After the first collision the motion is not governed by the law.
    HullsHit {
        /// First collision.
        #[serde(flatten)]
        first: Bounce,
        /// Number of collisions.
        collisions: usize,
    },
    /// The two detectors disagree on a pair of vehicles.
    DetectorsDisagree {
        /// Number of disagreements.
        disagreements: u64,
        /// The first one.
        #[serde(skip)]
        first: Option<Disagreement>,
    },
    /// Paths may bend by more than a pair's distance from delta.
    PathsBend {
        /// Number of such steps.
        steps: u64,
    },
    /// Not every pair and step was judged.
    NotJudged {},
    /// A pair came closer than certified.
    CertificateBroken {
        /// The approach, with the certified separation as its limit.
        #[serde(flatten, serialize_with = "serialize_approach")]
        approach: Finding,
        /// Whether the shield certifies; otherwise the law does.
        by_shield: bool,
    },
    /// A bound that the shield assumes was exceeded.
    ShieldBoundExceeded {
        /// The bound and its vehicle.
        exceeded: String,
    },
    /// The law failed behind the shield.
    LawFailed {
        /// Number of instants.
        instants: u64,
    },
    /// Steps were longer than the law allows.
    StepsTooLong {
        /// Number of steps.
        steps: u64,
    },
    /// The energy rose although it is proved never to grow.
    EnergyRose {
        /// Energy at the last change of the target \[m^2/s^2\].
        from: f64,
        /// Largest energy after it \[m^2/s^2\].
        to: f64,
        /// Largest energy that integration and rounding explain \[m^2/s^2\].
        explained: f64,
    },
    /// The run ended early.
    EndedEarly {
        /// Time of the end \[s\].
        at_s: f64,
        /// Code of the ending, such as `interrupted`.
        ending: &'static str,
        /// The ending.
        #[serde(skip)]
        cause: Ending,
    },
    /// The formation was not reached.
    NotReached {
        /// Criterion that is not met.
        criterion: UnmetCriterion,
        /// Value of the criterion at the end; null if it is unknown.
        value: Option<f64>,
        /// Limit of the criterion.
        limit: Option<f64>,
        /// Whether the vehicles have come to rest elsewhere; null if unknown.
        at_rest: Option<bool>,
        /// Whether more time may help: the vehicles are moving and the check does not refuse the flight.
        more_time_may_help: bool,
        /// Vehicles with a failed part.
        failed: Vec<FailedVehicle>,
    },
    /// A leg was not reached before the next one began.
    LegNotReached {
        /// Number of the leg, from 1.
        leg: usize,
        /// Start of the next leg \[s\].
        until_s: Option<f64>,
    },
    /// A leg never began.
    LegNeverBegan {
        /// Number of the leg, from 1.
        leg: usize,
        /// Whether the leg before was reached, so that the flight ended first.
        is_before_reached: bool,
    },
    /// The start has fewer dimensions than the formation, and the law acts along the lines between vehicles.
    StartTooFlat {
        /// Dimensions of the start.
        start_dimension: usize,
        /// Dimensions of the formation.
        formation_dimension: usize,
    },
}

/// Serialises a smallest distance as the data of a reason, with names of keys that differ for pairs and obstacles.
fn serialize_approach<S: Serializer>(found: &Finding, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    #[serde(untagged)]
    enum Data<'a> {
        Pair {
            pair: Pair,
            min_m: Option<f64>,
            min_at_s: Option<f64>,
            limit_m: Option<f64>,
        },
        Obstacle {
            vehicle: usize,
            obstacle: &'a str,
            clearance_m: Option<f64>,
            min_m: Option<f64>,
            min_at_s: Option<f64>,
        },
        Vehicle {},
    }
    let &Finding { at_s: min_at_s, limit: limit_m, ref value, .. } = found;
    let min_m = value.upper;
    let data = match found.objects {
        Objects::Pair(ObjectPair::Vehicles(pair)) => Data::Pair { pair, min_m, min_at_s, limit_m },
        Objects::Pair(ObjectPair::Obstacle { vehicle, .. }) => {
            let (vehicle, obstacle) = (vehicle + 1, found.subjects.last().map_or("", String::as_str));
            Data::Obstacle { vehicle, obstacle, clearance_m: limit_m, min_m, min_at_s }
        }
        Objects::Vehicle(_) => Data::Vehicle {},
    };
    data.serialize(serializer)
}

impl_coded! { Reason {
    Self::Refused { .. } => "refused",
    Self::Violation { .. } => "violation",
    Self::UnresolvedByStep(_) => "unresolved-by-step",
    Self::ObstacleViolation { .. } => "obstacle-violation",
    Self::ObstacleCertificateBroken { .. } => "obstacle-certificate-broken",
    Self::ObstacleDetectorsDisagree { .. } => "obstacle-detectors-disagree",
    Self::ObstacleUnresolvedByStep(_) => "obstacle-unresolved-by-step",
    Self::ObstacleUndecided { .. } => "obstacle-undecided",
    Self::PassedThrough { .. } => "passed-through",
    Self::HullsHit { .. } => "hulls-hit",
    Self::DetectorsDisagree { .. } => "detectors-disagree",
    Self::PathsBend { .. } => "paths-bend",
    Self::NotJudged {} => "not-judged",
    Self::CertificateBroken { .. } => "certificate-broken",
    Self::ShieldBoundExceeded { .. } => "shield-bound-exceeded",
    Self::LawFailed { .. } => "law-failed",
    Self::StepsTooLong { .. } => "steps-too-long",
    Self::EnergyRose { .. } => "energy-rose",
    Self::EndedEarly { .. } => "ended-early",
    Self::NotReached { .. } => "not-reached",
    Self::LegNotReached { .. } => "leg-not-reached",
    Self::LegNeverBegan { .. } => "leg-never-began",
    Self::StartTooFlat { .. } => "start-too-flat",
} }

impl Verdict {
    /// Returns whether the flown motion is that of law and vehicles. If it is not, a clear flight proves nothing about
    /// them.
    #[must_use]
    pub fn is_motion_of_the_law(&self) -> bool {
        !self.reasons.iter().any(|reason| {
            matches!(
                reason,
                Reason::StepsTooLong { .. }
                    | Reason::EnergyRose { .. }
                    | Reason::CertificateBroken { .. }
                    | Reason::ObstacleCertificateBroken { .. }
                    | Reason::PassedThrough { .. }
            )
        })
    }

    /// Returns whether a reason has this code.
    #[must_use]
    pub fn has(&self, code: &str) -> bool {
        self.reasons.iter().any(|reason| reason.code() == code)
    }

    /// Returns the verdict. A flight passes if the check does not refuse it, the audit is clear and both detectors
    /// agree. The certificate and the energy bound must hold, every leg must be reached, and the run must be flown to
    /// its end.
    pub(super) fn of(report: &Report, result: &FlightResult<'_>) -> Self {
        let mut reasons = Vec::new();
        let warnings: Vec<_> = result.preflight.refusing().into_iter().map(str::to_owned).collect();
        reasons.extend((!warnings.is_empty()).then_some(Reason::Refused { warnings }));
        reasons.extend(of_pairs(result));
        reasons.extend(of_obstacles(report, result));
        reasons.extend(of_hulls(report));
        reasons.extend(undecided(result));
        reasons.extend(broken_certificate(report));
        reasons.extend(of_shield(report));
        let steps = result.flight.overlong_steps;
        reasons.extend((steps > 0).then_some(Reason::StepsTooLong { steps }));
        reasons.extend(risen_energy(result));
        reasons.extend(ended_early(result));
        reasons.extend(not_reached(report, result));
        reasons.extend(of_legs(&report.legs));
        reasons.extend(too_flat(result));
        // A status without a reason never passes.
        if reasons.is_empty() && report.answer.status != Status::Clear {
            reasons.push(Reason::NotJudged {});
        }
        Self { pass: reasons.is_empty(), reasons }
    }
}

/// Criterion that keeps a formation from being reached, by its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
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

/// Returns the violation of a pair, or the one that integration may have caused.
fn of_pairs(result: &FlightResult<'_>) -> Option<Reason> {
    let audit = &result.flight.audit;
    let deepest = result.deepest(&audit.violations)?;
    match audit.status {
        Status::Violation => Some(Reason::Violation { deepest, violations: audit.violations.len() }),
        // A step was too long for the law before or within the first violation.
        _ => (result.flight.overlong_steps > 0).then_some(Reason::UnresolvedByStep(deepest)),
    }
}

/// Returns the reasons of obstacles.
fn of_obstacles(report: &Report, result: &FlightResult<'_>) -> Vec<Reason> {
    let Some(outcome) = &result.flight.clearance else { return Vec::new() };
    let (disagreements, violations) = (outcome.parry.disagreements, outcome.violations.len());
    let deepest = result.deepest(&outcome.violations);
    let mut reasons = Vec::new();
    match (outcome.status, deepest.clone()) {
        (Status::Violation, Some(deepest)) => reasons.push(Reason::ObstacleViolation { deepest, violations }),
        _ => reasons.extend(broken_clearance(report)),
    }
    reasons.extend((disagreements > 0).then_some(Reason::ObstacleDetectorsDisagree { disagreements }));
    if outcome.status == Status::Undecided && disagreements == 0 {
        let undecided = outcome.undecided.len() as u64 + outcome.unresolved + outcome.refused;
        reasons.push(deepest.map_or(Reason::ObstacleUndecided { undecided }, Reason::ObstacleUnresolvedByStep));
    }
    reasons
}

/// Returns the reason of an approach to an obstacle below the certified distance, by more than the error of
/// integration.
fn broken_clearance(report: &Report) -> Option<Reason> {
    let certified_clearance_margin_m = report.certificate.clearance_margin_m?;
    let approach = report.closest_obstacle()?.clone();
    let is_broken = approach.margin() < certified_clearance_margin_m * (1.0 - INTEGRATION);
    is_broken.then_some(Reason::ObstacleCertificateBroken { approach, certified_clearance_margin_m })
}

fn of_hulls(report: &Report) -> impl Iterator<Item = Reason> {
    let hulls = &report.hulls;
    let are_points = hulls.bounces.is_none();
    let through = hulls.passed_through.map(|through| Reason::PassedThrough { through, are_points });
    let bounces = hulls.bounces.as_deref().unwrap_or_default();
    let hit = bounces.first().map(|&first| Reason::HullsHit { first, collisions: bounces.len() });
    through.into_iter().chain(hit)
}

/// Returns the reasons of pairs and steps that are not decided.
fn undecided(result: &FlightResult<'_>) -> Vec<Reason> {
    let audit = &result.flight.audit;
    let disagreements = audit.parry.disagreements;
    let first = audit.parry.first_disagreement;
    let mut reasons = Vec::new();
    reasons.extend((disagreements > 0).then_some(Reason::DetectorsDisagree { disagreements, first }));
    if audit.violations.is_empty() && audit.status == Status::Undecided {
        if audit.unresolved > 0 {
            reasons.push(Reason::PathsBend { steps: audit.unresolved });
        } else if disagreements == 0 {
            reasons.push(Reason::NotJudged {});
        }
    }
    reasons
}

/// Returns the early end of the run.
fn ended_early(result: &FlightResult<'_>) -> Option<Reason> {
    let cause = &result.flight.ending;
    let at_s = result.flight.duration_s;
    (*cause != Ending::Completed).then(|| Reason::EndedEarly { at_s, ending: cause.code(), cause: cause.clone() })
}

fn of_shield(report: &Report) -> impl Iterator<Item = Reason> {
    let shield = report.shield.as_ref();
    let exceeded = shield.and_then(|shield| shield.exceeded.clone());
    let instants = shield.map_or(0, |shield| shield.law_failed);
    let failed = (instants > 0).then_some(Reason::LawFailed { instants });
    exceeded.map(|exceeded| Reason::ShieldBoundExceeded { exceeded }).into_iter().chain(failed)
}

/// Returns whether a separation is below the certified one by more than the integration error. The error is relative to
/// the certified clearance above delta. Near the barrier the energy of a pair is inversely proportional to its
/// clearance, so both have the same relative error.
pub(super) fn breaks_certificate(separation_m: f64, certified_m: f64, delta_m: f64) -> bool {
    separation_m - delta_m < (certified_m - delta_m) * (1.0 - INTEGRATION)
}

/// Returns the rise of an energy that is proved never to grow. A rise shows a step that is too long for the law, or a
/// loss of digits.
fn risen_energy(result: &FlightResult<'_>) -> Option<Reason> {
    let EnergyRise { from, to } = result.flight.energy_rise?;
    let explained = largest_explained_energy(from, result.summary, result.scenario.count());
    (result.energy_falls() && to > explained).then_some(Reason::EnergyRose { from, to, explained })
}

/// Returns whether the energy rose although it is proved never to grow.
pub(super) fn energy_rises(result: &FlightResult<'_>) -> bool {
    risen_energy(result).is_some()
}

/// Returns the reason of a broken certificate. The proof is of continuous time: a separation below the certified one
/// shows a step that is too long for the law's barrier, or loss of digits.
fn broken_certificate(report: &Report) -> Option<Reason> {
    let closest = report.answer.closest.iter().find(|found| !found.is_of_obstacle())?.clone();
    let approach = Finding { limit: report.certificate.separation_m, ..closest };
    let by_shield = report.shield.is_some();
    report.breaks_certificate().then_some(Reason::CertificateBroken { approach, by_shield })
}

fn not_reached(report: &Report, result: &FlightResult<'_>) -> Option<Reason> {
    let (summary, judge) = (result.summary, result.scenario.arrival);
    let criterion = report.formation.fails?;
    let (value, limit) = match criterion {
        // The early end has a reason of its own.
        UnmetCriterion::EndedEarly => return None,
        UnmetCriterion::HeldS => (Some(summary.held_s.unwrap_or_default()), Some(judge.hold_s)),
        UnmetCriterion::Unknown => (None, None),
        UnmetCriterion::MaxEdgeErrorM => (Some(summary.max_edge_error_m), Some(judge.edge_error_m)),
        UnmetCriterion::MaxPositionErrorM => (Some(summary.max_position_error_m), Some(judge.edge_error_m)),
        UnmetCriterion::Disagreement => (Some(summary.disagreement_m_s), Some(judge.disagreement_m_s)),
    };
    let at_rest = report.formation.at_rest;
    let more_time_may_help = at_rest == Some(false) && !result.preflight.refuses();
    Some(Reason::NotReached { criterion, value, limit, at_rest, more_time_may_help, failed: report.failures.clone() })
}

/// Returns the first leg that was not reached before the next one began, and the first leg that never began.
fn of_legs(legs: &[LegNumbers]) -> impl Iterator<Item = Reason> {
    let missed = legs.windows(2).find_map(|pair| {
        let (leg, next) = (&pair[0], &pair[1]);
        let is_missed = leg.from_s.is_some() && leg.reached_at_s.is_none() && next.from_s.is_some();
        is_missed.then_some(Reason::LegNotReached { leg: leg.leg, until_s: leg.to_s })
    });
    let never = legs
        .windows(2)
        .find(|pair| pair[1].from_s.is_none())
        .map(|pair| Reason::LegNeverBegan { leg: pair[1].leg, is_before_reached: pair[0].reached_at_s.is_some() });
    missed.into_iter().chain(never)
}

/// Returns the reason of a start of fewer dimensions than the formation: forces along the lines between vehicles never
/// leave it.
fn too_flat(result: &FlightResult<'_>) -> Option<Reason> {
    if result.reached_at_s().is_some() {
        return None;
    }
    let start_dimension = result.preflight.trap_dimension()?;
    Some(Reason::StartTooFlat { start_dimension, formation_dimension: result.preflight.formation_dimension })
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
