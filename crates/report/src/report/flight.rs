//! `report.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::artefact::{ArtefactError, write_atomically};
use super::ellipsoid::Ellipsoid;
use super::failures::FailedVehicle;
use super::findings::{Findings, Performance, Run, finite};
use super::hulls::Hulls;
use super::legs::{self, LegNumbers};
use super::network::Network;
use super::obstacles::Obstacles;
use super::strain::VehicleNumbers;
use super::verdict::{Fails, Verdict, at_rest, rises};
use super::verification::Verification;
use tautline_audit::{self as audit, Status};
use tautline_core::record::{Breath, Reassignment};
use tautline_core::swarm::{ClosestApproach, Pair};

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
    pub network: Option<Network>,
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
    pub breaths: Vec<Breath>,
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

impl Report {
    /// The report on what was found.
    #[must_use]
    pub fn new(findings: &Findings<'_>) -> Self {
        let Findings { audit, summary, certificate, .. } = findings;
        let closest = audit.closest;
        let min_m = closest.and_then(|closest| finite(closest.separation_m));
        Self {
            schema_version: SCHEMA_VERSION,
            scenario: ScenarioIdentity {
                name: findings.scenario_name.to_owned(),
                sha256: findings.scenario_sha256.to_owned(),
            },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            verdict: Verdict::of(findings),
            separation: Separation {
                delta_m: findings.delta_m,
                min_m,
                min_at_s: closest.and_then(|closest| finite(closest.time_s)),
                min_pair: closest.map(|closest| closest.pair.numbers()),
                certified_m: certificate.certified_m.and_then(finite),
                certified_until_s: certificate.certified_until_s.and_then(finite),
                certificate_void: certificate.void.iter().map(ToString::to_string).collect(),
                ellipsoid: Ellipsoid::of(findings),
            },
            audit: Audit {
                status: findings.status(),
                violations: audit.violations.iter().map(|found| Violation::new(found.pair, found)).collect(),
                undecided: audit.unresolved + audit.refused,
                steps: audit.steps,
                pairs_checked: audit.pairs_checked,
                closed_form: ClosedForm { min_m },
                parry: Parry {
                    min_toi_s: audit.parry.min_toi_s.and_then(finite),
                    disagreements: audit.parry.disagreements,
                },
                rapier: Rapier { contact_pairs: findings.engine_contact_pairs },
            },
            vehicle: findings.vehicle.cloned(),
            network: findings.network,
            failures: findings.failures.to_vec(),
            obstacles: Obstacles::of(findings),
            hulls: findings.hulls.clone(),
            formation: FormationNumbers {
                reached: findings.reached_at_s().is_some(),
                reached_at_s: findings.reached_at_s().and_then(finite),
                held_s: summary.held_s.and_then(finite),
                fails: Fails::of(findings),
                at_rest: at_rest(findings),
                max_edge_error_m: finite(summary.max_edge_error_m),
                rms_position_error_m: finite(summary.rms_position_error_m),
                max_position_error_m: finite(summary.max_position_error_m),
            },
            legs: legs::legs(findings),
            breaths: findings.breaths.to_vec(),
            assignments: findings.assignments.to_vec(),
            energy: Energy {
                initial: summary.energy_initial.and_then(finite),
                at_end: summary.energy_final.and_then(finite),
                max_over_initial: summary.energy_max_over_initial.and_then(finite),
                max_over_leg_start: findings.energy_rise.and_then(|rise| finite(rise.to / rise.from)),
                rose: rises(findings),
            },
            control: Control {
                peak_m_s2: finite(summary.peak_control_m_s2),
                final_m_s2: finite(summary.final_control_m_s2),
            },
            velocity: Velocity {
                disagreement_m_s: finite(summary.disagreement_m_s),
                common_m_s: finite(summary.common_m_s),
            },
            run: findings.run.clone(),
            verification: None,
            performance: Some(findings.performance),
        }
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
