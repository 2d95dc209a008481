//! Requests to plan, fly, merge and report a campaign, on one machine or on several with a common folder.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::replay::{WorstFlight, fly_worst_again, remove_former_worst};
use super::{ANSWER, Campaign, Folder, Program, RESULTS, Shard, Spec, Stop, Summary, Tally};
use crate::Criterion;
use crate::batch::Batch;
use crate::study::{Study as _, StudyPage};
use tautline_core::failure::{Failure, in_range};
use tautline_core::files::write_atomically;
use tautline_core::monitor::Monitor;
use tautline_core::option::WORST;
use tautline_core::text::counted;
use tautline_report::request::{Pictures, command_line};
use tautline_sim::scenario::ExternalLaw;

/// File name of the page.
const PAGE: &str = "campaign.html";
/// Largest number of flights that are flown again for the page.
pub const MOST_WORST: usize = 10;

/// A specification with its overrides, output folder, shards and threads.
#[derive(Clone, Debug)]
pub struct CampaignRequest {
    /// The file of the specification.
    pub spec: PathBuf,
    /// Text of the specification, in the place of that of the file.
    pub text: Option<String>,
    /// Stop as soon as the interval of each law's share of clear flights is at most this wide.
    pub until_width: Option<f64>,
    /// Stop as soon as the interval of each law's share of clear flights does not contain this share.
    pub until_decided: Option<f64>,
    /// Folder of the campaign; by default `out/NAME` with the name of the specification.
    pub out: Option<PathBuf>,
    /// Number of shards; by default one for 250 runs. Finished shards are not flown again.
    pub shards: Option<u64>,
    /// Number of threads; by default one for each core. The result is the same for any number.
    pub threads: Option<usize>,
    /// Number of flights with the least clearance that are flown again for the page: at most [`MOST_WORST`].
    pub worst: usize,
    /// Law that flies every run in place of the scenario's own.
    pub external_law: Option<ExternalLaw>,
}

impl CampaignRequest {
    /// Returns the request for a specification, with 10 worst flights on the page.
    #[must_use]
    pub fn new(spec: PathBuf) -> Self {
        Self {
            spec,
            text: None,
            until_width: None,
            until_decided: None,
            out: None,
            shards: None,
            threads: None,
            worst: MOST_WORST,
            external_law: None,
        }
    }

    /// Returns the name of the campaign.
    fn name(&self) -> String {
        self.spec.file_stem().map_or_else(|| "campaign".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// Returns the folder of the campaign.
    #[must_use]
    pub fn folder(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("out").join(self.name()))
    }

    /// Reads the specification and adds the keys of the request.
    fn read(&self) -> Result<Spec, Failure> {
        let shown = self.spec.display().to_string();
        let text = self.text.clone().map_or_else(|| fs::read_to_string(&self.spec), Ok).map_err(|error| {
            Failure::input(
                "campaign/cannot-read",
                format!("cannot read {shown}: {error}"),
                "give the path of a specification; docs/campaigns.md has an example",
            )
        })?;
        let mut spec = Spec::read(&shown, &text)?;
        if self.until_width.is_some() || self.until_decided.is_some() {
            let stop = spec.stop.unwrap_or(Stop { of: Criterion::Clear, width: None, decided: None });
            spec.stop = Some(Stop {
                width: self.until_width.or(stop.width),
                decided: self.until_decided.or(stop.decided),
                ..stop
            });
        }
        Ok(spec)
    }

    /// Plans the campaign into its folder, or opens the campaign that is there.
    ///
    /// # Errors
    /// [`Failure`] if the specification is wrong, or the folder is of another campaign.
    pub fn plan(&self) -> Result<Folder, Failure> {
        let folder = self.spec.parent().unwrap_or(Path::new(""));
        let (spec, law) = (self.read()?, self.external_law.as_ref());
        let campaign = Campaign::plan(&spec, &self.name(), folder, self.shards, Program::running()?, law)?;
        Folder::plan(&self.folder(), campaign, self.shards.is_some())
    }
}

/// Flies a whole campaign on this machine, merges it and writes its answer and page. A repeated call continues an
/// interrupted campaign. Returns `None` after an interruption; finished flights are kept.
///
/// # Errors
/// [`Failure`] if the specification is wrong, or a file cannot be written.
pub fn campaign(
    request: &CampaignRequest,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<Summary>, Failure> {
    in_range(WORST, &request.worst, &(0..=MOST_WORST))?;
    let batch = Batch::for_laws(request.threads, monitor, &request.external_law)?;
    let folder = request.plan()?;
    let campaign = folder.campaign();
    let manifest = campaign.manifest();
    monitor.begin(&manifest.name, Some(campaign.steps(manifest.runs)));
    let began = Instant::now();
    let mut flights = 0;
    let mut tally = Tally::new(campaign.laws().len(), campaign.stop());
    for shard in 0..manifest.shards {
        if tally.is_enough() {
            break;
        }
        let Some(Shard { rows, flown }) = fly_shard(&folder, shard, &batch, monitor)? else { return Ok(None) };
        if flown == 0 {
            monitor.advance(campaign.steps(rows.len() as u64 / campaign.laws().len() as u64));
        }
        flights += flown;
        for row in &rows {
            tally.take(row);
        }
    }
    monitor.finish();
    if flights > 0 {
        let seconds = began.elapsed().as_secs_f64();
        let an_hour = 3600.0 * flights as f64 / seconds;
        let what = if campaign.splitting().is_some() { "estimates" } else { "flights" };
        let on = counted(batch.threads() as u64, "thread", "threads");
        monitor.say(&format!("{flights} {what} in {seconds:.1} s on {on}: {an_hour:.0} an hour"));
    }
    merge(&folder, request.worst, pictures, monitor)
}

/// Flies shards of a campaign, on one thread if its law requires that. Returns whether all were flown; `false` after an
/// interruption.
///
/// # Errors
/// As [`Folder::fly`].
pub fn fly_shards(folder: &Folder, shards: &[u64], threads: usize, monitor: &dyn Monitor) -> Result<bool, Failure> {
    let law = folder.campaign().external_law();
    // Schedulers give the number of threads of a task, whatever its law.
    let threads = if law.is_some_and(ExternalLaw::requires_calling_thread) { 1 } else { threads };
    let batch = Batch::for_laws(Some(threads), monitor, law)?;
    let manifest = folder.campaign().manifest();
    let runs = shards.iter().map(|&shard| manifest.range(shard)).map(|range| range.end - range.start).sum();
    monitor.begin(&manifest.name, Some(folder.campaign().steps(runs)));
    for &shard in shards {
        let Some(Shard { rows, flown }) = fly_shard(folder, shard, &batch, monitor)? else { return Ok(false) };
        monitor.say(&match flown {
            0 => format!("shard {shard}: {} flights were finished before", rows.len()),
            flown => format!("shard {shard}: {flown} flights flown, wrote {}", folder.part_path(shard).display()),
        });
    }
    monitor.finish();
    Ok(true)
}

/// Flies a shard. Returns `None` after an interruption.
fn fly_shard(folder: &Folder, shard: u64, batch: &Batch<'_>, monitor: &dyn Monitor) -> Result<Option<Shard>, Failure> {
    warn_of_damage(shard, folder.damaged(shard)?.as_deref(), monitor);
    let flown = folder.fly(shard, batch)?;
    if flown.is_none() {
        monitor.finish();
        monitor.warn(&format!("interrupted in shard {shard}: finished flights are kept; the same command continues"));
    }
    Ok(flown)
}

/// Returns the missing shards of a campaign, and warns of damaged ones.
///
/// # Errors
/// As [`Folder::missing`].
pub fn missing_shards(folder: &Folder, monitor: &dyn Monitor) -> Result<Vec<u64>, Failure> {
    let missing = folder.missing()?;
    for (shard, damage) in &missing {
        warn_of_damage(*shard, damage.as_deref(), monitor);
    }
    Ok(missing.into_iter().map(|(shard, _)| shard).collect())
}

/// Warns of a damaged part, whose shard is flown again.
fn warn_of_damage(shard: u64, damage: Option<&str>, monitor: &dyn Monitor) {
    if let Some(damage) = damage {
        monitor.warn(&format!("{damage}; flying shard {shard} again replaces it"));
    }
}

/// Merges all parts of a campaign, and writes its answer and page. Returns `None` after an interruption.
///
/// # Errors
/// [`Failure`] if shards are missing, or a file cannot be written.
pub fn merge(
    folder: &Folder,
    worst: usize,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<Summary>, Failure> {
    let (summary, sha256) = folder.merge()?;
    answer(folder, summary, worst, Some(&sha256), pictures, monitor)
}

/// Reports the answer of a merged campaign again, and rewrites its page. Returns `None` after an interruption.
///
/// # Errors
/// [`Failure`] if the campaign is not merged, or a file cannot be written.
pub fn report(
    folder: &Folder,
    worst: usize,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<Summary>, Failure> {
    answer(folder, folder.summary()?, worst, None, pictures, monitor)
}

/// Reports the answer and writes its page.
fn answer(
    folder: &Folder,
    summary: Summary,
    worst: usize,
    sha256: Option<&str>,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<Summary>, Failure> {
    in_range(WORST, &worst, &(0..=MOST_WORST))?;
    for note in summary.notes() {
        monitor.warn(&format!("note: {note}"));
    }
    monitor.say(&format!("{}\n\n{}", summary.headline(), summary.text()));
    let again = summary.laws.iter().map(|law| law.worst.len() + law.bad.len()).sum::<usize>().min(worst);
    if again > 0 {
        let flights = counted(again as u64, "flight", "flights");
        let option = WORST.set(0);
        monitor.warn(&format!("flying {flights} with the least clearance again for the page; {option} leaves it out"));
    }
    let flights = fly_worst_again(folder, &summary, worst, pictures, monitor)?;
    let path = folder.file(PAGE);
    if monitor.is_interrupted() {
        let report = command_line(["campaign", "report", &folder.path().display().to_string()].into_iter());
        monitor.warn(&format!("interrupted: all flights are kept, and no page was written; write it with: {report}"));
        return Ok(None);
    }
    remove_former_worst(folder, &summary)?;
    let command = command_line(["campaign", "run", &format!("{}.toml", summary.name)].into_iter());
    // The command line has no external laws.
    let command = folder.campaign().external_law().is_none().then_some(command);
    let page = StudyPage {
        commands: command.into_iter().chain([folder.campaign().manifest().spec.clone()]).collect(),
        sections: vec![WorstFlight::section(&flights)],
        ..StudyPage::default()
    };
    write_atomically(&path, summary.to_html(&page).as_bytes())?;
    if let Some(sha256) = sha256 {
        monitor.say(&format!("{sha256}  {}", folder.file(RESULTS).display()));
        monitor.say(&format!("wrote {} and {}", folder.file(ANSWER).display(), path.display()));
    } else {
        monitor.say(&format!("wrote {}", path.display()));
    }
    Ok(Some(summary))
}
