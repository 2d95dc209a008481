//! `tautline attack`: the worst start, wind or loss within bounds.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};

use super::console::{self, Console};
use super::folder::OutFolder;
use super::outputs::{self, is_standard_output, write};
use super::run::{self, RunArguments, interruption};
use super::scenario::ScenarioArguments;
use super::{Exit, Failure};
use tautline_sim::scenario::Override;
use tautline_studies::attack::{Asked, Attack, AttackError, AttackPage, Method, Plan, Variation};
use tautline_studies::compare::Watch;

/// Most flights of a search.
const MOST_FLIGHTS: u64 = 10_000_000;
/// Most seeds of a candidate.
const MOST_SEEDS: u64 = 10_000;

/// Arguments of `tautline attack`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 0 where the search found no violation, with 1 where it found one or was interrupted. What it did not find may be \
there all the same: it is a search, not a proof. docs/attack.md says more.")]
pub(super) struct AttackArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// A key that is a number, and the values between which it may be: `network.loss=0..0.3`; may be given several times.
    #[arg(long, value_name = "KEY=LOW..HIGH")]
    vary: Vec<String>,
    /// Every start may be up to R metres from that of the scenario, along each axis.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    start: Option<f64>,
    /// Every velocity at the start may be up to V m/s from that of the scenario, along each axis.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    velocity: Option<f64>,
    /// No two start nearer than this many metres to each other, more than delta; without it any start that can be flown will do.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    apart: Option<f64>,
    /// Flights of the whole search.
    #[arg(long, value_name = "F", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..=MOST_FLIGHTS))]
    flights: u64,
    /// Fly each candidate with K seeds of noise, that of the scenario and those that follow; the worst counts.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: u64,
    /// How candidates are found.
    #[arg(long, value_enum, value_name = "HOW", default_value_t = How::CmaEs)]
    method: How,
    /// Seed of the search; noise has that of the scenario.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Fly the worst again and leave its recording, report and pictures in this folder, as `tautline run` does.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write everything as JSON; - is standard output, for this and the next two.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row for each candidate that was worse than all before it as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a page with a plot.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Overwrite files that exist, and a folder that holds a finished run.
    #[arg(long)]
    force: bool,
    /// Print no table and no progress.
    #[arg(long)]
    quiet: bool,
    /// Threads to use, by default one a core; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

/// How candidates are found.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum How {
    /// CMA-ES, started again with twice the population where it has come to rest.
    CmaEs,
    /// Uniform within the bounds.
    Random,
}

impl From<How> for Method {
    fn from(how: How) -> Self {
        match how {
            How::CmaEs => Self::CmaEs,
            How::Random => Self::Random,
        }
    }
}

impl AttackArguments {
    /// Whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        self.out.is_some()
    }

    fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let all = [("--json", &self.json), ("--csv", &self.csv), ("--html", &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?)))
    }

    fn plan(&self) -> Result<Plan, Failure> {
        let overrides = &self.what.overrides;
        let overrides = overrides.iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>()?;
        let vary = self.vary.iter().map(|text| Variation::parse(text)).collect::<Result<Vec<_>, _>>();
        let vary = vary.map_err(|why| {
            Failure::input(
                format!("--vary: {why}"),
                "write a key that is a number and two different finite numbers, the smaller one first, as in \
                 --vary network.loss=0..0.3",
            )
        })?;
        let asked = Asked {
            vary,
            start_m: self.start,
            velocity_m_s: self.velocity,
            apart_m: self.apart,
            method: self.method.into(),
            flights: self.flights,
            seeds: self.seeds,
            seed: self.seed,
        };
        Ok(Plan::new(self.what.source()?, &overrides, asked)?)
    }

    /// The command that makes the same search again, for a shell.
    fn command(&self) -> String {
        let reaches = [("--start", self.start), ("--velocity", self.velocity), ("--apart", self.apart)];
        let reaches = reaches.map(|(option, by)| by.map(|by| [option.to_owned(), format!("{by:?}")]));
        let method = self.method.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        let counts = [self.flights, self.seeds, self.seed].map(|count| count.to_string());
        let vary = self.vary.iter().flat_map(|text| ["--vary", text]);
        let reaches = reaches.iter().flatten().flatten().map(String::as_str);
        let asked = ["--flights", &counts[0], "--seeds", &counts[1], "--method", &method, "--seed", &counts[2]];
        let sets = self.what.overrides.iter().flat_map(|text| ["--set", text]);
        let words: Vec<_> =
            ["attack", &self.what.scenario].into_iter().chain(vary).chain(reaches).chain(asked).chain(sets).collect();
        console::command_line(words.into_iter())
    }

    /// The words of the command that flies the worst again.
    fn worst<'a>(&'a self, attack: &'a Attack) -> Option<Vec<&'a str>> {
        attack.worst()?;
        let sets = attack.sets.iter().flat_map(|set| ["--set", set.as_str()]);
        Some(["run", &self.what.scenario].into_iter().chain(sets).collect())
    }

    /// The folder of the worst flight, made ready; none where there is to be none.
    fn folder(&self) -> Result<Option<&Path>, Failure> {
        let Some(path) = self.out.as_deref() else { return Ok(None) };
        // Known before an hour of flights; the flight itself opens it again.
        OutFolder::at(path, "run", "report.json").open(self.force)?;
        Ok(Some(path))
    }
}

pub(super) fn attack(arguments: &AttackArguments) -> Result<Exit, Failure> {
    let data_on_stdout = arguments.outputs().any(|(_, file)| is_standard_output(file));
    let console = Console { data_on_stdout, quiet: arguments.quiet };
    outputs::check_new(&arguments.what.scenario, arguments.outputs(), arguments.force)?;
    let plan = arguments.plan()?;
    let threads = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    let interrupted = interruption()?;
    let folder = arguments.folder()?;

    let bar = console.progress(plan.steps(), "attack".to_owned());
    let found = plan.search(threads, Watch { flown: &|steps| bar.inc(steps), interrupted: &interrupted });
    bar.finish_and_clear();
    let Some(attack) = found? else {
        console.warn("interrupted before a candidate was flown: there is nothing to say");
        return Ok(Exit::Bad);
    };
    for note in attack.notes() {
        console.warn(&format!("note: {note}"));
    }
    let worst = arguments.worst(&attack);
    let command = worst.as_ref().map(|words| console::command_line(words.iter().copied()));
    let again = command.as_ref().map_or_else(String::new, |command| format!("\nFly the worst again:\n  {command}"));
    console.say(&format!("{}\n\n{}{again}", attack.headline(), attack.text()));
    leave(arguments, &attack, command.as_deref(), console)?;
    if let (Some(command), Some(folder), false) = (&command, folder, attack.interrupted) {
        fly_worst(&plan, &attack, command, folder, &interrupted)?;
        let recording = folder.join(run::RECORDING);
        console.say(&format!("wrote {} and the report beside it", recording.display()));
    }
    Ok(if attack.is_bad() || attack.interrupted { Exit::Bad } else { Exit::Good })
}

/// Flies the worst again as `tautline run` does.
fn fly_worst(
    plan: &Plan,
    attack: &Attack,
    command: &str,
    folder: &Path,
    interrupted: &AtomicBool,
) -> Result<(), Failure> {
    let Some(worst) = attack.worst() else { return Ok(()) };
    let scenario = plan.scenario(&worst.values, worst.run)?;
    let options = RunArguments::for_folder(folder.to_owned());
    run::fly_into(&options, &scenario, command, interrupted).map(drop)
}

/// Writes what was asked for.
fn leave(arguments: &AttackArguments, attack: &Attack, worst: Option<&str>, console: Console) -> Result<(), Failure> {
    let unwritten = |error: &dyn std::error::Error| Failure::machine(format!("cannot write the result: {error}"));
    if let Some(file) = &arguments.json {
        write(file, attack.to_json().map_err(|error| unwritten(&error))?.as_bytes())?;
    }
    if let Some(file) = &arguments.csv {
        write(file, &attack.to_csv().map_err(|error| unwritten(&error))?)?;
    }
    if let Some(file) = &arguments.html {
        let page = AttackPage { command: &arguments.command(), worst };
        write(file, attack.to_html(&page).as_bytes())?;
    }
    for (_, file) in arguments.outputs().filter(|(_, file)| !is_standard_output(file)) {
        console.say(&format!("wrote {}", file.display()));
    }
    Ok(())
}

impl From<AttackError> for Failure {
    fn from(error: AttackError) -> Self {
        let help = match &error {
            AttackError::Nothing => {
                "say what may be varied: --start 1 moves every start by up to 1 m, --vary network.loss=0..0.3 a key"
            }
            AttackError::Twice(_) => "vary each key once; --start and --velocity vary the whole of [start]",
            AttackError::Seed(_) => "leave it out; --seeds K flies each candidate with K seeds of noise",
            AttackError::Reach { .. } => {
                "give --start metres and --velocity metres a second, each a positive finite number"
            }
            AttackError::Apart { .. } => "give --apart a distance between the two, or leave it out",
            AttackError::Flights { .. } => "give --flights at least as many as --seeds",
            AttackError::Seeds(_) => {
                "leave --seeds out, or give the scenario turbulence, noise of measurement, loss or jitter"
            }
            AttackError::Scenario { .. } | AttackError::Flight { .. } => "",
        };
        match error {
            AttackError::Scenario { set, error } => Self::from(error).under(&format!("with {set}")),
            AttackError::Flight { set, error } => Self::from(error).under(&format!("with {set}")),
            error => Self::input(error.to_string(), help),
        }
    }
}
