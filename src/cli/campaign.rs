//! `tautline campaign`: many flights, merged into one answer with intervals.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::Exit;
use super::console::{self, Console, Terminal};
use super::json::JsonArgument;
use super::run::pictures;
use tautline_core::option::PYTHON_LAW;
use tautline_report::request::{Failure, Pictures, command_line};
use tautline_studies::Study as _;
use tautline_studies::campaign::{
    self as study, CampaignRequest, Folder, LoadLaw, Program, ReplayRequest, Summary, listed, parse,
};

/// Arguments of `tautline campaign`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exit codes: 0 no violation (`missing`: no missing shard); 1 violations, unknown flights, or interrupted; 2 wrong \
input; 3 failure of the machine. See docs/campaigns.md for all causes.")]
pub(super) struct CampaignArguments {
    #[command(subcommand)]
    command: CampaignCommand,
}

#[derive(Debug, Subcommand)]
enum CampaignCommand {
    /// Fly a whole campaign on this machine, merge and report it; a repeated call continues an interrupted campaign.
    Run(RunArguments),
    /// Split a campaign into shards that several machines can fly.
    Plan(PlanArguments),
    /// Fly one or several shards.
    Shard(ShardArguments),
    /// Print the missing shards as a list for --shard; exits with 0 if none is missing.
    Missing(FolderArguments),
    /// Merge all parts into results.parquet, campaign.json and campaign.html; flies the worst flights again (--worst).
    Merge(AnswerArguments),
    /// Print the answer of a campaign and rewrite its page; flies the worst flights again (--worst).
    Report(AnswerArguments),
    /// Repeat one flight with recording and pictures, and compare its state hash.
    Replay(ReplayArguments),
}

/// Specification with the rule for an early stop.
#[derive(Debug, Args)]
struct SpecArguments {
    /// Specification of the campaign (TOML).
    #[arg(value_name = "SPEC.toml")]
    spec: PathBuf,
    /// Stop when the interval of each law's share of clear flights is at most W wide.
    #[arg(long, value_name = "W")]
    until_width: Option<f64>,
    /// Stop when the interval of each law's share of clear flights does not contain P.
    #[arg(long, value_name = "P")]
    until_decided: Option<f64>,
    /// Law in Python that flies every run; only in the program of the Python package, `python -m tautline`.
    #[arg(long, value_name = "MODULE:CLASS")]
    python_law: Option<String>,
}

#[derive(Debug, Args)]
struct RunArguments {
    #[command(flatten)]
    spec: SpecArguments,
    /// Folder of the campaign [default: out/NAME with the name of the specification].
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of shards [default: one for 250 runs]; finished shards are not flown again.
    #[arg(long, value_name = "N")]
    shards: Option<u64>,
    /// Number of threads [default: one for each core]; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    #[command(flatten)]
    answer: AnswerOptions,
}

#[derive(Debug, Args)]
struct PlanArguments {
    #[command(flatten)]
    spec: SpecArguments,
    /// Folder of the campaign.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Number of shards [default: one for 250 runs].
    #[arg(long, value_name = "N")]
    shards: Option<u64>,
}

#[derive(Debug, Args)]
struct ShardArguments {
    #[command(flatten)]
    folder: FolderArguments,
    /// Shards to fly, from 0: 7, 3-5, 13,500-502, or env:NAME for a list in an environment variable, such as
    /// `env:SLURM_ARRAY_TASK_ID`.
    #[arg(long, value_name = "K|A-B|env:NAME")]
    shard: String,
    /// Number of threads; the result is the same for any number.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Print no progress.
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct FolderArguments {
    /// Folder of the campaign, or its manifest.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

#[derive(Debug, Args)]
struct AnswerArguments {
    #[command(flatten)]
    folder: FolderArguments,
    #[command(flatten)]
    answer: AnswerOptions,
}

/// Form of an answer.
#[derive(Debug, Args)]
struct AnswerOptions {
    /// Number of flights with the least clearance to fly again, each with recording, report and pictures for the page;
    /// 0 flies none.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u8).range(0..=10))]
    worst: u8,
    /// Take no pictures of these flights.
    #[arg(long)]
    no_snapshots: bool,
    #[command(flatten)]
    json: JsonArgument,
    /// Print no summary and no progress.
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct ReplayArguments {
    #[command(flatten)]
    folder: FolderArguments,
    /// Number of the run, from 0.
    #[arg(long, value_name = "I")]
    run: u64,
    /// Law of the flight [default: the first].
    #[arg(long, value_name = "NAME")]
    law: Option<String>,
    /// Violated flight of the run to repeat, counted from 0; only for campaigns that estimate rare violations.
    #[arg(long, value_name = "K")]
    bad: Option<usize>,
    /// Folder for the recording and the report [default: worst/LAW-run-I in the folder of the campaign].
    #[arg(long, short, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Take no pictures.
    #[arg(long)]
    no_snapshots: bool,
}

pub(super) fn campaign(arguments: &CampaignArguments, load: &LoadLaw<'_>) -> Result<Exit, Failure> {
    match &arguments.command {
        CampaignCommand::Run(run) => {
            let request = CampaignRequest {
                out: run.out.clone(),
                shards: run.shards,
                threads: run.threads.map(usize::from),
                worst: run.answer.worst.into(),
                ..run.spec.request(load)?
            };
            run.answer.run(|monitor| study::campaign(&request, &*run.answer.pictures()?, monitor))
        }
        CampaignCommand::Plan(plan) => {
            let request =
                CampaignRequest { out: Some(plan.out.clone()), shards: plan.shards, ..plan.spec.request(load)? };
            let file = plan.out.join("manifest.json");
            let was_planned = file.exists();
            let folder = request.plan()?;
            let manifest = folder.campaign().manifest();
            let console = Console { data_on_stdout: false, quiet: false };
            let shards = format!("0-{}", manifest.shards - 1);
            let words = ["campaign", "shard", &plan.out.display().to_string(), "--shard", &shards];
            let place = if was_planned { "planned before in" } else { "wrote" };
            console.say(&format!(
                "{place} {}: {} runs in {} shards, campaign {}\nfly them with: {}",
                file.display(),
                manifest.runs,
                manifest.shards,
                manifest.campaign,
                command_line(words.into_iter())
            ));
            Ok(Exit::Good)
        }
        CampaignCommand::Shard(shard) => {
            let folder = shard.folder.open(load)?;
            let shards = parse(&shard.shard, folder.campaign().manifest().shards)?;
            let monitor = Terminal::new(Console { data_on_stdout: false, quiet: shard.quiet })?;
            Ok(Exit::good_if(study::fly_shards(&folder, &shards, shard.threads.into(), &monitor)?))
        }
        CampaignCommand::Missing(at) => {
            let monitor = Terminal::without_signals(Console { data_on_stdout: true, quiet: false });
            let missing = study::missing_shards(&at.open(load)?, &monitor)?;
            console::data(&if missing.is_empty() { String::new() } else { listed(&missing) + "\n" })?;
            Ok(Exit::good_if(missing.is_empty()))
        }
        CampaignCommand::Merge(AnswerArguments { folder, answer }) => {
            let folder = folder.open(load)?;
            answer.run(|monitor| study::merge(&folder, answer.worst.into(), &*answer.pictures()?, monitor))
        }
        CampaignCommand::Report(AnswerArguments { folder, answer }) => {
            let folder = folder.open(load)?;
            answer.run(|monitor| study::report(&folder, answer.worst.into(), &*answer.pictures()?, monitor))
        }
        CampaignCommand::Replay(replay) => {
            let request =
                ReplayRequest { run: replay.run, law: replay.law.clone(), bad: replay.bad, out: replay.out.clone() };
            let folder = replay.folder.open(load)?;
            let monitor = Terminal::new(Console { data_on_stdout: false, quiet: false })?;
            Ok(Exit::good_if(study::replay(&folder, &request, &*pictures("best", !replay.no_snapshots)?, &monitor)?))
        }
    }
}

impl SpecArguments {
    fn request(&self, load: &LoadLaw<'_>) -> Result<CampaignRequest, Failure> {
        let external_law = self.python_law.as_deref().map(|name| {
            load(name).unwrap_or_else(|| {
                let problem = format!("{}: this program cannot import laws in Python", PYTHON_LAW.set(name));
                Err(Failure::input("request/python-law", problem, "use the program of the Python package"))
            })
        });
        Ok(CampaignRequest {
            until_width: self.until_width,
            until_decided: self.until_decided,
            external_law: external_law.transpose()?,
            ..CampaignRequest::new(self.spec.clone())
        })
    }
}

impl FolderArguments {
    fn open(&self, load: &LoadLaw<'_>) -> Result<Folder, Failure> {
        Folder::open(&self.folder, &Program::running()?, load)
    }
}

impl AnswerOptions {
    fn pictures(&self) -> Result<Box<dyn Pictures>, Failure> {
        pictures("best", !self.no_snapshots)
    }

    /// Answers a request, and writes the answer as JSON if asked.
    fn run(&self, request: impl FnOnce(&Terminal) -> Result<Option<Summary>, Failure>) -> Result<Exit, Failure> {
        let console = Console { data_on_stdout: self.json.is_piped(), quiet: self.quiet };
        self.json.check_new()?;
        let Some(summary) = request(&Terminal::new(console)?)? else { return Ok(Exit::Bad) };
        self.json.write(&summary, console)?;
        Ok(Exit::good_if(summary.is_good()))
    }
}
