//! `run_into`: flies a scenario and writes its recording, report, figures and pictures.

use std::fs::{self, File};
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use rayon::ThreadPool;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::audit::run_audit;
use super::{Failure, Monitor, NamedPicture, OutFolder, Pictures};
use crate::figures::{self, Criteria, Figure, Format};
use crate::flight_log::FlightLog;
use crate::replay::{NoReplay, PAGE_BYTES, Replay, Stage};
use crate::report::{Report, RunPage};
use crate::run::{run_with, verify};
use tautline_audit::MovingObstacle;
use tautline_core::files::{FileError, write_atomically, write_atomically_with};
use tautline_core::option::CONTRACT_LOG;
use tautline_core::text::seconds;
use tautline_recordings::mcap::{Header, McapRecorder};
use tautline_sim::plant::FreeSteps;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;
use tautline_sim::shield::ContractLog;
use tautline_sim::sim::Components;

/// Name of the recording in the folder of a run.
pub const RECORDING: &str = "run.mcap";
/// Number of steps between two updates of the progress bar.
const PROGRESS_EVERY: u64 = 64;
/// Number of threads that a flight can use: one for the law and one for the audit.
const THREADS_OF_USE: usize = 2;

/// A scenario, with the options of its flight and its folder.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct RunRequest<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// Command that repeats the flight, for the page.
    pub command: String,
    /// Changes of keys of the scenario's file, such as `law.kind=orca`, for the page.
    pub changes: Vec<String>,
    /// Output folder; by default `out/NAME` with the name of the scenario.
    pub out: Option<PathBuf>,
    /// Whether a finished run is overwritten.
    pub force: bool,
    /// Whether figures are drawn.
    pub figures: bool,
    /// Formats of the files of figures.
    pub formats: Vec<Format>,
    /// Whether steps without possible contact leave out the engine, which makes each eighth of them for comparison.
    pub free_steps: bool,
    /// Whether the scenario is flown again at half the step.
    pub verify: bool,
    /// Number of threads; a flight uses at most two. By default the number of cores. The recording has the same
    /// bits for any number.
    pub threads: Option<usize>,
    /// File for the log of the shield's contracts, if one is written.
    pub contract_log: Option<PathBuf>,
    /// Whether all findings are printed. Otherwise the verdict, the smallest distances and the audit are printed.
    pub verbose: bool,
    /// Whether the report contains wall-clock times. Without them equal flights give equal bytes.
    pub is_timed: bool,
}

impl<'a> RunRequest<'a> {
    /// Returns a request with figures and times, into `out/NAME`.
    #[must_use]
    pub fn new(scenario: &'a Scenario, command: String) -> Self {
        let (out, threads, contract_log, formats) = (None, None, None, vec![Format::Svg]);
        Self {
            scenario,
            command,
            changes: Vec::new(),
            out,
            force: false,
            figures: true,
            formats,
            free_steps: false,
            verify: false,
            threads,
            contract_log,
            verbose: false,
            is_timed: true,
        }
    }

    /// Returns a request that overwrites its folder and writes the same bytes each time.
    #[must_use]
    pub fn reproducible(scenario: &'a Scenario, command: String, out: PathBuf) -> Self {
        Self { out: Some(out), force: true, is_timed: false, ..Self::new(scenario, command) }
    }
}

/// Result of a run beside its files.
pub struct RunFiles {
    /// Report, as in `report.json`.
    pub report: Report,
    /// History of the flight.
    pub log: Arc<FlightLog>,
    /// Pictures with their names, such as `closest`.
    pub pictures: Vec<NamedPicture>,
    /// Path of the page `report.html`.
    pub page: PathBuf,
}

/// Flies a scenario and writes its folder: `run.mcap`, `report.html`, `figures/*`, `snapshots/*.png` and
/// `report.json`. The report is written last, so a folder with a report is complete.
///
/// # Errors
/// [`Failure`] if the scenario cannot be flown, the folder holds a finished run, or a file cannot be written. The
/// recording up to then stays readable.
pub fn run_into(request: &RunRequest<'_>, pictures: &dyn Pictures, monitor: &dyn Monitor) -> Result<RunFiles, Failure> {
    let scenario = request.scenario;
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = threads(request.threads.unwrap_or_else(cores).min(THREADS_OF_USE))?;
    let preflight = Preflight::of(scenario)?;
    if preflight.refuses() {
        monitor.warn(&preflight.headline());
    }
    for warning in &preflight.warnings {
        monitor.warn(&warning.to_string());
    }
    if let Some(note) = &preflight.drift_note {
        monitor.warn(&format!("note: {note}"));
    }
    // All checks of the input precede the first write.
    if request.contract_log.is_some() && scenario.shield_limits()?.is_none() {
        let message = format!("{CONTRACT_LOG}: the scenario `{}` has no shield", scenario.name);
        return Err(Failure::input("usage/no-effect", message, "set shield.enabled=true"));
    }
    if request.contract_log.is_some() && scenario.shield.is_some_and(|shield| shield.hang_share > 0.0) {
        let message = format!("{CONTRACT_LOG}: the model has regular instants only, and shield.hang_share is above 0");
        return Err(Failure::input("usage/no-effect", message, "set shield.hang_share=0"));
    }
    let path = request.out.clone().unwrap_or_else(|| Path::new("out").join(&scenario.name));
    let folder = OutFolder::at(path, "run", "report.json");
    let _lock = folder.open(request.force)?;
    let mut log = FlightLog::of(scenario);
    let mut report = within(&threads, scenario, || {
        let mut parts = Components::of(scenario)?;
        if request.free_steps {
            parts = parts.with_free_steps(FreeSteps::Compared);
        }
        let mut flight = |parts| fly((scenario, &preflight), parts, &folder, pictures, monitor, &mut log);
        match &request.contract_log {
            None => flight(parts),
            Some(path) => write_atomically_with(path, |file| fly_logged(parts, (path, file), flight)),
        }
    })?;
    if let Some(closest) = report.closest_pair() {
        log.conclude(closest.separation_m, closest.time_s);
    }
    let log = Arc::new(log);
    report.performance = report.performance.filter(|_| request.is_timed);
    if request.verify && !report.run.is_interrupted() {
        report.verification = Some(within(&threads, scenario, || verify(scenario, &report))?);
    }
    let pictures = pictures.draw(scenario, &report, &log, folder.path(), monitor)?;
    let figures = if request.figures { figures(scenario, &log, &report) } else { Vec::new() };
    let replay = replay_of_run(scenario, &log, &report, PAGE_BYTES);
    let page = RunPage {
        scenario,
        preflight: &preflight,
        replay: &replay,
        figures: &figures,
        pictures: &pictures.iter().map(|(_, picture)| picture.clone()).collect::<Vec<_>>(),
        command: &request.command,
        changes: &request.changes,
    };
    let page = write_page(folder.path(), &report, &page, &request.formats)?;
    report.write(&folder.report())?;

    let found = if request.verbose { report.text() } else { report.brief() };
    monitor.say(&format!("{}\n{found}", report.headline()));
    for reason in &report.verdict.reasons {
        monitor.say(&reason.to_string());
    }
    monitor.say(&format!("wrote {} with a replay, report.json and {RECORDING}", page.display()));
    if let Some(path) = &request.contract_log {
        monitor.say(&format!("wrote {}", path.display()));
    }
    if request.free_steps && report.run.engine_steps.is_none_or(|made| made >= report.run.steps) {
        monitor.warn("note: no step left out the engine: that needs the plant rapier and vehicles out of contact");
    }
    if report.run.is_interrupted() {
        let at = seconds(report.run.duration_s);
        monitor.warn(&format!(
            "interrupted: the files hold the flight up to {at}; the same command begins again and replaces them"
        ));
    }
    Ok(RunFiles { report, log, pictures, page })
}

/// Flies the scenario. The recording is closed when this function returns, with or without an error.
fn fly(
    (scenario, preflight): (&Scenario, &Preflight),
    parts: Components,
    folder: &OutFolder,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
    log: &mut FlightLog,
) -> Result<Report, Failure> {
    let header = Header::new(&scenario.name, &preflight.resolved.toml, scenario.count(), scenario.delta_m);
    let mut recording = McapRecorder::create(&folder.file(RECORDING), &header)?;
    if let Some(topic) = pictures.topic(scenario) {
        recording = recording.with(topic)?;
    }
    monitor.begin(&scenario.name, Some(scenario.time.steps()));
    let mut carry_on = |step: u64| {
        if step.is_multiple_of(PROGRESS_EVERY) {
            monitor.advance(PROGRESS_EVERY);
        }
        if monitor.is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let flown = run_with(scenario, preflight, parts, &mut (&mut recording, log), &mut carry_on);
    let flown = flown.map(|(report, _)| report);
    monitor.finish();
    let closed = match &flown {
        Ok(report) => recording.close(run_audit(scenario, report)),
        Err(_) => recording.finish(),
    };
    let report = flown?;
    closed?;
    Ok(report)
}

/// Flies with a log of the contracts, and ends the log.
fn fly_logged(
    mut parts: Components,
    (path, file): (&Path, &File),
    flight: impl FnOnce(Components) -> Result<Report, Failure>,
) -> Result<Report, Failure> {
    let file = file.try_clone().map_err(|source| FileError::new(path, source))?;
    let log = Arc::new(Mutex::new(ContractLog::new(Box::new(file))));
    parts.contract_log = Some(Arc::clone(&log));
    let report = flight(parts)?;
    let ended = log.lock().unwrap_or_else(PoisonError::into_inner).finish();
    ended.map_err(|source| FileError::new(path, source))?;
    Ok(report)
}

/// Calls `work` in a pool, or on this thread if the law of the scenario requires it.
fn within<T: Send>(threads: &ThreadPool, scenario: &Scenario, work: impl FnOnce() -> T + Send) -> T {
    if scenario.requires_calling_thread() { work() } else { threads.install(work) }
}

/// Starts a pool of `number` threads, or of one thread per core for 0.
///
/// # Errors
/// [`Failure`] if the threads cannot be started.
pub fn threads(number: usize) -> Result<ThreadPool, Failure> {
    let built = rayon::ThreadPoolBuilder::new().num_threads(number).build();
    built.map_err(|error| Failure::machine("machine/threads", format!("cannot start threads: {error}")))
}

/// Returns the replay of a flight with its findings, of at most `room_bytes`.
///
/// # Errors
/// [`NoReplay`] if it does not fit, or the flight has no samples.
pub fn replay_of_run(
    scenario: &Scenario,
    log: &FlightLog,
    report: &Report,
    room_bytes: usize,
) -> Result<Replay, NoReplay> {
    let stage = Stage::of(scenario);
    Replay::new(&stage, log, &report.moments(), report.judgement(), room_bytes)
}

/// Returns the charts of a run.
fn figures(scenario: &Scenario, log: &FlightLog, report: &Report) -> Vec<Figure> {
    let obstacles: Vec<_> = scenario.obstacles.iter().map(MovingObstacle::from).collect();
    let criteria = Criteria {
        delta_m: scenario.delta_m,
        certified_m: report.certificate.separation_m,
        shape: Some((&scenario.legs, &scenario.graph)),
        edge_error_m: Some(scenario.arrival.edge_error_m),
        disagreement_m_s: Some(scenario.arrival.disagreement_m_s),
        most_thrust_n: scenario.airframe.quadrotor().map(|quadrotor| quadrotor.model.max_thrust_n),
        obstacles: &obstacles,
    };
    figures::of_run(log, &criteria)
}

/// Returns the page of a flight that the caller has flown. `command` repeats the flight. The page has no pictures.
#[must_use]
pub fn flight_page(
    scenario: &Scenario,
    preflight: &Preflight,
    mut log: FlightLog,
    report: &Report,
    command: &str,
) -> String {
    if let Some(closest) = report.closest_pair() {
        log.conclude(closest.separation_m, closest.time_s);
    }
    let figures = figures(scenario, &log, report);
    let replay = replay_of_run(scenario, &log, report, PAGE_BYTES);
    let page =
        RunPage { scenario, preflight, replay: &replay, figures: &figures, pictures: &[], command, changes: &[] };
    report.to_html(&page)
}

/// Writes figures and `report.html` into the folder of a run, and removes figures of an earlier run. Returns the path
/// of the page.
fn write_page(folder: &Path, report: &Report, page: &RunPage<'_>, formats: &[Format]) -> Result<PathBuf, Failure> {
    let all = figures::NAMES_OF_RUN.iter().flat_map(|name| Format::ALL.map(|of| format!("{name}.{}", of.name())));
    write_files(&folder.join("figures"), &all.collect::<Vec<_>>(), &figure_files(page.figures, formats))?;
    let path = folder.join("report.html");
    write_atomically(&path, report.to_html(page).as_bytes())?;
    Ok(path)
}

/// Returns names and contents of the files of figures.
#[must_use]
pub fn figure_files(figures: &[Figure], formats: &[Format]) -> Vec<(String, Vec<u8>)> {
    let file =
        |(figure, format): (&Figure, &Format)| (format!("{}.{}", figure.name, format.name()), figure.file(*format));
    let files: Vec<_> = figures.iter().flat_map(|figure| formats.iter().map(move |format| (figure, format))).collect();
    files.into_par_iter().map(file).collect()
}

/// Writes files into a folder, and removes the files of `names` that are not among them.
///
/// # Errors
/// [`Failure`] if a file cannot be written or removed.
pub fn write_files(folder: &Path, names: &[String], files: &[(String, Vec<u8>)]) -> Result<(), Failure> {
    let failure = |path: &Path, error: &io::Error| {
        Failure::machine("files/cannot-write", format!("cannot write {}: {error}", path.display()))
    };
    if !files.is_empty() {
        fs::create_dir_all(folder).map_err(|error| failure(folder, &error))?;
    }
    for (name, bytes) in files {
        write_atomically(&folder.join(name), bytes)?;
    }
    for name in names.iter().filter(|&name| files.iter().all(|(written, _)| written != name)) {
        let path = folder.join(name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failure(&path, &error)),
            _ => {}
        }
    }
    Ok(())
}
