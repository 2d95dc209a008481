//! Content of `report.json` and its construction from a flight.

use std::path::Path;

use serde::{Serialize, Serializer};

use super::answer::{Answer, Detectors, Finding, FindingList, Judgement, Objects, Part, Question};
use super::findings::moments;
use super::hulls::Hulls;
use super::legs::LegNumbers;
use super::shield::ShieldNumbers;
use super::verdict::{Reason, UnmetCriterion, Verdict, at_rest, energy_rises};
use super::words::early_end;
use crate::replay::{JudgementContext, Moment};
use tautline_audit::{Approach, ObjectPair, Status, Violation};
use tautline_core::fact::{CHORDS, EVERY_STEP, Fact, FactKind, Source, serialize_coded};
use tautline_core::files::{FileError, write_atomically};
use tautline_core::record::{DeadlockRecovery, Reassignment};
use tautline_core::swarm::ClosestApproach;
use tautline_laws::law::{Certificate, VoidReason};
use tautline_sim::link::Traffic;
use tautline_sim::metrics::{LegSummary, QuadrotorPeaks, Summary};
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{Failure, FailureKind, Scenario};
use tautline_sim::sim::{Ending, Flight};

/// Version of the keys. It increases when a key is renamed or removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 3;

/// Report on a flight, the content of `report.json`. In JSON the keys of a [`Judgement`] come first, then `reasons`,
/// then the fields from [`Self::certificate`] on.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(remote = "Self")]
#[non_exhaustive]
pub struct Report {
    /// The question.
    #[serde(skip)]
    pub question: Question,
    /// Facts that the answers rest on.
    #[serde(skip)]
    pub facts: Vec<Fact>,
    /// Verdict on the flight.
    #[serde(skip)]
    pub verdict: Verdict,
    /// Answer on separations and obstacles.
    #[serde(skip)]
    pub answer: Answer,
    /// Certificate of the flight.
    pub certificate: FlightCertificate,
    /// Ellipsoid that must stay empty around each vehicle. The separations of answer and certificate are then scaled
    /// lengths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ellipsoid: Option<Ellipsoid>,
    /// Scenario of the flight.
    pub scenario: ScenarioIdentity,
    /// Program that flew the scenario.
    pub tool: Tool,
    /// Extremes of tilt and thrust of quadrotors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<VehicleNumbers>,
    /// Statistics of the network, if messages are sent one by one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<Traffic>,
    /// Numbers of the shield, if the scenario has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shield: Option<ShieldNumbers>,
    /// Vehicles with a failed part, in the order of the scenario.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub failures: Vec<FailedVehicle>,
    /// Collisions of hulls, or pairs of points whose hulls would have collided.
    pub hulls: Hulls,
    /// Errors of the formation at the end, for the last leg that began.
    pub formation: FormationNumbers,
    /// Legs in their order, if the scenario has several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub legs: Vec<LegNumbers>,
    /// Times at which the slots were spread to let vehicles pass each other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub deadlock_recoveries: Vec<DeadlockRecovery>,
    /// Every time that interchangeable vehicles were given other slots.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub assignments: Vec<Reassignment>,
    /// Energy of the law.
    pub energy: Energy,
    /// Commanded accelerations.
    pub control: Control,
    /// Velocities at the end.
    pub velocity: Velocity,
    /// Duration, steps and hash of the run.
    pub run: Run,
    /// Result of the second flight at half the step, if the request asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub verification: Option<Verification>,
    /// Wall-clock times, the only part that differs between two runs of one scenario. Absent if a campaign repeats a
    /// run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub performance: Option<Performance>,
}

/// Identity of a scenario.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ScenarioIdentity {
    /// Name of the scenario.
    pub name: String,
    /// SHA-256 of the resolved scenario, 64 hexadecimal digits.
    pub sha256: String,
}

/// Identity of the program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Tool {
    /// Name of the program.
    pub name: String,
    /// Its version.
    pub version: String,
}

/// Certificate of a flight, before the first step or after slots were spread if that is smaller.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FlightCertificate {
    /// Certified separation \[m\]; null if nothing is certified.
    pub separation_m: Option<f64>,
    /// Certified distance beyond the clearance of every obstacle \[m\]; null without obstacles or certificate.
    pub clearance_margin_m: Option<f64>,
    /// Time up to which the certificate holds \[s\]; null if it has no end or nothing is certified.
    pub until_s: Option<f64>,
    /// Reasons why nothing is certified, objects with `code` and `text`.
    #[serde(serialize_with = "serialize_coded")]
    pub void: Vec<VoidReason>,
}

/// Errors of the formation at the end, and its arrival.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FormationNumbers {
    /// Whether the formation was reached and kept to the end. False for a flight that ended early.
    pub reached: bool,
    /// Time of arrival \[s\].
    pub reached_at_s: Option<f64>,
    /// Time over which all errors had stayed within their limits at the end \[s\]; null if an error exceeds its limit.
    pub held_s: Option<f64>,
    /// Criterion that keeps the formation from being reached; null if it is reached.
    pub fails: Option<UnmetCriterion>,
    /// Whether the vehicles have come to rest elsewhere, relative to each other; null if the formation is reached or
    /// this is unknown.
    pub at_rest: Option<bool>,
    /// Largest error of a desired distance at the end \[m\].
    pub max_edge_error_m: Option<f64>,
    /// Root mean square distance of the vehicles from the best-placed formation at the end \[m\].
    pub rms_position_error_m: Option<f64>,
    /// Largest distance of a vehicle from its slot in the best-placed formation at the end \[m\].
    pub max_position_error_m: Option<f64>,
}

/// Energy of the law \[m^2/s^2\].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Energy {
    /// At the start.
    pub initial: Option<f64>,
    /// At the end.
    #[serde(rename = "final")]
    pub at_end: Option<f64>,
    /// Largest energy of any step over the initial energy.
    pub max_over_initial: Option<f64>,
    /// Largest energy of any step over the energy at the last change of the target.
    pub max_over_leg_start: Option<f64>,
    /// Whether the energy rose on any leg by more than integration and rounding explain, although it is proved never to
    /// grow.
    pub rose: bool,
}

/// Largest commanded acceleration of any vehicle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Control {
    /// Over all steps \[m/s^2\].
    pub peak_m_s2: Option<f64>,
    /// At the end \[m/s^2\].
    pub final_m_s2: Option<f64>,
}

/// Velocities at the end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Velocity {
    /// Largest speed relative to the swarm's mean velocity \[m/s\].
    pub disagreement_m_s: Option<f64>,
    /// Speed of the mean velocity \[m/s\].
    pub common_m_s: Option<f64>,
}

/// Ellipsoid that must stay empty around a vehicle, and the smallest separation in metres.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ellipsoid {
    /// Half axes \[m\]. A scaled length divides heights by the ratio of the third half axis to the first.
    pub half_axes_m: [f64; 3],
    /// Smallest separation over the flight, unscaled \[m\].
    pub min_distance_m: Option<f64>,
    /// Time of `min_distance_m` \[s\].
    pub min_distance_at_s: Option<f64>,
    /// The two vehicles, numbered from 1.
    pub min_distance_pair: Option<[usize; 2]>,
}

/// Extremes of quadrotors over all samples.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VehicleNumbers {
    /// Name of the quadrotor model.
    pub model: String,
    /// Largest angle between a vehicle's thrust and the vertical \[deg\].
    pub max_tilt_deg: f64,
    /// Largest thrust of a rotor over its maximum.
    pub thrust_share: f64,
}

/// A vehicle with a failed part. The failure lasts to the end of the flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailedVehicle {
    /// Number of the vehicle, from 1.
    pub vehicle: u64,
    /// Start of the failure \[s\].
    pub at_s: f64,
    /// Kind of the failure, as in the scenario: `dead`, `rotor`, `silent` or `frozen`.
    pub kind: String,
}

impl From<&Failure> for FailedVehicle {
    fn from(failure: &Failure) -> Self {
        let kind = match failure.kind {
            FailureKind::Dead {} => "dead",
            FailureKind::Rotor { .. } => "rotor",
            FailureKind::Silent {} => "silent",
            FailureKind::Frozen {} => "frozen",
        };
        Self { vehicle: failure.vehicle, at_s: failure.at_s, kind: kind.to_owned() }
    }
}

/// Duration, steps and hash of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Run {
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Control and physics step \[s\].
    pub dt_s: f64,
    /// Steps flown.
    pub steps: u64,
    /// Steps of the physics engine, parts and repetitions included. Null for a plant without an engine.
    pub engine_steps: Option<u64>,
    /// Steps that were flown in parts, because the law was too fast for them or vehicles were too close.
    pub refined_steps: u64,
    /// Steps whose shortest part was still longer than the law allows. From there on the motion is not that of
    /// the law.
    pub overlong_steps: u64,
    /// Early end of the run, an object with `code` and `text`; null if it was flown to its end.
    #[serde(serialize_with = "super::words::serialize_early_end")]
    pub ended_early: Option<Ending>,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// [`tautline_core::record::StateHash`] of the recorded states.
    pub state_hash: String,
}

impl Run {
    /// Returns whether the user interrupted the run.
    #[must_use]
    pub fn is_interrupted(&self) -> bool {
        self.ended_early == Some(Ending::Interrupted)
    }

    /// Returns the reason of an early end in a sentence, with a remedy.
    #[must_use]
    pub fn early_end(&self) -> Option<String> {
        self.ended_early.as_ref().map(early_end)
    }
}

/// Wall-clock times. Times of parallel work are added up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Performance {
    /// From first to last step \[s\].
    pub wall_s: f64,
    /// `duration_s` over `wall_s`; null if `wall_s` is zero.
    pub real_time_factor: Option<f64>,
    /// In the law \[s\].
    pub law_s: f64,
    /// In the law's energy \[s\].
    pub energy_s: f64,
    /// In the plant \[s\].
    pub physics_s: f64,
    /// Part of `physics_s` in forces, rotors and attitude loops \[s\].
    pub airframe_s: f64,
    /// In the audit \[s\].
    pub audit_s: f64,
    /// In the recorders \[s\].
    pub record_s: f64,
}

/// Result of a second flight with every step half as long.
///
/// A flight that bounces hard off a barrier is chaotic: 10 to 20 of 100 such flights end elsewhere at any step. A
/// verdict on which both steps agree is called firm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verification {
    /// Longest step of the second flight \[s\].
    pub dt_s: f64,
    /// Whether the second flight passed.
    pub pass: bool,
    /// Smallest separation of the second flight \[m\].
    pub min_m: Option<f64>,
    /// When the second flight reached its formation \[s\].
    pub reached_at_s: Option<f64>,
    /// Whether both flights have the same verdict and smallest separations within 1 % of delta.
    pub firm: bool,
}

/// A flight, with all other inputs of its report.
#[derive(Clone, Copy, Debug)]
pub struct FlightResult<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Findings of the check before the first step, under the law that was flown.
    pub preflight: &'a Preflight,
    /// The flight.
    pub flight: &'a Flight,
    /// Statistics of the samples.
    pub summary: &'a Summary,
    /// Legs that ended before the last one.
    pub ended_legs: &'a [LegSummary],
    /// Extremes of tilt and thrust, for quadrotors.
    pub quadrotor_peaks: Option<QuadrotorPeaks>,
    /// [`tautline_core::record::StateHash`] of the recorded states.
    pub state_hash: &'a str,
}

impl FlightResult<'_> {
    /// Returns the time of the last arrival \[s\] if the formation was kept to the end of a completed flight.
    pub(super) fn reached_at_s(&self) -> Option<f64> {
        self.summary.reached_at_s.filter(|_| self.flight.ending == Ending::Completed)
    }

    /// Returns whether a disturbance or the airframe may hold vehicles at rest although they are commanded to move.
    pub(super) fn is_disturbed(&self) -> bool {
        !self.scenario.wind.is_still() || !self.scenario.is_exact() || !self.scenario.airframe.is_point()
    }

    /// Returns whether the energy is proved never to grow: relative velocities are damped in still air, and the
    /// certificate is void only for reasons that leave the energy bound intact.
    pub(super) fn energy_falls(&self) -> bool {
        let holds = |void: &VoidReason| {
            matches!(
                void,
                VoidReason::NoBarrier
                    | VoidReason::GraphNotComplete
                    | VoidReason::StepsTooLong
                    | VoidReason::Unresolved
            )
        };
        self.scenario.shield.is_none()
            && self.scenario.wind.is_still()
            && self.preflight.velocity_margin_per_s.is_some_and(|margin_per_s| margin_per_s >= 0.0)
            && self.flight.certificate.void.iter().all(holds)
    }

    fn run(&self) -> Run {
        let Flight { duration_s, steps, engine_steps, refined_steps, overlong_steps, .. } = *self.flight;
        Run {
            duration_s,
            dt_s: self.scenario.time.dt_s,
            steps,
            engine_steps,
            refined_steps,
            overlong_steps,
            ended_early: Some(self.flight.ending.clone()).filter(|ending| *ending != Ending::Completed),
            vehicles: self.scenario.count(),
            state_hash: self.state_hash.to_owned(),
        }
    }

    fn performance(&self) -> Performance {
        let times = &self.flight.performance;
        let wall_s = times.wall.as_secs_f64();
        Performance {
            wall_s,
            real_time_factor: finite(self.flight.duration_s / wall_s),
            law_s: times.law.as_secs_f64(),
            energy_s: times.energy.as_secs_f64(),
            physics_s: times.physics.as_secs_f64(),
            airframe_s: times.airframe.as_secs_f64(),
            audit_s: times.audit.as_secs_f64(),
            record_s: times.record.as_secs_f64(),
        }
    }

    fn unit(&self) -> &'static str {
        if self.scenario.half_axes_m().is_some() { "m, scaled" } else { "m" }
    }

    /// Returns the names of a pair, and the unit of its distances.
    fn names(&self, pair: ObjectPair) -> ([String; 2], &'static str) {
        match pair {
            ObjectPair::Vehicles(pair) => (pair.numbers().map(|number| number.to_string()), self.unit()),
            ObjectPair::Obstacle { vehicle, obstacle } => {
                let name = self.scenario.obstacles.get(obstacle).map(|obstacle| obstacle.name.clone());
                ([(vehicle + 1).to_string(), name.unwrap_or_default()], "m")
            }
        }
    }

    fn approach(&self, pair: ObjectPair, distance_m: f64, time_s: f64, limit_m: f64) -> Finding {
        let (names, unit) = self.names(pair);
        Finding::approach(&Approach { pair, lower_m: distance_m, upper_m: distance_m, time_s, limit_m }, names, unit)
    }

    fn violation<P: Copy + Into<ObjectPair>>(&self, found: &Violation<P>) -> Finding {
        let (names, unit) = self.names(found.pair.into());
        Finding::violation(found, names, unit, true)
    }

    /// Returns the deepest of some violations. Of equal ones it is that of the closest pair.
    pub(super) fn deepest<P: Copy + Into<ObjectPair>>(&self, violations: &[Violation<P>]) -> Option<Finding> {
        let closest = self.flight.audit.closest.map(|found| ObjectPair::from(found.pair));
        let is_other = |found: &Violation<P>| Some(found.pair.into()) != closest;
        let depth = |found: &Violation<P>| [found.min_m - found.limit_m, found.min_m];
        let order = |[a, b]: [f64; 2], [c, d]: [f64; 2]| a.total_cmp(&c).then(b.total_cmp(&d));
        let deepest = violations.iter().min_by(|a, b| order(depth(a), depth(b)).then(is_other(a).cmp(&is_other(b))));
        deepest.map(|found| self.violation(found))
    }

    /// Returns the answer on separations and obstacles. Of many violations the deepest are listed.
    fn answer(&self) -> Answer {
        let (flight, audit, clearance) = (self.flight, &self.flight.audit, self.flight.clearance.as_ref());
        let delta_m = self.scenario.delta_m;
        let closest = audit.closest.filter(|found| found.separation_m.is_finite() && found.time_s.is_finite());
        let closest = closest.map(|found| self.approach(found.pair.into(), found.separation_m, found.time_s, delta_m));
        let nearest = clearance.into_iter().flat_map(|outcome| &outcome.closest);
        let nearest = nearest.map(|found| self.approach(found.pair, found.certain_m(), found.time_s, found.limit_m));
        let of_pairs = audit.violations.iter().map(|found| self.violation(found));
        let of_obstacles = clearance.into_iter().flat_map(|outcome| &outcome.violations);
        let violations = of_pairs.chain(of_obstacles.map(|found| self.violation(found))).collect();
        let undecided_by_obstacles =
            clearance.map_or(0, |outcome| outcome.undecided.len() as u64 + outcome.unresolved + outcome.refused);
        let undecided = audit.unresolved + audit.refused + undecided_by_obstacles;
        Answer {
            status_so_far: flight.status_so_far(),
            closest: closest.into_iter().chain(nearest).collect(),
            violations: FindingList::deepest(violations),
            undecided: FindingList { count: undecided, is_exact: true, listed: Vec::new() },
            detectors: Some(Detectors {
                steps: Some(audit.steps),
                segments: None,
                pairs_swept: audit.pairs_checked,
                parry_contact_s: audit.parry.min_toi_s.and_then(finite),
                parry_disagreements: audit.parry.disagreements
                    + clearance.map_or(0, |outcome| outcome.parry.disagreements),
                rapier_contact_pairs: self.scenario.has_engine().then_some(flight.engine_contacts.len() as u64),
            }),
            ..Answer::new(Part::Separation, flight.status())
        }
    }

    fn certificate(&self) -> FlightCertificate {
        let Certificate { certified_m, certified_clearance_margin_m, certified_until_s, void, .. } =
            &self.flight.certificate;
        let margin_m = self.flight.clearance.as_ref().and(*certified_clearance_margin_m);
        FlightCertificate {
            separation_m: certified_m.and_then(finite),
            clearance_margin_m: margin_m.and_then(finite),
            until_s: certified_until_s.and_then(finite),
            void: void.clone(),
        }
    }

    fn ellipsoid(&self) -> Option<Ellipsoid> {
        let closest = self.flight.in_metres.as_ref().and_then(|in_metres| in_metres.closest);
        Some(Ellipsoid {
            half_axes_m: self.scenario.half_axes_m()?,
            min_distance_m: closest.and_then(|closest| finite(closest.separation_m)),
            min_distance_at_s: closest.and_then(|closest| finite(closest.time_s)),
            min_distance_pair: closest.map(|closest| closest.pair.numbers()),
        })
    }

    fn vehicle(&self) -> Option<VehicleNumbers> {
        let model = &self.scenario.airframe.quadrotor()?.model;
        let QuadrotorPeaks { max_tilt_rad, max_thrust_n } = self.quadrotor_peaks?;
        Some(VehicleNumbers {
            model: model.name.clone(),
            max_tilt_deg: max_tilt_rad.to_degrees(),
            thrust_share: max_thrust_n / model.max_thrust_n,
        })
    }
}

impl Report {
    /// Returns the report on a flight.
    #[must_use]
    pub fn new(result: &FlightResult<'_>) -> Self {
        let FlightResult { scenario, flight, summary, .. } = *result;
        let failed = scenario.failures.iter().filter(|failure| failure.at_s <= flight.duration_s);
        let mut report = Self {
            question: Question {
                delta: Some(scenario.delta_m),
                unit: result.unit(),
                ellipsoid_m: scenario.half_axes_m(),
                obstacles: scenario.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect(),
                ..Question::default()
            },
            facts: vec![if scenario.has_engine() {
                Fact::name(FactKind::Motion, Source::Proved, EVERY_STEP)
            } else {
                // A path leaves the chord of its step by less than a bound, which the audit adds.
                Fact::name(FactKind::Motion, Source::Deduced, CHORDS)
            }],
            scenario: ScenarioIdentity {
                name: scenario.name.clone(),
                sha256: result.preflight.resolved.sha256.clone(),
            },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            verdict: Verdict { pass: false, reasons: Vec::new() },
            answer: result.answer(),
            certificate: result.certificate(),
            ellipsoid: result.ellipsoid(),
            vehicle: result.vehicle(),
            network: flight.traffic,
            shield: flight.shield.as_ref().map(ShieldNumbers::from),
            failures: failed.map(FailedVehicle::from).collect(),
            hulls: Hulls::of(result),
            formation: FormationNumbers {
                reached: result.reached_at_s().is_some(),
                reached_at_s: result.reached_at_s().and_then(finite),
                held_s: summary.held_s.and_then(finite),
                fails: UnmetCriterion::of(result),
                at_rest: at_rest(result),
                max_edge_error_m: finite(summary.max_edge_error_m),
                rms_position_error_m: finite(summary.rms_position_error_m),
                max_position_error_m: finite(summary.max_position_error_m),
            },
            legs: LegNumbers::of(result),
            deadlock_recoveries: flight.deadlock_recoveries.clone(),
            assignments: flight.assignments.clone(),
            energy: Energy {
                initial: summary.energy_initial.and_then(finite),
                at_end: summary.energy_final.and_then(finite),
                max_over_initial: summary.energy_max_over_initial.and_then(finite),
                max_over_leg_start: flight.energy_rise.and_then(|rise| finite(rise.to / rise.from)),
                rose: energy_rises(result),
            },
            control: Control {
                peak_m_s2: finite(summary.peak_control_m_s2),
                final_m_s2: finite(summary.final_control_m_s2),
            },
            velocity: Velocity {
                disagreement_m_s: finite(summary.disagreement_m_s),
                common_m_s: finite(summary.common_m_s),
            },
            run: result.run(),
            verification: None,
            performance: Some(result.performance()),
        };
        report.verdict = Verdict::of(&report, result);
        report
    }

    /// Returns the safety distance delta \[m\].
    #[must_use]
    pub fn delta_m(&self) -> f64 {
        self.question.delta.unwrap_or_default()
    }

    /// Returns the closest approach of two vehicles over the flight.
    #[must_use]
    pub fn closest_pair(&self) -> Option<ClosestApproach> {
        self.answer.closest.iter().find_map(|found| {
            let Objects::Pair(ObjectPair::Vehicles(pair)) = found.objects else { return None };
            Some(ClosestApproach { pair, separation_m: found.value.upper?, time_s: found.at_s? })
        })
    }

    /// Returns the smallest separation of two vehicles over the flight \[m\].
    #[must_use]
    pub fn min_separation_m(&self) -> Option<f64> {
        self.closest_pair().map(|closest| closest.separation_m)
    }

    /// Returns the closest approach of a vehicle to an obstacle, beside its clearance.
    pub(super) fn closest_obstacle(&self) -> Option<&Finding> {
        self.answer.closest.iter().find(|found| found.is_of_obstacle())
    }

    /// Returns the number of contradictions of the two detectors.
    pub(super) fn disagreements(&self) -> u64 {
        self.answer.detectors.map_or(0, |detectors| detectors.parry_disagreements)
    }

    /// Returns the closest approach and the violations, the gravest first. Distances and times are those of the audit.
    #[must_use]
    pub fn moments(&self) -> Vec<Moment> {
        moments(std::slice::from_ref(&self.answer)).collect()
    }

    /// Returns the limit of separations, and whether the audit decided everything else.
    #[must_use]
    pub fn judgement(&self) -> JudgementContext {
        let is_open = self.answer.undecided.count + self.disagreements() > 0;
        let is_else_known = self.answer.status_so_far != Status::Undecided && !is_open;
        JudgementContext { is_else_known, limit: self.question.delta, unit: self.question.unit }
    }

    /// Returns the report as indented JSON with a final line break.
    ///
    /// # Errors
    /// None in practice: every key is a string and every value has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Writes the report as JSON to `path` atomically.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let json = self.to_json().map_err(|error| FileError::new(path, error.into()))?;
        write_atomically(path, json.as_bytes())
    }
}

/// Content of `report.json`.
impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        struct Rest<'a>(&'a Report);
        impl Serialize for Rest<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                Report::serialize(self.0, serializer)
            }
        }
        #[derive(Serialize)]
        struct Document<'a> {
            #[serde(flatten)]
            judgement: Judgement,
            reasons: &'a [Reason],
            #[serde(flatten)]
            rest: Rest<'a>,
        }
        let status = self.answer.status;
        let document = Document {
            judgement: Judgement {
                schema_version: SCHEMA_VERSION,
                status,
                pass: self.verdict.pass,
                proved: status == Status::Clear
                    && self.verdict.is_motion_of_the_law()
                    && !self.facts.iter().any(Fact::is_assumption),
                question: self.question.clone(),
                answers: vec![self.answer.clone()],
                facts: self.facts.clone(),
                window_s: Some((0.0, self.run.duration_s)),
                vehicles: (1..=self.run.vehicles).map(|number| number.to_string()).collect(),
            },
            reasons: &self.verdict.reasons,
            rest: Rest(self),
        };
        document.serialize(serializer)
    }
}

/// Returns the number if it is finite.
pub(super) fn finite(number: f64) -> Option<f64> {
    Some(number).filter(|number| number.is_finite())
}
