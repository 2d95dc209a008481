//! `audit_files`: judges a recording of any origin.

mod against_plan;
mod config;
mod options;
mod own;
mod places;
mod proof;
mod published;
mod question;
mod replays;
pub mod rules;
mod side_files;
mod subject;
mod toml_file;
mod venue_file;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

pub use options::{AuditOptions, Entry, Names};
pub use own::{OwnRecording, run_audit};
pub use question::AuditRequest;
pub use rules::Rules;
pub use subject::{Open, Subject, open, own_recording, recording_in};

use self::against_plan::AuditedFlight;
use self::own::RunAnswer;
use super::run::{figure_files, write_files};
use super::{Failure, Monitor, outputs};
use crate::figures::{self, Figure, Format as FigureFormat};
use crate::report::Status;
use crate::report::recorded::{Clock, RecordedReport, Source};
use replays::Instants;
use side_files::{ItemSpan, SideFiles};
use tautline_audit::recorded::{
    ObjectPair, Outcome, PairSample, PairSeries, PlansOutcome, Presence, Settings, TrackAuditor,
};
use tautline_audit::{MovingObstacle, Violation, are_decimals_apart};
use tautline_core::fact::{Fact, FactKind, Source as FactSource};
use tautline_core::files::write_atomically;
use tautline_core::option::{OBSTACLES, OFFSET};
use tautline_core::text::counted;
use tautline_core::track::{Item, Tracks};
use tautline_recordings::read::ReadError;

/// Number of items that are read before the first is judged. They determine the usual sampling intervals.
const OPENING: usize = 65_536;

/// Largest number of notes on vehicles that are never present together with another vehicle.
const MOST_ALONE: usize = 3;

/// The answer of an audit.
#[derive(Clone, Debug)]
pub struct AuditedRecording {
    /// The report.
    pub report: RecordedReport,
    /// Whether an undecided verdict counts as good.
    pub allows_undecided: bool,
    /// Note on the `tautline.toml` in use.
    pub asked_by: Option<String>,
}

impl AuditedRecording {
    /// Returns whether the verdict is clear, or undecided if that is allowed.
    #[must_use]
    pub fn is_good(&self) -> bool {
        match self.report.status {
            Status::Clear => true,
            Status::Undecided => self.allows_undecided,
            Status::Violation => false,
        }
    }
}

/// A complete request, with the options of `tautline.toml`.
#[derive(Clone)]
pub struct ConfiguredAudit<'a> {
    request: AuditRequest<'a>,
    /// Note on the `tautline.toml` in use.
    asked_by: Option<String>,
}

/// Judges one recording, and writes the page and the proof that the request asks for.
///
/// ```
/// # use std::fs;
/// use tautline_report::request::{AuditOptions, AuditRequest, Silent, Subject, audit_files};
///
/// # let folder = std::env::temp_dir().join(format!("tautline-audit-files-{}", std::process::id()));
/// # fs::create_dir_all(&folder)?;
/// # let path = folder.join("two.csv");
/// fs::write(&path, "t,id,x,y,z\n0,a,0,0,0\n0,b,3,0,0\n1,a,0,1,0\n1,b,3,1,0\n")?;
/// let subject = Subject::Files { paths: vec![path], options: Box::default() };
/// let request = AuditRequest::new(subject, AuditOptions { delta_m: Some(2.0), ..AuditOptions::default() });
/// assert!(audit_files(&request, &Silent::default())?.is_good());
/// # fs::remove_dir_all(&folder)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Failure`] if the request or the recording is wrong, or a file cannot be written. The monitor receives the verdict
/// before files are written.
pub fn audit_files(request: &AuditRequest<'_>, monitor: &dyn Monitor) -> Result<AuditedRecording, Failure> {
    request.check_outputs(&[])?;
    let configured = request.configured()?;
    configured.check_outputs(&[])?;
    configured.judge(monitor)
}

impl ConfiguredAudit<'_> {
    /// A note on the file of settings that was used.
    #[must_use]
    pub fn asked_by(&self) -> Option<&str> {
        self.asked_by.as_deref()
    }

    /// Rejects outputs as [`AuditRequest::check_outputs`] does.
    ///
    /// # Errors
    /// As [`AuditRequest::check_outputs`].
    pub fn check_outputs(&self, more: &[outputs::NamedPath<'_>]) -> Result<(), Failure> {
        self.request.check_outputs(more)
    }

    /// Judges the recording: settles the question, reads and judges the motion, answers, and writes.
    ///
    /// # Errors
    /// As [`audit_files`].
    pub fn judge(&self, monitor: &dyn Monitor) -> Result<AuditedRecording, Failure> {
        self.judge_with(self.request.options.settings()?, monitor)
    }

    /// Judges the recording with settings in the place of those of the options.
    pub(super) fn judge_with(&self, settings: Settings, monitor: &dyn Monitor) -> Result<AuditedRecording, Failure> {
        let settled = self.settle(settings, monitor)?;
        let mut judged = self.judge_motion(settled, monitor)?;
        let (report, plan_figure) = self.answer(&mut judged, monitor)?;
        // Print the verdict before writing files, so that a write error does not hide it.
        monitor.say(&format!("{}\n{}", report.headline(), report.text()));
        self.write(judged, &report, plan_figure, monitor)?;
        Ok(AuditedRecording {
            report,
            allows_undecided: self.request.options.allow_undecided,
            asked_by: self.asked_by.clone(),
        })
    }

    /// Completes the question: limits of the recording, rules, side files. Reads the first items.
    fn settle(&self, mut settings: Settings, monitor: &dyn Monitor) -> Result<Settled<'_>, Failure> {
        let request = &self.request;
        let is_own_limit = is_silent(&settings) && request.options.obstacles.is_none();
        let (own, show) = request.subject.own(monitor)?;
        let own = if request.options.independent { own.map(OwnRecording::independent) } else { own };
        let mut notes = rules::fill(&mut settings, request, show.as_ref())?;
        let side_obstacles = settings.obstacles.len();
        let taken = RecordedLimits::fill(&mut settings, request, own.as_ref());
        notes.extend(taken.notes(request, own.as_ref()));
        proof::check(request, &settings, own.as_ref())?;
        against_plan::refuse_changed_positions(request)?;
        let opening = Opening::read(&|| request.subject.open(), monitor)?;
        let side_files = opening.align(&mut settings, side_obstacles)?;
        Ok(Settled { settings, is_own_limit, own, opening, side_files, notes })
    }

    /// Reads and judges all items, from the first ones on.
    fn judge_motion(&self, settled: Settled<'_>, monitor: &dyn Monitor) -> Result<JudgedRecording, Failure> {
        let request = &self.request;
        let called = request.subject.name();
        let Settled { settings, is_own_limit, own, opening, side_files, notes: notes_on_question } = settled;
        let mut auditor = TrackAuditor::new(settings.clone())?.with_interruption(monitor.interruption().clone());
        if request.options.plan.is_some() {
            auditor = auditor.with_plan();
        }
        if is_own_limit {
            auditor = auditor.with_own_limit();
        }
        if request.html.is_some() {
            auditor = auditor.with_smallest();
        }
        let mut instants = request.html.as_ref().map(|_| Instants::default());
        let Opening { mut recording, mut items, mut more } = opening;
        let is_planar = recording.is_planar();
        let level = places::refuse_unknown(request, self.asked_by(), &settings, recording.as_ref())?;
        request.refuse_guessed_seconds(&settings, recording.clock(), &items)?;
        let mut plan_auditor = request.plan_auditor(recording.as_ref(), &settings, monitor)?;
        monitor.begin(&called, None);
        let (mut curves, mut span) = (true, ItemSpan::default());
        loop {
            level.check(&called, recording.vehicles(), &items)?;
            curves &= items.iter().all(|item| matches!(item, Item::Piece(_)));
            span.add(&items);
            let failed = |error| Failure::from(error).of(Path::new(&called));
            auditor.push(recording.vehicles(), &items).map_err(failed)?;
            if let Some(auditor) = &mut plan_auditor {
                auditor.push_flights(recording.vehicles(), &items).map_err(failed)?;
            }
            if let Some(instants) = &mut instants {
                instants.note(&items, recording.vehicles(), &settings);
            }
            monitor.advance(items.len() as u64);
            if !more {
                break;
            }
            items.clear();
            more = read_until(recording.as_mut(), &mut items, 1, monitor)?;
        }
        monitor.finish();
        let clock = recording.clock();
        let clock = Clock { unit: clock.unit.to_owned(), inferred: clock.inferred, epoch_ns: clock.epoch_ns };
        let outcome = auditor.finish().map_err(|error| Failure::from(error).of(Path::new(&called)))?;
        let mut facts = recording.facts().to_vec();
        if clock.inferred && facts.iter().all(|fact| fact.kind != FactKind::TimeUnit) {
            facts.push(Fact::name(FactKind::TimeUnit, FactSource::Inferred, &clock.unit));
        }
        let plan_auditor = plan_auditor.filter(|_| outcome.separation.is_some());
        let plans = plan_auditor.map(|auditor| request.judge_plans(recording.as_ref(), auditor)).transpose()?;
        let notes = recording.notes().to_vec();
        request.check_count(&outcome, &settings)?;
        side_files.check(&settings, &outcome)?;
        side_files::check_offsets(&settings, &outcome, span.length_s())?;
        facts.extend(side_files.facts(&settings, &outcome));
        let source = Source { recording: called, clock, planar: is_planar, notes, facts };
        Ok(JudgedRecording { settings, own, outcome, plans, source, notes_on_question, curves, instants })
    }

    /// Answers the question: by the samples or by the run's own audit, against a plan, with an early end.
    fn answer(
        &self,
        judged: &mut JudgedRecording,
        monitor: &dyn Monitor,
    ) -> Result<(RecordedReport, Option<Figure>), Failure> {
        let request = &self.request;
        let open: &Open<'_> = &|| request.subject.open();
        let JudgedRecording { settings, own, outcome, plans, source, notes_on_question, curves, .. } = judged;
        let (settings, own) = (&*settings, own.as_ref());
        let answer = own.map(|own| own.answer(outcome, settings, request, &mut source.notes));
        let is_by_run = answer == Some(RunAnswer::Repeated);
        let holds_every_step = own.is_some_and(OwnRecording::holds_every_step);
        source.notes.append(notes_on_question);
        source.notes.extend(notes_on_alone(outcome));
        source.notes.extend(self.asked_by.clone());
        tell(monitor, &source.notes);
        let is_unaltered = own.is_some_and(OwnRecording::is_unaltered);
        let motion = [*curves, holds_every_step, is_by_run, is_unaltered];
        source.facts.extend(request.facts(settings, motion, outcome, self.asked_by()));
        let flight = AuditedFlight {
            open,
            name: request.subject.name(),
            settings,
            outcome,
            epoch_ns: source.clock.epoch_ns,
            is_planar: source.planar,
        };
        let tie = decimal_tie(open, settings, outcome, monitor)?;
        let compared = against_plan::compare(&request.options, &flight, monitor)?;
        let report = RecordedReport::new(outcome, settings, source.clone());
        let report = plans.iter().fold(report, RecordedReport::with_published_plans);
        let (mut report, plan_figure) = against_plan::attach(report, compared, is_by_run, monitor);
        if let Some(RunAnswer::Undecided(why)) = answer {
            report.run_objection = Some(why);
        }
        // An early end of the flight does not affect a window that ends before it.
        let is_beyond = |to_s: f64| outcome.span_s.is_none_or(|(_, end_s)| to_s > end_s);
        let early_end = own.and_then(|own| own.early_end.clone());
        let early_end = early_end.filter(|_| settings.until_s.is_none_or(is_beyond));
        let mut report = early_end.into_iter().fold(report, RecordedReport::with_early_end);
        report.is_decimal_tie = tie.is_some();
        let late: Vec<_> = tie.into_iter().chain(report.shortened()).collect();
        tell(monitor, &late);
        report.source.notes.extend(late);
        Ok((report, plan_figure))
    }

    /// Writes the page, its figures and the proof that the request asks for.
    fn write(
        &self,
        judged: JudgedRecording,
        report: &RecordedReport,
        plan_figure: Option<Figure>,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let request = &self.request;
        let open: &Open<'_> = &|| request.subject.open();
        let JudgedRecording { settings, own, outcome, instants, .. } = judged;
        if let Some((html, instants)) = request.html.as_ref().zip(instants) {
            let (replay, mut figures) = replays::of_recording(open, monitor, &settings, &outcome, report, instants)?;
            figures.extend(plan_figure);
            write_atomically(html, report.to_html(&replay, &figures, &request.command).as_bytes())?;
            let mut written = html.display().to_string();
            if !request.formats.is_empty() {
                let folder = figures_beside(html);
                let names = figures::NAMES_OF_AUDIT.iter();
                let names = names.flat_map(|name| FigureFormat::ALL.map(|of| format!("{name}.{}", of.name())));
                let files = figure_files(&figures, &request.formats);
                write_files(&folder, &names.collect::<Vec<_>>(), &files)?;
                let count = counted(files.len() as u64, "figure", "figures");
                let _ = write!(written, " and {count} in {}", folder.display());
            }
            monitor.say(&format!("wrote {written}"));
        }
        if let Some(file) = &request.proof {
            let (recording, clock) = (&report.source.recording, &report.source.clock);
            let judged = (&settings, own.as_ref(), &outcome, report.is_decimal_tie);
            let refused = proof::write(file, request, recording, judged, clock)?;
            match refused {
                Some(why) => tell(monitor, &[why]),
                None => monitor.say(&format!("wrote {}", file.display())),
            }
        }
        Ok(())
    }
}

/// Passes notes to the monitor.
fn tell(monitor: &dyn Monitor, notes: &[String]) {
    for note in notes {
        monitor.warn(&format!("note: {note}"));
    }
}

/// Returns whether the settings limit no distance of vehicles.
fn is_silent(settings: &Settings) -> bool {
    let has_radius = settings.radius_m.is_some() || settings.vehicles.values().any(|one| one.radius_m.is_some());
    let has_shape = settings.ellipsoid_m.is_some() || settings.cylinder.is_some();
    settings.delta_m.is_none() && !has_radius && !has_shape
}

/// A complete question, and the first items of the recording.
struct Settled<'a> {
    settings: Settings,
    /// Whether the limits on distances are those of the recording.
    is_own_limit: bool,
    /// Limits, obstacles and audit of a flight of `tautline run`.
    own: Option<OwnRecording>,
    opening: Opening<'a>,
    side_files: SideFiles,
    /// Notes on the limits that rules and the recording add.
    notes: Vec<String>,
}

/// A recording with its first items.
struct Opening<'a> {
    recording: Box<dyn Tracks<Error = ReadError> + 'a>,
    items: Vec<Item>,
    /// Whether there are more items.
    more: bool,
}

impl<'a> Opening<'a> {
    fn read(open: &Open<'a>, monitor: &dyn Monitor) -> Result<Self, Failure> {
        let (mut recording, mut items) = (open()?, Vec::new());
        let more = read_until(recording.as_mut(), &mut items, OPENING, monitor)?;
        Ok(Self { recording, items, more })
    }

    /// Moves the paths of the first `side_obstacles` obstacles of the settings to the clock of the report.
    fn align(&self, settings: &mut Settings, side_obstacles: usize) -> Result<SideFiles, Failure> {
        let mut span = ItemSpan::default();
        span.add(&self.items);
        SideFiles::align(settings, side_obstacles, self.recording.clock().epoch_ns, span.first_s())
    }
}

/// Reads items until there are `least`, or no more. Returns whether there are more.
fn read_until(
    recording: &mut dyn Tracks<Error = ReadError>,
    items: &mut Vec<Item>,
    least: usize,
    monitor: &dyn Monitor,
) -> Result<bool, Failure> {
    loop {
        if monitor.is_interrupted() {
            return Err(Failure::interrupted());
        }
        let more = recording.read(items)?;
        if !more || items.len() >= least {
            return Ok(more);
        }
    }
}

/// Limits and obstacles that the recording states itself and the request leaves open.
struct RecordedLimits<'a> {
    delta_m: Option<f64>,
    ellipsoid_m: Option<Vector3<f64>>,
    obstacles: Option<&'a [MovingObstacle]>,
}

impl<'a> RecordedLimits<'a> {
    /// Fills the settings with the limits and obstacles of the recording.
    fn fill(settings: &mut Settings, request: &AuditRequest<'_>, own: Option<&'a OwnRecording>) -> Self {
        let is_open = request.options.is_silent() && settings.delta_m.is_none();
        let ellipsoid_m = own.and_then(|own| own.ellipsoid_m).filter(|_| is_open);
        let delta_m = own.map(|own| own.limit_m).filter(|_| is_open && ellipsoid_m.is_none());
        settings.delta_m = settings.delta_m.or(delta_m);
        settings.ellipsoid_m = settings.ellipsoid_m.or(ellipsoid_m);
        // Every sample of a `tautline run` recording contains all vehicles, so no vehicle is absent between two
        // samples.
        settings.max_gap_s = settings.max_gap_s.or(own.filter(|own| own.is_unaltered()).map(|_| f64::INFINITY));
        let is_scaled = settings.ellipsoid_m.is_some() || settings.cylinder.is_some();
        let is_asked = request.options.obstacles.is_none() && !is_scaled;
        let obstacles = own.map(|own| &own.obstacles[..]).filter(|own| is_asked && !own.is_empty());
        settings.obstacles.extend_from_slice(obstacles.unwrap_or_default());
        Self { delta_m, ellipsoid_m, obstacles }
    }

    /// Returns notes on the flight of a `tautline run` recording, and on the limits that it states.
    fn notes(&self, request: &AuditRequest<'_>, own: Option<&OwnRecording>) -> Vec<String> {
        let mut notes: Vec<String> = own.and_then(OwnRecording::note_on_law).into_iter().collect();
        notes.extend(self.delta_m.map(|m| format!("the safety distance is the recording's own, {m:?} m")));
        notes.extend(self.ellipsoid_m.map(|axes| {
            let (x, y, z) = (axes.x, axes.y, axes.z);
            format!("the ellipsoid is the recording's own, with half axes of {x:?}, {y:?} and {z:?} m")
        }));
        if self.obstacles.is_none() && own.is_some_and(|own| !own.obstacles.is_empty()) {
            let why = if request.options.obstacles.is_some() {
                format!("{OBSTACLES} names others")
            } else {
                "obstacles are not judged with ellipsoids or cylinders".to_owned()
            };
            notes.push(format!("the obstacles of the recording are not judged: {why}"));
        }
        notes.extend(self.obstacles.map(|obstacles| {
            let names: Vec<_> = obstacles.iter().map(|obstacle| obstacle.name.as_str()).collect();
            format!("the obstacles are the recording's own: {}", names.join(", "))
        }));
        notes
    }
}

/// Relative depth of a violation below which the written decimals may be at the limit.
const JUST_BELOW: f64 = 1e-9;

/// Returns a note if the deepest violation is one of the doubles only: the decimals of the two positions are exactly at
/// the limit. Reads the recording again if the depth is that of rounding.
fn decimal_tie(
    open: &Open<'_>,
    settings: &Settings,
    outcome: &Outcome,
    monitor: &dyn Monitor,
) -> Result<Option<String>, Failure> {
    let deepest = outcome.violations.iter().min_by(|a, b| (a.min_m - a.limit_m).total_cmp(&(b.min_m - b.limit_m)));
    let is_in_metres = settings.ellipsoid_m.is_none() && settings.cylinder.is_none();
    let is_just_below = |found: &&Violation<ObjectPair>| found.limit_m - found.min_m <= JUST_BELOW * found.limit_m;
    let Some(deepest) = deepest.filter(is_just_below).filter(|one| is_in_metres && one.pair.vehicles().is_some())
    else {
        return Ok(None);
    };
    let mut series = PairSeries::new(settings, outcome, deepest.pair)?;
    let (mut recording, mut more) = (open()?, true);
    while more {
        let mut items = Vec::new();
        more = read_until(recording.as_mut(), &mut items, 1, monitor)?;
        series.push(&items)?;
    }
    let closest = series.finish().into_iter().min_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    let is_tie = closest.is_some_and(|PairSample { positions_m: [first, second], .. }| {
        are_decimals_apart(first, second, deepest.limit_m)
    });
    let [first, second] = outcome.names(deepest.pair, &settings.obstacles);
    let (limit_m, min_m) = (deepest.limit_m, deepest.min_m);
    Ok(is_tie.then(|| {
        format!(
            "the decimals of {first} and {second} are exactly {limit_m:?} m apart, and the doubles nearest to them \
             are closer; a limit of {min_m:?} m accepts them"
        )
    }))
}

/// Returns notes on vehicles that are never present together with another one.
fn notes_on_alone(outcome: &Outcome) -> impl Iterator<Item = String> {
    outcome.alone.iter().take(MOST_ALONE).filter_map(|&vehicle| {
        let Presence { from_s, to_s } = outcome.presence[vehicle]?;
        let name = outcome.name(vehicle);
        Some(format!(
            "{name}, present from {from_s:?} s to {to_s:?} s, is never present with another and is not judged \
             ({} corrects a clock)",
            OFFSET.set(format!("{name}=SECONDS"))
        ))
    })
}

/// A recording after its audit.
struct JudgedRecording {
    settings: Settings,
    own: Option<OwnRecording>,
    outcome: Outcome,
    /// Findings between published plans, if the recording has plans.
    plans: Option<PlansOutcome>,
    source: Source,
    notes_on_question: Vec<String>,
    /// Whether the recording has curves instead of samples.
    curves: bool,
    /// Instants of the replay, if a page is asked for.
    instants: Option<Instants>,
}

/// Returns the folder of the figures of a page.
fn figures_beside(html: &Path) -> PathBuf {
    let stem = html.file_stem().unwrap_or_default().to_string_lossy();
    html.with_file_name(format!("{stem}-figures"))
}
