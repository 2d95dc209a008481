//! `tautline campaign`: many flights, one answer with an error bar, on one machine or on as many as see one folder.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use clap::{Args, Subcommand};

use super::campaign_worst::{self, Looks};
use super::console::{self, Console};
use super::run::{RECORDING, RunArguments, interruption};
use super::{Exit, Failure};
use tautline_report::report::write_atomically;
use tautline_studies::campaign::{
    ANSWER, Campaign, CampaignError, Folder, Program, RESULTS, Shard, Spec, Stop, Summary, Tally, listed, parse,
};
use tautline_studies::compare::Watch;

/// The page for people.
const PAGE: &str = "campaign.html";

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

/// A specification, and what is asked beyond it.
#[derive(Debug, Args)]
struct Asked {
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
    asked: Asked,
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
    asked: Asked,
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
    #[command(flatten)]
    looks: Looks,
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
    #[cfg(feature = "viewer")]
    #[arg(long)]
    no_snapshots: bool,
}

pub(super) fn campaign(arguments: &CampaignArguments) -> Result<Exit, Failure> {
    match &arguments.what {
        What::Run(run) => run_whole(run),
        What::Plan(plan) => {
            let folder = planned(&plan.asked, &plan.out, plan.shards)?;
            let manifest = folder.campaign().manifest();
            let console = Console { data_on_stdout: false, quiet: false };
            console.say(&format!(
                "{} runs in {} shards, campaign {}\nfly them with: {}",
                manifest.runs,
                manifest.shards,
                manifest.campaign,
                console::command_line(
                    ["campaign", "shard", &shown(&plan.out), "--shard", &format!("0-{}", manifest.shards - 1)]
                        .into_iter()
                )
            ));
            Ok(Exit::Good)
        }
        What::Shard(shard) => fly_shards(shard),
        What::Missing(at) => {
            let folder = opened(at)?;
            let missing = folder.missing()?;
            let console = Console { data_on_stdout: true, quiet: false };
            for &shard in &missing {
                warn_of_damage(&folder, shard, console)?;
            }
            console::data(&if missing.is_empty() { String::new() } else { listed(&missing) + "\n" })?;
            Ok(if missing.is_empty() { Exit::Good } else { Exit::Bad })
        }
        What::Merge(merge) => {
            let folder = opened(&merge.folder)?;
            let interrupted = interruption()?;
            merged(&folder, &merge.says, &interrupted)
        }
        What::Report(report) => {
            let folder = opened(&report.folder)?;
            let interrupted = interruption()?;
            let summary = folder.summary().map_err(|error| Failure::from(error).naming(&shown(folder.path())))?;
            answer(&folder, &summary, &report.says, None, &interrupted)
        }
        What::Replay(replay) => fly_again(replay),
    }
}

impl Asked {
    /// Text and keys of the specification.
    fn spec(&self) -> Result<(String, Spec), Failure> {
        let shown = self.spec.display().to_string();
        let text = std::fs::read_to_string(&self.spec).map_err(|error| {
            Failure::input(
                format!("cannot read {shown}: {error}"),
                "give the path of a specification, as docs/campaigns.md shows one",
            )
        })?;
        let mut spec = Spec::read(&shown, &text)?;
        if self.until_width.is_some() || self.until_decided.is_some() {
            let stop =
                spec.stop.unwrap_or(Stop { of: tautline_studies::campaign::Asked::Clear, width: None, decided: None });
            spec.stop = Some(Stop {
                width: self.until_width.or(stop.width),
                decided: self.until_decided.or(stop.decided),
                ..stop
            });
        }
        Ok((text, spec))
    }

    fn name(&self) -> String {
        self.spec.file_stem().map_or_else(|| "campaign".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn opened(at: &InFolder) -> Result<Folder, Failure> {
    Ok(Folder::open(&at.folder, &Program::running()?)?)
}

fn planned(asked: &Asked, out: &Path, shards: Option<u64>) -> Result<Folder, Failure> {
    let folder = asked.spec.parent().unwrap_or(Path::new(""));
    let (text, spec) = asked.spec()?;
    let campaign = Campaign::plan(&spec, &asked.name(), folder, shards, Program::running()?).map_err(|error| {
        let place = error.place(&shown(&asked.spec), &text);
        place.into_iter().fold(Failure::from(error), |failure, place| failure.at(&place))
    })?;
    Ok(Folder::plan(out, campaign, shards.is_some())?)
}

fn run_whole(arguments: &RunCampaign) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.says.json, quiet: arguments.says.quiet };
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("out").join(arguments.asked.name()));
    let folder = planned(&arguments.asked, &out, arguments.shards)?;
    let threads = arguments.threads.map_or_else(rayon::current_num_threads, usize::from);
    let interrupted = interruption()?;
    let campaign = folder.campaign();
    let manifest = campaign.manifest();
    let bar = console.progress(campaign.steps(manifest.runs), manifest.name.clone());
    let began = Instant::now();
    let mut flights = 0;
    let mut tally = Tally::new(campaign.laws().len(), campaign.stop());
    for shard in 0..manifest.shards {
        if tally.is_enough() {
            break;
        }
        bar.suspend(|| warn_of_damage(&folder, shard, console))?;
        let rows =
            match folder.fly(shard, threads, Watch { flown: &|steps| bar.inc(steps), interrupted: &interrupted })? {
                Shard::Kept(rows) => {
                    bar.inc(campaign.steps(rows.len() as u64 / campaign.laws().len() as u64));
                    rows
                }
                Shard::Flown { rows, flown } => {
                    flights += flown;
                    rows
                }
                Shard::Interrupted => {
                    bar.finish_and_clear();
                    console.warn("interrupted: what was flown is kept, and the same command goes on from there");
                    return Ok(Exit::Bad);
                }
            };
        for row in &rows {
            tally.take(row);
        }
    }
    bar.finish_and_clear();
    if flights > 0 {
        let seconds = began.elapsed().as_secs_f64();
        let an_hour = 3600.0 * flights as f64 / seconds;
        let what = if campaign.splitting().is_some() { "estimates" } else { "flights" };
        let on = if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        console.say(&format!("{flights} {what} in {seconds:.1} s on {on}: {an_hour:.0} an hour"));
    }
    merged(&folder, &arguments.says, &interrupted)
}

fn fly_shards(arguments: &ShardCampaign) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: false, quiet: arguments.quiet };
    let folder = opened(&arguments.folder)?;
    let manifest = folder.campaign().manifest();
    let shards = parse(&arguments.shard, manifest.shards)?;
    let interrupted = interruption()?;
    let runs = shards.iter().map(|&shard| manifest.range(shard)).map(|range| range.end - range.start).sum();
    let bar = console.progress(folder.campaign().steps(runs), manifest.name.clone());
    for shard in shards {
        bar.suspend(|| warn_of_damage(&folder, shard, console))?;
        let watch = Watch { flown: &|steps| bar.inc(steps), interrupted: &interrupted };
        let done = match folder.fly(shard, arguments.threads.into(), watch)? {
            Shard::Kept(rows) => format!("shard {shard}: {} flights had been flown", rows.len()),
            Shard::Flown { flown, .. } => format!("shard {shard}: {flown} flights flown"),
            Shard::Interrupted => {
                bar.finish_and_clear();
                console.warn(&format!(
                    "interrupted in shard {shard}: what was flown is kept, and the same command goes on"
                ));
                return Ok(Exit::Bad);
            }
        };
        bar.suspend(|| console.say(&done));
    }
    bar.finish_and_clear();
    Ok(Exit::Good)
}

/// Says that the part of a shard is damaged: the shard is flown again.
fn warn_of_damage(folder: &Folder, shard: u64, console: Console) -> Result<(), Failure> {
    if let Some(part) = folder.damaged(shard)? {
        console.warn(&format!("{part}; shard {shard} is to be flown again, which replaces it"));
    }
    Ok(())
}

fn merged(folder: &Folder, says: &Says, interrupted: &AtomicBool) -> Result<Exit, Failure> {
    let merged = folder.merge().map_err(|error| {
        let failure = Failure::from(error);
        failure.naming(&shown(folder.path()))
    })?;
    answer(folder, &merged.summary, says, Some(&merged.sha256), interrupted)
}

/// Says the answer and writes its page.
fn answer(
    folder: &Folder,
    summary: &Summary,
    says: &Says,
    sha256: Option<&str>,
    interrupted: &AtomicBool,
) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: says.json, quiet: says.quiet };
    for note in summary.notes() {
        console.warn(&format!("note: {note}"));
    }
    console.say(&format!("{}\n\n{}", summary.headline(), summary.text()));
    let worst = campaign_worst::flown_again(folder, summary, &says.looks, console, interrupted)?;
    let path = folder.file(PAGE);
    if interrupted.load(Ordering::Relaxed) {
        console.warn("interrupted: no page was written");
        return Ok(Exit::Bad);
    }
    let command = console::command_line(["campaign", "run", &format!("{}.toml", summary.name)].into_iter());
    write_atomically(&path, summary.to_html(&worst.page(&command, &folder.campaign().manifest().spec)).as_bytes())?;
    if let Some(sha256) = sha256 {
        console.say(&format!("{sha256}  {}", folder.file(RESULTS).display()));
        console.say(&format!("wrote {} and {}", folder.file(ANSWER).display(), path.display()));
    } else {
        console.say(&format!("wrote {}", path.display()));
    }
    if says.json {
        console::json(summary)?;
    }
    Ok(if summary.is_clear() { Exit::Good } else { Exit::Bad })
}

fn fly_again(arguments: &Replay) -> Result<Exit, Failure> {
    let folder = opened(&arguments.folder)?;
    let campaign = folder.campaign();
    let names: Vec<_> = campaign.laws().iter().map(|law| law.name.as_str()).collect();
    let law = match &arguments.law {
        None => campaign.laws().first(),
        Some(name) => campaign.laws().iter().find(|law| law.name == *name),
    };
    let Some(law) = law else {
        let said = arguments.law.as_deref().unwrap_or_default();
        return Err(Failure::input(
            format!("no law of this campaign is named {said}"),
            format!("its laws are {}", names.join(", ")),
        ));
    };
    let runs = campaign.manifest().runs;
    if arguments.run >= runs {
        let help = format!("its runs are 0 to {}", runs - 1);
        return Err(Failure::input(format!("the campaign has no run {}", arguments.run), help));
    }
    if campaign.splitting().is_some() {
        let bad = arguments.bad.unwrap_or_default();
        let default = || campaign_worst::place_of_bad(&folder, &law.name, arguments.run, bad);
        let place = arguments.out.clone().unwrap_or_else(default);
        let hash = campaign_worst::fly_bad(&folder, law, [arguments.run, bad as u64], &place)?;
        console::data(&format!("state hash {hash}, as in the campaign\nwrote {}\n", place.join(RECORDING).display()))?;
        return Ok(Exit::Bad);
    }
    if let Some(out) = arguments.out.as_ref().filter(|out| out.join("report.json").exists()) {
        let message = format!("{} holds a finished run", out.display());
        return Err(Failure::input(message, "give another folder with --out"));
    }
    let mut options = RunArguments::for_folder(
        arguments.out.clone().unwrap_or_else(|| campaign_worst::place(&folder, &law.name, arguments.run)),
    );
    #[cfg(feature = "viewer")]
    {
        options = options.without_pictures(arguments.no_snapshots);
    }
    options = options.aloud();
    let interrupted = interruption()?;
    campaign_worst::replay(&folder, arguments.run, law, &options, &interrupted)
}

impl From<CampaignError> for Failure {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::Scenario { under, error, .. } => {
                let failure = Self::from(*error);
                if under.is_empty() { failure } else { failure.under(under.trim_end_matches(": ")) }
            }
            CampaignError::Flight { run, law, error } => {
                Self::from(*error).under(&format!("run {run} under the law {law}"))
            }
            other => Self::told(other.is_machine(), &other, other.help()),
        }
    }
}
