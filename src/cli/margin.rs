//! `tautline margin`: where between two values of a key the verdict turns.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::console::{self, Console};
use super::outputs::{self, is_standard_output, write};
use super::run::interruption;
use super::scenario::ScenarioArguments;
use super::{Exit, Failure};
use tautline_sim::scenario::Override;
use tautline_studies::compare::Watch;
use tautline_studies::margin::{Asked, Margin, MarginError, MarginPage, Plan, Question, Range};

/// Most runs of a value.
const MOST_RUNS: u64 = 1_000_000;
/// Largest seed that a scenario file can say, less the most runs.
const LAST_SEED: u64 = i64::MAX as u64 - MOST_RUNS;

/// Arguments of `tautline margin`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 0 where the verdict turns or holds everywhere, with 1 where it holds nowhere or the search was interrupted. Flown \
once (--runs 1) everything but the key is as the scenario says; with more runs, run k has start.seed and noise.seed = S + k, and \
where nothing is random the start is moved a little. docs/margins.md says more.")]
pub(super) struct MarginArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// The key that is changed, such as `time.control_hz`.
    #[arg(long, value_name = "KEY.PATH")]
    key: String,
    /// Its first value.
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    from: f64,
    /// Its last value.
    #[arg(long, value_name = "B", allow_negative_numbers = true)]
    to: f64,
    /// Runs of each value: it holds where every one of them does.
    #[arg(long, value_name = "R", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=MOST_RUNS))]
    runs: u64,
    /// Seed of the first run.
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=LAST_SEED))]
    seed: u64,
    /// What every run has to show.
    #[arg(long, value_enum, value_name = "WHAT", default_value_t = Verdict::Pass)]
    verdict: Verdict,
    /// Values, evenly spaced with both ends, that are looked at first.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(2..=1000))]
    scan: u16,
    /// Times that the interval in which the verdict turns is halved.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(0..=50))]
    halvings: u32,
    /// Space and halve values by their ratio.
    #[arg(long)]
    log: bool,
    /// Write everything as JSON; - is standard output, for this and the next two.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a row a value as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a page with a plot.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Overwrite files that exist.
    #[arg(long)]
    force: bool,
    /// Print no table and no progress.
    #[arg(long)]
    quiet: bool,
    /// Threads to use, by default one a core; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

/// What every run of a value has to show.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Verdict {
    /// It passes: clear, and its formation reached as far as asked.
    Pass,
    /// No two vehicles come closer than delta, to the end of the flight.
    Clear,
    /// The formation is reached and kept to the end.
    Reached,
}

impl From<Verdict> for Question {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Pass => Self::Pass,
            Verdict::Clear => Self::Clear,
            Verdict::Reached => Self::Reached,
        }
    }
}

impl MarginArguments {
    fn outputs(&self) -> impl Iterator<Item = (&'static str, &Path)> {
        let all = [("--json", &self.json), ("--csv", &self.csv), ("--html", &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?)))
    }

    fn plan(&self) -> Result<Plan, Failure> {
        let overrides = &self.what.overrides;
        let overrides = overrides.iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>()?;
        let range = Range {
            from: self.from,
            to: self.to,
            scan: self.scan.into(),
            halvings: self.halvings,
            logarithmic: self.log,
        };
        let asked = Asked { question: self.verdict.into(), runs: self.runs, seed: self.seed };
        Ok(Plan::new(self.what.source()?, &overrides, &self.key, range, asked)?)
    }

    /// The command that makes the same search again, for a shell.
    fn command(&self) -> String {
        let numbers = [self.from, self.to].map(|number| format!("{number:?}"));
        let counts = [self.runs.to_string(), self.seed.to_string(), self.scan.to_string(), self.halvings.to_string()];
        let verdict = self.verdict.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
        let [runs, seed, scan, halvings] = counts.each_ref().map(String::as_str);
        let what = ["margin", &self.what.scenario, "--key", &self.key, "--from", &numbers[0], "--to", &numbers[1]];
        let asked = ["--runs", runs, "--seed", seed, "--verdict", &verdict, "--scan", scan, "--halvings", halvings];
        let sets = self.what.overrides.iter().flat_map(|text| ["--set", text]);
        let words: Vec<_> = what.into_iter().chain(asked).chain(self.log.then_some("--log")).chain(sets).collect();
        console::command_line(words.into_iter())
    }

    /// The commands that fly the two sides of the bracket: a run that holds, and the first that does not.
    fn sides(&self, plan: &Plan, margin: &Margin) -> Vec<(String, String)> {
        let question = margin.question;
        let side = |(probe, what): (&tautline_studies::margin::Probe, &str)| {
            let sets = plan.sets(probe.value, probe.worst_run(question));
            let sets = self.what.overrides.iter().chain(&sets).flat_map(|set| ["--set", set.as_str()]);
            let words = ["run", &self.what.scenario].into_iter().chain(sets).collect::<Vec<_>>();
            (format!("A flight that {what}:"), console::command_line(words.into_iter()))
        };
        margin.sides().into_iter().flat_map(|sides| sides.into_iter().zip(question.words())).map(side).collect()
    }
}

pub(super) fn margin(arguments: &MarginArguments) -> Result<Exit, Failure> {
    let data_on_stdout = arguments.outputs().any(|(_, file)| is_standard_output(file));
    let console = Console { data_on_stdout, quiet: arguments.quiet };
    outputs::check_new(&arguments.what.scenario, arguments.outputs(), arguments.force)?;
    let plan = arguments.plan()?;
    let threads = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    let interrupted = interruption()?;

    let bar = console.progress(plan.steps(), "margin".to_owned());
    let found = plan.search(threads, Watch { flown: &|steps| bar.inc(steps), interrupted: &interrupted });
    bar.finish_and_clear();
    let Some(margin) = found? else {
        console.warn("interrupted before the verdict was known at both ends of an interval: there is nothing to say");
        return Ok(Exit::Bad);
    };
    for note in margin.notes() {
        console.warn(&format!("note: {note}"));
    }
    let sides = arguments.sides(&plan, &margin);
    let repeated: Vec<_> = sides.iter().map(|(what, command)| format!("{what}\n  {command}")).collect();
    let said = [vec![margin.headline()], margin.predictions()].concat().join("\n");
    console.say(&format!("{said}\n\n{}\n{}", margin.text(), repeated.join("\n")));
    leave(arguments, &margin, &sides, console)?;
    let known = !margin.interrupted && (margin.turn.is_some() || margin.holds_everywhere());
    Ok(if known { Exit::Good } else { Exit::Bad })
}

/// Writes what was asked for.
fn leave(
    arguments: &MarginArguments,
    margin: &Margin,
    sides: &[(String, String)],
    console: Console,
) -> Result<(), Failure> {
    let unwritten = |error: &dyn std::error::Error| Failure::machine(format!("cannot write the result: {error}"));
    if let Some(file) = &arguments.json {
        write(file, margin.to_json().map_err(|error| unwritten(&error))?.as_bytes())?;
    }
    if let Some(file) = &arguments.csv {
        write(file, &margin.to_csv().map_err(|error| unwritten(&error))?)?;
    }
    if let Some(file) = &arguments.html {
        write(file, margin.to_html(&MarginPage { command: &arguments.command(), sides }).as_bytes())?;
    }
    for (_, file) in arguments.outputs().filter(|(_, file)| !is_standard_output(file)) {
        console.say(&format!("wrote {}", file.display()));
    }
    Ok(())
}

impl From<MarginError> for Failure {
    fn from(error: MarginError) -> Self {
        match error {
            MarginError::Range(why) => Self::input(
                why,
                "give --from and --to two different finite numbers, both more than 0 where --log is given",
            ),
            MarginError::Scenario { set, error } => Self::from(error).under(&format!("with {set}")),
            MarginError::Flight { set, error } => Self::from(error).under(&format!("with {set}")),
        }
    }
}
