//! `tautline margin`: where between two values of a key the verdict turns.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, TypedValueParser};

use super::Exit;
use super::console::{Console, Terminal};
use super::reading::one_of;
use super::scenario::ScenarioArguments;
use tautline_report::request::Failure;
use tautline_report::request::outputs::is_standard_output;
use tautline_studies::margin::{Asked, MarginRequest, Question, Range, margin as answer};
use tautline_studies::{MOST_RUNS, SEEDS};

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
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(SEEDS))]
    seed: u64,
    /// What every run has to show.
    #[arg(long, value_name = "WHAT", default_value = "pass", value_parser = verdict())]
    verdict: Question,
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

fn verdict() -> impl TypedValueParser<Value = Question> {
    let help = |question| match question {
        Question::Pass => "It passes: clear, and its formation reached as far as asked",
        Question::Clear => "No two vehicles come closer than delta, to the end of the flight",
        Question::Reached => "The formation is reached and kept to the end",
    };
    one_of(Question::ALL.map(|question| (PossibleValue::new(question.name()).help(help(question)), question)).into())
}

impl MarginArguments {
    fn request(&self) -> Result<MarginRequest, Failure> {
        Ok(MarginRequest {
            range: Range {
                from: self.from,
                to: self.to,
                scan: self.scan.into(),
                halvings: self.halvings,
                logarithmic: self.log,
            },
            asked: Asked { question: self.verdict, runs: self.runs, seed: self.seed },
            json: self.json.clone(),
            csv: self.csv.clone(),
            html: self.html.clone(),
            force: self.force,
            threads: self.threads.map(usize::from),
            ..MarginRequest::new(self.what.request()?, &self.key, self.from, self.to)
        })
    }
}

pub(super) fn margin(arguments: &MarginArguments) -> Result<Exit, Failure> {
    let request = arguments.request()?;
    let data_on_stdout = request.outputs().any(|(_, file)| is_standard_output(file));
    let monitor = Terminal::new(Console { data_on_stdout, quiet: arguments.quiet })?;
    Ok(Exit::good_if(answer(&request, &monitor)?.is_some_and(|margin| margin.is_known())))
}
