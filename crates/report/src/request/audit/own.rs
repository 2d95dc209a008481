//! What a recording of `tautline run` says of itself beside positions.

use std::path::Path;

use nalgebra::Vector3;

use super::super::{Failure, Monitor};
use super::own_obstacles::OwnObstacles;
use super::own_told::{Near, told};
use crate::report::recorded::EarlyEnd;
use tautline_audit::Status;
use tautline_audit::recorded::{Outcome, Settings, Told, ToldViolation};
use tautline_core::record::{Event, OwnedSample, RecordError, Sample, Sink, StateHash};
use tautline_core::swarm::{ClosestApproach, Pair};
use tautline_recordings::mcap::{Entry, McapRecording, RunVerdict};
use tautline_sim::scenario::{self, Scenario};

/// Scaled distance at which two equal ellipsoids touch.
const TOUCHING_ELLIPSOIDS: f64 = 2.0;

/// What a flight of ours says of itself beside positions.
#[derive(Clone, Debug)]
pub struct OwnRecording {
    /// Its safety distance \[m\]; the scaled distance at which two of its ellipsoids touch where it has these.
    pub(super) delta_m: f64,
    /// Half axes of what had to stay empty around a vehicle \[m\], where that was no ball. Distances are lengths over them then, in
    /// what it says of itself too.
    pub(super) ellipsoid_m: Option<Vector3<f64>>,
    /// What it says of the time between its samples, in order of time; nothing where it holds every step that was flown.
    pub(super) told: Vec<Told>,
    /// The times that it says a pair was too close in.
    pub(super) violations: Vec<ToldViolation>,
    /// Whether it holds every step that was flown, and every step was straight.
    pub has_every_step: bool,
    /// Most steps between two of its samples.
    pub most_steps: u64,
    /// Times of the samples \[s\].
    samples_s: Vec<f64>,
    /// What it was flown past.
    pub(super) obstacles: OwnObstacles,
    verdict: OwnVerdict,
    /// The law that was flown, where it is not the scenario's.
    other_law: Option<String>,
    /// Where the flight ended before its time.
    pub(super) early_end: Option<EarlyEnd>,
}

/// What a recording says of the verdict of its run.
#[derive(Clone, Copy, Debug)]
enum OwnVerdict {
    /// There is none, or it is not asked for.
    None,
    /// The hashes of the verdict do not agree: the recording was changed.
    Altered,
    Clear(JudgedClear),
    Undecided,
    /// Another verdict of the recording as the run wrote it.
    Other,
}

/// The verdict of a finished run whose judge found it clear at every step.
#[derive(Clone, Copy, Debug)]
struct JudgedClear {
    /// The closest that any two came; none where that is not known.
    closest: Option<ClosestApproach>,
}

impl JudgedClear {
    /// Whether the verdict of the run answers what was asked: nothing but distances, none larger than the smallest that the run
    /// saw, in its lengths and by its clock, and no obstacles but its own.
    fn answers(&self, outcome: &Outcome, settings: &Settings, own: &OwnRecording) -> bool {
        let Some(closest) = self.closest else { return false };
        let radii_m = settings.radius_m.into_iter().chain(settings.vehicles.values().filter_map(|of| of.radius_m));
        let by_radii_m = 2.0 * radii_m.fold(0.0, f64::max);
        let touching = settings.ellipsoid_m.map_or(0.0, |_| TOUCHING_ELLIPSOIDS);
        let limit_m = settings.delta_m.unwrap_or(touching).max(by_radii_m);
        let is_by_its_clock = settings.vehicles.values().all(|of| of.offset_s == 0.0);
        let is_past_its_own = settings.obstacles == own.obstacles.obstacles;
        outcome.status == Status::Clear
            && settings.envelope.is_empty()
            && settings.ellipsoid_m == own.ellipsoid_m
            && is_by_its_clock
            && is_past_its_own
            && limit_m <= closest.separation_m
    }
}

impl OwnRecording {
    /// Reads it; `None` where the file is none of ours. Where it is damaged, what it says up to there; reading its positions
    /// tells better what is wrong with it. `scale` is what its lengths are multiplied by.
    ///
    /// # Errors
    /// [`Failure`] where its scenario cannot be read: nobody knows then what was flown past, or in which lengths it tells.
    pub fn read(path: &Path, scale: f64, monitor: &dyn Monitor) -> Result<Option<Self>, Failure> {
        let Some(mut recording) = path.is_file().then(|| McapRecording::open(path).ok()).flatten() else {
            return Ok(None);
        };
        let header = recording.header();
        let text = header.scenario_toml.clone();
        let source = scenario::Source::Text { name: header.scenario_name.clone(), text };
        let scenario = Scenario::read(&source, &[]).map_err(|error| {
            let why = error.to_string();
            let why = why.lines().next().unwrap_or_default();
            let message =
                format!("{} was flown by another tautline: its scenario cannot be read: {why}", path.display());
            let help =
                "audit it with the tautline that flew it, or export it as CSV and say how close vehicles may come";
            Failure::input("recording/foreign-scenario", message, help)
        })?;
        let mut witness = Witness::new(&scenario, header.delta_m, scale);
        let mut states = StateHash::new();
        for entry in recording.by_ref().map_while(Result::ok) {
            if monitor.is_interrupted() {
                return Err(Failure::interrupted());
            }
            match entry {
                Entry::Sample(sample) => {
                    states.observe(&sample.as_sample());
                    witness.note_sample(sample);
                }
                Entry::Event(event) => witness.note_event(event),
            }
        }
        let verdict = recording.verdict().filter(|_| recording.is_complete());
        let is_as_written = |verdict: &RunVerdict| {
            verdict.state_sha256 == states.clone().finish() && verdict.told_sha256 == recording.told_sha256()
        };
        Ok(Some(match verdict {
            None => witness.end(),
            Some(verdict) if is_as_written(verdict) => witness.finish(verdict),
            Some(_) => witness.end().altered(),
        }))
    }

    /// Without what it says of the time between its samples, but for what was too close.
    fn altered(self) -> Self {
        Self { told: Vec::new(), verdict: OwnVerdict::Altered, has_every_step: false, ..self }
    }

    /// Whether every sample contains every vehicle. This holds for a recording that is not known to be altered.
    pub(super) fn has_no_gaps(&self) -> bool {
        matches!(self.verdict, OwnVerdict::Clear(_) | OwnVerdict::Undecided | OwnVerdict::Other)
    }

    /// Reconciles the outcome of the samples with the verdict of the run, which judged every step. Returns whether the verdict
    /// of the run answers the question of this audit.
    pub(super) fn settle(&self, outcome: &mut Outcome, settings: &Settings, notes: &mut Vec<String>) -> bool {
        let OwnVerdict::Clear(judged) = self.verdict else { return false };
        let Some(closest) = judged.closest else { return false };
        if outcome.contradicts(closest) {
            notes.push(format!(
                "the verdict of the run is not used: its smallest separation ({:?} m) is larger than that of the samples",
                closest.separation_m
            ));
            return false;
        }
        let is_by_its_clock = settings.vehicles.values().all(|of| of.offset_s == 0.0);
        if !self.has_every_step && is_by_its_clock && settings.obstacles == self.obstacles.obstacles {
            self.obstacles.refute(outcome, settings, &self.samples_s);
        }
        let is_answered = judged.answers(outcome, settings, self);
        if is_answered {
            outcome.raise_to(closest);
        }
        is_answered
    }

    /// Takes no word of the run for what happened between its samples.
    pub(super) fn independent(mut self) -> Self {
        self.told.clear();
        self.violations.clear();
        self.obstacles.forget_what_was_seen();
        Self { verdict: OwnVerdict::None, has_every_step: false, ..self }
    }

    /// Refuses other lengths than those in which it says what happened between its samples: that would be lost.
    pub(super) fn check_told_in(&self, ellipsoid_m: Option<Vector3<f64>>) -> Result<(), Failure> {
        let Some(axes) = self.ellipsoid_m.filter(|_| !self.told.is_empty() && self.ellipsoid_m != ellipsoid_m) else {
            return Ok(());
        };
        let (x, y, z) = (axes.x, axes.y, axes.z);
        Err(Failure::input(
            "audit/other-ellipsoid",
            format!(
                "the run says what happened between its samples in lengths over its ellipsoids, of half axes {x:?}, {y:?} and {z:?} m"
            ),
            format!(
                "leave out --delta and --ellipsoid, ask with --ellipsoid {x:?},{y:?},{z:?}, or record every step of the run"
            ),
        ))
    }

    /// Returns a note if the audit finds a violation in the recording of an undecided run. A run is undecided, for example,
    /// after steps that were too long for the law.
    pub(super) fn doubt(&self, status: Status) -> Option<String> {
        let is_doubtful = matches!(self.verdict, OwnVerdict::Undecided) && status == Status::Violation;
        is_doubtful.then(|| {
            "the run itself is UNDECIDED: the recorded motion may differ from that of the law (see report.json)"
                .to_owned()
        })
    }

    /// What a person should know about how it was flown and is judged, by clocks that were all set right alike or not.
    pub(super) fn notes(&self, clocks_agree: bool) -> impl Iterator<Item = String> {
        let (steps, is_altered) = (self.most_steps, matches!(self.verdict, OwnVerdict::Altered));
        let between = (!self.has_every_step).then(|| {
            let of = if clocks_agree { "" } else { ", for pairs whose clocks were set right alike" };
            format!(
                "up to {steps} steps were flown between two samples: the closest approach that the run saw there \
                 counts{of}"
            )
        });
        let altered = is_altered.then(|| {
            "the recording is not as the run wrote it: what the run says of the time between samples is not believed".to_owned()
        });
        let law = self.other_law.as_ref().map(|name| format!("flown under the law {name}, and not the scenario's"));
        law.into_iter().chain(between.filter(move |_| !is_altered)).chain(altered)
    }
}

/// Watches a flight of ours, sample by sample, for what a judge of its samples alone cannot know.
#[derive(Debug)]
pub struct Witness {
    own: OwnRecording,
    /// What lengths are multiplied by, and those that the flight tells.
    scale: f64,
    told_scale: f64,
    before: Option<OwnedSample>,
    near: Near,
    /// Steps and duration \[s\] that the scenario asks for.
    planned: (u64, f64),
    /// Why the flight ended early, as its recording says.
    reason: Option<String>,
}

impl Witness {
    /// For a flight of this scenario.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self::new(scenario, scenario.delta_m, 1.0)
    }

    fn new(scenario: &Scenario, delta_m: f64, scale: f64) -> Self {
        let ellipsoid_m = scenario.half_axes_m().map(|axes| Vector3::from(axes) * scale);
        // What the run told is of lengths in which its delta is the width of an ellipsoid.
        let told_scale = if ellipsoid_m.is_some() { TOUCHING_ELLIPSOIDS / delta_m } else { scale };
        let own = OwnRecording {
            delta_m: delta_m * told_scale,
            ellipsoid_m,
            told: Vec::new(),
            violations: Vec::new(),
            has_every_step: scenario.has_engine(),
            most_steps: 0,
            samples_s: Vec::new(),
            other_law: None,
            early_end: None,
            obstacles: OwnObstacles::of(scenario, scale),
            verdict: OwnVerdict::None,
        };
        let planned = (scenario.time.steps(), scenario.time.duration_s);
        Self { own, scale, told_scale, before: None, near: Near::default(), planned, reason: None }
    }

    fn note_sample(&mut self, mut sample: OwnedSample) {
        let own = &mut self.own;
        sample.swarm.positions_m *= self.scale;
        let last = self.before.as_ref().unwrap_or(&sample);
        own.samples_s.push(sample.time_s);
        own.most_steps = own.most_steps.max(sample.step.saturating_sub(last.step));
        let lengths = (self.told_scale, own.ellipsoid_m);
        let told = sample.separation.and_then(|closest| told(last, &sample, closest, lengths));
        own.told.extend(told.map(|told| Told { others_m: own.delta_m, ..told }));
        own.violations.extend(self.near.pass(&sample));
        self.before = Some(sample);
    }

    fn note_event(&mut self, event: Event) {
        let (own, before) = (&mut self.own, self.before.as_ref());
        match event {
            Event::StepRefined { .. } => own.has_every_step = false,
            Event::ViolationBegan { pair, time_s } => self.near.begin(pair, time_s, before),
            Event::ViolationEnded { pair, time_s, min_m } => {
                self.near.end(pair, time_s, min_m * self.told_scale, own.delta_m, before);
            }
            Event::Approach { pair, time_s, separation_m } => {
                self.near.approach(pair, (separation_m * self.told_scale, time_s));
            }
            Event::OtherLaw { name, .. } => own.other_law = Some(name),
            Event::EndedEarly { reason, .. } => self.reason = Some(reason),
            event => own.obstacles.note(&event, self.scale),
        }
    }

    /// What the flight says of itself, once it is over, with the verdict of its run.
    #[must_use]
    pub fn finish(self, verdict: &RunVerdict) -> OwnRecording {
        let scale = self.told_scale;
        let own = self.end();
        let index = |number: u64| usize::try_from(number).ok()?.checked_sub(1);
        let pair = index(verdict.pair[0]).zip(index(verdict.pair[1])).filter(|(first, second)| first != second);
        let closest = pair.filter(|_| verdict.separation_m.is_finite()).map(|(first, second)| ClosestApproach {
            pair: Pair::new(first, second),
            separation_m: verdict.separation_m * scale,
            time_s: verdict.separation_time_s,
        });
        let verdict = match verdict.status.as_str() {
            "clear" if verdict.ended_early.is_empty() => OwnVerdict::Clear(JudgedClear { closest }),
            "undecided" => OwnVerdict::Undecided,
            _ => OwnVerdict::Other,
        };
        OwnRecording { verdict, ..own }
    }

    /// What the flight says of itself, without a verdict.
    fn end(self) -> OwnRecording {
        let Self { mut own, before, mut near, planned: (steps, duration_s), reason, .. } = self;
        let at_s = before.as_ref().map_or(0.0, |last| last.time_s);
        let is_whole = reason.is_none() && before.as_ref().is_some_and(|last| last.step >= steps);
        own.early_end = (!is_whole).then_some(EarlyEnd { at_s, duration_s, reason });
        own.violations.append(&mut near.ended);
        if let Some(last) = &before {
            own.violations.extend(near.lasting(last, (own.delta_m, own.ellipsoid_m), &own.told));
        }
        own.has_every_step &= own.most_steps <= 1;
        if own.has_every_step {
            own.told.clear();
            own.violations.clear();
            own.obstacles.forget_what_was_seen();
        }
        own
    }
}

impl Sink for Witness {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.note_sample(sample.into());
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.note_event(event.clone());
        Ok(())
    }

    fn looks_at_steps(&self) -> bool {
        false
    }
}
