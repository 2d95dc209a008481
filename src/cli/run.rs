//! `tautline run`: fly a scenario and leave a recording, figures and a report.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser;
use rayon::ThreadPool;

use super::caller;
use super::console::{self, Console};
use super::folder::OutFolder;
use super::pictures;
use super::scenario::{self, ScenarioArguments};
#[cfg(feature = "viewer")]
use super::snapshots::Watched;
use super::{Exit, Failure};
use tautline_core::record::Sink;
use tautline_recordings::mcap::{Header, McapRecorder, RunVerdict};
use tautline_report::figures::RunHistory;
use tautline_report::replay::{Film, PAGE_BYTES};
use tautline_report::report::page::Picture;
use tautline_report::report::{INTERRUPTED, Report, RunPage, Status};
use tautline_report::run::{run_while, verify};
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::Scenario;

/// Exit code of a second Ctrl-C, as shells give it.
const INTERRUPTED_TWICE: i32 = 130;
/// The recording's name in the folder of a run.
pub(super) const RECORDING: &str = "run.mcap";
/// Steps between two looks at the progress bar.
const PROGRESS_EVERY: u64 = 64;
/// Threads that a flight has work for: one for the law and one for the audit.
const THREADS_OF_USE: usize = 2;

/// Arguments of `tautline run`.
#[derive(Debug, Parser)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct RunArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// What moves the vehicles: rigid bodies, or the equation of motion solved in continuous time. Short for
    /// `--set plant.kind=...`.
    #[arg(long, value_name = "PLANT", value_parser = ["rapier", "ideal"])]
    plant: Option<String>,
    /// Folder for the recording and the report; by default out/NAME, where NAME is the scenario's.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite a folder that holds a finished run.
    #[arg(long)]
    force: bool,
    /// Draw no figures.
    #[arg(long)]
    no_figures: bool,
    /// Take no pictures.
    #[cfg(feature = "viewer")]
    #[arg(long)]
    no_snapshots: bool,
    /// What draws pictures: best, hardware, software, or a part of an adapter's name.
    #[cfg(feature = "viewer")]
    #[arg(long, value_name = "NAME", default_value = "best")]
    adapter: String,
    /// Fly again at half the step, and say what that changed.
    #[arg(long)]
    verify: bool,
    /// Print the report as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// Print no summary and no progress.
    #[arg(long)]
    quiet: bool,
    /// Threads to use, of which two are of use, by default one a core; the recording has the same bits for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Leave wall-clock times out of the report.
    #[arg(skip)]
    untimed: bool,
}

impl RunArguments {
    /// Whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        !self.no_snapshots
    }

    /// Everything as by default into a folder, without a word and without wall-clock times: the same flight leaves the same bytes.
    pub(super) fn for_folder(out: PathBuf) -> Self {
        Self { out: Some(out), force: true, quiet: true, untimed: true, ..Self::parse_from(["run"]) }
    }

    /// The same, with a summary.
    pub(super) fn aloud(self) -> Self {
        Self { quiet: false, ..self }
    }

    /// The same, perhaps without pictures.
    #[cfg(feature = "viewer")]
    pub(super) fn without_pictures(self, none: bool) -> Self {
        Self { no_snapshots: none, ..self }
    }

    /// The command that flies the same again, for a shell.
    fn command(&self) -> String {
        let sets = self.what.overrides.iter().flat_map(|text| ["--set", text]);
        let plant = self.plant.iter().flat_map(|plant| ["--plant", plant]);
        console::command_line(["run", &self.what.scenario].into_iter().chain(sets).chain(plant))
    }
}

pub(super) fn run(arguments: &RunArguments) -> Result<Exit, Failure> {
    let plant = arguments.plant.as_ref().map(|kind| format!("plant.kind={kind}"));
    let scenario = scenario::read(&arguments.what.scenario, arguments.what.overrides.iter().chain(&plant))?;
    let interrupted = interruption()?;
    let left = fly_into(arguments, &scenario, &arguments.command(), &interrupted)?;
    Ok(if left.report.verdict.pass { Exit::Good } else { Exit::Bad })
}

/// What a run left beside its files.
pub(super) struct Left {
    pub(super) report: Report,
    /// Its motion.
    pub(super) film: Film,
    /// Its pictures, in the order of their names.
    #[cfg_attr(not(feature = "viewer"), expect(dead_code, reason = "nothing is drawn"))]
    pub(super) pictures: Vec<Picture>,
}

/// Flies a scenario, which `command` flies again, and leaves everything that is asked for.
pub(super) fn fly_into(
    arguments: &RunArguments,
    scenario: &Scenario,
    command: &str,
    interrupted: &AtomicBool,
) -> Result<Left, Failure> {
    let console = Console { data_on_stdout: arguments.json, quiet: arguments.quiet };
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = threads(arguments.threads.map_or_else(cores, usize::from).min(THREADS_OF_USE))?;
    let preflight = Preflight::of(scenario)?;
    if preflight.refuses() {
        console.warn(&preflight.headline());
    }
    for warning in &preflight.warnings {
        console.warn(&warning.to_string());
    }
    let warnings: Vec<_> =
        preflight.warnings.iter().map(|warning| (warning.code.name().to_owned(), warning.message.clone())).collect();
    // Nothing is written before everything that can be wrong with the input has been looked at.
    let path = arguments.out.clone().unwrap_or_else(|| Path::new("out").join(&scenario.name));
    let folder = OutFolder::at(path, "run", "report.json");
    let _lock = folder.open(arguments.force)?;
    let mut history = RunHistory::new().scaled_by(scenario.metric());
    #[cfg(feature = "viewer")]
    let mut watched = Watched::new(scenario, !arguments.no_snapshots, &arguments.adapter);
    #[cfg(not(feature = "viewer"))]
    let mut watched = ();
    let mut film = Film::new();
    let mut watchers = (&mut history, (&mut film, &mut watched));
    let mut report = threads.install(|| fly(scenario, &preflight, &folder, console, interrupted, &mut watchers))?;
    report.performance = report.performance.filter(|_| !arguments.untimed);
    if arguments.verify && report.run.ended_early.as_deref() != Some(INTERRUPTED) {
        report.verification = Some(threads.install(|| verify(scenario, &report))?);
    }
    #[cfg(feature = "viewer")]
    let snapshots = watched.snapshots(folder.path(), console)?;
    #[cfg(not(feature = "viewer"))]
    let snapshots = Vec::new();
    let figures = if arguments.no_figures { Vec::new() } else { pictures::figures(scenario, &history, &report) };
    let replay = pictures::replay(scenario, &film, &report, PAGE_BYTES);
    let page =
        RunPage { scenario, warnings: &warnings, replay: &replay, figures: &figures, pictures: &snapshots, command };
    let page = pictures::write(folder.path(), &report, &page)?;
    report.write(&folder.report())?;

    console.say(&format!("{}\n{}", report.headline(), report.text()));
    for reason in &report.verdict.reasons {
        console.say(reason);
    }
    if let Some(verification) = &report.verification {
        console.say(&format!("{:<12} {}", "verified", verification.text()));
    }
    console.say(&format!(
        "wrote {}, {} and {}",
        folder.file(RECORDING).display(),
        folder.report().display(),
        page.display()
    ));
    if arguments.json {
        console::json(&report)?;
    }
    Ok(Left { report, film, pictures: snapshots })
}

/// Flies the scenario; the recording is complete when this returns, whether the flight went well or not.
fn fly(
    scenario: &Scenario,
    preflight: &Preflight,
    folder: &OutFolder,
    console: Console,
    interrupted: &AtomicBool,
    watchers: &mut (dyn Sink + Send),
) -> Result<Report, Failure> {
    let header = Header::new(&scenario.name, &scenario.resolved_toml(), scenario.count(), scenario.delta_m);
    let mut recording = McapRecorder::create(&folder.file(RECORDING), &header)?;
    #[cfg(feature = "viewer")]
    {
        recording = recording.with(Box::new(tautline_render::FoxgloveScene::of(scenario)))?;
    }
    let progress = console.progress(scenario.time.steps(), scenario.name.clone());
    let mut carry_on = |step: u64| {
        if step.is_multiple_of(PROGRESS_EVERY) {
            progress.set_position(step);
        }
        if interrupted.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let flown = run_while(scenario, preflight, &mut (&mut recording, watchers), &mut carry_on);
    progress.finish_and_clear();
    let closed = match &flown {
        Ok(report) => recording.close(run_verdict(report)),
        Err(_) => recording.finish(),
    };
    let report = flown?;
    closed?;
    Ok(report)
}

/// What a run says of itself when it closes its recording.
#[must_use]
pub fn run_verdict(report: &Report) -> RunVerdict {
    let status = match report.audit.status {
        Status::Clear => "clear",
        Status::Violation => "violation",
        Status::Undecided => "undecided",
    };
    RunVerdict {
        status: status.to_owned(),
        ended_early: report.run.ended_early.clone().unwrap_or_default(),
        separation_m: report.separation.min_m.unwrap_or(f64::NAN),
        separation_time_s: report.separation.min_at_s.unwrap_or(f64::NAN),
        pair: report.separation.min_pair.unwrap_or_default().map(|number| number as u64),
        steps: report.audit.steps,
        duration_s: report.run.duration_s,
        state_sha256: report.run.state_hash.clone(),
        told_sha256: String::new(),
    }
}

/// So many threads; 0 for one a core.
pub(super) fn threads(number: usize) -> Result<ThreadPool, Failure> {
    let built = rayon::ThreadPoolBuilder::new().num_threads(number).build();
    built.map_err(|error| Failure::machine(format!("cannot start threads: {error}")))
}

/// Set by Ctrl-C (and by a request to terminate), or by the program that called. The second one does not wait for what is under way to end.
pub(super) fn interruption() -> Result<Arc<AtomicBool>, Failure> {
    if let Some(interrupted) = caller::interruption() {
        return Ok(interrupted);
    }
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    let again = move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED_TWICE);
        }
    };
    ctrlc::set_handler(again).map_err(|error| Failure::machine(format!("cannot listen to Ctrl-C: {error}")))?;
    Ok(interrupted)
}
