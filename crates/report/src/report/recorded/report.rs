//! Judged recording, and its form as JSON.

use serde::{Serialize, Serializer};

use super::plan::PlanReport;
use crate::report::answer::{Answer, Detectors, Finding, FindingList, Judgement, Part, Question};
use crate::report::flight::{SCHEMA_VERSION, finite};
use tautline_audit::envelope::{self, Corner, Exceedance, LimitOutcome};
use tautline_audit::recorded::{
    Absence, Contradiction, Counterpart, ExemptTime, Gap, ObjectPair, Outcome, PlanApproach, PlanConflict,
    PlanReference, PlanSeparations, PlansOutcome, Presence, Settings, TOUCHING_CYLINDER, TOUCHING_ELLIPSOIDS,
    TrackingError, WellClearLoss, WellClearOutcome,
};
use tautline_audit::{Status, Tally};
use tautline_core::fact::{BOUNDED, Fact, FactKind, RUN_AUDIT, Source as FactSource};

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
    #[serde(skip)]
    pub facts: Vec<Fact>,
}

/// Clock of a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Clock {
    /// The unit: `s`, `ms`, `us` or `ns`; `given` where a factor was given.
    pub unit: String,
    /// Whether it was inferred from the numbers.
    pub inferred: bool,
    /// Instant on the recording's clock that is 0 s in this report \[ns\].
    pub epoch_ns: i64,
}

/// Early end of a recorded flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EarlyEnd {
    /// Time of the last sample \[s\].
    pub at_s: f64,
    /// Duration that the scenario asks for \[s\].
    pub duration_s: f64,
    /// Reason of the end; `None` if the recording does not state it.
    pub reason: Option<String>,
}

/// Reason why the audit of a run leaves its recording undecided, although the samples are clear.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "code", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RunObjection {
    /// The audit of the run is undecided itself.
    RunUndecided {},
    /// The audit of the run found two objects closer than the limit.
    RunFoundCloser {
        /// The vehicle, and the other vehicle or the obstacle.
        who: [String; 2],
        /// Smallest distance \[m\], or in half axes.
        min: f64,
        /// Unit of the distance.
        unit: &'static str,
        /// Time of the smallest distance \[s\].
        at_s: f64,
    },
}

/// Judged recording: its answers with the findings, and the facts that they rest on.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedReport {
    /// Status of the whole audit.
    pub status: Status,
    /// The question.
    pub question: Question,
    /// The recording.
    pub source: Source,
    /// Names of the vehicles. The numbers of pairs count them from 1.
    pub vehicles: Vec<String>,
    /// Number of judged vehicles: selected and present.
    pub judged: usize,
    /// First and last judged instant \[s\].
    pub span_s: Option<(f64, f64)>,
    /// Presence of the vehicles in the window.
    pub presence: PresenceSummary,
    /// Answers to all asked parts.
    pub answers: Vec<Answer>,
    /// Results of the detectors of separations.
    pub detectors: Detectors,
    /// Corners of curves, at which a limit is not applied.
    pub corners: Vec<Corners>,
    /// Number of gaps, and how many are listed.
    pub gaps_tally: Tally,
    /// Intervals in which a vehicle was not seen.
    pub gaps: Vec<VehicleFinding<Gap>>,
    /// Vehicles that are never present together with another one, with their intervals, unless an obstacle is judged.
    pub alone: Vec<VehicleFinding<Presence>>,
    /// Time at which the recording contradicts the assumed bound on acceleration.
    pub contradiction: Option<VehicleFinding<Contradiction>>,
    /// Findings against a plan; null without one.
    pub plan: Option<PlanReport>,
    /// Early end of the flight inside the judged window. The rest of the window is unknown.
    pub ended_early: Option<EarlyEnd>,
    /// Time that is not judged because vehicles are on the ground.
    pub(super) exemption: Option<Exemption>,
    /// Whether the deepest violation is one of doubles only, whose decimals are exactly at the limit.
    pub is_decimal_tie: bool,
    /// Reason why the run's own audit does not decide the question.
    pub run_objection: Option<RunObjection>,
    /// Whether everything beyond the listed findings is decided.
    pub(super) is_else_known: bool,
    /// Sampling rate that would decide all undecided pairs \[Hz\].
    pub(super) deciding_rate_hz: Option<f64>,
}

/// Content of `tautline audit --json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    judgement: Judgement,
    #[serde(flatten)]
    source: &'a Source,
    /// Number of judged vehicles: selected and present.
    judged: usize,
    presence: &'a PresenceSummary,
    alone: &'a [VehicleFinding<Presence>],
    gaps: Gaps<'a>,
    corners: &'a [Corners],
    contradiction: Option<&'a VehicleFinding<Contradiction>>,
    run_objection: Option<&'a RunObjection>,
    plan: Option<&'a PlanReport>,
    ended_early: Option<&'a EarlyEnd>,
}

/// Intervals in which vehicles are not seen, with their number.
#[derive(Serialize)]
struct Gaps<'a> {
    count: u64,
    is_exact: bool,
    listed: &'a [VehicleFinding<Gap>],
}

/// Corners of curves, where the velocity jumps and a limit is not applied.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Corners {
    /// Part of the question, such as `accel_m_s2`.
    pub part: Part,
    /// Number of corners of all vehicles.
    pub count: u64,
    /// Corner with the largest jump of the velocity.
    pub largest: VehicleFinding<Corner>,
}

impl Corners {
    /// Returns the assumption that vehicles round off the corners.
    pub(super) fn fact(&self) -> Fact {
        let VehicleFinding { vehicle, finding } = &self.largest;
        Fact::number(FactKind::RoundedCorners, FactSource::Default, finding.by_m_s, "m/s").about(vehicle)
    }
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
#[non_exhaustive]
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
            window_s: settings.from_s.or(first_s).zip(settings.until_s.or(last_s)),
            required: settings.require_presence,
            throughout: asked.saturating_sub(partly),
            partly,
            listed: outcome.absences.iter().take(ABSENT_LISTED).map(seen).collect(),
        }
    }
}

impl RecordedReport {
    /// Returns the report on the outcome of an audit. The facts of `source` include the motion between samples.
    #[must_use]
    pub fn new(outcome: &Outcome, settings: &Settings, mut source: Source) -> Self {
        let limits = &outcome.envelope.limits;
        let corners = limits.iter().filter_map(|found| {
            let envelope::Corners { count, largest } = found.corners?;
            let largest = VehicleFinding::new(outcome, largest.vehicle, largest);
            Some(Corners { part: Part::Limit(found.limit), count, largest })
        });
        let corners: Vec<_> = corners.collect();
        source.facts.extend(limits.iter().filter_map(|found| found.assumes.clone()));
        source.facts.extend(corners.iter().map(Corners::fact));
        let alone = outcome.alone.iter();
        let alone = alone.filter_map(|&of| Some(VehicleFinding::new(outcome, of, outcome.presence[of]?)));
        let is_by_run = source.facts.iter().any(|fact| fact.kind == FactKind::Motion && fact.is_named(RUN_AUDIT));
        let detectors = Detectors {
            steps: is_by_run.then_some(outcome.segments),
            segments: (!is_by_run).then_some(outcome.segments),
            pairs_swept: outcome.swept,
            parry_contact_s: outcome.parry.min_toi_s.and_then(finite),
            parry_disagreements: outcome.parry.disagreements,
            rapier_contact_pairs: None,
        };
        // Under bounds on the motion only an upper bound of the smallest distance is known.
        let is_exact = !source.facts.iter().any(|fact| fact.kind == FactKind::Motion && fact.is_named(BOUNDED));
        let of_pairs = outcome.separation.map(|status| separations(outcome, settings, status, detectors, is_exact));
        let of_limits = limits.iter().map(|found| on_limit(found, outcome));
        let of_well_clear = outcome.well_clear.iter().map(|found| on_well_clear(found, outcome));
        let presence = PresenceSummary::new(outcome, settings);
        let is_present = if presence.partly > 0 { Status::Undecided } else { Status::Clear };
        let of_presence = presence.required.then(|| Answer::new(Part::Presence, is_present));
        let answers = of_pairs.into_iter().chain(of_limits).chain(of_well_clear).chain(of_presence).collect();
        Self {
            status: outcome.status,
            question: Question::of(settings, outcome),
            source,
            vehicles: outcome.vehicles.clone(),
            judged: outcome.presence.iter().flatten().count(),
            span_s: outcome.span_s,
            presence,
            answers,
            detectors,
            corners,
            gaps_tally: outcome.tallies.gaps,
            deciding_rate_hz: outcome.deciding_rate_hz,
            plan: None,
            ended_early: None,
            exemption: Exemption::new(outcome, settings),
            is_decimal_tie: false,
            run_objection: None,
            is_else_known: outcome.is_else_known,
            gaps: outcome.gaps.iter().map(|gap| VehicleFinding::new(outcome, gap.vehicle, *gap)).collect(),
            alone: alone.collect(),
            contradiction: outcome.contradiction.map(|of| VehicleFinding::new(outcome, of.vehicle, of)),
        }
    }

    /// Returns the report with the findings against a plan. Its status is the worse of the two.
    #[must_use]
    pub fn with_plan(mut self, plan: PlanReport, facts: Vec<Fact>) -> Self {
        self.status = self.status.and(plan.status);
        self.answers.push(plan.answer());
        self.question.plan = Some(plan.file.clone());
        self.source.facts.extend(facts);
        self.plan = Some(plan);
        self
    }

    /// Returns the report with the findings on published plans. Its status is the worst of all.
    #[must_use]
    pub fn with_published_plans(mut self, found: &PlansOutcome) -> Self {
        let unit = self.unit();
        let names = |plan: PlanReference, other: Counterpart| {
            [plan.vehicle, other.vehicle()].map(|vehicle| self.vehicles.get(vehicle).cloned().unwrap_or_default())
        };
        let conflict = |found: &PlanConflict| Finding::plan_conflict(found, names(found.plan, found.other), unit);
        let approach = |found: &PlanApproach| Finding::plan_approach(found, names(found.plan, found.other), unit);
        let answer = |part, found: &PlanSeparations| Answer {
            closest: found.closest.iter().map(approach).collect(),
            violations: FindingList::new(found.violations_tally, found.violations.iter().map(conflict).collect()),
            undecided: FindingList::new(found.undecided_tally, found.undecided.iter().map(conflict).collect()),
            ..Answer::new(part, found.status)
        };
        // Beside flights, plans of a single vehicle are compared with flights alone.
        let has_others = found.published.comparisons > 0 || found.flown.is_none();
        let mut answers: Vec<_> =
            has_others.then(|| answer(Part::PublishedPlans, &found.published)).into_iter().collect();
        answers.extend(found.flown.iter().map(|found| answer(Part::FlownPlans, found)));
        let tracking_error = found.tracking_error.map(|TrackingError { plan, distance_m, .. }| {
            let name = self.vehicles.get(plan.vehicle).cloned().unwrap_or_default();
            Fact::number(FactKind::TrackingError, FactSource::Observed, distance_m, "m").about(name)
        });
        self.status = answers.iter().fold(self.status, |status, answer| status.and(answer.status));
        self.answers.append(&mut answers);
        self.source.facts.extend(tracking_error);
        self
    }

    /// Returns the report with an early end: undecided at best.
    #[must_use]
    pub fn with_early_end(mut self, end: EarlyEnd) -> Self {
        let of_plan = self.plan.iter_mut().map(|plan| &mut plan.status);
        let of_parts = self.answers.iter_mut().map(|answer| &mut answer.status);
        for status in of_parts.chain(of_plan).chain([&mut self.status]) {
            *status = status.and(Status::Undecided);
        }
        self.ended_early = Some(end);
        self
    }

    /// Returns whether the recording is clear and the answers rest on no assumption.
    #[must_use]
    pub fn is_proved(&self) -> bool {
        self.status == Status::Clear && !self.source.facts.iter().any(Fact::is_assumption)
    }

    /// Returns whether the motion between samples is judged by the run's audit of every step.
    pub(super) fn is_by_run(&self) -> bool {
        self.detectors.steps.is_some()
    }

    /// Returns the unit of distances.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.question.unit
    }

    /// Returns the answer on separations; `None` if only limits of single vehicles were judged.
    #[must_use]
    pub fn separation(&self) -> Option<&Answer> {
        self.answers.iter().find(|answer| answer.part == Part::Separation)
    }

    /// Returns the report as indented JSON with a final line break.
    ///
    /// # Errors
    /// None in practice: every key is a string and every value has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// Content of `tautline audit --json`.
impl Serialize for RecordedReport {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let document = Document {
            judgement: Judgement {
                schema_version: SCHEMA_VERSION,
                status: self.status,
                pass: self.status == Status::Clear,
                proved: self.is_proved(),
                question: self.question.clone(),
                answers: self.answers.clone(),
                facts: self.source.facts.clone(),
                window_s: self.span_s,
                vehicles: self.vehicles.clone(),
            },
            source: &self.source,
            judged: self.judged,
            presence: &self.presence,
            alone: &self.alone,
            gaps: Gaps { count: self.gaps_tally.count, is_exact: self.gaps_tally.is_exact, listed: &self.gaps },
            corners: &self.corners,
            contradiction: self.contradiction.as_ref(),
            run_objection: self.run_objection.as_ref(),
            plan: self.plan.as_ref(),
            ended_early: self.ended_early.as_ref(),
        };
        document.serialize(serializer)
    }
}

fn separations(outcome: &Outcome, settings: &Settings, status: Status, detectors: Detectors, is_exact: bool) -> Answer {
    let unit = unit(settings);
    let names = |pair: ObjectPair| outcome.names(pair, &settings.obstacles);
    let closest = outcome.closest.iter().chain(&outcome.obstacles);
    let violations =
        outcome.violations.iter().map(|found| Finding::violation(found, names(found.pair), unit, is_exact));
    let undecided = outcome.undecided.iter().map(|found| Finding::undecided(found, names(found.pair), unit));
    Answer {
        closest: closest.map(|found| Finding::approach(found, names(found.pair), unit)).collect(),
        violations: FindingList::new(outcome.tallies.violations, violations.collect()),
        undecided: FindingList::new(outcome.tallies.undecided, undecided.collect()),
        detectors: Some(detectors),
        ..Answer::new(Part::Separation, status)
    }
}

/// Returns the answer on a limit. A vehicle whose quantity is not known is undecided.
fn on_limit(found: &LimitOutcome, outcome: &Outcome) -> Answer {
    let limit = found.limit;
    let finding = |exceedance: &Exceedance| Finding::exceedance(exceedance, outcome.name(exceedance.vehicle), limit);
    let unknown = found
        .unknown
        .iter()
        .map(|&vehicle| Finding::unknown(vehicle, outcome.name(vehicle), limit.quantity.unit(), Some(limit.allowed)));
    let undecided: Vec<_> = found.undecided.iter().map(finding).chain(unknown).collect();
    let count = found.undecided_tally.count + found.unknown.len() as u64;
    Answer {
        closest: found.extreme.iter().map(finding).collect(),
        violations: FindingList::new(found.violations_tally, found.violations.iter().map(finding).collect()),
        undecided: FindingList::new(Tally { count, ..found.undecided_tally }, undecided),
        ..Answer::new(Part::Limit(limit), found.status)
    }
}

fn on_well_clear(found: &WellClearOutcome, outcome: &Outcome) -> Answer {
    let finding = |loss: &WellClearLoss| {
        let names = [outcome.name(loss.pair.first()), outcome.name(loss.pair.second())];
        Finding::well_clear(loss, names, found.thresholds)
    };
    let closest = found.violations.iter().min_by(|a, b| a.horizontal_m.total_cmp(&b.horizontal_m));
    Answer {
        closest: closest.map(finding).into_iter().collect(),
        violations: FindingList::new(found.violations_tally, found.violations.iter().map(finding).collect()),
        undecided: FindingList::new(found.undecided_tally, found.undecided.iter().map(finding).collect()),
        ..Answer::new(Part::WellClear(found.thresholds), found.status)
    }
}

impl Question {
    /// Returns the question of complete settings.
    fn of(settings: &Settings, outcome: &Outcome) -> Self {
        let scaled = settings.ellipsoid_m.is_some();
        Self {
            delta: settings
                .delta_m
                .or(scaled.then_some(TOUCHING_ELLIPSOIDS))
                .or(settings.cylinder.map(|_| TOUCHING_CYLINDER)),
            unit: unit(settings),
            radius_m: settings.radius_m,
            ellipsoid_m: settings.ellipsoid_m.map(Into::into),
            cylinder_m: settings.cylinder.map(|cylinder| [cylinder.horizontal_m, cylinder.vertical_m]),
            obstacles: settings.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect(),
            limits: outcome
                .envelope
                .limits
                .iter()
                .map(|found| (found.limit.quantity.key(), found.limit.allowed))
                .collect(),
            well_clear: settings.well_clear.map(|limits| [limits.horizontal_m, limits.vertical_m, limits.tau_s]),
            require_presence: settings.require_presence,
            plan: None,
            above_m: settings.above_m,
            from_s: settings.from_s,
            to_s: settings.until_s,
        }
    }
}

/// Returns the unit of distances with these settings: `m`, or `ellipsoids` or `cylinders` for scaled distances.
#[must_use]
pub fn unit(settings: &Settings) -> &'static str {
    match (settings.ellipsoid_m, settings.cylinder) {
        (Some(_), _) => "ellipsoids",
        (None, Some(_)) => "cylinders",
        (None, None) => "m",
    }
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
