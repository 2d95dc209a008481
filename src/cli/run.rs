//! `tautline run` and `tautline check`, and the arguments of all commands with a scenario.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Parser};

use super::console::{self, Console, Terminal};
use super::json::{JsonArgument, check_outside};
use super::{Exit, completions};
use tautline_core::option::CONTRACT_LOG;
use tautline_report::figures::Format;
use tautline_report::request::{
    Failure, Monitor as _, Pictures, RunRequest, ScenarioRequest, command_line, identify, outputs, run_into,
};
use tautline_sim::preflight::Preflight;

/// Time between two looks at a watched file.
const WATCH_INTERVAL: Duration = Duration::from_millis(150);

/// Scenario with its overrides.
#[derive(Debug, Args)]
pub(super) struct ScenarioArguments {
    /// Scenario file, name of a built-in scenario, or - for standard input.
    #[arg(default_value = "pentagon", add = completions::scenario())]
    pub(super) scenario: String,
    /// Set a key of the scenario; repeatable.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", add = completions::setting())]
    pub(super) overrides: Vec<String>,
}

impl ScenarioArguments {
    /// Returns the scenario as a part of a request.
    pub(super) fn request(&self) -> Result<ScenarioRequest, Failure> {
        ScenarioRequest::named(&self.scenario, &self.overrides)
    }
}

/// Returns the formats of figures with these names.
pub(super) fn figure_formats(names: &[String]) -> Vec<Format> {
    Format::ALL.into_iter().filter(|of| names.iter().any(|name| name == of.name())).collect()
}

/// Returns the renderer of pictures on an adapter. Refuses an adapter that is named and missing. A build without the
/// viewer draws nothing.
#[cfg(feature = "viewer")]
pub(super) fn pictures(adapter: &str, takes_snapshots: bool) -> Result<Box<dyn Pictures>, Failure> {
    if takes_snapshots {
        tautline_render::AdapterChoice::from(adapter).check()?;
    }
    Ok(Box::new(tautline_render::RunPictures { adapter: adapter.to_owned(), takes_snapshots }))
}

/// Returns the renderer of pictures on an adapter. A build without the viewer draws nothing.
#[cfg(not(feature = "viewer"))]
#[expect(clippy::unnecessary_wraps, reason = "a build with the viewer refuses missing adapters")]
pub(super) fn pictures(_adapter: &str, _takes_snapshots: bool) -> Result<Box<dyn Pictures>, Failure> {
    Ok(Box::new(()))
}

/// Arguments of `tautline run`.
#[derive(Debug, Parser)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct RunArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// Plant: rigid bodies, or the equation of motion in continuous time; short for `--set plant.kind=...`.
    #[arg(long, value_name = "PLANT", value_parser = ["rapier", "ideal"])]
    plant: Option<String>,
    /// Folder for the recording and the report [default: out/NAME with the name of the scenario].
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Overwrite a folder with a finished run.
    #[arg(long)]
    force: bool,
    /// Open the report in a browser.
    #[arg(long)]
    open: bool,
    /// Fly again after each change of the scenario file, until Ctrl-C; overwrites its folder each time.
    #[arg(long, conflicts_with = "json")]
    watch: bool,
    /// Draw no figures.
    #[arg(long, conflicts_with = "figures")]
    no_figures: bool,
    /// Formats of the figures; PDF and PNG have the width of a paper's column, 85 mm.
    #[arg(long, value_name = "FORMAT,...", value_delimiter = ',', default_value = "svg")]
    #[arg(value_parser = ["svg", "pdf", "png"])]
    figures: Vec<String>,
    /// Take no pictures.
    #[arg(long)]
    no_snapshots: bool,
    /// Graphics adapter: best, hardware, software, none, or a part of its name.
    #[arg(long, value_name = "NAME", default_value = "best")]
    adapter: String,
    /// Leave out the engine where no contact is possible, except for each eighth step, which is compared bit by bit.
    #[arg(long)]
    free_steps: bool,
    /// Repeat the flight at half the step, and report the differences.
    #[arg(long)]
    verify: bool,
    /// Write each event of the shield's contracts, for `proofs/replay` (proofs/README.md).
    #[arg(long, value_name = "FILE")]
    contract_log: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
    /// Print all findings: formation, energy, commands, velocities, radio, shield, times.
    #[arg(long, short)]
    verbose: bool,
    /// Print no summary and no progress.
    #[arg(long, short)]
    quiet: bool,
    /// Number of threads, at most 2 in use [default: one for each core]; the recording is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl RunArguments {
    /// Returns whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        !self.no_snapshots
    }
}

pub(super) fn run(arguments: &RunArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.json.is_piped(), quiet: arguments.quiet };
    let log = arguments.contract_log.iter().map(|file| (CONTRACT_LOG.to_string(), file.as_path()));
    let outputs = arguments.json.file().into_iter().chain(log.clone());
    outputs::check_new(&arguments.what.scenario, outputs, arguments.force)?;
    log.into_iter().try_for_each(|(option, file)| outputs::refuse_standard_output(&option, file))?;
    let terminal = Terminal::new(console)?;
    if arguments.watch {
        return watch(arguments, &terminal);
    }
    fly(arguments, arguments.force, arguments.open, &terminal)
}

/// Flies the scenario once. `opens` states whether the page is opened.
fn fly(arguments: &RunArguments, force: bool, opens: bool, terminal: &Terminal) -> Result<Exit, Failure> {
    let plant = arguments.plant.as_ref().map(|kind| format!("plant.kind={kind}"));
    let what = arguments.what.request()?;
    // `--plant` is short for the last override; the command that repeats the flight keeps it as written.
    let flown = ScenarioRequest { overrides: what.overrides.iter().cloned().chain(plant).collect(), ..what.clone() };
    let scenario = flown.read()?;
    let folder = arguments.out.clone().unwrap_or_else(|| Path::new("out").join(&scenario.name));
    arguments.json.check_outside(&folder)?;
    if let Some(file) = &arguments.contract_log {
        check_outside(&CONTRACT_LOG.to_string(), file, &folder)?;
    }
    let plant = arguments.plant.iter().flat_map(|kind| ["--plant", kind]);
    let sets = what.overrides.iter().flat_map(|text| ["--set", text.as_str()]);
    let repeat = |words: &[&str]| match (&*what.argument, &arguments.out) {
        ("-", out) => {
            // Standard input is gone, but the recording holds the scenario with its overrides.
            let folder = out.clone().unwrap_or_else(|| Path::new("out").join(&scenario.name));
            let recording = folder.join("run.mcap");
            let show = command_line(["list", "--show", &recording.to_string_lossy()].into_iter());
            format!("{show} | {}", command_line(["run", "-"].into_iter()))
        }
        _ => command_line(words.iter().copied()),
    };
    let free_steps = arguments.free_steps.then_some("--free-steps");
    let words: Vec<_> = ["run", &what.argument].into_iter().chain(sets).chain(plant).chain(free_steps).collect();
    let request = RunRequest {
        changes: flown.overrides.clone(),
        out: arguments.out.clone(),
        force,
        figures: !arguments.no_figures,
        formats: figure_formats(&arguments.figures),
        free_steps: arguments.free_steps,
        verify: arguments.verify,
        threads: arguments.threads.map(usize::from),
        contract_log: arguments.contract_log.clone(),
        verbose: arguments.verbose,
        ..RunRequest::new(&scenario, repeat(&words))
    };
    let pictures = pictures(&arguments.adapter, !arguments.no_snapshots)?;
    let left = run_into(&request, &*pictures, terminal)?;
    if opens {
        terminal.open_page(&left.page);
    }
    arguments.json.write(&left.report, terminal.console())?;
    Ok(Exit::good_if(left.report.verdict.pass))
}

/// Flies the scenario, and again whenever its file changes, until an interruption. A scenario that cannot be flown is
/// reported and waited for.
fn watch(arguments: &RunArguments, terminal: &Terminal) -> Result<Exit, Failure> {
    let path = Path::new(&arguments.what.scenario);
    if !path.is_file() {
        let message = format!("--watch: `{}` is not a file", arguments.what.scenario);
        return Err(Failure::input("usage/no-effect", message, "give a scenario file; `tautline new NAME` writes one"));
    }
    // Read before the flight, so that a change during the flight is noticed.
    let mut flown = content(path);
    let mut exit = shown(fly(arguments, true, arguments.open, terminal));
    while !terminal.is_interrupted() {
        terminal.warn(&format!("waiting for a change of {}; Ctrl-C ends", path.display()));
        if let Some(changed) = next_content(path, flown.as_deref(), terminal) {
            flown = Some(changed);
            exit = shown(fly(arguments, true, false, terminal));
        }
    }
    Ok(exit)
}

/// Waits until the content of a file differs from `flown` and is the same in two successive reads. An editor may empty
/// a file before it writes.
/// Returns `None` after an interruption.
fn next_content(path: &Path, flown: Option<&[u8]>, terminal: &Terminal) -> Option<Vec<u8>> {
    let mut seen = None;
    while !terminal.is_interrupted() {
        let now = content(path);
        if now.is_some() && now.as_deref() != flown && now == seen {
            return now;
        }
        seen = now;
        std::thread::sleep(WATCH_INTERVAL);
    }
    None
}

/// Returns the exit code of a flight, and prints its failure.
fn shown(flown: Result<Exit, Failure>) -> Exit {
    flown.unwrap_or_else(|failure| console::show(&failure))
}

/// Returns the content of a file; `None` while it is missing, as between the two steps of an editor that replaces it.
fn content(path: &Path) -> Option<Vec<u8>> {
    std::fs::read(path).ok()
}

/// Arguments of `tautline check`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit codes: 0 flyable, also with other warnings; 1 the flight cannot succeed; 2 wrong input, such as a desired \
distance of at most delta. The code is 1 with one of these warnings: relative-velocity-unstable, start-on-line, \
start-in-plane, step-too-long, drift-unresolved, ends-at-start, slots-too-near.")]
pub(super) struct CheckArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// Measure the tracking error of the scenario's quadrotors, which the shield assumes.
    #[arg(long)]
    identify: bool,
    /// With --identify: write a model file with the measured table; comments of an existing file stay.
    #[arg(long, short, value_name = "FILE", requires = "identify")]
    out: Option<PathBuf>,
    #[command(flatten)]
    json: JsonArgument,
    /// Print no summary.
    #[arg(long, short)]
    quiet: bool,
}

pub(super) fn check(arguments: &CheckArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.json.is_piped(), quiet: arguments.quiet };
    arguments.json.check_new()?;
    if arguments.identify {
        let found = identify(&arguments.what.request()?, arguments.out.as_deref())?;
        console.say(&format!("{}\n{}", found.measured, found.table.trim_end()));
        if let Some(path) = &arguments.out {
            console.say(&format!("wrote {}", path.display()));
        }
        arguments.json.write(&found.measured, console)?;
        return Ok(Exit::Good);
    }
    let scenario = arguments.what.request()?.read()?;
    let found = Preflight::of(&scenario)?;
    console.say(&format!("{}\n{}", found.headline(), found.text()));
    for warning in &found.warnings {
        console.say(&warning.to_string());
    }
    arguments.json.write(&found, console)?;
    Ok(Exit::good_if(!found.refuses()))
}
