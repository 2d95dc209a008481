//! `tautline compare`, `margin`, `sweep` and `attack`: studies of many flights of one scenario.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValue, TypedValueParser};

use super::console::{Console, Terminal};
use super::json::JsonArgument;
use super::run::{ScenarioArguments, pictures};
use super::{Exit, completions};
use tautline_report::request::{Failure, one_of};
use tautline_studies::attack::{Bound, FLIGHTS, SEEDS_OF_A_CANDIDATE};
use tautline_studies::margin::Range;
use tautline_studies::sweep::SweptKey;
use tautline_studies::{
    Criterion, Experiment, MOST_RUNS, SEEDS, Study as _, StudyFiles, StudyRequest, answer, attack, compare, key_range,
    margin, sweep,
};

/// Scenario, files and threads of a study.
#[derive(Debug, Args)]
pub(super) struct StudyArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    #[command(flatten)]
    json: JsonArgument,
    /// Write a table as CSV, with a row for each law, value, point, or new worst candidate; - is standard output, also
    /// for the next two options.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the tables as LaTeX.
    #[arg(long, value_name = "FILE")]
    latex: Option<PathBuf>,
    /// Write a page with tables and figures.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Open the page in a browser.
    #[arg(long, requires = "html")]
    open: bool,
    /// Overwrite existing files, and a folder with a finished run.
    #[arg(long)]
    force: bool,
    /// Graphics adapter: best, hardware, software, none, or a part of its name.
    #[arg(long, value_name = "NAME", default_value = "best")]
    adapter: String,
    /// Print no table and no progress.
    #[arg(long, short)]
    quiet: bool,
    /// Number of threads [default: one for each core]; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

impl StudyArguments {
    /// Flies a study and writes its files. `folder` is that of a repeated flight.
    fn answer<E: Experiment>(&self, options: E, folder: Option<&Path>) -> Result<Exit, Failure> {
        let files = StudyFiles {
            json: self.json.place().map(Path::to_owned),
            csv: self.csv.clone(),
            latex: self.latex.clone(),
            html: self.html.clone(),
            force: self.force,
        };
        if let Some(folder) = folder {
            self.json.check_outside(folder)?;
        }
        let monitor = Terminal::new(Console { data_on_stdout: files.are_piped(), quiet: self.quiet })?;
        let threads = self.threads.map(usize::from);
        let request = StudyRequest { scenario: self.what.request()?, options, files, threads };
        let study = answer(&request, &*pictures(&self.adapter, true)?, &monitor)?;
        if let (true, Some(page)) = (self.open && study.is_some(), &self.html) {
            monitor.open_page(page);
        }
        Ok(Exit::good_if(study.is_some_and(|study| study.is_good())))
    }
}

/// Number of runs, and seed of the first.
#[derive(Debug, Args)]
struct RunArguments {
    /// Runs of each law [default: 20], or of each value or point [default: 1].
    #[arg(long, value_name = "R", value_parser = clap::value_parser!(u64).range(1..=MOST_RUNS))]
    runs: Option<u64>,
    /// Seed: run k, from 0, has `start.seed` and `noise.seed` S + k; a single run of a value or point keeps those of
    /// the scenario.
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = clap::value_parser!(u64).range(SEEDS))]
    seed: u64,
}

/// Arguments of `tautline compare`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit codes: 0 complete, for any result; 1 interrupted. The keys of a law are in [laws.NAME] of the scenario. NAME is \
the kind of the law, or any name if the table has a `kind`. See docs/studies.md.")]
pub(super) struct CompareArguments {
    #[command(flatten)]
    study: StudyArguments,
    #[command(flatten)]
    runs: RunArguments,
    /// Laws to compare: kinds, or names of tables [laws.NAME] [default: all such tables, or all kinds if there is no
    /// table].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', add = completions::choice("law.kind"))]
    laws: Option<Vec<String>>,
    /// Fly each law twice: without the shield (NAME+bare) and under it (NAME+shield), with the keys of [shield].
    #[arg(long)]
    shield: bool,
}

impl CompareArguments {
    /// Returns whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        self.study.html.is_some()
    }

    pub(super) fn run(&self) -> Result<Exit, Failure> {
        let default = compare::Options::default();
        let runs = self.runs.runs.unwrap_or(default.runs);
        self.study.answer(
            compare::Options {
                laws: self.laws.clone(),
                shield: self.shield,
                runs,
                seed: self.runs.seed,
                ..compare::Options::default()
            },
            None,
        )
    }
}

/// Arguments of `tautline margin`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit codes: 0 the verdict turns or holds everywhere; 1 it holds nowhere, or the search was interrupted. A single run \
(--runs 1) changes only the key. With more runs, run k has start.seed and noise.seed = S + k, and a scenario without \
randomness gets a small jitter of the start. See docs/studies.md.")]
pub(super) struct MarginArguments {
    #[command(flatten)]
    study: StudyArguments,
    #[command(flatten)]
    runs: RunArguments,
    /// Key with the first and the last of its values, such as `time.duration_s=20..40`.
    #[arg(long, value_name = "KEY=FROM..TO", value_parser = key_range, add = completions::key("="))]
    key: (String, [f64; 2]),
    /// Verdict that every run must show.
    #[arg(long, value_name = "WHAT", default_value = "pass", value_parser = verdict())]
    verdict: Criterion,
    /// Number of evenly spaced values, with both ends, that are flown first.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(2..=1000))]
    scan: u16,
    /// Number of halvings of the interval in which the verdict turns.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(0..=50))]
    halvings: u32,
    /// Space and halve values by their ratio.
    #[arg(long)]
    log: bool,
}

fn verdict() -> impl TypedValueParser<Value = Criterion> {
    let help = |question| match question {
        Criterion::Pass => "Clear, and the formation is reached as far as the scenario requires",
        Criterion::Clear => "No two vehicles come closer than delta up to the end",
        Criterion::Reached => "The formation is reached and kept to the end",
    };
    one_of(Criterion::ALL.map(|question| (PossibleValue::new(question.name()).help(help(question)), question)).into())
}

impl MarginArguments {
    pub(super) fn run(&self) -> Result<Exit, Failure> {
        let (scan, halvings, logarithmic) = (self.scan.into(), self.halvings, self.log);
        let (key, [from, to]) = self.key.clone();
        self.study.answer(
            margin::Options {
                key,
                range: Range { from, to, scan, halvings, logarithmic },
                question: self.verdict,
                runs: self.runs.runs.unwrap_or(1),
                seed: self.runs.seed,
            },
            None,
        )
    }
}

/// Arguments of `tautline sweep`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit codes: 0 complete, for any result; 1 interrupted, or more runs refused than flown. A single run (--runs 1) \
changes only the keys. With more runs, run k has start.seed and noise.seed = S + k, and a scenario without randomness \
gets a small jitter of the start. See docs/studies.md.")]
pub(super) struct SweepArguments {
    #[command(flatten)]
    study: StudyArguments,
    #[command(flatten)]
    runs: RunArguments,
    /// Key with evenly spaced or listed values: `sensing.latency_s=0..0.1:11` or `law.alpha=0.5,1,2`; give it twice for
    /// a grid.
    #[arg(
        long = "key",
        value_name = "KEY=FROM..TO:COUNT|KEY=V1,V2,...",
        required = true,
        add = completions::key("=")
    )]
    keys: Vec<String>,
    /// Verdict whose share is counted.
    #[arg(long, value_name = "WHAT", default_value = "pass", value_parser = verdict())]
    verdict: Criterion,
}

impl SweepArguments {
    pub(super) fn run(&self) -> Result<Exit, Failure> {
        self.study.answer(
            sweep::Options {
                keys: self.keys.iter().map(|text| SweptKey::parse(text)).collect::<Result<_, _>>()?,
                question: self.verdict,
                runs: self.runs.runs.unwrap_or(1),
                seed: self.runs.seed,
            },
            None,
        )
    }
}

/// Arguments of `tautline attack`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit codes: 0 no violation found; 1 violation or broken certificate found, nothing flown, or interrupted. This is a \
search, not a proof: worse flights may exist within the bounds. See docs/studies.md.")]
pub(super) struct AttackArguments {
    #[command(flatten)]
    study: StudyArguments,
    /// Numeric key with its bounds, such as `sensing.latency_s=0..0.1`; repeatable.
    #[arg(long, value_name = "KEY=FROM..TO", add = completions::key("="))]
    vary: Vec<String>,
    /// Move each start by up to R metres along each axis.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    move_start: Option<f64>,
    /// Change each initial velocity by up to V m/s along each axis.
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    velocity: Option<f64>,
    /// Smallest separation of two starts [m], more than delta [default: any start that can be flown].
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    apart: Option<f64>,
    /// Flights of the whole search.
    #[arg(long, value_name = "F", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(FLIGHTS))]
    flights: u64,
    /// Fly each candidate with K seeds of noise, from that of the scenario on; the worst one counts.
    #[arg(
        long,
        value_name = "K",
        default_value_t = 1,
        value_parser = clap::value_parser!(u64).range(SEEDS_OF_A_CANDIDATE)
    )]
    seeds: u64,
    /// Seed of the search; noise has the seed of the scenario.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Repeat the worst flight, and write its recording, report and pictures into this folder, as `tautline run` does.
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl AttackArguments {
    /// Returns whether pictures are taken.
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    pub(super) fn draws(&self) -> bool {
        self.out.is_some()
    }

    pub(super) fn run(&self) -> Result<Exit, Failure> {
        self.study.answer(
            attack::Options {
                vary: self.vary.iter().map(|text| Bound::parse(text)).collect::<Result<_, _>>()?,
                start_m: self.move_start,
                velocity_m_s: self.velocity,
                apart_m: self.apart,
                flights: self.flights,
                seeds: self.seeds,
                seed: self.seed,
                out: self.out.clone(),
            },
            self.out.as_deref(),
        )
    }
}
