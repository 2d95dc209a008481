//! `audit_files`: judges a recording of any origin.

mod against_plan;
mod config;
mod own;
mod places;
mod proof;
mod replays;
pub mod rules;
mod toml_file;
mod venue_file;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

pub use against_plan::PlanQuestion;
pub use own::{OwnRecording, run_audit};
pub use rules::Rules;

use self::against_plan::AuditedFlight;
use self::own::RunAnswer;
use super::run::{figure_files, write_files};
use super::{Failure, Monitor, RECORDING, outputs};
use crate::figures::{self, Format as FigureFormat};
use crate::report::recorded::{AssumedMotion, Basis, Clock, RecordedReport, Source};
use crate::report::{Status, write_atomically};
use replays::Instants;
use tautline_audit::Obstacle;
use tautline_audit::recorded::{
    Interpolation, Outcome, Presence, RecordedError, Settings, TrackAuditor, VehicleSettings,
};
use tautline_core::text::counted;
use tautline_core::track::{Item, Tracks};
use tautline_recordings::read::{self, Format, ReadError, ReadOptions, ShowRules};

/// Number of items that are read before the first is judged. They determine the usual sampling intervals.
const OPENING: usize = 65_536;

/// Largest number of notes on vehicles that are never present together with another vehicle.
const MOST_ALONE: usize = 3;

/// Speed of sound \[m/s\], which no vehicle of a swarm reaches.
const FASTEST_M_S: f64 = 340.0;

/// Function that opens the recording at its beginning, at each call.
pub type Open<'a> = dyn Fn() -> Result<Box<dyn Tracks<Error = ReadError> + 'a>, ReadError> + Sync + 'a;

/// The recording of a request.
#[derive(Clone)]
pub enum Subject<'a> {
    /// Files or folders. Several paths are one recording, each with a vehicle of its own.
    Files {
        /// Paths, at least one.
        paths: Vec<PathBuf>,
        /// Options of the readers.
        options: Box<ReadOptions>,
    },
    /// Motion in the memory of the caller.
    InMemory {
        /// Name of the motion in messages.
        name: &'a str,
        /// Limits, obstacles and audit of a flight of `tautline run`.
        own: Option<&'a OwnRecording>,
        /// Function that opens the motion.
        open: &'a Open<'a>,
    },
}

impl Subject<'_> {
    /// Returns the name of the recording in messages.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Files { paths, .. } => read::recording_name(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>()),
            Self::InMemory { name, .. } => (*name).to_owned(),
        }
    }

    /// Opens the recording at its beginning.
    ///
    /// # Errors
    /// [`ReadError`] if the recording cannot be read.
    pub fn open(&self) -> Result<Box<dyn Tracks<Error = ReadError> + '_>, ReadError> {
        match self {
            Self::Files { paths, options } => open(paths, options).map(|recording| recording as _),
            Self::InMemory { open, .. } => open(),
        }
    }

    /// Returns the path and the options if the recording is a single file.
    fn only_file(&self) -> Option<(&Path, &ReadOptions)> {
        match self {
            Self::Files { paths, options } => match &paths[..] {
                [path] => Some((path, options)),
                _ => None,
            },
            Self::InMemory { .. } => None,
        }
    }

    fn paths(&self) -> &[PathBuf] {
        match self {
            Self::Files { paths, .. } => paths,
            Self::InMemory { .. } => &[],
        }
    }

    /// Returns limits, obstacles and audit of a `tautline run` recording, and the rules of a show file.
    fn own(&self, monitor: &dyn Monitor) -> Result<(Option<OwnRecording>, Option<ShowRules>), Failure> {
        match self {
            Self::InMemory { own, .. } => Ok((own.cloned(), None)),
            Self::Files { paths, options } => {
                let show = match paths.first() {
                    Some(path) => read::show_rules(path, options).map_err(|error| Failure::from(error).of(path))?,
                    None => None,
                };
                Ok((own_recording(paths, options, monitor)?, show))
            }
        }
    }
}

/// Returns the folder of the figures of a page.
fn figures_beside(html: &Path) -> PathBuf {
    let stem = html.file_stem().unwrap_or_default().to_string_lossy();
    html.with_file_name(format!("{stem}-figures"))
}

/// Opens files or folders as one recording.
///
/// # Errors
/// [`ReadError`] if one of them cannot be read.
pub fn open(paths: &[PathBuf], options: &ReadOptions) -> Result<read::Recording, ReadError> {
    match paths {
        [path] => read::open(&recording_in(path), options),
        paths => read::open_joined(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>(), options),
    }
}

/// Returns the recording in the folder of a run, and any other path unchanged.
#[must_use]
pub fn recording_in(path: &Path) -> PathBuf {
    let recorded = path.join(RECORDING);
    if recorded.is_file() { recorded } else { path.to_owned() }
}

/// Returns the contents of a recording of `tautline run` besides positions; `None` for any other recording.
///
/// # Errors
/// [`Failure`] if its scenario cannot be read.
pub fn own_recording(
    paths: &[PathBuf],
    options: &ReadOptions,
    monitor: &dyn Monitor,
) -> Result<Option<OwnRecording>, Failure> {
    match paths {
        [path] if options.format.is_none_or(|format| format == Format::MCAP) => {
            OwnRecording::read(path, options, monitor)
        }
        _ => Ok(None),
    }
}

/// Choice of the `tautline.toml` that fills options which the request leaves open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ConfigFile {
    /// The nearest file in the recording's folder and its parents, up to the working folder.
    #[default]
    Nearest,
    /// This file.
    File(PathBuf),
    /// No file.
    None,
}

/// A recording and the question about it.
#[derive(Clone)]
pub struct AuditRequest<'a> {
    /// The recording.
    pub subject: Subject<'a>,
    /// Limits, assumed motion, window, clocks and vehicles. Obstacles and a fence from files are added to them.
    pub settings: Settings,
    /// TOML file of obstacles.
    pub obstacles: Option<PathBuf>,
    /// TOML file of a fence.
    pub fence: Option<PathBuf>,
    /// Plan that the recording is compared with.
    pub plan: Option<PlanQuestion>,
    /// Origin of limits that the request leaves open.
    pub rules: Rules,
    /// Number of vehicles that must be present.
    pub expect_vehicles: Option<usize>,
    /// Whether the samples of a recording of `tautline run` are judged without the run's audit.
    pub independent: bool,
    /// Whether an undecided verdict counts as good.
    pub allow_undecided: bool,
    /// Whether the motion is exported for drones, so that a wrong unit of time changes its speed.
    pub for_drones: bool,
    /// Choice of the `tautline.toml`. Motion in memory has no nearest file.
    pub config: ConfigFile,
    /// Command or expression that repeats the audit, for the page.
    pub command: String,
    /// Path of the page with figures.
    pub html: Option<PathBuf>,
    /// Formats of the files of figures, in the folder `NAME-figures` beside the page `NAME.html`.
    pub formats: Vec<FigureFormat>,
    /// Path of the proof, which `check_proof.py` confirms. Available for one CSV table and a safety distance alone.
    pub proof: Option<PathBuf>,
}

impl<'a> AuditRequest<'a> {
    /// Returns a request without limits.
    #[must_use]
    pub fn new(subject: Subject<'a>) -> Self {
        Self {
            subject,
            settings: Settings::default(),
            obstacles: None,
            fence: None,
            plan: None,
            rules: Rules::default(),
            expect_vehicles: None,
            independent: false,
            allow_undecided: false,
            for_drones: false,
            config: ConfigFile::default(),
            command: String::new(),
            html: None,
            formats: Vec::new(),
            proof: None,
        }
    }
}

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
/// use tautline_audit::recorded::Settings;
/// use tautline_report::request::{AuditRequest, Silent, Subject, audit_files};
///
/// # let folder = std::env::temp_dir().join(format!("tautline-audit-files-{}", std::process::id()));
/// # fs::create_dir_all(&folder)?;
/// # let path = folder.join("two.csv");
/// fs::write(&path, "t,id,x,y,z\n0,a,0,0,0\n0,b,3,0,0\n1,a,0,1,0\n1,b,3,1,0\n")?;
/// let subject = Subject::Files { paths: vec![path], options: Box::default() };
/// let request = AuditRequest { settings: Settings::delta(2.0), ..AuditRequest::new(subject) };
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

impl<'a> AuditRequest<'a> {
    /// Fills options that are left open from the `tautline.toml`.
    ///
    /// # Errors
    /// [`Failure`] if that file is wrong.
    pub fn configured(&self) -> Result<ConfiguredAudit<'a>, Failure> {
        let mut request = self.clone();
        if let Subject::Files { paths, .. } = &mut request.subject {
            for path in paths {
                *path = recording_in(path);
            }
        }
        config::configured(request)
    }

    /// Rejects outputs of the request and `more` outputs of the caller that would overwrite an input or each other.
    ///
    /// # Errors
    /// [`Failure`] that names both files.
    pub fn check_outputs(&self, more: &[outputs::NamedPath<'_>]) -> Result<(), Failure> {
        let Self { subject, obstacles, fence, plan, html, proof, .. } = self;
        let settings = config::file_of(self);
        let mut inputs: Vec<_> = subject.paths().iter().map(|path| ("the recording", path.as_path())).collect();
        inputs.extend(obstacles.as_deref().map(|path| ("the file of obstacles", path)));
        inputs.extend(settings.as_deref().map(|path| ("the file of settings", path)));
        inputs.extend(fence.as_deref().map(|path| ("the file of the fence", path)));
        inputs.extend(plan.as_ref().map(|plan| ("the plan", plan.path.as_path())));
        let own = [("--html", html), ("--proof", proof)];
        let own = own.into_iter().filter_map(|(option, path)| Some((option, path.as_deref()?)));
        outputs::check(&inputs, &more.iter().copied().chain(own).collect::<Vec<_>>())
    }

    /// Returns whether a radius is given, for all vehicles or for one.
    fn has_radius(&self) -> bool {
        self.settings.radius_m.is_some() || self.settings.vehicles.values().any(|of| of.radius_m.is_some())
    }

    /// Returns whether a largest acceleration is given, for all vehicles or for one.
    fn has_max_accel(&self) -> bool {
        self.settings.max_accel_m_s2.is_some() || self.settings.vehicles.values().any(|of| of.max_accel_m_s2.is_some())
    }

    /// Returns whether no limit on distances is given.
    fn is_silent(&self) -> bool {
        let settings = &self.settings;
        let has_shape = settings.ellipsoid_m.is_some() || settings.cylinder.is_some();
        settings.delta_m.is_none() && !self.has_radius() && !has_shape
    }

    /// Returns the settings with the obstacles and the fence of the files.
    fn complete_settings(&self) -> Result<Settings, Failure> {
        if self.has_max_accel() && self.settings.motion != Some(Interpolation::Bounded) {
            return Err(Failure::input(
                "audit/unused-acceleration",
                "--max-accel has no effect without --motion bounded",
                "add --motion bounded, or leave --max-accel out",
            ));
        }
        if self.settings.ellipsoid_m.is_some() && self.has_radius() {
            return Err(Failure::input(
                "audit/radius-and-ellipsoid",
                "--radius and --ellipsoid are both given",
                "an ellipsoid has its own size: leave one of them out",
            ));
        }
        let jumps = self.settings.motion.filter(|of| matches!(of, Interpolation::Hold | Interpolation::Bounded));
        if let Some(motion) = jumps.filter(|_| self.settings.well_clear.is_some()) {
            let error = RecordedError::WellClearMotion { motion: motion.name() };
            let help = "give --motion linear, or leave --motion out";
            return Err(Failure::input("audit/well-clear", format!("--{error}"), help));
        }
        if self.settings.only.as_ref().is_some_and(BTreeSet::is_empty) {
            let help = "name at least one vehicle, or leave --ids out to judge all";
            return Err(Failure::input("audit/nothing-to-judge", "--ids names no vehicle", help));
        }
        let limits = &self.settings.envelope.limits;
        for (k, limit) in limits.iter().enumerate() {
            if limits[..k].iter().any(|before| before.quantity == limit.quantity) {
                let message = format!("--limit {} is given twice", limit.quantity.name());
                return Err(Failure::input("audit/limit-twice", message, "give each limit once"));
            }
        }
        self.plan.as_ref().map_or(Ok(()), PlanQuestion::check)?;
        let mut settings = self.settings.clone();
        settings.has_plan = self.plan.is_some();
        settings.obstacles.extend(self.obstacles.as_deref().map_or(Ok(Vec::new()), venue_file::read_obstacles)?);
        if let Some(fence) = self.fence.as_deref() {
            settings.envelope.fence = Some(venue_file::read_fence(fence)?);
        }
        Ok(settings)
    }

    /// Returns the settings with the limits and obstacles of the files and of the recording.
    ///
    /// # Errors
    /// [`Failure`] if the request or a file is wrong, or the recording cannot be read.
    pub fn settings_with_limits(&self, monitor: &dyn Monitor) -> Result<Settings, Failure> {
        let mut settings = self.complete_settings()?;
        let (own, show) = self.subject.own(monitor)?;
        rules::fill(&mut settings, self, show.as_ref())?;
        RecordedLimits::fill(&mut settings, self, own.as_ref());
        Ok(settings)
    }

    /// Rejects a single vehicle without other limits, and a number of vehicles other than the expected one.
    fn check_count(&self, outcome: &Outcome, settings: &Settings) -> Result<(), Failure> {
        let path = self.subject.name();
        let judged = outcome.presence.iter().flatten().count();
        if let Some(expected) = self.expect_vehicles
            && judged != expected
        {
            let message = format!("{path}: {} to judge, not {expected}", counted(judged as u64, "vehicle", "vehicles"));
            return Err(Failure::input(
                "audit/vehicle-count",
                message,
                "look for missing or additional vehicles, or give another --expect-vehicles",
            ));
        }
        let asked =
            outcome.vehicles.iter().filter(|&name| settings.only.as_ref().is_none_or(|only| only.contains(name)));
        let asked = asked.count();
        if asked < 2 && settings.obstacles.is_empty() && settings.envelope.is_empty() && !settings.has_plan {
            let message =
                format!("{path}: {} to judge, but no second object", counted(asked as u64, "vehicle", "vehicles"));
            let help = "judge two vehicles or more (--ids, --frame, --column id=NAME select them), or --obstacles, \
                 --limit, --fence";
            return Err(Failure::input("audit/nothing-to-judge", message, help));
        }
        if judged == 0 && (self.settings.from_s.is_some() || self.settings.to_s.is_some()) {
            let message = format!("{path}: no vehicle is present between --from and --to");
            return Err(Failure::input(
                "audit/empty-window",
                message,
                "give a window in which the recording has vehicles",
            ));
        }
        Ok(())
    }

    /// Rejects options in seconds if the unit of time is a guess. Seconds are accepted if the unit milliseconds would
    /// make the vehicles of these first items faster than sound.
    fn refuse_guessed_seconds(&self, unit: &str, items: &[Item]) -> Result<(), Failure> {
        let settings = &self.settings;
        let asked = [
            (self.for_drones, "export --to"),
            (settings.motion == Some(Interpolation::Bounded), "--motion bounded"),
            (settings.from_s.is_some(), "--from"),
            (settings.to_s.is_some(), "--to"),
            (settings.max_gap_s.is_some(), "--max-gap"),
            (settings.vehicles.values().any(|of| of.offset_s != 0.0), "--offset"),
            (settings.envelope.limits.iter().any(|limit| limit.quantity.unit() != "m"), "--limit"),
            (settings.has_plan || self.plan.is_some(), "--plan"),
        ];
        let Some((_, option)) = asked.into_iter().find(|(is_asked, _)| *is_asked) else { return Ok(()) };
        let path = self.subject.name();
        if unit != "s" {
            let message = format!(
                "{path}: the unit of time {unit} is inferred from the steps of whole numbers only, and {option} \
                 depends on it"
            );
            return Err(Failure::input(
                "audit/guessed-time-unit",
                message,
                format!("give --time-unit {unit}, or --time-unit s"),
            ));
        }
        if 1000.0 * fastest_m_s(items) > FASTEST_M_S {
            return Ok(());
        }
        let message =
            format!("{path}: by their steps the times may be in seconds or milliseconds, and {option} depends on it");
        Err(Failure::input("audit/guessed-time-unit", message, "give --time-unit s, or --time-unit ms"))
    }

    /// Returns the motion between samples, for a recording of curves or of `tautline run`. Nothing is proved if the
    /// samples themselves are assumed.
    fn assumed_motion(
        &self,
        curves: bool,
        holds_every_step: bool,
        answer: &RunAnswer,
        assumed: Option<&str>,
    ) -> AssumedMotion {
        let most = || {
            let all = self.settings.max_accel_m_s2.map(|a| format!("{a:?} m/s^2"));
            let by_name =
                |(name, of): (&String, &VehicleSettings)| of.max_accel_m_s2.map(|a| format!("{a:?} m/s^2 for {name}"));
            all.into_iter().chain(self.settings.vehicles.iter().filter_map(by_name)).collect::<Vec<_>>().join(", ")
        };
        let (motion, basis) = match self.settings.motion {
            Some(Interpolation::Hold) => ("held between samples, jumps swept".to_owned(), Basis::Assumed),
            Some(Interpolation::Bounded) => (format!("accelerations of at most {}", most()), Basis::Bounded),
            _ if curves => ("on the recording's curves".to_owned(), Basis::Recorded),
            _ if *answer == RunAnswer::Repeated => ("by the run's audit of every step".to_owned(), Basis::Run),
            _ if holds_every_step => ("on every step of the run".to_owned(), Basis::Recorded),
            _ => ("straight between samples".to_owned(), Basis::Assumed),
        };
        match assumed {
            Some(assumed) => AssumedMotion { motion: format!("{motion}, {assumed}"), basis: Basis::Assumed },
            None => AssumedMotion { motion, basis },
        }
    }
}

impl ConfiguredAudit<'_> {
    /// A note on the file of settings that was used.
    #[must_use]
    pub fn asked_by(&self) -> Option<&str> {
        self.asked_by.as_deref()
    }

    /// Refuses outputs of the request, and `more` of the caller, that would overwrite an input or each other.
    ///
    /// # Errors
    /// [`Failure`] that names both.
    pub fn check_outputs(&self, more: &[outputs::NamedPath<'_>]) -> Result<(), Failure> {
        self.request.check_outputs(more)
    }

    /// Judges the recording.
    ///
    /// # Errors
    /// As [`audit_files`].
    pub fn judge(&self, monitor: &dyn Monitor) -> Result<AuditedRecording, Failure> {
        let request = &self.request;
        let mut settings = request.complete_settings()?;
        let (own, show) = request.subject.own(monitor)?;
        let open: &Open<'_> = &|| request.subject.open();
        let own = if request.independent { own.map(OwnRecording::independent) } else { own };
        let notes_on_rules = rules::fill(&mut settings, request, show.as_ref())?;
        let taken = RecordedLimits::fill(&mut settings, request, own.as_ref());
        proof::check(request, &settings)?;
        let mut auditor = TrackAuditor::new(settings.clone())?;
        if request.html.is_some() {
            auditor = auditor.with_smallest();
        }
        auditor = auditor.with_interruption(monitor.interruption().clone());
        let mut instants = request.html.as_ref().map(|_| Instants::default());
        let JudgedRecording { mut outcome, clock, mut notes, assumed, curves, is_planar } =
            self.judged(auditor, &settings, open, monitor, &mut |items, names| {
                if let Some(instants) = &mut instants {
                    instants.note(items, names, &settings);
                }
            })?;
        request.check_count(&outcome, &settings)?;
        let answer = own.as_ref().map(|own| own.answer(&mut outcome, &settings, request, &mut notes));
        let answer = answer.unwrap_or(RunAnswer::Samples);
        let holds_every_step = own.as_ref().is_some_and(OwnRecording::holds_every_step);
        let between = request.assumed_motion(curves, holds_every_step, &answer, assumed.as_deref());
        notes.extend(notes_on_rules);
        notes.extend(taken.notes(request, own.as_ref()));
        notes.extend(notes_on_alone(&outcome));
        notes.extend(self.asked_by.clone());
        for note in &notes {
            monitor.warn(&format!("note: {note}"));
        }
        let source = Source { recording: request.subject.name(), clock, planar: is_planar, notes };
        let flight = AuditedFlight {
            open,
            name: request.subject.name(),
            settings: &settings,
            outcome: &outcome,
            epoch_ns: source.clock.epoch_ns,
            is_planar,
        };
        let compared = request.plan.as_ref().map(|plan| against_plan::compare(plan, &flight, monitor)).transpose()?;
        let early_end = own.as_ref().and_then(|own| own.early_end.clone());
        // An early end of the flight does not affect a window that ends before it.
        let is_beyond = |to_s: f64| outcome.span_s.is_none_or(|(_, end_s)| to_s > end_s);
        let early_end = early_end.filter(|_| settings.to_s.is_none_or(is_beyond));
        let is_by_run = between.basis == Basis::Run;
        let report = RecordedReport::new(&outcome, &settings, source, between);
        let (mut report, plan_figure) = against_plan::attach(report, compared, is_by_run, monitor);
        if let RunAnswer::Undecided(why) = answer {
            report.run_objection = Some(why);
        }
        let mut report = early_end.into_iter().fold(report, RecordedReport::with_early_end);
        let shortened = report.shortened();
        for note in &shortened {
            monitor.warn(&format!("note: {note}"));
        }
        report.source.notes.extend(shortened);

        // Print the verdict before writing files, so that a write error does not hide it.
        monitor.say(&format!("{}\n{}", report.headline(), report.text()));
        if let Some((html, instants)) = request.html.as_ref().zip(instants) {
            let (replay, mut figures) = replays::of_recording(open, monitor, &settings, &outcome, &report, instants)?;
            figures.extend(plan_figure);
            write_atomically(html, report.to_html(&replay, &figures, &request.command).as_bytes())?;
            if !request.formats.is_empty() {
                let folder = figures_beside(html);
                let names = figures::NAMES_OF_AUDIT.iter();
                let names = names.flat_map(|name| FigureFormat::ALL.map(|of| format!("{name}.{}", of.name())));
                write_files(&folder, &names.collect::<Vec<_>>(), &figure_files(&figures, &request.formats))?;
            }
        }
        if let Some((file, (path, _))) = request.proof.as_ref().zip(request.subject.only_file()) {
            let recording = &report.source.recording;
            let refused = proof::write(file, path, recording, (&settings, &outcome), &report.source.clock, open)?;
            if let Some(why) = refused {
                monitor.warn(&format!("note: {why}"));
            }
        }
        Ok(AuditedRecording { report, allows_undecided: request.allow_undecided, asked_by: self.asked_by.clone() })
    }

    /// Reads and judges all items.
    fn judged(
        &self,
        mut auditor: TrackAuditor,
        settings: &Settings,
        open: &Open<'_>,
        monitor: &dyn Monitor,
        note: &mut dyn FnMut(&[Item], &[String]),
    ) -> Result<JudgedRecording, Failure> {
        let called = self.request.subject.name();
        let mut recording = open()?;
        let is_planar = recording.is_planar();
        let level = places::refuse_unknown(&self.request, self.asked_by(), settings, recording.as_ref())?;
        monitor.begin(&called, None);
        let mut items = Vec::new();
        let (mut more, mut first, mut curves) = (true, true, true);
        while more {
            if monitor.is_interrupted() {
                return Err(Failure::interrupted());
            }
            items.clear();
            while more && (items.is_empty() || (first && items.len() < OPENING)) {
                more = recording.read(&mut items)?;
            }
            if first && recording.clock().by_steps {
                self.request.refuse_guessed_seconds(recording.clock().unit, &items)?;
            }
            first = false;
            level.check(&called, recording.vehicles(), &items)?;
            curves &= items.iter().all(|item| matches!(item, Item::Piece(_)));
            auditor.push(recording.vehicles(), &items).map_err(|error| Failure::from(error).of(Path::new(&called)))?;
            note(&items, recording.vehicles());
            monitor.advance(items.len() as u64);
        }
        monitor.finish();
        let clock = recording.clock();
        let clock = Clock { unit: clock.unit.to_owned(), inferred: clock.inferred, epoch_ns: clock.epoch_ns };
        let outcome = auditor.finish().map_err(|error| Failure::from(error).of(Path::new(&called)))?;
        let (notes, assumed) = (recording.notes().to_vec(), recording.assumed().map(str::to_owned));
        Ok(JudgedRecording { outcome, clock, notes, assumed, curves, is_planar })
    }
}

/// Limits and obstacles that the recording states itself and the request leaves open.
struct RecordedLimits<'a> {
    delta_m: Option<f64>,
    ellipsoid_m: Option<Vector3<f64>>,
    obstacles: Option<&'a [Obstacle]>,
}

impl<'a> RecordedLimits<'a> {
    /// Fills the settings with the limits and obstacles of the recording.
    fn fill(settings: &mut Settings, request: &AuditRequest<'_>, own: Option<&'a OwnRecording>) -> Self {
        let is_silent = request.is_silent();
        let is_open = is_silent && settings.delta_m.is_none();
        let ellipsoid_m = own.and_then(|own| own.ellipsoid_m).filter(|_| is_open);
        let delta_m = own.map(|own| own.limit_m).filter(|_| is_open && ellipsoid_m.is_none());
        settings.delta_m = settings.delta_m.or(delta_m);
        settings.ellipsoid_m = settings.ellipsoid_m.or(ellipsoid_m);
        settings.is_own_limit = is_silent && request.obstacles.is_none();
        // Every sample of a `tautline run` recording contains all vehicles, so no vehicle is absent between two
        // samples.
        settings.max_gap_s = settings.max_gap_s.or(own.filter(|own| own.is_unaltered()).map(|_| f64::INFINITY));
        let is_scaled = settings.ellipsoid_m.is_some() || settings.cylinder.is_some();
        let is_asked = request.obstacles.is_none() && !is_scaled;
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
            let why = if request.obstacles.is_some() {
                "--obstacles names others"
            } else {
                "obstacles are not judged with ellipsoids or cylinders"
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

/// Returns notes on vehicles that are never present together with another one.
fn notes_on_alone(outcome: &Outcome) -> impl Iterator<Item = String> {
    outcome.alone.iter().take(MOST_ALONE).filter_map(|&vehicle| {
        let Presence { from_s, to_s } = outcome.presence[vehicle]?;
        let name = outcome.name(vehicle);
        Some(format!(
            "{name}, present from {from_s:?} s to {to_s:?} s, is never present with another and is not judged \
             (--offset {name}=SECONDS corrects a clock)"
        ))
    })
}

/// A recording after its audit.
struct JudgedRecording {
    outcome: Outcome,
    clock: Clock,
    notes: Vec<String>,
    /// Assumption about the samples themselves.
    assumed: Option<String>,
    /// Whether the recording has curves instead of samples.
    curves: bool,
    /// Whether the height of a vehicle is unknown.
    is_planar: bool,
}

/// Returns the largest speed of a vehicle between two samples \[m/s\]; 0 for curves.
fn fastest_m_s(items: &[Item]) -> f64 {
    let mut last: BTreeMap<usize, (f64, Vector3<f64>)> = BTreeMap::new();
    let samples = items.iter().filter_map(|item| match item {
        Item::Sample(sample) => Some((sample.vehicle, (sample.time_s, sample.position_m))),
        Item::Piece(_) => None,
    });
    let speeds = samples.filter_map(|(vehicle, (time_s, position_m))| {
        let (before_s, before_m) = last.insert(vehicle, (time_s, position_m))?;
        Some((position_m - before_m).norm() / (time_s - before_s))
    });
    speeds.fold(0.0, f64::max)
}
