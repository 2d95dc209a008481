//! `tautline compare`: laws side by side on the same starts.

use std::path::{Path, PathBuf};

use clap::Args;

use super::console::{self, Console};
use super::outputs::{self, is_standard_output, write};
use super::run::interruption;
use super::scenario::ScenarioArguments;
#[cfg(feature = "viewer")]
use super::worst;
use super::{Exit, Failure};
use tautline_sim::scenario::{Override, Template};
use tautline_studies::compare::{CompareError, ComparePage, Comparison, Plan, Watch};

/// Largest seed that a scenario file can say, less the most runs.
const LAST_SEED: u64 = i64::MAX as u64 - MOST_RUNS;
/// Most starts under each law.
const MOST_RUNS: u64 = 1_000_000;

/// Arguments of `tautline compare`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 0 once the comparison is made, whatever the laws did; with 1 where it was interrupted. A law's keys stand in \
[laws.NAME] of the scenario; NAME is its kind, or any name with a `kind` inside. docs/compare.md says what each number means.")]
pub(super) struct CompareArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// Laws to compare, by their kind or by the NAME of a table [laws.NAME]: edge-tension,laplacian. Those of all such
    /// tables unless given, and where there are none, every kind.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    laws: Option<Vec<String>>,
    /// Starts under each law.
    #[arg(long, value_name = "R", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=MOST_RUNS))]
    runs: u64,
    /// Run k, from 0, is flown with `start.seed` = S + k, and where chance has a part in the flight, `noise.seed` too.
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=LAST_SEED))]
    seed: u64,
    /// Write every number as JSON; - is standard output, for this and the next three.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row a law as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the table as LaTeX.
    #[arg(long, value_name = "FILE")]
    latex: Option<PathBuf>,
    /// Write a page with a picture of each law at its worst moment.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Overwrite files that exist.
    #[arg(long)]
    force: bool,
    /// What draws pictures: best, hardware, software, or a part of an adapter's name.
    #[cfg(feature = "viewer")]
    #[arg(long, value_name = "NAME", default_value = "best")]
    adapter: String,
    /// Print no table and no progress.
    #[arg(long)]
    quiet: bool,
    /// Threads to use, by default one a core; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

impl CompareArguments {
    /// Whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        self.html.is_some()
    }

    fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let all = [("--json", &self.json), ("--csv", &self.csv), ("--latex", &self.latex), ("--html", &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?)))
    }

    /// The command that compares the same again, for a shell.
    fn command(&self, plan: &Plan) -> String {
        let laws: Vec<_> = plan.laws().iter().map(|law| law.name.as_str()).collect();
        let (laws, runs, seed) = (laws.join(","), self.runs.to_string(), self.seed.to_string());
        let sets = self.what.overrides.iter().flat_map(|text| ["--set", text]);
        let what = ["compare", &self.what.scenario, "--laws", &laws, "--runs", &runs, "--seed", &seed];
        console::command_line(what.into_iter().chain(sets))
    }

    /// The commands that fly the worst flight of each law, by the law's name.
    fn worst(&self, plan: &Plan, comparison: &Comparison) -> Vec<(String, String)> {
        let jitter = plan.jitter_m().map(|jitter_m| format!("start.jitter_m={jitter_m:?}"));
        let is_random = plan.template().flight_is_random();
        let command = |law: &tautline_studies::compare::LawRow| {
            let seed = law.worst()?.seed;
            let noise = is_random.then(|| format!("noise.seed={seed}"));
            let seed = format!("start.seed={seed}");
            let sets = self.what.overrides.iter().chain(&law.overrides).chain([&seed]).chain(&noise).chain(&jitter);
            let sets = sets.flat_map(|set| ["--set", set.as_str()]);
            Some((law.name.clone(), console::command_line(["run", &self.what.scenario].into_iter().chain(sets))))
        };
        comparison.laws.iter().filter_map(command).collect()
    }
}

pub(super) fn compare(arguments: &CompareArguments) -> Result<Exit, Failure> {
    let data_on_stdout = arguments.outputs().any(|(_, file)| is_standard_output(file));
    let console = Console { data_on_stdout, quiet: arguments.quiet };
    outputs::check_new(&arguments.what.scenario, arguments.outputs(), arguments.force)?;
    let overrides = arguments.what.overrides.iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>()?;
    let template = Template::read(&arguments.what.source()?, &overrides)?;
    let names = arguments.laws.clone().unwrap_or_else(|| template.compared());
    let plan = Plan::new(template, &names, arguments.runs, arguments.seed)?;
    let threads = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    let interrupted = interruption()?;

    let bar = console.progress(plan.steps(), "compare".to_owned());
    let flown = plan.fly(threads, Watch { flown: &|steps| bar.inc(steps), interrupted: &interrupted });
    bar.finish_and_clear();
    let comparison = flown?;
    if comparison.runs == 0 {
        console.warn("interrupted before one start was flown under every law: there is nothing to compare");
        return Ok(Exit::Bad);
    }
    for note in comparison.notes() {
        console.warn(&format!("note: {note}"));
    }
    console.say(&format!("{}\n\n{}", comparison.headline(), comparison.text()));
    leave(arguments, &plan, &comparison, console)?;
    Ok(if comparison.runs == comparison.runs_asked { Exit::Good } else { Exit::Bad })
}

/// Writes what was asked for.
fn leave(arguments: &CompareArguments, plan: &Plan, comparison: &Comparison, console: Console) -> Result<(), Failure> {
    let unwritten = |error: &dyn std::error::Error| Failure::machine(format!("cannot write the result: {error}"));
    if let Some(file) = &arguments.json {
        write(file, comparison.to_json().map_err(|error| unwritten(&error))?.as_bytes())?;
    }
    if let Some(file) = &arguments.csv {
        write(file, &comparison.to_csv().map_err(|error| unwritten(&error))?)?;
    }
    if let Some(file) = &arguments.latex {
        write(file, comparison.to_latex().as_bytes())?;
    }
    if let Some(file) = &arguments.html {
        #[cfg(feature = "viewer")]
        let drawn = worst::pictures(plan, comparison, &arguments.adapter);
        #[cfg(not(feature = "viewer"))]
        let drawn = Err(Failure::machine("this build draws nothing"));
        let (pictures, no_pictures) = match drawn {
            Ok(pictures) => (pictures, None),
            Err(failure) => (Vec::new(), Some(format!("no pictures were taken: {}", failure.in_words()))),
        };
        if let Some(why) = &no_pictures {
            console.warn(why);
        }
        let page = ComparePage {
            pictures: &pictures,
            no_pictures: no_pictures.as_deref(),
            command: &arguments.command(plan),
            worst: &arguments.worst(plan, comparison),
        };
        write(file, comparison.to_html(&page).as_bytes())?;
    }
    let files: Vec<_> = arguments.outputs().filter(|(_, file)| !is_standard_output(file)).collect();
    for (_, file) in files {
        console.say(&format!("wrote {}", file.display()));
    }
    Ok(())
}

impl From<CompareError> for Failure {
    fn from(error: CompareError) -> Self {
        let under = |law: &str, seed: u64| format!("under the law {law}, start.seed = {seed}");
        match error {
            CompareError::NoLaw => Self::input(error.to_string(), "name one with --laws, such as edge-tension"),
            CompareError::Twice(_) => Self::input(
                error.to_string(),
                "name each once; two settings of one law have tables [laws.NAME] of two names, with the same `kind`",
            ),
            CompareError::Law(error) => error.into(),
            CompareError::Scenario { law, seed, error } => Self::from(error).under(&under(&law, seed)),
            CompareError::Flight { law, seed, error } => Self::from(error).under(&under(&law, seed)),
        }
    }
}
