//! `run_into`: flies a scenario and leaves a recording, figures, pictures and a report.

use std::fs;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::ThreadPool;

use super::audit::run_audit;
use super::{Failure, Monitor, NamedPicture, OutFolder, Pictures};
use crate::figures::{self, Criteria, Figure};
use crate::flight_log::FlightLog;
use crate::replay::{NoReplay, PAGE_BYTES, Replay, Stage};
use crate::report::{INTERRUPTED, Report, RunPage, write_atomically};
use crate::run::{run_while, verify};
use tautline_recordings::mcap::{Header, McapRecorder};
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim;

/// The name of the recording in the folder of a run.
pub const RECORDING: &str = "run.mcap";
/// Steps between two looks at the progress bar.
const PROGRESS_EVERY: u64 = 64;
/// Threads that a flight has work for: one for the law and one for the audit.
const THREADS_OF_USE: usize = 2;

/// A scenario, and what its flight leaves in a folder.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct RunRequest<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// The command that flies the same again, for the page.
    pub command: String,
    /// The folder; by default `out/NAME`, where NAME is the scenario's.
    pub out: Option<PathBuf>,
    /// Whether a folder that holds a finished run is overwritten.
    pub force: bool,
    /// Whether figures are drawn.
    pub figures: bool,
    /// Whether the scenario is flown again at half the step, to see what that changes.
    pub verify: bool,
    /// Threads to use, of which two are of use; by default one a core. The recording has the same bits for any number.
    pub threads: Option<usize>,
    /// Whether wall-clock times are a part of the report. Without them the same flight leaves the same bytes.
    pub is_timed: bool,
}

impl<'a> RunRequest<'a> {
    /// A request with figures and times, into `out/NAME`.
    #[must_use]
    pub fn new(scenario: &'a Scenario, command: String) -> Self {
        Self { scenario, command, out: None, force: false, figures: true, verify: false, threads: None, is_timed: true }
    }

    /// A request that overwrites a folder and leaves the same bytes each time.
    #[must_use]
    pub fn reproducible(scenario: &'a Scenario, command: String, out: PathBuf) -> Self {
        Self { out: Some(out), force: true, is_timed: false, ..Self::new(scenario, command) }
    }
}

/// The answer of a run, beside its files.
pub struct RunFiles {
    /// The report, as in `report.json`.
    pub report: Report,
    /// The history of the flight.
    pub log: Arc<FlightLog>,
    /// Pictures by their names, such as `closest`.
    pub pictures: Vec<NamedPicture>,
}

/// Flies a scenario and leaves everything that is asked for in a folder: `run.mcap`, `report.json`, `report.html`,
/// `figures/*.svg` and `snapshots/*.png`. The report comes last: a folder with a report is whole.
///
/// # Errors
/// [`Failure`] where the scenario cannot be flown, the folder holds a finished run, or the system refuses. What was recorded
/// up to then stays readable.
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
    // Nothing is written before everything that can be wrong with the input has been looked at.
    let path = request.out.clone().unwrap_or_else(|| Path::new("out").join(&scenario.name));
    let folder = OutFolder::at(path, "run", "report.json");
    let _lock = folder.open(request.force)?;
    let mut log = FlightLog::of(scenario);
    let mut report = threads.install(|| fly(scenario, &preflight, &folder, pictures, monitor, &mut log))?;
    if let Some(closest) = report.separation.closest() {
        log.conclude(closest.separation_m, closest.time_s);
    }
    let log = Arc::new(log);
    report.performance = report.performance.filter(|_| request.is_timed);
    if request.verify && report.run.ended_early.as_deref() != Some(INTERRUPTED) {
        report.verification = Some(threads.install(|| verify(scenario, &report))?);
    }
    let pictures = pictures.draw(scenario, &log, folder.path(), monitor)?;
    let figures = if request.figures { figures(scenario, &log, &report) } else { Vec::new() };
    let replay = replay_of_run(scenario, &log, &report, PAGE_BYTES);
    let page = RunPage {
        scenario,
        preflight: &preflight,
        replay: &replay,
        figures: &figures,
        pictures: &pictures.iter().map(|(_, picture)| picture.clone()).collect::<Vec<_>>(),
        command: &request.command,
    };
    let page = write_page(folder.path(), &report, &page)?;
    report.write(&folder.report())?;

    monitor.say(&format!("{}\n{}", report.headline(), report.text()));
    for reason in &report.verdict.reasons {
        monitor.say(reason);
    }
    monitor.say(&format!(
        "wrote {}, {} and {}",
        folder.file(RECORDING).display(),
        folder.report().display(),
        page.display()
    ));
    Ok(RunFiles { report, log, pictures })
}

/// Flies the scenario; the recording is complete when this returns, whether the flight went well or not.
fn fly(
    scenario: &Scenario,
    preflight: &Preflight,
    folder: &OutFolder,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
    log: &mut FlightLog,
) -> Result<Report, Failure> {
    let header = Header::new(&scenario.name, &scenario.resolved_toml(), scenario.count(), scenario.delta_m);
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
    let flown = run_while(scenario, preflight, &mut (&mut recording, log), &mut carry_on);
    monitor.finish();
    let closed = match &flown {
        Ok(report) => recording.close(run_audit(scenario, report)),
        Err(_) => recording.finish(),
    };
    let report = flown?;
    closed?;
    Ok(report)
}

/// Starts a pool of `number` threads, or of one per core for 0.
///
/// # Errors
/// [`Failure`] where the system refuses.
pub fn threads(number: usize) -> Result<ThreadPool, Failure> {
    let built = rayon::ThreadPoolBuilder::new().num_threads(number).build();
    built.map_err(|error| Failure::machine("machine/threads", format!("cannot start threads: {error}")))
}

/// The replay of a flight, with what was found on it, in at most `room_bytes`.
///
/// # Errors
/// [`NoReplay`] where it does not fit, or nothing was flown.
pub fn replay_of_run(
    scenario: &Scenario,
    log: &FlightLog,
    report: &Report,
    room_bytes: usize,
) -> Result<Replay, NoReplay> {
    let names: Vec<_> = scenario.obstacles.iter().map(|obstacle| obstacle.name.clone()).collect();
    let stage = Stage::of(scenario, scenario.obstacles.iter().map(sim::judged).collect());
    Replay::new(&stage, log, &report.moments(&names), report.judgement(), room_bytes)
}

/// A run as charts.
fn figures(scenario: &Scenario, log: &FlightLog, report: &Report) -> Vec<Figure> {
    let criteria = Criteria {
        delta_m: scenario.delta_m,
        certified_m: report.separation.certified_m,
        shape: Some((&scenario.legs, &scenario.graph)),
        edge_error_m: Some(scenario.arrival.edge_error_m),
        disagreement_m_s: Some(scenario.arrival.disagreement_m_s),
        most_thrust_n: scenario.airframe.quadrotor().map(|quadrotor| quadrotor.model.max_thrust_n),
    };
    figures::of_run(log, &criteria)
}

/// The page on a flight that the caller has flown itself, which `command` flies again; without pictures.
#[must_use]
pub fn flight_page(
    scenario: &Scenario,
    preflight: &Preflight,
    mut log: FlightLog,
    report: &Report,
    command: &str,
) -> String {
    if let Some(closest) = report.separation.closest() {
        log.conclude(closest.separation_m, closest.time_s);
    }
    let figures = figures(scenario, &log, report);
    let replay = replay_of_run(scenario, &log, report, PAGE_BYTES);
    let page = RunPage { scenario, preflight, replay: &replay, figures: &figures, pictures: &[], command };
    report.to_html(&page)
}

/// Writes `figures/*.svg` and `report.html` into the folder of a run and returns the path of the page. Figures of an
/// earlier run are removed.
fn write_page(folder: &Path, report: &Report, page: &RunPage<'_>) -> Result<PathBuf, Failure> {
    let names = figures::NAMES_OF_RUN.map(|name| format!("{name}.svg"));
    write_files(&folder.join("figures"), &names, &svg_files(page.figures))?;
    let path = folder.join("report.html");
    write_atomically(&path, report.to_html(page).as_bytes())?;
    Ok(path)
}

/// Names and contents of the files of figures.
#[must_use]
pub fn svg_files(figures: &[Figure]) -> Vec<(String, Vec<u8>)> {
    figures.iter().map(|figure| (format!("{}.svg", figure.name), figure.svg.clone().into_bytes())).collect()
}

/// Writes files into a folder, and removes those of `names` that are not among them.
///
/// # Errors
/// [`Failure`] where the system refuses.
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
