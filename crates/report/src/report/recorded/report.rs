//! Content of `tautline audit --json`.

use serde::Serialize;

use super::envelope::LimitFindings;
use super::plan::PlanReport;
use super::well_clear::WellClearFindings;
use crate::report::flight::{self, Audit, ClosedForm, Parry, Rapier, SCHEMA_VERSION, Separation, finite};
use tautline_audit::recorded::{
    Absence, Approach, Contradiction, ExemptTime, Gap, ObjectPair, Outcome, Presence, Settings, TOUCHING_CYLINDER,
    TOUCHING_ELLIPSOIDS, Tallies,
};
use tautline_audit::{Status, Undecided, Violation};
use tautline_core::fact::Fact;
use tautline_core::swarm::Pair;

/// The recording and how it was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Source {
    /// Path of the recording.
    pub recording: String,
    /// Clock of the recording.
    pub clock: Clock,
    /// Whether the height of a vehicle is unknown. Distances and speeds are then those in the plane of x and y.
    pub planar: bool,
    /// Notes on the reading, a sentence each.
    pub notes: Vec<String>,
    /// Facts that the verdict rests on, with their sources.
    pub facts: Vec<Fact>,
}

/// Clock of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Clock {
    /// The unit: `s`, `ms`, `us` or `ns`.
    pub unit: String,
    /// Whether it was inferred from the numbers.
    pub inferred: bool,
    /// Instant on the recording's clock that is 0 s in this report \[ns\].
    pub epoch_ns: i64,
}

/// Motion between two samples, and its basis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssumedMotion {
    /// Motion in words, such as `straight between samples`.
    pub motion: String,
    /// Basis of the motion.
    pub basis: Basis,
}

/// Early end of a recorded flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EarlyEnd {
    /// Time of the last sample \[s\].
    pub at_s: f64,
    /// Duration that the scenario asks for \[s\].
    pub duration_s: f64,
    /// Reason of the end; `None` if the recording does not state it.
    pub reason: Option<String>,
}

/// Basis of the motion between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// The recording defines the motion: curves, or every step of an engine that moves vehicles on straight lines.
    Recorded,
    /// The run's audit of every step answers the question.
    Run,
    /// A bound on every possible motion.
    Bounded,
    /// An assumption.
    Assumed,
}

/// Findings of the audit of a recording: the keys of a flight's `audit`, and whether the verdict is proved.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedAudit {
    /// Keys of a flight. The status is null if only limits of single vehicles were asked.
    #[serde(flatten)]
    pub flight: Audit<Option<Status>>,
    /// Whether the verdict is clear without an assumption about the time between samples.
    pub proved: bool,
    /// Whether the verdict is clear by the run's audit of every step, which the recording holds.
    pub judged_by_run: bool,
    /// Assumption about the motion between samples; null without one.
    pub assumes: Option<String>,
}

/// Content of `tautline audit --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedReport {
    /// Version of the keys.
    pub schema_version: u32,
    /// Status of the whole audit.
    pub status: Status,
    /// The recording.
    #[serde(flatten)]
    pub source: Source,
    /// `metres`; `ellipsoids` or `cylinders` if distances are scaled by the half axes of an ellipsoid or by a cylinder.
    pub measure: &'static str,
    /// Motion between samples in words.
    pub motion: String,
    /// Names of the vehicles. The numbers of pairs count them from 1.
    pub vehicles: Vec<String>,
    /// Number of judged vehicles: selected and present.
    pub judged: usize,
    /// First and last judged instant \[s\].
    pub span_s: Option<(f64, f64)>,
    /// Presence of the vehicles in the window.
    pub presence: PresenceSummary,
    /// Smallest separation.
    pub separation: Separation<Option<f64>>,
    /// Findings of the audit.
    pub audit: RecordedAudit,
    /// Number of findings, and how many are listed.
    pub findings: Tallies,
    /// Violations of pairs and obstacles in order of time; of a long list the worst, and the first of each pair.
    pub violations: Vec<PairFinding<Violation<ObjectPair>>>,
    /// The ten closest pairs.
    pub closest: Vec<PairFinding<Approach>>,
    /// Findings on obstacles.
    pub obstacles: Obstacles,
    /// Findings on the limits of single vehicles.
    pub limits: Vec<LimitFindings>,
    /// Findings on well clear of air traffic; null if it was not asked.
    pub well_clear: Option<WellClearFindings>,
    /// Intervals in which a vehicle was not seen.
    pub gaps: Vec<VehicleFinding<Gap>>,
    /// Vehicles that are never present together with another one, with their intervals, unless an obstacle is judged.
    pub alone: Vec<VehicleFinding<Presence>>,
    /// Intervals in which the separation of a pair is undecided.
    pub undecided: Vec<PairFinding<Undecided<ObjectPair>>>,
    /// Time at which the recording contradicts the assumed bound on acceleration.
    pub contradiction: Option<VehicleFinding<Contradiction>>,
    /// Findings against a plan; null without one.
    pub plan: Option<PlanReport>,
    /// Early end of the flight inside the judged window. The rest of the window is unknown.
    pub ended_early: Option<EarlyEnd>,
    /// Verdict and finding up to the early end, if clear up to there.
    #[serde(skip)]
    pub(super) until_then: Option<String>,
    /// Time that is not judged because vehicles are on the ground.
    #[serde(skip)]
    pub(super) exemption: Option<Exemption>,
    /// Whether the deepest violation is one of doubles only, whose decimals are exactly at the limit.
    #[serde(skip)]
    pub is_decimal_tie: bool,
    /// Reason why the run's own audit does not decide the question.
    #[serde(skip)]
    pub run_objection: Option<String>,
    /// Whether everything beyond the listed findings is decided.
    #[serde(skip)]
    pub(super) is_else_known: bool,
    /// Sampling rate that would decide all undecided pairs \[Hz\].
    #[serde(skip)]
    pub(super) deciding_rate_hz: Option<f64>,
}

/// Time that is not judged because vehicles are on the ground.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Exemption {
    /// Height at or below which vehicles are on the ground \[m\].
    pub(super) above_m: f64,
    /// Exempt time of pairs, and of vehicles that land.
    pub(super) exempt: ExemptTime,
    /// Obstacles on which vehicles land.
    pub(super) land_on: Vec<String>,
    /// Length of the judged time \[s\].
    pub(super) judged_s: f64,
}

impl Exemption {
    fn new(outcome: &Outcome, settings: &Settings) -> Option<Self> {
        let judged_s = outcome.span_s.map_or(0.0, |(from_s, to_s)| to_s - from_s);
        let land_on = settings.land_on.iter().cloned().collect();
        Some(Self { above_m: settings.above_m?, exempt: outcome.exempt?, land_on, judged_s })
    }
}

/// Largest number of listed vehicles that are not seen throughout.
const ABSENT_LISTED: usize = 1000;

/// Presence of the vehicles in the window.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PresenceSummary {
    /// Window of the verdict \[s\]: the requested one, or that of the recording; null if nothing was judged.
    pub window_s: Option<(f64, f64)>,
    /// Whether the verdict depends on the presence.
    pub required: bool,
    /// Number of selected vehicles that are seen throughout.
    pub throughout: usize,
    /// Number of selected vehicles that are not.
    pub partly: usize,
    /// Times of the latter, at most 1000, by their numbers.
    pub listed: Vec<VehicleFinding<PresenceSpan>>,
}

/// First and last time at which a vehicle is seen; null if it is not seen in the window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PresenceSpan {
    /// First time \[s\].
    pub from_s: Option<f64>,
    /// Last time \[s\].
    pub to_s: Option<f64>,
}

impl PresenceSummary {
    fn new(outcome: &Outcome, settings: &Settings) -> Self {
        let is_asked = |name: &&String| settings.only.as_ref().is_none_or(|only| only.contains(*name));
        let (asked, partly) = (outcome.vehicles.iter().filter(is_asked).count(), outcome.absences.len());
        let seen = |of: &Absence| {
            let seen = PresenceSpan { from_s: of.seen.map(|seen| seen.from_s), to_s: of.seen.map(|seen| seen.to_s) };
            VehicleFinding::new(outcome, of.vehicle, seen)
        };
        let (first_s, last_s) = (outcome.span_s.map(|span| span.0), outcome.span_s.map(|span| span.1));
        Self {
            window_s: settings.from_s.or(first_s).zip(settings.to_s.or(last_s)),
            required: settings.require_presence,
            throughout: asked.saturating_sub(partly),
            partly,
            listed: outcome.absences.iter().take(ABSENT_LISTED).map(seen).collect(),
        }
    }
}

/// Findings on obstacles.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Obstacles {
    /// The ten closest approaches.
    pub closest: Vec<PairFinding<Approach>>,
    /// Intervals in which a vehicle was below its clearance.
    pub violations: Vec<PairFinding<Violation<ObjectPair>>>,
}

impl RecordedReport {
    /// Returns the report on the outcome of an audit.
    #[must_use]
    pub fn new(outcome: &Outcome, settings: &Settings, source: Source, between: AssumedMotion) -> Self {
        let first = outcome.closest.first();
        let scaled = settings.ellipsoid_m.is_some();
        let min_m = first.and_then(|first| finite(first.certain_m()));
        let limits: Vec<_> = outcome.envelope.limits.iter().map(|found| LimitFindings::new(found, outcome)).collect();
        let by_limits = limits.iter().filter_map(|limit| limit.assumes.clone());
        let by_motion = (!matches!(between.basis, Basis::Recorded | Basis::Run)).then_some(between.motion.clone());
        let assumes: Vec<_> = by_motion.into_iter().chain(by_limits).collect();
        let is_assumed = between.basis == Basis::Assumed || limits.iter().any(|limit| limit.assumes.is_some());
        let names = |pair: ObjectPair| outcome.names(pair, &settings.obstacles);
        let closest = |of: &[Approach]| of.iter().map(|a| PairFinding { who: names(a.pair), finding: *a }).collect();
        let violations = outcome.violations.iter().map(|v| PairFinding { who: names(v.pair), finding: *v });
        let violations: Vec<_> = violations.collect();
        let alone = outcome.alone.iter();
        let alone = alone.filter_map(|&of| Some(VehicleFinding::new(outcome, of, outcome.presence[of]?)));
        Self {
            schema_version: SCHEMA_VERSION,
            status: outcome.status,
            source,
            measure: measure(settings),
            motion: between.motion,
            vehicles: outcome.vehicles.clone(),
            judged: outcome.presence.iter().flatten().count(),
            span_s: outcome.span_s,
            presence: PresenceSummary::new(outcome, settings),
            findings: outcome.tallies,
            deciding_rate_hz: outcome.deciding_rate_hz,
            separation: Separation {
                delta_m: settings
                    .delta_m
                    .or(scaled.then_some(TOUCHING_ELLIPSOIDS))
                    .or(settings.cylinder.map(|_| TOUCHING_CYLINDER)),
                min_m,
                min_at_s: first.and_then(|first| finite(first.time_s)),
                min_pair: first.and_then(|first| first.pair.vehicles()).map(Pair::numbers),
                certified_m: None,
                certified_until_s: None,
                certificate_void: Vec::new(),
                ellipsoid: None,
            },
            audit: RecordedAudit {
                flight: Audit {
                    status: outcome.separation,
                    violations: outcome
                        .violations
                        .iter()
                        .filter_map(|v| Some(flight::Violation::new(v.pair.vehicles()?, v)))
                        .collect(),
                    // A bounded list may find a time of an obstacle again. The difference is then a lower bound, as the
                    // tally is.
                    undecided: outcome.tallies.undecided.count.saturating_sub(outcome.undecided_of_obstacles),
                    steps: outcome.segments,
                    pairs_checked: outcome.swept,
                    closed_form: ClosedForm { min_m },
                    parry: Parry {
                        min_toi_s: outcome.parry.min_toi_s.and_then(finite),
                        disagreements: outcome.parry.disagreements,
                    },
                    rapier: Rapier { contact_pairs: None },
                },
                proved: outcome.status == Status::Clear && !is_assumed,
                judged_by_run: outcome.status == Status::Clear && between.basis == Basis::Run,
                assumes: (!assumes.is_empty()).then(|| assumes.join(" and ")),
            },
            closest: closest(&outcome.closest),
            obstacles: Obstacles {
                closest: closest(&outcome.obstacles),
                violations: violations.iter().filter(|v| v.finding.pair.vehicles().is_none()).cloned().collect(),
            },
            violations,
            limits,
            plan: None,
            well_clear: outcome.well_clear.as_ref().map(|found| WellClearFindings::new(found, outcome)),
            ended_early: None,
            exemption: Exemption::new(outcome, settings),
            until_then: None,
            is_decimal_tie: false,
            run_objection: None,
            is_else_known: outcome.is_else_known,
            gaps: outcome.gaps.iter().map(|gap| VehicleFinding::new(outcome, gap.vehicle, *gap)).collect(),
            alone: alone.collect(),
            undecided: outcome.undecided.iter().map(|u| PairFinding { who: names(u.pair), finding: *u }).collect(),
            contradiction: outcome.contradiction.map(|of| VehicleFinding::new(outcome, of.vehicle, of)),
        }
    }

    /// Returns the report with an early end: undecided at best.
    #[must_use]
    pub fn with_early_end(mut self, end: EarlyEnd) -> Self {
        self.until_then = (self.status == Status::Clear).then(|| self.headline());
        self.status = self.status.and(Status::Undecided);
        self.audit.flight.status = self.audit.flight.status.map(|status| status.and(Status::Undecided));
        self.audit.proved = false;
        for limit in &mut self.limits {
            limit.status = limit.status.and(Status::Undecided);
        }
        if let Some(well_clear) = &mut self.well_clear {
            well_clear.status = well_clear.status.and(Status::Undecided);
        }
        self.ended_early = Some(end);
        self
    }

    /// Returns the unit of distances.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        unit_of(self.measure)
    }

    /// Returns the status of separations alone; `None` if only limits of single vehicles were judged.
    #[must_use]
    pub fn separation(&self) -> Option<Status> {
        self.audit.flight.status
    }

    /// Returns the report as indented JSON with a final line break.
    ///
    /// # Errors
    /// None in practice: every key is a string and every value has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// Returns the measure of distances with these settings: `metres`, `ellipsoids` or `cylinders`.
fn measure(settings: &Settings) -> &'static str {
    match (settings.ellipsoid_m, settings.cylinder) {
        (Some(_), _) => "ellipsoids",
        (None, Some(_)) => "cylinders",
        (None, None) => "metres",
    }
}

/// Returns the unit of distances with these settings.
#[must_use]
pub fn unit(settings: &Settings) -> &'static str {
    unit_of(measure(settings))
}

/// Returns the unit of a measure.
pub(super) fn unit_of(measure: &'static str) -> &'static str {
    if measure == "metres" { "m" } else { measure }
}

/// A finding on a pair of vehicles, or a vehicle and an obstacle, with their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairFinding<T> {
    /// The two names.
    pub who: [String; 2],
    /// The finding.
    #[serde(flatten)]
    pub finding: T,
}

/// A finding on a vehicle, with its name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VehicleFinding<T> {
    /// Name of the vehicle.
    pub vehicle: String,
    /// The finding.
    #[serde(flatten)]
    pub finding: T,
}

impl<T> VehicleFinding<T> {
    /// Returns the finding with the name of its vehicle.
    pub(super) fn new(outcome: &Outcome, vehicle: usize, finding: T) -> Self {
        Self { vehicle: outcome.name(vehicle), finding }
    }
}
