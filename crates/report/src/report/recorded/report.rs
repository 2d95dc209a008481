//! What `tautline audit --json` holds.

use serde::Serialize;

use super::envelope::OfLimit;
use crate::report::flight::{self, Audit, ClosedForm, Parry, Rapier, SCHEMA_VERSION, Separation, finite};
use tautline_audit::recorded::{
    Absence, Approach, Contradiction, Gap, ObjectPair, Outcome, Presence, Settings, TOUCHING_ELLIPSOIDS, Tallies,
};
use tautline_audit::{Status, Undecided, Violation};
use tautline_core::swarm::Pair;

/// What was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Source {
    /// The recording.
    pub recording: String,
    /// How it counts time.
    pub clock: Clock,
    /// Whether the height of some vehicle is not known: then distances and speeds are those in the plane of x and y.
    pub planar: bool,
    /// How it was read, a sentence each.
    pub notes: Vec<String>,
}

/// How a recording counts time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Clock {
    /// The unit: `s`, `ms`, `us` or `ns`.
    pub unit: String,
    /// Whether it was inferred from the numbers.
    pub inferred: bool,
    /// The instant that is 0 s in this report, on the recording's clock \[ns\].
    pub epoch_ns: i64,
}

/// What is taken to happen between two samples, and what that is worth.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Between {
    /// In words, such as `straight between samples`.
    pub motion: String,
    /// How these words are known.
    pub basis: Basis,
}

/// Where a recorded flight ended before its time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EarlyEnd {
    /// Time of the last recorded instant \[s\].
    pub at_s: f64,
    /// Duration of the flight that the scenario asks for \[s\].
    pub duration_s: f64,
    /// Why the flight ended; none where the recording does not say.
    pub reason: Option<String>,
}

/// How it is known what happens between two samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    /// The recording says it: curves, or every step of an engine that moves vehicles straight.
    Recorded,
    /// The run's audit of every step answers the question.
    Run,
    /// A bound on every motion there can be.
    Bounded,
    /// It is taken for granted.
    Assumed,
}

/// What a judgement of a recording rests on: the keys of a flight's `audit`, and how far it is a proof.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedAudit {
    /// The keys of a flight.
    #[serde(flatten)]
    pub flight: Audit,
    /// Clear, and nothing was taken for granted of the time between samples.
    pub proved: bool,
    /// Clear by the run's audit of every step, which the recording holds.
    pub judged_by_run: bool,
    /// What was assumed of the motion between samples; none where the recording says it itself.
    pub assumes: Option<String>,
}

/// The content of `tautline audit --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedReport {
    /// Version of the keys.
    pub schema_version: u32,
    /// The verdict.
    pub status: Status,
    /// What was read.
    #[serde(flatten)]
    pub source: Source,
    /// `metres`, or `ellipsoids` where lengths are divided by the axes of the ellipsoid.
    pub measure: &'static str,
    /// What was taken to happen between samples.
    pub motion: String,
    /// Names of the vehicles; numbers of pairs count them from 1.
    pub vehicles: Vec<String>,
    /// How many of them were judged: asked for, and there.
    pub judged: usize,
    /// First and last instant judged \[s\].
    pub span_s: Option<(f64, f64)>,
    /// Which vehicles are seen throughout, and when the others are.
    pub presence: SeenWhen,
    /// How close vehicles came.
    pub separation: Separation<Option<f64>>,
    /// What the judgement rests on.
    pub audit: RecordedAudit,
    /// How many findings there are, and how many of them are listed.
    pub findings: Tallies,
    /// Violations, of pairs and of obstacles, in order of time; of many the worst, and the first of each pair.
    pub violations: Vec<OfPair<Violation<ObjectPair>>>,
    /// The ten closest pairs.
    pub closest: Vec<OfPair<Approach>>,
    /// What obstacles were in the way of.
    pub obstacles: Obstacles,
    /// What each vehicle may do by itself, limit by limit.
    pub limits: Vec<OfLimit>,
    /// When vehicles were not seen.
    pub gaps: Vec<OfVehicle<Gap>>,
    /// Vehicles that are never there together with another, and when they are, where they are to keep apart from nothing else.
    pub alone: Vec<OfVehicle<Presence>>,
    /// When it cannot be told whether two came too close.
    pub undecided: Vec<OfPair<Undecided<ObjectPair>>>,
    /// Where the recording contradicts the assumed bound on acceleration.
    pub contradiction: Option<OfVehicle<Contradiction>>,
    /// Where the flight ended before its time, and what was judged did not: nothing is known of the rest.
    pub ended_early: Option<EarlyEnd>,
    /// Verdict and finding up to there, where nothing was wrong.
    #[serde(skip)]
    pub(super) until_then: Option<String>,
    /// Why the run's own audit leaves the question undecided.
    #[serde(skip)]
    pub run_objection: Option<String>,
    /// Whether it was asked how close two came, and not single vehicles alone.
    #[serde(skip)]
    pub(super) separation_asked: bool,
    /// Whether everything is known but for what is listed.
    #[serde(skip)]
    pub(super) is_else_known: bool,
    /// The sampling rate that would decide all that is undecided of pairs \[Hz\].
    #[serde(skip)]
    pub(super) deciding_rate_hz: Option<f64>,
}

/// Vehicles that are listed for not being seen throughout, at most.
const ABSENT_LISTED: usize = 1000;

/// Which vehicles are seen over the whole window.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SeenWhen {
    /// The window that the verdict is about \[s\]: what was asked for, or the time of the recording; null where nothing was judged.
    pub window_s: Option<(f64, f64)>,
    /// Whether the verdict depends on it.
    pub required: bool,
    /// How many of those that were asked for are seen throughout.
    pub throughout: usize,
    /// How many of them are not.
    pub partly: usize,
    /// When these are seen, the first of them by their numbers.
    pub listed: Vec<OfVehicle<Seen>>,
}

/// When a vehicle is seen, from the first time to the last; null where it is not seen in the window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Seen {
    /// From \[s\].
    pub from_s: Option<f64>,
    /// To \[s\].
    pub to_s: Option<f64>,
}

impl SeenWhen {
    fn new(outcome: &Outcome, settings: &Settings) -> Self {
        let is_asked = |name: &&String| settings.only.as_ref().is_none_or(|only| only.contains(*name));
        let (asked, partly) = (outcome.vehicles.iter().filter(is_asked).count(), outcome.absences.len());
        let seen = |of: &Absence| {
            let seen = Seen { from_s: of.seen.map(|seen| seen.from_s), to_s: of.seen.map(|seen| seen.to_s) };
            OfVehicle::new(outcome, of.vehicle, seen)
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

/// Obstacles and who came close to them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Obstacles {
    /// The ten closest approaches.
    pub closest: Vec<OfPair<Approach>>,
    /// Every time that a vehicle was too close to one.
    pub violations: Vec<OfPair<Violation<ObjectPair>>>,
}

impl RecordedReport {
    /// The report on an outcome.
    #[must_use]
    pub fn new(outcome: &Outcome, settings: &Settings, source: Source, between: Between) -> Self {
        let first = outcome.closest.first();
        let scaled = settings.ellipsoid_m.is_some();
        let min_m = first.and_then(|first| finite(first.certain_m()));
        let limits: Vec<_> = outcome.envelope.limits.iter().map(|found| OfLimit::new(found, outcome)).collect();
        let by_limits = limits.iter().filter_map(|limit| limit.assumes.clone());
        let by_motion = (!matches!(between.basis, Basis::Recorded | Basis::Run)).then_some(between.motion.clone());
        let assumes: Vec<_> = by_motion.into_iter().chain(by_limits).collect();
        let is_assumed = between.basis == Basis::Assumed || limits.iter().any(|limit| limit.assumes.is_some());
        let names = |pair: ObjectPair| outcome.names(pair, &settings.obstacles);
        let closest = |of: &[Approach]| of.iter().map(|a| OfPair { who: names(a.pair), finding: *a }).collect();
        let violations = outcome.violations.iter().map(|v| OfPair { who: names(v.pair), finding: *v });
        let violations: Vec<_> = violations.collect();
        let alone = outcome.alone.iter();
        let alone = alone.filter_map(|&of| Some(OfVehicle::new(outcome, of, outcome.presence[of]?)));
        Self {
            schema_version: SCHEMA_VERSION,
            status: outcome.status,
            source,
            measure: if scaled { "ellipsoids" } else { "metres" },
            motion: between.motion,
            vehicles: outcome.vehicles.clone(),
            judged: outcome.presence.iter().flatten().count(),
            span_s: outcome.span_s,
            presence: SeenWhen::new(outcome, settings),
            findings: outcome.tallies,
            deciding_rate_hz: outcome.deciding_rate_hz,
            separation: Separation {
                delta_m: settings.delta_m.or(scaled.then_some(TOUCHING_ELLIPSOIDS)),
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
                    status: outcome.separation.unwrap_or_default(),
                    violations: outcome
                        .violations
                        .iter()
                        .filter_map(|v| Some(flight::Violation::new(v.pair.vehicles()?, v)))
                        .collect(),
                    undecided: outcome.tallies.undecided.count.saturating_sub(
                        outcome.undecided.iter().filter(|of| of.pair.vehicles().is_none()).count() as u64,
                    ),
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
            ended_early: None,
            until_then: None,
            run_objection: None,
            separation_asked: outcome.separation.is_some(),
            is_else_known: outcome.is_else_known,
            gaps: outcome.gaps.iter().map(|gap| OfVehicle::new(outcome, gap.vehicle, *gap)).collect(),
            alone: alone.collect(),
            undecided: outcome.undecided.iter().map(|u| OfPair { who: names(u.pair), finding: *u }).collect(),
            contradiction: outcome.contradiction.map(|of| OfVehicle::new(outcome, of.vehicle, of)),
        }
    }

    /// Returns the report on a flight that ended before its time: undecided at best.
    #[must_use]
    pub fn with_early_end(mut self, end: EarlyEnd) -> Self {
        self.until_then = (self.status == Status::Clear).then(|| self.headline());
        self.status = self.status.and(Status::Undecided);
        self.audit.flight.status = self.audit.flight.status.and(Status::Undecided);
        self.audit.proved = false;
        for limit in &mut self.limits {
            limit.status = limit.status.and(Status::Undecided);
        }
        self.ended_early = Some(end);
        self
    }

    /// The verdict on how close any two came alone; none where only single vehicles were asked about.
    #[must_use]
    pub fn separation(&self) -> Option<Status> {
        self.separation_asked.then_some(self.audit.flight.status)
    }

    /// The report as indented JSON with a line end.
    ///
    /// # Errors
    /// None in practice: every key is a string and every value has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// A finding on a pair, with their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfPair<T> {
    /// Their names.
    pub who: [String; 2],
    /// What was found.
    #[serde(flatten)]
    pub finding: T,
}

/// A finding on a vehicle, with its name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfVehicle<T> {
    /// Its name.
    pub vehicle: String,
    /// What was found.
    #[serde(flatten)]
    pub finding: T,
}

impl<T> OfVehicle<T> {
    /// Returns the finding with the name of its vehicle.
    pub(super) fn new(outcome: &Outcome, vehicle: usize, finding: T) -> Self {
        Self { vehicle: outcome.name(vehicle), finding }
    }
}
