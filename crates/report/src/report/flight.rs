//! `report.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::artefact::{ArtefactError, write_atomically};
use super::hulls::Hulls;
use super::legs::LegNumbers;
use super::obstacles::Obstacles;
use super::verdict::{Fails, Verdict, at_rest, rises};
use tautline_audit::{self as audit, Status};
use tautline_core::record::{DeadlockRecovery, Reassignment};
use tautline_core::swarm::{ClosestApproach, Pair};
use tautline_laws::law::{Certificate, Void};
use tautline_sim::link::Traffic;
use tautline_sim::metrics::{LegSummary, Strain, Summary};
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{Failure, FailureKind, Scenario};
use tautline_sim::sim::{Breakdown, Ending, Flight};

/// Version of the keys: raised when one is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// The content of `report.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// What was flown.
    pub scenario: ScenarioIdentity,
    /// What flew it.
    pub tool: Tool,
    /// The judgement.
    pub verdict: Verdict,
    /// How close vehicles came.
    pub separation: Separation,
    /// What the judgement rests on.
    pub audit: Audit,
    /// What was asked of bodies that turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<VehicleNumbers>,
    /// What became of messages, where they were sent one by one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<Traffic>,
    /// Vehicles of which a part failed, in the scenario's order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failures: Vec<FailedVehicle>,
    /// How vehicles kept clear of obstacles, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstacles: Option<Obstacles>,
    /// What solid hulls did, or would have done.
    #[serde(default)]
    pub hulls: Hulls,
    /// How near the formation of the last leg that began was at the end.
    pub formation: FormationNumbers,
    /// Each leg of a flight of several, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub legs: Vec<LegNumbers>,
    /// Every time that slots were spread to let vehicles past each other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub deadlock_recoveries: Vec<DeadlockRecovery>,
    /// Every time that interchangeable vehicles were given other slots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assignments: Vec<Reassignment>,
    /// The law's energy.
    pub energy: Energy,
    /// Commanded accelerations.
    pub control: Control,
    /// Velocities at the end.
    pub velocity: Velocity,
    /// Facts of the run.
    pub run: Run,
    /// What flying again at half the step changed, where that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verification: Option<Verification>,
    /// Wall-clock times, the only part that differs between two runs of one scenario; left out where a campaign flies a run again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub performance: Option<Performance>,
}

/// Which scenario it was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScenarioIdentity {
    /// Name of the scenario.
    pub name: String,
    /// SHA-256 of the resolved scenario, 64 hexadecimal digits.
    pub sha256: String,
}

/// Which program it was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tool {
    /// Name of the program.
    pub name: String,
    /// Its version.
    pub version: String,
}

/// How close vehicles came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Separation<Delta = f64> {
    /// Safety distance delta \[m\]; of a recording, none where radii alone were asked about.
    pub delta_m: Delta,
    /// Smallest distance of two centres over the whole run \[m\].
    pub min_m: Option<f64>,
    /// When it occurred \[s\].
    pub min_at_s: Option<f64>,
    /// Which pair.
    pub min_pair: Option<[usize; 2]>,
    /// Distance that the law's certificate promised before the first step, and anew wherever slots were spread \[m\].
    pub certified_m: Option<f64>,
    /// Up to when it is promised \[s\]; null where it holds for ever, or nothing is promised.
    #[serde(default)]
    pub certified_until_s: Option<f64>,
    /// Why the certificate is void, a sentence each; empty where it holds.
    pub certificate_void: Vec<String>,
    /// Where an ellipsoid must stay empty around each vehicle: distances above, and in the audit, are scaled lengths then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ellipsoid: Option<Ellipsoid>,
}

impl<Delta> Separation<Delta> {
    /// The closest approach of two vehicles over the whole run.
    #[must_use]
    pub fn closest(&self) -> Option<ClosestApproach> {
        let (separation_m, time_s, [first, second]) = (self.min_m?, self.min_at_s?, self.min_pair?);
        let (first, second) = (first.checked_sub(1)?, second.checked_sub(1)?);
        (first != second).then(|| ClosestApproach { pair: Pair::new(first, second), separation_m, time_s })
    }

    /// Whether what was promised was promised of the time at which two came closest.
    pub(super) fn is_promised(&self) -> bool {
        self.certified_until_s.zip(self.min_at_s).is_none_or(|(until_s, min_at_s)| min_at_s <= until_s)
    }
}

/// What the judgement rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Audit {
    /// Verdict on separation, and on obstacles where there are any: the worse of the two. Undecided at best where the flight ended
    /// early.
    pub status: Status,
    /// Every time that a pair was closer than delta.
    pub violations: Vec<Violation>,
    /// Times at which it cannot be told of two vehicles, whatever else there was.
    pub undecided: u64,
    /// Steps swept.
    pub steps: u64,
    /// Pairs swept, summed over all steps.
    pub pairs_checked: u64,
    /// The closed-form sweep, which decides.
    pub closed_form: ClosedForm,
    /// The shape cast, which must agree.
    pub parry: Parry,
    /// The engine's own collision detection, which is evidence alone.
    pub rapier: Rapier,
}

/// A time during which a pair was closer than delta.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violation {
    /// The pair.
    pub pair: Pair,
    /// When it began \[s\].
    pub from_s: f64,
    /// When it ended, or the end of the run \[s\].
    pub to_s: f64,
    /// Smallest distance within \[m\].
    pub min_m: f64,
    /// When that was \[s\].
    pub min_at_s: f64,
}

impl Violation {
    /// Of two vehicles, whichever audit found it.
    pub(super) fn new<P>(pair: Pair, found: &audit::Violation<P>) -> Self {
        let &audit::Violation { from_s, to_s, min_m, min_at_s, .. } = found;
        Self { pair, from_s, to_s, min_m, min_at_s }
    }
}

/// The closed-form sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClosedForm {
    /// Smallest distance of two centres \[m\].
    pub min_m: Option<f64>,
}

/// The shape cast.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parry {
    /// Earliest contact of two keep-out balls \[s\]; null where there was none.
    pub min_toi_s: Option<f64>,
    /// Casts that contradict the closed form.
    pub disagreements: u64,
}

/// The engine's own collision detection.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rapier {
    /// Pairs whose keep-out balls it saw overlap at the end of some step; null for a plant without one.
    pub contact_pairs: Option<u64>,
}

/// How near the formation was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FormationNumbers {
    /// Whether it was reached and kept to the end; never of a flight that ended early.
    pub reached: bool,
    /// From when on \[s\].
    pub reached_at_s: Option<f64>,
    /// How long everything had been within the limits at the end \[s\]; null where something was not.
    pub held_s: Option<f64>,
    /// The number that keeps the formation from being reached; null where it is.
    pub fails: Option<Fails>,
    /// Where it is not reached: whether the vehicles have come to rest elsewhere, relative to each other; null where that
    /// is not known.
    pub at_rest: Option<bool>,
    /// Largest error of a desired distance at the end \[m\].
    pub max_edge_error_m: Option<f64>,
    /// Root mean square distance from the best-placed formation at the end \[m\].
    pub rms_position_error_m: Option<f64>,
    /// Distance of the vehicle that is then farthest from its slot \[m\].
    pub max_position_error_m: Option<f64>,
}

/// The law's energy \[m^2/s^2\].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// At the start.
    pub initial: Option<f64>,
    /// At the end.
    #[serde(rename = "final")]
    pub at_end: Option<f64>,
    /// Largest over all steps, as a ratio to the initial one.
    pub max_over_initial: Option<f64>,
    /// Largest over all steps, as a ratio to what it was when the target was last changed.
    #[serde(default)]
    pub max_over_leg_start: Option<f64>,
    /// Whether it rose above its start, on any leg, by more than integration and rounding explain, where it is proved never to grow.
    #[serde(default)]
    pub rose: bool,
}

/// Commanded accelerations, the largest of any vehicle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Control {
    /// Over all steps \[m/s^2\].
    pub peak_m_s2: Option<f64>,
    /// At the end \[m/s^2\].
    pub final_m_s2: Option<f64>,
}

/// Velocities at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// Largest speed relative to the swarm's mean velocity \[m/s\].
    pub disagreement_m_s: Option<f64>,
    /// Speed of the mean velocity \[m/s\].
    pub common_m_s: Option<f64>,
}

/// What must stay empty around a vehicle, and how close vehicles came in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipsoid {
    /// Its half axes \[m\]: a scaled length is a level one in metres, and a height divided by the third over the first.
    pub half_axes_m: [f64; 3],
    /// Smallest distance of two centres over the whole run \[m\], unscaled.
    pub min_distance_m: Option<f64>,
    /// When it occurred \[s\].
    pub min_distance_at_s: Option<f64>,
    /// Which pair.
    pub min_distance_pair: Option<[usize; 2]>,
}

/// Numbers of quadrotors, over all samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VehicleNumbers {
    /// Name of their model.
    pub model: String,
    /// Largest angle between a vehicle's thrust and the vertical \[deg\].
    pub max_tilt_deg: f64,
    /// Largest thrust of a rotor over the most that it has.
    pub thrust_share: f64,
}

/// A vehicle of which a part failed, for the rest of the flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailedVehicle {
    /// The vehicle, from 1.
    pub vehicle: u64,
    /// From when on \[s\].
    pub at_s: f64,
    /// What failed, as the scenario names it: `dead`, `rotor`, `silent` or `frozen`.
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

/// Why a run ended that its user stopped.
pub const INTERRUPTED: &str = "interrupted";

/// Facts of the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Time flown \[s\].
    pub duration_s: f64,
    /// Control and physics step \[s\].
    pub dt_s: f64,
    /// Steps flown.
    pub steps: u64,
    /// Those of them that were flown in parts, for a law too fast for them or vehicles too near each other.
    #[serde(default)]
    pub refined_steps: u64,
    /// Those of which even the shortest part was longer than the law allows: what was flown is not the law's motion.
    #[serde(default)]
    pub overlong_steps: u64,
    /// Why the run ended before its time, such as [`INTERRUPTED`]; null where it did not.
    pub ended_early: Option<String>,
    /// Number of vehicles N.
    pub vehicles: usize,
    /// [`tautline_core::record::StateHash`] of the recorded states.
    pub state_hash: String,
}

/// Wall-clock times. Work done side by side counts in each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Performance {
    /// From first to last step \[s\].
    pub wall_s: f64,
    /// Time flown over `wall_s`; null where that took no time.
    pub real_time_factor: Option<f64>,
    /// In the law \[s\].
    pub law_s: f64,
    /// In the law's energy \[s\].
    #[serde(default)]
    pub energy_s: f64,
    /// In the plant \[s\].
    pub physics_s: f64,
    /// Of that, in the forces, rotors and attitude loops of vehicles that have them \[s\].
    #[serde(default)]
    pub airframe_s: f64,
    /// In the judge \[s\].
    pub audit_s: f64,
    /// In the recorders \[s\].
    pub record_s: f64,
}

/// The same flight with every step half as long, and what that changed.
///
/// What bounces hard off a barrier is chaotic: 10 to 20 of a hundred such flights end elsewhere however fine the step is. A
/// verdict that two steps agree on is called firm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// Longest step of the second flight \[s\].
    pub dt_s: f64,
    /// Whether the second flight passed.
    pub pass: bool,
    /// Smallest separation of the second flight \[m\].
    pub min_m: Option<f64>,
    /// When the second flight reached its formation \[s\].
    pub reached_at_s: Option<f64>,
    /// Whether both flights have the same verdict, and smallest separations that differ by at most 1 % of delta.
    pub firm: bool,
}

/// A flight and everything else that its report is made of.
#[derive(Clone, Copy, Debug)]
pub struct FlightResult<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Findings before the first step, under the law that was flown.
    pub preflight: &'a Preflight,
    /// The flight.
    pub flight: &'a Flight,
    /// Numbers of the samples.
    pub summary: &'a Summary,
    /// Legs that another one followed.
    pub ended_legs: &'a [LegSummary],
    /// Strain of bodies that turn.
    pub strain: Option<Strain>,
    /// [`tautline_core::record::StateHash`] of the recorded states.
    pub state_hash: &'a str,
}

impl FlightResult<'_> {
    /// Returns when the last formation was reached \[s\], where it was kept to the end of a flight that was flown to its end.
    pub(super) fn reached_at_s(&self) -> Option<f64> {
        self.summary.reached_at_s.filter(|_| self.flight.ending == Ending::Completed)
    }

    /// Whether a disturbance or a body may keep vehicles at rest that are commanded to move.
    pub(super) fn is_disturbed(&self) -> bool {
        !self.scenario.wind.is_still() || !self.scenario.is_exact() || !self.scenario.airframe.is_point()
    }

    /// Whether the energy is proved never to grow: relative velocities are damped in still air, and nothing voids the proof
    /// but that it certifies no distance.
    pub(super) fn energy_falls(&self) -> bool {
        let holds = |void: &Void| {
            matches!(void, Void::NoBarrier | Void::GraphNotComplete | Void::StepsTooLong | Void::Unresolved)
        };
        self.scenario.wind.is_still()
            && self.preflight.velocity_margin_per_s.is_some_and(|margin_per_s| margin_per_s >= 0.0)
            && self.flight.certificate.void.iter().all(holds)
    }

    /// Why the run ended before its time, with a remedy.
    fn ended_early(&self) -> Option<String> {
        match &self.flight.ending {
            Ending::BrokeDown(why @ Breakdown::Unresolved { .. }) => {
                Some(format!("{why}; shorten time.duration_s, or reduce what drives the mean velocity"))
            }
            Ending::BrokeDown(why) => Some(format!("{why}; shorten time.dt_s, or look for speeds and gains that grow")),
            ending => ending.reason(),
        }
    }

    fn run(&self) -> Run {
        let Flight { duration_s, steps, refined_steps, overlong_steps, .. } = *self.flight;
        Run {
            duration_s,
            dt_s: self.scenario.time.dt_s,
            steps,
            refined_steps,
            overlong_steps,
            ended_early: self.ended_early(),
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

    fn separation(&self) -> Separation {
        let Certificate { certified_m, certified_until_s, void, .. } = &self.flight.certificate;
        let closest = self.flight.audit.closest;
        let in_metres = self.flight.in_metres.as_ref().and_then(|in_metres| in_metres.closest);
        let [min_m, min_distance_m] = [closest, in_metres].map(|of| finite(of?.separation_m));
        let [min_at_s, min_distance_at_s] = [closest, in_metres].map(|of| finite(of?.time_s));
        let [min_pair, min_distance_pair] = [closest, in_metres].map(|of| of.map(|of| of.pair.numbers()));
        let half_axes_m = self.scenario.half_axes_m();
        Separation {
            delta_m: self.scenario.delta_m,
            min_m,
            min_at_s,
            min_pair,
            certified_m: certified_m.and_then(finite),
            certified_until_s: certified_until_s.and_then(finite),
            certificate_void: void.iter().map(ToString::to_string).collect(),
            ellipsoid: half_axes_m.map(|half_axes_m| Ellipsoid {
                half_axes_m,
                min_distance_m,
                min_distance_at_s,
                min_distance_pair,
            }),
        }
    }

    fn audit(&self) -> Audit {
        let (flight, audit) = (self.flight, &self.flight.audit);
        let contact_pairs = self.scenario.has_engine().then_some(flight.engine_contacts.len() as u64);
        Audit {
            status: flight.status(),
            violations: audit.violations.iter().map(|found| Violation::new(found.pair, found)).collect(),
            undecided: audit.unresolved + audit.refused,
            steps: audit.steps,
            pairs_checked: audit.pairs_checked,
            closed_form: ClosedForm { min_m: audit.closest.and_then(|closest| finite(closest.separation_m)) },
            parry: Parry {
                min_toi_s: audit.parry.min_toi_s.and_then(finite),
                disagreements: audit.parry.disagreements,
            },
            rapier: Rapier { contact_pairs },
        }
    }

    fn vehicle(&self) -> Option<VehicleNumbers> {
        let model = &self.scenario.airframe.quadrotor()?.model;
        let Strain { max_tilt_rad, max_thrust_n } = self.strain?;
        Some(VehicleNumbers {
            model: model.name.clone(),
            max_tilt_deg: max_tilt_rad.to_degrees(),
            thrust_share: max_thrust_n / model.max_thrust_n,
        })
    }
}

impl Report {
    /// The report on a flight.
    #[must_use]
    pub fn new(result: &FlightResult<'_>) -> Self {
        let FlightResult { scenario, flight, summary, .. } = *result;
        let failed = scenario.failures.iter().filter(|failure| failure.at_s <= flight.duration_s);
        let mut report = Self {
            schema_version: SCHEMA_VERSION,
            scenario: ScenarioIdentity { name: scenario.name.clone(), sha256: scenario.sha256_hex() },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            verdict: Verdict { pass: false, refused: Vec::new(), reasons: Vec::new() },
            separation: result.separation(),
            audit: result.audit(),
            vehicle: result.vehicle(),
            network: flight.traffic,
            failures: failed.map(FailedVehicle::from).collect(),
            obstacles: Obstacles::of(result),
            hulls: Hulls::of(result),
            formation: FormationNumbers {
                reached: result.reached_at_s().is_some(),
                reached_at_s: result.reached_at_s().and_then(finite),
                held_s: summary.held_s.and_then(finite),
                fails: Fails::of(result),
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
                rose: rises(result),
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

    /// The report as indented JSON with a line end.
    ///
    /// # Errors
    /// None in practice: every key is a string and every value has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Writes the report as JSON to `path`: whole, or not at all.
    ///
    /// # Errors
    /// [`ArtefactError`] when the system refuses.
    pub fn write(&self, path: &Path) -> Result<(), ArtefactError> {
        let json = self.to_json().map_err(|error| ArtefactError::new(path, error.into()))?;
        write_atomically(path, json.as_bytes())
    }
}

/// None for a number that is not finite.
pub(super) fn finite(number: f64) -> Option<f64> {
    Some(number).filter(|number| number.is_finite())
}
