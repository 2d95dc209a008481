//! `tautline compare`: laws side by side on the same starts.

use std::path::PathBuf;

use clap::Args;

use super::Exit;
use super::console::{Console, Terminal};
use super::pictures::pictures;
use super::scenario::ScenarioArguments;
use tautline_report::request::Failure;
use tautline_report::request::outputs::is_standard_output;
use tautline_studies::compare::{CompareRequest, compare as answer};
use tautline_studies::{MOST_RUNS, SEEDS};

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
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(SEEDS))]
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

    fn request(&self) -> Result<CompareRequest, Failure> {
        Ok(CompareRequest {
            laws: self.laws.clone(),
            runs: self.runs,
            seed: self.seed,
            json: self.json.clone(),
            csv: self.csv.clone(),
            latex: self.latex.clone(),
            html: self.html.clone(),
            force: self.force,
            threads: self.threads.map(usize::from),
            ..CompareRequest::new(self.what.request()?)
        })
    }
}

pub(super) fn compare(arguments: &CompareArguments) -> Result<Exit, Failure> {
    let request = arguments.request()?;
    let data_on_stdout = request.outputs().any(|(_, file)| is_standard_output(file));
    let monitor = Terminal::new(Console { data_on_stdout, quiet: arguments.quiet })?;
    let comparison = answer(&request, &*pictures(&arguments.adapter, true), &monitor)?;
    Ok(Exit::good_if(comparison.is_some_and(|comparison| comparison.runs == comparison.runs_asked)))
}
