//! `tautline campaign`: many flights, one answer with an error bar, on one machine or on as many as see one folder.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::Exit;
use super::console::{self, Console, Terminal};
use super::run::pictures;
use tautline_report::request::{Failure, Pictures, command_line};
use tautline_studies::Study as _;
use tautline_studies::campaign::{
    self as study, CampaignAnswer, CampaignRequest, Folder, Program, ReplayRequest, listed, parse,
};

/// Arguments of `tautline campaign`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 0 where no flight violated (missing: where nothing is missing), with 1 where one did, where that is not known of all, \
or where it was interrupted, with 2 for wrong input, other campaigns' parts and missing shards, with 3 where the machine failed or two machines flew \
different results. docs/campaigns.md says more.")]
pub(super) struct CampaignArguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Fly everything on this machine, merge it and report; started again it goes on where it was.
    Run(RunCampaign),
    /// Split a campaign into shards, which are then flown anywhere.
    Plan(PlanCampaign),
    /// Fly one shard or several.
    Shard(ShardCampaign),
    /// Print the shards that are missing, as --shard takes them; exits with 0 where there are none.
    Missing(InFolder),
    /// Put all parts together: results.parquet, campaign.json and campaign.html.
    Merge(Answered),
    /// Say the answer of a campaign again, and write its page anew.
    Report(Answered),
    /// Fly a run again, with its recording and pictures, and compare its state hash.
    Replay(Replay),
}

/// A specification, and when to stop.
#[derive(Debug, Args)]
struct SpecArguments {
    /// The specification.
    #[arg(value_name = "SPEC.toml")]
    spec: PathBuf,
    /// Stop as soon as the interval of each law's share of clear flights is no wider.
    #[arg(long, value_name = "W")]
    until_width: Option<f64>,
    /// Stop as soon as each law's share of clear flights is known to be above or below P.
    #[arg(long, value_name = "P")]
    until_decided: Option<f64>,
}

#[derive(Debug, Args)]
struct RunCampaign {
    #[command(flatten)]
    spec: SpecArguments,
    /// Folder for everything; by default out/NAME, where NAME is the specification's.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Parts to fly it in; one that is whole is not flown again.
    #[arg(long, value_name = "N")]
    shards: Option<u64>,
    /// Threads to use, by default one a core; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    #[command(flatten)]
    says: Says,
}

#[derive(Debug, Args)]
struct PlanCampaign {
    #[command(flatten)]
    spec: SpecArguments,
    /// Folder for everything.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Parts to fly it in, by default one for 250 runs.
    #[arg(long, value_name = "N")]
    shards: Option<u64>,
}

#[derive(Debug, Args)]
struct ShardCampaign {
    #[command(flatten)]
    folder: InFolder,
    /// Which, from 0 on: 7, 3-5, 13,500-502, or env:NAME for what that variable says, such as `env:SLURM_ARRAY_TASK_ID`.
    #[arg(long, value_name = "K|A-B|env:NAME")]
    shard: String,
    /// Threads to use; the result is the same for any number.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: u16,
    /// Print no progress.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct InFolder {
    /// The folder of the campaign, or its manifest.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

#[derive(Debug, Args)]
struct Answered {
    #[command(flatten)]
    folder: InFolder,
    #[command(flatten)]
    says: Says,
}

/// How an answer is said.
#[derive(Debug, Args)]
struct Says {
    /// Flights with the least clearance that are flown again, each with its recording, report and pictures.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u8).range(0..=10))]
    worst: u8,
    /// Take no pictures of them.
    #[arg(long)]
    no_snapshots: bool,
    /// Print the answer as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// Print no summary and no progress.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Args)]
struct Replay {
    #[command(flatten)]
    folder: InFolder,
    /// Number of the run, from 0.
    #[arg(long, value_name = "I")]
    run: u64,
    /// The law, where several fly each run; the first unless given.
    #[arg(long, value_name = "NAME")]
    law: Option<String>,
    /// The flight among those that were violated in this run, from 0, where runs are estimates of rare violations.
    #[arg(long, value_name = "K")]
    bad: Option<usize>,
    /// Folder for the recording and the report; by default worst/LAW-run-I in the campaign's.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Take no pictures.
    #[arg(long)]
    no_snapshots: bool,
}

pub(super) fn campaign(arguments: &CampaignArguments) -> Result<Exit, Failure> {
    match &arguments.what {
        What::Run(run) => {
            let request = CampaignRequest {
                out: run.out.clone(),
                shards: run.shards,
                threads: run.threads.map(usize::from),
                worst: run.says.worst.into(),
                ..run.spec.request()
            };
            run.says.answer(|monitor| study::campaign(&request, &*run.says.pictures(), monitor))
        }
        What::Plan(plan) => {
            let request = CampaignRequest { out: Some(plan.out.clone()), shards: plan.shards, ..plan.spec.request() };
            let folder = request.plan()?;
            let manifest = folder.campaign().manifest();
            let console = Console { data_on_stdout: false, quiet: false };
            let shards = format!("0-{}", manifest.shards - 1);
            let words = ["campaign", "shard", &plan.out.display().to_string(), "--shard", &shards];
            console.say(&format!(
                "{} runs in {} shards, campaign {}\nfly them with: {}",
                manifest.runs,
                manifest.shards,
                manifest.campaign,
                command_line(words.into_iter())
            ));
            Ok(Exit::Good)
        }
        What::Shard(shard) => {
            let folder = shard.folder.open()?;
            let shards = parse(&shard.shard, folder.campaign().manifest().shards)?;
            let monitor = Terminal::new(Console { data_on_stdout: false, quiet: shard.quiet })?;
            Ok(Exit::good_if(study::fly_shards(&folder, &shards, shard.threads.into(), &monitor)?))
        }
        What::Missing(at) => {
            let monitor = Terminal::without_signals(Console { data_on_stdout: true, quiet: false });
            let missing = study::missing_shards(&at.open()?, &monitor)?;
            console::data(&if missing.is_empty() { String::new() } else { listed(&missing) + "\n" })?;
            Ok(Exit::good_if(missing.is_empty()))
        }
        What::Merge(Answered { folder, says }) => {
            let folder = folder.open()?;
            says.answer(|monitor| study::merge(&folder, says.worst.into(), &*says.pictures(), monitor))
        }
        What::Report(Answered { folder, says }) => {
            let folder = folder.open()?;
            says.answer(|monitor| study::report(&folder, says.worst.into(), &*says.pictures(), monitor))
        }
        What::Replay(replay) => {
            let request =
                ReplayRequest { run: replay.run, law: replay.law.clone(), bad: replay.bad, out: replay.out.clone() };
            let folder = replay.folder.open()?;
            let monitor = Terminal::new(Console { data_on_stdout: false, quiet: false })?;
            Ok(Exit::good_if(study::replay(&folder, &request, &*pictures("best", !replay.no_snapshots), &monitor)?))
        }
    }
}

impl SpecArguments {
    fn request(&self) -> CampaignRequest {
        CampaignRequest {
            until_width: self.until_width,
            until_decided: self.until_decided,
            ..CampaignRequest::new(self.spec.clone())
        }
    }
}

impl InFolder {
    fn open(&self) -> Result<Folder, Failure> {
        Ok(Folder::open(&self.folder, &Program::running()?)?)
    }
}

impl Says {
    fn pictures(&self) -> Box<dyn Pictures> {
        pictures("best", !self.no_snapshots)
    }

    /// Answers a request, and prints the answer as JSON where that is asked for.
    fn answer(
        &self,
        request: impl FnOnce(&Terminal) -> Result<Option<CampaignAnswer>, Failure>,
    ) -> Result<Exit, Failure> {
        let monitor = Terminal::new(Console { data_on_stdout: self.json, quiet: self.quiet })?;
        let Some(CampaignAnswer { summary, .. }) = request(&monitor)? else { return Ok(Exit::Bad) };
        if self.json {
            console::json(&summary)?;
        }
        Ok(Exit::good_if(summary.is_good()))
    }
}
