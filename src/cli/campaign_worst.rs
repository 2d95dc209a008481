//! Flights of a campaign flown again: the worst of them for its page, and any of them by its number.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

use super::console::{self, Console};
use super::run::{Left, RECORDING, RunArguments, fly_into};
use super::{Exit, Failure};
use crate::campaign::{Campaign, CampaignPage, Folder, Found, Law, Summary, Worst, WorstFlight};
use crate::report::page::Picture;
use crate::text::metres;

/// Which flights are flown again for the page.
#[derive(Debug, Args)]
pub(super) struct Looks {
    /// Flights with the least clearance that are flown again, each with its recording, report and pictures.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u8).range(0..=10))]
    worst: u8,
    /// Take no pictures of them.
    #[cfg(feature = "viewer")]
    #[arg(long)]
    no_snapshots: bool,
}

/// Flights that were flown again.
pub(super) struct Again {
    flights: Vec<WorstFlight>,
    no_pictures: Option<String>,
}

impl Again {
    /// What a page shows of them.
    pub(super) fn page<'a>(&'a self, command: &'a str, spec: &'a str) -> CampaignPage<'a> {
        CampaignPage { command, spec, worst: &self.flights, no_pictures: self.no_pictures.as_deref() }
    }
}

/// Where a flight that is flown again leaves its files.
pub(super) fn place(folder: &Folder, law: &str, run: u64) -> PathBuf {
    folder.file("worst").join(format!("{law}-run-{run}"))
}

/// Flies the worst flights again, the worst of all laws first.
pub(super) fn flown_again(
    folder: &Folder,
    summary: &Summary,
    looks: &Looks,
    console: Console,
    interrupted: &AtomicBool,
) -> Result<Again, Failure> {
    let campaign = folder.campaign();
    let laws = std::iter::zip(campaign.laws(), &summary.laws);
    let mut worst: Vec<(&Law, &Worst)> =
        laws.flat_map(|(law, of)| of.worst.iter().map(move |worst| (law, worst))).collect();
    worst.sort_by(|(_, a), (_, b)| a.clearance_m.total_cmp(&b.clearance_m));
    worst.truncate(looks.worst.into());
    let mut again = Again { flights: Vec::new(), no_pictures: None };
    for (law, worst) in worst {
        if interrupted.load(Ordering::Relaxed) {
            console.warn("interrupted: the page has no recordings of the flights that were not flown again");
            break;
        }
        let path = place(folder, &law.name, worst.run);
        let options = RunArguments::for_folder(path);
        #[cfg(feature = "viewer")]
        let options = options.without_pictures(looks.no_snapshots);
        let left =
            fly_into(&options, &campaign.scenario(worst.run, law)?, &command(campaign, worst.run, law), interrupted)?;
        check(&left, worst.run, law, &worst.state_hash)?;
        again.flights.push(looked_at(campaign, law, worst, &left));
    }
    Ok(again)
}

/// Refuses a flight that did not end as it did in the campaign.
fn check(left: &Left, run: u64, law: &Law, state_hash: &str) -> Result<(), Failure> {
    if left.report.run.ended_early.as_deref() == Some(crate::report::INTERRUPTED) {
        return Ok(());
    }
    let found = &left.report.run.state_hash;
    if found == state_hash {
        return Ok(());
    }
    let message = format!(
        "run {run} under {}: flown again it has the state hash {found}, and in the campaign it had {state_hash}",
        law.name
    );
    Err(Failure::machine(message).with_help("the same flight has the same bits everywhere: look for a faulty machine"))
}

fn looked_at(campaign: &Campaign, law: &Law, worst: &Worst, left: &Left) -> WorstFlight {
    let pair = worst.min_pair.map_or_else(String::new, |[a, b]| format!("vehicles {a} and {b} came to "));
    let at = worst.min_at_s.map_or_else(String::new, |at_s| format!(" at {at_s:.2} s"));
    let reached = if worst.reached { "reached its formation" } else { "did not reach its formation" };
    let said = format!(
        "Run {} under {}: {pair}{} m{at}, {} m {} delta; it {reached}.",
        worst.run,
        law.name,
        metres(worst.min_m),
        metres(worst.clearance_m.abs()),
        if worst.clearance_m < 0.0 { "below" } else { "above" }
    );
    WorstFlight {
        run: worst.run,
        law: law.name.clone(),
        recording: Some(format!("worst/{}-run-{}/{RECORDING}", law.name, worst.run)),
        command: command(campaign, worst.run, law),
        picture: closest(left, &said),
        said,
    }
}

/// The picture of the worst moment.
fn closest(left: &Left, said: &str) -> Option<Picture> {
    #[cfg(feature = "viewer")]
    {
        let place = crate::render::snapshot_names().iter().position(|name| *name == "closest")?;
        let picture = left.pictures.get(place)?;
        Some(Picture { description: said.to_owned(), data_uri: picture.data_uri.clone() })
    }
    #[cfg(not(feature = "viewer"))]
    {
        let _ = (left, said);
        None
    }
}

/// The command that flies a run again without its campaign.
fn command(campaign: &Campaign, run: u64, law: &Law) -> String {
    let sets = campaign.sets(run, law);
    let sets = sets.iter().flat_map(|set| ["--set", set.as_str()]);
    console::command_line(["run", campaign.scenario_argument()].into_iter().chain(sets).collect::<Vec<_>>().into_iter())
}

/// Flies a run again and compares it with its row, where there is one.
pub(super) fn replay(
    folder: &Folder,
    run: u64,
    law: &Law,
    options: &RunArguments,
    interrupted: &AtomicBool,
) -> Result<Exit, Failure> {
    let campaign = folder.campaign();
    let scenario = campaign.scenario(run, law).map_err(|error| Failure::from(error).under(&format!("run {run}")))?;
    let left = fly_into(options, &scenario, &command(campaign, run, law), interrupted)?;
    let console = Console { data_on_stdout: false, quiet: false };
    let manifest = campaign.manifest();
    let shard = (0..manifest.shards).find(|&shard| manifest.range(shard).contains(&run)).unwrap_or_default();
    let place = campaign.laws().iter().position(|other| other == law).unwrap_or_default();
    let row = match folder.read(shard)? {
        Found::Whole(rows) => rows.into_iter().find(|row| row.place() == (run, place)),
        Found::Nothing | Found::Broken => None,
    };
    match row.and_then(|row| row.flight) {
        Some(flight) => {
            check(&left, run, law, &flight.state_hash)?;
            console.say(&format!("state hash {}, as in the campaign", flight.state_hash));
        }
        None => console.warn("note: the campaign has not flown this run: there is nothing to compare it with"),
    }
    Ok(if left.report.verdict.pass { Exit::Good } else { Exit::Bad })
}
