//! Contents of a recording of `tautline run` besides positions: limit, obstacles and the run's own audit.

use std::path::Path;

use nalgebra::Vector3;

use super::super::{Failure, Monitor};
use super::AuditRequest;
use crate::report::recorded::{EarlyEnd, RunObjection};
use crate::report::{Finding, Objects, Report};
use tautline_audit::recorded::{Approach, ObjectPair, Outcome, Settings, TOUCHING_ELLIPSOIDS, VehicleSettings};
use tautline_audit::{MovingObstacle, ParryEvidence, Status, Tally, Violation};
use tautline_core::option::{DELTA, INDEPENDENT};
use tautline_core::record::Event;
use tautline_core::swarm::Pair;
use tautline_core::text::{counted, exact};
use tautline_recordings::mcap::{Entry, RunAudit, RunFinding, StoredAudit};
use tautline_recordings::read;
use tautline_recordings::read::ReadOptions;
use tautline_sim::scenario;
use tautline_sim::scenario::Scenario;

/// Relative rounding difference of two distances at the same instant, computed in two ways.
const SAME: f64 = 1e-9;

/// Contents of a recording of `tautline run` besides positions.
#[derive(Clone, Debug)]
pub struct OwnRecording {
    /// Safety distance \[m\]; 2, as a scaled distance, if the scenario has ellipsoids.
    pub(super) limit_m: f64,
    /// Half axes of the ellipsoid around each vehicle \[m\].
    pub(super) ellipsoid_m: Option<Vector3<f64>>,
    /// Obstacles of the scenario.
    pub(super) obstacles: Vec<MovingObstacle>,
    /// Early end of the flight, if it has one.
    pub(super) early_end: Option<EarlyEnd>,
    audit: StoredAudit,
    /// Violations and approaches of the events of the run.
    run_findings: Vec<Violation<ObjectPair>>,
    /// Whether the audit ignores the run's audit.
    is_independent: bool,
    /// Whether positions and times are read unchanged.
    is_read_as_written: bool,
    /// Metres of a length as the run wrote it.
    scale: f64,
    /// Times of the samples \[s\].
    samples_s: Vec<f64>,
    /// The flown law, if it differs from the law of the scenario.
    other_law: Option<String>,
}

/// Use of the run's audit in the audit of its recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum RunAnswer {
    /// The verdict is that of the samples.
    Samples,
    /// The samples are clear, but the run's audit leaves the question undecided, for this reason.
    Undecided(RunObjection),
    /// The verdict is that of the run's audit.
    Repeated,
}

/// Returns the audit that a run writes at the end of its recording.
#[must_use]
pub fn run_audit(scenario: &Scenario, report: &Report) -> RunAudit {
    let scale = metric_scale(scenario);
    let run_finding = |found: &Finding| {
        let ([vehicle, other_vehicle, obstacle], scale) = match found.objects {
            Objects::Pair(ObjectPair::Vehicles(pair)) => ([pair.first() + 1, pair.second() + 1, 0], scale),
            Objects::Pair(ObjectPair::Obstacle { vehicle, obstacle }) => ([vehicle + 1, 0, obstacle + 1], 1.0),
            Objects::Vehicle(_) => return None,
        };
        let [vehicle, other_vehicle, obstacle] = [vehicle, other_vehicle, obstacle].map(|number| number as u64);
        let (min_m, min_at_s, limit_m) = (found.value.upper? * scale, found.at_s?, found.limit? * scale);
        let (from_s, to_s) = (found.from_s.unwrap_or(min_at_s), found.to_s.unwrap_or(min_at_s));
        Some(RunFinding { vehicle, other_vehicle, obstacle, limit_m, from_s, to_s, min_m, min_at_s })
    };
    let answer = &report.answer;
    let mut violations: Vec<_> = answer.violations.listed.iter().filter_map(run_finding).collect();
    violations.sort_by(|a, b| (a.min_m - a.limit_m).total_cmp(&(b.min_m - b.limit_m)));
    violations.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    let time = &scenario.time;
    RunAudit {
        status: answer.status.name().to_owned(),
        ended_early: report.run.early_end().unwrap_or_default(),
        holds_every_step: scenario.has_engine() && report.run.refined_steps == 0 && time.samples() > time.steps(),
        limit_m: scenario.delta_m * scale,
        duration_s: report.run.duration_s,
        steps: answer.detectors.and_then(|detectors| detectors.steps).unwrap_or_default(),
        pairs_checked: answer.detectors.map_or(0, |detectors| detectors.pairs_swept),
        violations_count: answer.violations.count,
        closest: answer.closest.iter().filter_map(run_finding).collect(),
        violations,
        sha256: String::new(),
    }
}

impl OwnRecording {
    /// Returns the contents for a flight in memory, with the reason of its early end, and with the name of its law if
    /// it is not that of the scenario.
    #[must_use]
    pub fn of_flight(scenario: &Scenario, report: &Report, other_law: Option<String>, reason: Option<String>) -> Self {
        Self::of_run(scenario, run_audit(scenario, report), other_law, reason)
    }

    /// As [`OwnRecording::of_flight`], from the audit of the run ([`run_audit`]).
    #[must_use]
    pub fn of_run(scenario: &Scenario, audit: RunAudit, other_law: Option<String>, reason: Option<String>) -> Self {
        let (at_s, duration_s) = (audit.duration_s, scenario.time.duration_s);
        let early_end = (!audit.ended_early.is_empty()).then_some(EarlyEnd { at_s, duration_s, reason });
        let audit = StoredAudit::AsWritten(Box::new(audit));
        Self { early_end, audit, other_law, ..Self::of(scenario, scenario.delta_m, 1.0) }
    }

    /// Returns the limits of a scenario, with lengths multiplied by `scale`.
    fn of(scenario: &Scenario, delta_m: f64, scale: f64) -> Self {
        let ellipsoid_m = scenario.half_axes_m().map(|axes| Vector3::from(axes) * scale);
        Self {
            limit_m: if ellipsoid_m.is_some() { TOUCHING_ELLIPSOIDS } else { delta_m * scale },
            ellipsoid_m,
            obstacles: scenario.obstacles.iter().map(|obstacle| MovingObstacle::from(obstacle).scaled(scale)).collect(),
            early_end: None,
            audit: StoredAudit::None,
            run_findings: Vec::new(),
            is_independent: false,
            is_read_as_written: true,
            scale,
            samples_s: Vec::new(),
            other_law: None,
        }
    }

    /// Reads the contents of a recording besides positions; `None` if the file is not a recording of `tautline run`.
    /// Reads a damaged recording up to the damage.
    ///
    /// # Errors
    /// [`Failure`] if the scenario of the recording cannot be read, because its obstacles are then unknown.
    pub fn read(path: &Path, options: &ReadOptions, monitor: &dyn Monitor) -> Result<Option<Self>, Failure> {
        let Some(mut recording) = read::open_run(path) else { return Ok(None) };
        let header = recording.header();
        let text = header.scenario_toml.clone();
        let source = scenario::Source::Text { name: header.scenario_name.clone(), text };
        let scenario = Scenario::read(&source, &[]).map_err(|error| {
            let why = error.to_string();
            let why = why.lines().next().unwrap_or_default();
            let message =
                format!("{} was flown by another tautline: its scenario cannot be read: {why}", path.display());
            let help = format!("audit it with the tautline that flew it, or export it as CSV and give {DELTA}");
            Failure::input("recording/foreign-scenario", message, help)
        })?;
        let mut own = Self::of(&scenario, header.delta_m, options.metres());
        let usual =
            ReadOptions { format: options.format, usual_layout: options.usual_layout, ..ReadOptions::default() };
        own.is_read_as_written = ReadOptions { allow_unfinished: false, ..options.clone() } == usual;
        let (mut last_step, mut reason) = (0, None);
        for entry in recording.by_ref().map_while(Result::ok) {
            if monitor.is_interrupted() {
                return Err(Failure::interrupted());
            }
            match entry {
                Entry::Sample(sample) => {
                    own.samples_s.push(sample.time_s);
                    last_step = sample.step;
                }
                Entry::Event(Event::OtherLaw { name, .. }) => own.other_law = Some(name),
                Entry::Event(Event::EndedEarly { reason: why, .. }) => reason = Some(why),
                Entry::Event(event) => own.run_findings.extend(run_finding(&event, &scenario)),
            }
        }
        if reason.is_some() || last_step < scenario.time.steps() {
            let (at_s, duration_s) = (own.samples_s.last().copied().unwrap_or(0.0), scenario.time.duration_s);
            own.early_end = Some(EarlyEnd { at_s, duration_s, reason });
        }
        own.audit = recording.stored_audit();
        Ok(Some(own))
    }

    /// Drops the run's audit.
    pub(super) fn independent(self) -> Self {
        Self { is_independent: true, ..self }
    }

    fn run_audit(&self) -> Option<&RunAudit> {
        match &self.audit {
            StoredAudit::AsWritten(audit) if !self.is_independent => Some(audit),
            _ => None,
        }
    }

    /// Returns whether the recording is unchanged, so that every sample contains every vehicle.
    pub(super) fn is_unaltered(&self) -> bool {
        self.run_audit().is_some()
    }

    /// Returns whether positions and times are read unchanged.
    pub(super) fn is_read_as_written(&self) -> bool {
        self.is_read_as_written
    }

    /// Returns whether the samples are all steps of the run, each with straight motion.
    pub(crate) fn holds_every_step(&self) -> bool {
        self.run_audit().is_some_and(|audit| audit.holds_every_step)
    }

    /// Replaces the findings of the samples by those of the run's audit if the question is the same. Otherwise adds a
    /// note with the reason.
    pub(super) fn answer(
        &self,
        outcome: &mut Outcome,
        settings: &Settings,
        request: &AuditRequest<'_>,
        notes: &mut Vec<String>,
    ) -> RunAnswer {
        if self.is_independent {
            if let StoredAudit::AsWritten(audit) = &self.audit
                && audit.violations_count > 0
            {
                let count = counted(audit.violations_count, "violation", "violations");
                notes.push(format!("{INDEPENDENT} leaves out the audit of the run, which found {count}"));
            }
            return RunAnswer::Samples;
        }
        let mut note = |why: &str| notes.push(format!("the samples are judged: {why}"));
        let audit = match &self.audit {
            StoredAudit::None => {
                note(&match self.run_findings.len() as u64 {
                    0 => "the recording holds no audit of its run, which a run writes at its end".to_owned(),
                    count => format!(
                        "the run recorded {} but no audit, which a run writes at its end; an approach closer than the \
                         samples counts",
                        counted(count, "finding", "findings")
                    ),
                });
                return self.of_samples(outcome, settings, None, |_| true);
            }
            StoredAudit::Altered => {
                note("the recording was changed after the run, so the run's audit may refer to other samples");
                return self.of_samples(outcome, settings, None, |_| true);
            }
            StoredAudit::AsWritten(audit) => audit,
        };
        let status =
            [Status::Clear, Status::Violation, Status::Undecided].into_iter().find(|of| of.name() == audit.status);
        let status = status.unwrap_or_default();
        if audit.holds_every_step {
            // The run judged exactly these samples, so the verdict of the samples is a proof.
            if status == Status::Undecided && outcome.status == Status::Violation {
                notes.push(UNDECIDED_RUN.to_owned());
            }
            if self.ellipsoid_m.is_none() {
                return RunAnswer::Samples;
            }
            // Beside ellipsoids the samples are not judged against obstacles.
            let of_obstacles = |pair: ObjectPair| matches!(pair, ObjectPair::Obstacle { .. });
            return self.of_samples(outcome, settings, Some(audit), of_obstacles);
        }
        if !self.is_same_question(settings, request) || !outcome.absences.is_empty() {
            let limit = exact(self.limit_m);
            let verdict = audit.status.to_uppercase();
            note(&format!(
                "the run's audit of every step answers another question ({verdict}: all vehicles, limit {limit})"
            ));
            return self.of_samples(outcome, settings, Some(audit), |_| true);
        }
        if self.is_contradicted(outcome, audit, status) {
            note("they show vehicles closer than the run's audit");
            return RunAnswer::Samples;
        }
        match status {
            Status::Clear | Status::Undecided if !audit.ended_early.is_empty() => RunAnswer::Samples,
            Status::Clear if !settings.envelope.is_empty() || settings.well_clear.is_some() => {
                note("the run's audit of every step does not cover limits of single vehicles or well clear");
                RunAnswer::Samples
            }
            Status::Clear | Status::Violation => {
                repeat(audit, status, outcome);
                RunAnswer::Repeated
            }
            Status::Undecided if outcome.status == Status::Violation => {
                notes.push(UNDECIDED_RUN.to_owned());
                RunAnswer::Samples
            }
            Status::Undecided => undecided(outcome, RunObjection::RunUndecided {}),
        }
    }

    /// Leaves the answer to the samples, unless the run objects by a finding on a pair that counts.
    fn of_samples(
        &self,
        outcome: &mut Outcome,
        settings: &Settings,
        audit: Option<&RunAudit>,
        counts: fn(ObjectPair) -> bool,
    ) -> RunAnswer {
        match self.objection(outcome, settings, audit, counts) {
            Some(why) => undecided(outcome, why),
            None => RunAnswer::Samples,
        }
    }

    /// Returns the reason why a clear answer of the samples is not certain: between samples the run found a pair closer
    /// than the request allows. Distances of another metric are compared by an upper bound. Motion that `--offset`
    /// shifts in time is not that of the run.
    fn objection(
        &self,
        outcome: &Outcome,
        settings: &Settings,
        audit: Option<&RunAudit>,
        counts: fn(ObjectPair) -> bool,
    ) -> Option<RunObjection> {
        if outcome.separation != Some(Status::Clear) {
            return None;
        }
        let offset_s = |vehicle: usize| settings.vehicles.get(&(vehicle + 1).to_string()).map_or(0.0, |of| of.offset_s);
        let given = settings.delta_m.or(settings.ellipsoid_m.map(|_| TOUCHING_ELLIPSOIDS)).unwrap_or(0.0);
        let limit = outcome.closest.iter().map(|of| of.limit_m).fold(given, f64::max);
        // A distance in half axes is at most that in metres over the shortest axis, and at least that over the longest.
        let metres = self.ellipsoid_m.map_or(self.scale, |axes_m| axes_m.max());
        let asked = settings.ellipsoid_m.map_or(1.0, |axes_m| 1.0 / axes_m.min());
        let asked = settings.cylinder.map_or(asked, |of| 1.0 / of.horizontal_m.min(of.vertical_m));
        let is_same_metric = settings.ellipsoid_m.is_some() && settings.ellipsoid_m == self.ellipsoid_m;
        let factor = if is_same_metric { 1.0 } else { metres * asked };
        let is_judged =
            |vehicle: usize| settings.only.as_ref().is_none_or(|only| only.contains(&(vehicle + 1).to_string()));
        let in_window = |found: &Violation<ObjectPair>| {
            !self.is_read_as_written
                || (settings.from_s.is_none_or(|from_s| found.to_s >= from_s)
                    && settings.until_s.is_none_or(|to_s| found.from_s <= to_s))
        };
        let is_closer = |found: &Violation<ObjectPair>| match found.pair {
            ObjectPair::Vehicles(pair) => {
                is_judged(pair.first())
                    && is_judged(pair.second())
                    && offset_s(pair.first()) == offset_s(pair.second())
                    && found.min_m * factor < limit
                    && in_window(found)
            }
            ObjectPair::Obstacle { vehicle, obstacle } => {
                // The run judged obstacles beside its ellipsoids, a question on recordings does not.
                let is_asked = self.obstacles.get(obstacle).is_some_and(|of| settings.obstacles.contains(of));
                (is_asked || is_same_metric) && is_judged(vehicle) && found.min_m < found.limit_m && in_window(found)
            }
        };
        let stored = audit.into_iter().flat_map(|audit| audit.violations.iter().chain(&audit.closest));
        let found = stored.filter_map(decoded).chain(self.run_findings.iter().copied());
        let found = found.filter(|found| counts(found.pair)).filter(is_closer);
        let deepest = found.min_by(|a, b| (a.min_m - a.limit_m).total_cmp(&(b.min_m - b.limit_m)))?;
        let who = match deepest.pair {
            ObjectPair::Vehicles(pair) => pair.numbers().map(|number| number.to_string()),
            ObjectPair::Obstacle { vehicle, obstacle } => {
                [(vehicle + 1).to_string(), format!("obstacle {}", obstacle + 1)]
            }
        };
        let is_scaled = self.ellipsoid_m.is_some() && deepest.pair.vehicles().is_some();
        let (min, unit) = if is_scaled { (deepest.min_m, "half axes") } else { (deepest.min_m * self.scale, "m") };
        Some(RunObjection::RunFoundCloser { who, min, unit, at_s: deepest.min_at_s })
    }

    /// Returns whether the run's audit answers a question. The question must have the limit and obstacles of the run,
    /// all vehicles, the whole flight, the run's clock, and no assumption on the motion. Limits of single vehicles are
    /// checked separately.
    fn is_same_question(&self, settings: &Settings, request: &AuditRequest<'_>) -> bool {
        let limit_m = settings.delta_m.or(settings.ellipsoid_m.map(|_| TOUCHING_ELLIPSOIDS));
        self.is_read_as_written
            && (limit_m, settings.ellipsoid_m) == (Some(self.limit_m), self.ellipsoid_m)
            && settings.radius_m.is_none()
            && settings.vehicles.values().all(|of| *of == VehicleSettings::default())
            && settings.only.is_none()
            && (settings.from_s, settings.until_s, settings.above_m) == (None, None, None)
            && settings.obstacles == self.obstacles
            && (request.options.motion, request.options.max_gap_s) == (None, None)
    }

    /// Returns whether the samples contradict the run's audit with a smaller distance. Distances between samples are
    /// ignored: straight lines there may differ from the motion of the run.
    fn is_contradicted(&self, outcome: &Outcome, audit: &RunAudit, status: Status) -> bool {
        let has_sample = |from_s: f64, to_s: f64| {
            let rounding_s = SAME * (1.0 + to_s.abs());
            let first = self.samples_s.partition_point(|&at_s| at_s < from_s - rounding_s);
            self.samples_s.get(first).is_some_and(|&at_s| at_s <= to_s + rounding_s)
        };
        let smallest_m = audit.closest.iter().filter(|of| of.obstacle == 0).map(|of| of.min_m).reduce(f64::min);
        let of_obstacle =
            |pair: ObjectPair| audit.closest.iter().filter_map(decoded).find(|of| of.pair == pair).map(|of| of.min_m);
        let is_closer = |of: &Approach, least_m: Option<f64>| {
            least_m.is_some_and(|least_m| of.upper_m < least_m - SAME * (1.0 + least_m.abs()))
                && has_sample(of.time_s, of.time_s)
        };
        outcome.closest.iter().any(|of| is_closer(of, smallest_m))
            || outcome.obstacles.iter().any(|of| is_closer(of, of_obstacle(of.pair)))
            || (status == Status::Clear && outcome.violations.iter().any(|of| has_sample(of.from_s, of.to_s)))
    }

    /// Returns a note if the flown law differs from the law of the scenario.
    pub(super) fn note_on_law(&self) -> Option<String> {
        self.other_law.as_ref().map(|name| format!("flown under the law {name} instead of the scenario's"))
    }
}

/// Returns the violation or the approach of an event, in the lengths of [`run_audit`].
fn run_finding(event: &Event, scenario: &Scenario) -> Option<Violation<ObjectPair>> {
    let (pair, time_s, min_m) = match *event {
        Event::ViolationBegan { pair, time_s } => (pair.into(), time_s, None),
        Event::Approach { pair, time_s, separation_m } => (pair.into(), time_s, Some(separation_m)),
        Event::ObstacleViolationBegan { vehicle, obstacle, time_s } => {
            (ObjectPair::Obstacle { vehicle, obstacle }, time_s, None)
        }
        Event::ObstacleApproach { vehicle, obstacle, time_s, distance_m } => {
            (ObjectPair::Obstacle { vehicle, obstacle }, time_s, Some(distance_m))
        }
        _ => return None,
    };
    let (limit_m, scale) = match pair {
        ObjectPair::Vehicles(_) => (scenario.delta_m, metric_scale(scenario)),
        ObjectPair::Obstacle { obstacle, .. } => (scenario.obstacles.get(obstacle)?.clearance_m, 1.0),
    };
    let (min_m, limit_m) = (min_m.unwrap_or(limit_m.next_down()) * scale, limit_m * scale);
    Some(Violation { pair, from_s: time_s, to_s: time_s, min_m, min_at_s: time_s, limit_m })
}

/// Returns the factor from separations of the scenario to those of its recording.
fn metric_scale(scenario: &Scenario) -> f64 {
    scenario.half_axes_m().map_or(1.0, |_| TOUCHING_ELLIPSOIDS / scenario.delta_m)
}

/// Leaves the answer of the samples undecided, for a reason of the run's audit.
fn undecided(outcome: &mut Outcome, why: RunObjection) -> RunAnswer {
    outcome.status = outcome.status.and(Status::Undecided);
    outcome.separation = outcome.separation.map(|status| status.and(Status::Undecided));
    RunAnswer::Undecided(why)
}

const UNDECIDED_RUN: &str =
    "the run itself is UNDECIDED: the recorded motion may differ from that of the law (see report.json)";

/// Returns the violation or the approach of a finding; `None` if its numbers name no pair.
fn decoded(found: &RunFinding) -> Option<Violation<ObjectPair>> {
    let &RunFinding { limit_m, from_s, to_s, min_m, min_at_s, .. } = found;
    let index = |number: u64| usize::try_from(number).ok()?.checked_sub(1);
    let vehicle = index(found.vehicle)?;
    let pair = match (index(found.other_vehicle), index(found.obstacle)) {
        (Some(other), None) if other != vehicle => Pair::new(vehicle, other).into(),
        (None, Some(obstacle)) => ObjectPair::Obstacle { vehicle, obstacle },
        _ => return None,
    };
    Some(Violation { pair, from_s, to_s, min_m, min_at_s, limit_m })
}

/// Replaces the findings of the samples by those of the run's audit.
fn repeat(audit: &RunAudit, status: Status, outcome: &mut Outcome) {
    let closest = audit.closest.iter().filter_map(decoded).map(|found| {
        let Violation { pair, limit_m, min_m, min_at_s, .. } = found;
        Approach { pair, lower_m: min_m, upper_m: min_m, time_s: min_at_s, limit_m }
    });
    let (of_pairs, of_obstacles): (Vec<_>, Vec<_>) = closest.partition(|of| of.pair.vehicles().is_some());
    outcome.violations = audit.violations.iter().filter_map(decoded).collect();
    let listed = outcome.violations.len();
    outcome.tallies.violations = Tally { count: audit.violations_count, listed, is_exact: true };
    outcome.undecided.clear();
    outcome.tallies.undecided = Tally::all(0);
    outcome.deciding_rate_hz = None;
    // The figure of the smallest distance over time has samples. Between samples no pair is closer than the run's
    // closest approach.
    if let Some(nearest) = of_pairs.first() {
        for slice in &mut outcome.smallest {
            let drawn = &mut slice.closest;
            (drawn.lower_m, drawn.upper_m) = (drawn.lower_m.max(nearest.lower_m), drawn.upper_m.max(nearest.lower_m));
            if (slice.from_s..=slice.to_s).contains(&nearest.time_s) {
                slice.closest = *nearest;
            }
        }
    }
    (outcome.closest, outcome.obstacles) = (of_pairs, of_obstacles);
    outcome.separation = Some(status);
    outcome.status = status;
    outcome.is_else_known = !outcome.tallies.are_shortened();
    (outcome.segments, outcome.swept) = (audit.steps, audit.pairs_checked);
    outcome.parry = ParryEvidence::default();
}
