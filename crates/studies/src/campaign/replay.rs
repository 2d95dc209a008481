//! Flights of a campaign flown again: the worst of them for its page, and any of them by its number.

use std::path::{Path, PathBuf};

use super::folder::FAULTY;
use super::{Campaign, Folder, Law, Summary, Worst};
use crate::flight::Outcome;
use crate::splitting::{self, StateAt};
use crate::study::{Block, Section};
use tautline_core::text::metres;
use tautline_recordings::mcap::{Header, McapRecorder};
use tautline_report::replay::{NoReplay, PAGE_BYTES, Replay};
use tautline_report::report::page::{self, Picture, Start};
use tautline_report::request::{
    Failure, Monitor, Pictures, Quiet, RECORDING, RunFiles, RunRequest, command_line, replay_of_run, run_into,
};

/// Which flight of a campaign is flown again, and where its files go.
#[derive(Clone, Debug)]
pub struct ReplayRequest {
    /// Number of the run, from 0.
    pub run: u64,
    /// The law; the first by default.
    pub law: Option<String>,
    /// The flight among those that were violated in this run, from 0, where runs are estimates of rare violations.
    pub bad: Option<usize>,
    /// Folder for the recording and the report; by default `worst/LAW-run-I` in the campaign's.
    pub out: Option<PathBuf>,
}

/// A flight to look at.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstFlight {
    /// Number of the run.
    pub run: u64,
    /// The law.
    pub law: String,
    /// What is to be seen, in a sentence.
    pub said: String,
    /// The command that flies it again.
    pub command: String,
    /// Where its recording is, from the page.
    pub recording: Option<String>,
    /// It at its worst moment.
    pub picture: Option<Picture>,
    /// The flight itself, or why it cannot be replayed.
    pub replay: Option<Result<Replay, NoReplay>>,
}

impl WorstFlight {
    /// The section of a page on the worst flights.
    pub(super) fn section(flights: &[Self]) -> Section {
        let mut blocks = Vec::new();
        let pictures: Vec<_> = flights.iter().filter_map(|flight| flight.picture.clone()).collect();
        if flights.is_empty() {
            blocks.push(page::list(&["There are none."]));
        }
        if !pictures.is_empty() {
            blocks.push(page::pictures(&pictures));
        }
        for flight in flights {
            let recording = flight.recording.as_ref().map(|path| format!("Its recording: {path}"));
            blocks.push(page::list(&std::iter::once(flight.said.clone()).chain(recording).collect::<Vec<_>>()));
            blocks.extend(flight.replay.as_ref().map(|replay| match replay {
                Ok(replay) => page::replay(&flight.said, replay, Start::OnDemand),
                Err(why) => page::no_replay(&why.to_string()),
            }));
            blocks.push(page::command(&flight.command));
        }
        Section::new("The worst flights", blocks.into_iter().map(Block::Page))
    }
}

/// Flies one flight of a campaign again, with its recording and pictures, and compares its state hash with the campaign's.
/// Returns whether it passes.
///
/// # Errors
/// [`Failure`] where there is no such flight, it has another state hash, or the system refuses.
pub fn replay(
    folder: &Folder,
    request: &ReplayRequest,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<bool, Failure> {
    let campaign = folder.campaign();
    let names: Vec<_> = campaign.laws().iter().map(|law| law.name.as_str()).collect();
    let law = match &request.law {
        None => campaign.laws().first(),
        Some(name) => campaign.laws().iter().find(|law| law.name == *name),
    };
    let Some(law) = law else {
        let said = request.law.as_deref().unwrap_or_default();
        return Err(Failure::input(
            "campaign/unknown-law",
            format!("no law of this campaign is named {said}"),
            format!("its laws are {}", names.join(", ")),
        ));
    };
    let runs = campaign.manifest().runs;
    if request.run >= runs {
        let help = format!("its runs are 0 to {}", runs - 1);
        return Err(Failure::input("campaign/no-run", format!("the campaign has no run {}", request.run), help));
    }
    if campaign.splitting().is_some() {
        let bad = request.bad.unwrap_or_default();
        let default = || place_of_bad(folder, &law.name, request.run, bad);
        let place = request.out.clone().unwrap_or_else(default);
        let hash = fly_bad(folder, law, [request.run, bad as u64], &place)?;
        let recording = place.join(RECORDING);
        monitor.say(&format!("state hash {hash}, as in the campaign\nwrote {}", recording.display()));
        return Ok(false);
    }
    if let Some(out) = request.out.as_ref().filter(|out| out.join("report.json").exists()) {
        let message = format!("{} holds a finished run", out.display());
        return Err(Failure::input("files/finished", message, "give another folder with --out"));
    }
    let out = request.out.clone().unwrap_or_else(|| place(folder, &law.name, request.run));
    replay_run(folder, request.run, law, out, pictures, monitor)
}

/// Flies a run again and compares it with its row, where there is one. Returns whether it passes.
fn replay_run(
    folder: &Folder,
    run: u64,
    law: &Law,
    out: PathBuf,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<bool, Failure> {
    let campaign = folder.campaign();
    let scenario = campaign.scenario(run, law).map_err(|error| Failure::from(error).under(&format!("run {run}")))?;
    let request = RunRequest::reproducible(&scenario, command(campaign, run, law), out);
    let left = run_into(&request, pictures, monitor)?;
    let row = folder.row(run, number_of(campaign, law))?;
    match row.and_then(|row| row.flight) {
        Some(flight) => {
            check(&left, run, law, &flight.state_hash)?;
            monitor.say(&format!("state hash {}, as in the campaign", flight.state_hash));
        }
        None => monitor.warn("note: the campaign has not flown this run: there is nothing to compare it with"),
    }
    Ok(left.report.verdict.pass)
}

/// The number of a law of a campaign, from 0.
fn number_of(campaign: &Campaign, law: &Law) -> usize {
    campaign.laws().iter().position(|other| other == law).unwrap_or_default()
}

/// Where a flight that is flown again leaves its files.
pub(super) fn place(folder: &Folder, law: &str, run: u64) -> PathBuf {
    folder.file("worst").join(format!("{law}-run-{run}"))
}

/// Flies the worst flights again, the worst of all laws first.
pub(super) fn fly_worst_again(
    folder: &Folder,
    summary: &Summary,
    most: usize,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Vec<WorstFlight>, Failure> {
    let campaign = folder.campaign();
    if campaign.splitting().is_some() {
        return bad_again(folder, summary, most, monitor);
    }
    let laws = std::iter::zip(campaign.laws(), &summary.laws);
    let mut worst: Vec<(&Law, &Worst)> =
        laws.flat_map(|(law, of)| of.worst.iter().map(move |worst| (law, worst))).collect();
    let rank = |worst: &Worst| worst.outcome != Outcome::Violated;
    worst.sort_by(|(_, a), (_, b)| rank(a).cmp(&rank(b)).then(a.clearance_m.total_cmp(&b.clearance_m)));
    worst.truncate(most);
    let mut flights = Vec::new();
    for (law, worst) in worst {
        if monitor.is_interrupted() {
            monitor.warn("interrupted: the page has no recordings of the flights that were not flown again");
            break;
        }
        let path = place(folder, &law.name, worst.run);
        let scenario = campaign.scenario(worst.run, law)?;
        let run = RunRequest::reproducible(&scenario, command(campaign, worst.run, law), path);
        let left = run_into(&run, pictures, &Quiet::new(monitor))?;
        check(&left, worst.run, law, &worst.state_hash)?;
        let replay = replay_of_run(&scenario, &left.log, &left.report, PAGE_BYTES / most.max(1));
        flights.push(WorstFlight { replay: Some(replay), ..looked_at(campaign, law, worst, &left) });
    }
    Ok(flights)
}

/// Flies flights again that were violated in estimates, those furthest into a violation first.
fn bad_again(
    folder: &Folder,
    summary: &Summary,
    most: usize,
    monitor: &dyn Monitor,
) -> Result<Vec<WorstFlight>, Failure> {
    let laws = std::iter::zip(folder.campaign().laws(), &summary.laws);
    let mut worst: Vec<_> = laws.flat_map(|(law, of)| of.bad.iter().map(move |bad| (law, bad))).collect();
    worst.sort_by(|(_, a), (_, b)| a.clearance_m.total_cmp(&b.clearance_m));
    worst.truncate(most);
    let mut flights = Vec::new();
    for (law, bad) in worst {
        if monitor.is_interrupted() {
            break;
        }
        let place = place_of_bad(folder, &law.name, bad.run, bad.bad);
        fly_bad(folder, law, [bad.run, bad.bad as u64], &place)?;
        let (run, number) = (bad.run.to_string(), bad.bad.to_string());
        // From the folder of the page, so that the page has the same bytes wherever the campaign is.
        let command = ["campaign", "replay", ".", "--run", &run, "--law", &law.name, "--bad", &number];
        flights.push(WorstFlight {
            run: bad.run,
            law: law.name.clone(),
            said: format!(
                "Bad flight {} of run {} under {}: {} m below delta in step {}. To fly it again, in the folder of this page:",
                bad.bad,
                bad.run,
                law.name,
                metres(-bad.clearance_m),
                bad.violated_at_step
            ),
            command: command_line(command.into_iter()),
            recording: Some(format!("worst/{}-run-{}-bad-{}/{RECORDING}", law.name, bad.run, bad.bad)),
            picture: None,
            replay: None,
        });
    }
    Ok(flights)
}

/// Where a bad flight of an estimate leaves its recording.
pub(super) fn place_of_bad(folder: &Folder, law: &str, run: u64, bad: usize) -> PathBuf {
    folder.file("worst").join(format!("{law}-run-{run}-bad-{bad}"))
}

/// Flies a bad flight of an estimate again, with its recording, and compares the state in which it was violated.
pub(super) fn fly_bad(folder: &Folder, law: &Law, [run, bad]: [u64; 2], place: &Path) -> Result<String, Failure> {
    let campaign = folder.campaign();
    let row = folder.row(run, number_of(campaign, law))?;
    let flights = row.and_then(|row| row.splitting).map(|splitting| splitting.bad).unwrap_or_default();
    let Some(flight) = usize::try_from(bad).ok().and_then(|bad| flights.get(bad)) else {
        let help = format!("{} are kept of it, counted from 0", flights.len());
        return Err(Failure::input(
            "campaign/no-flight",
            format!("run {run} under {} has no bad flight {bad}", law.name),
            help,
        ));
    };
    let scenario = campaign.scenario(run, law).map_err(|error| Failure::from(error).under(&format!("run {run}")))?;
    std::fs::create_dir_all(place).map_err(|error| {
        Failure::machine("files/cannot-write", format!("cannot write {}: {error}", place.display()))
    })?;
    let header = Header::new(&scenario.name, &scenario.resolved_toml(), scenario.count(), scenario.delta_m);
    let mut recording = McapRecorder::create(&place.join(RECORDING), &header)?;
    let mut state = StateAt::violation_of(flight);
    let flown = splitting::replay(&scenario, &flight.genealogy, &mut (&mut recording, &mut state));
    let closed = recording.finish();
    flown?;
    closed?;
    let found = state.hash().unwrap_or("none").to_owned();
    if found == flight.state_hash {
        return Ok(found);
    }
    let message = format!(
        "bad flight {bad} of run {run} under {}: flown again it has the state hash {found}, and in the campaign it had {}",
        law.name, flight.state_hash
    );
    Err(Failure::machine("campaign/other-bits", message).with_help(FAULTY))
}

/// Refuses a flight that did not end as it did in the campaign.
fn check(left: &RunFiles, run: u64, law: &Law, state_hash: &str) -> Result<(), Failure> {
    if left.report.run.ended_early.as_deref() == Some(tautline_report::report::INTERRUPTED) {
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
    Err(Failure::machine("campaign/other-bits", message).with_help(FAULTY))
}

fn looked_at(campaign: &Campaign, law: &Law, worst: &Worst, left: &RunFiles) -> WorstFlight {
    let pair = worst.min_pair.map_or_else(String::new, |[a, b]| format!("vehicles {a} and {b} came to "));
    let at = worst.min_at_s.map_or_else(String::new, |at_s| format!(" at {at_s:.2} s"));
    let reached = if worst.reached { "reached its formation" } else { "did not reach its formation" };
    let by_obstacle = worst.outcome == Outcome::Violated && worst.clearance_m >= 0.0;
    let said = format!(
        "Run {} under {}: {}{pair}{} m{at}, {} m {} delta; it {reached}.",
        worst.run,
        law.name,
        if by_obstacle { "a vehicle came nearer to an obstacle than its clearance; " } else { "" },
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
        replay: None,
        said,
    }
}

/// The picture of the worst moment.
fn closest(left: &RunFiles, said: &str) -> Option<Picture> {
    let (_, picture) = left.pictures.iter().find(|(name, _)| name == "closest")?;
    Some(Picture { description: said.to_owned(), data_uri: picture.data_uri.clone() })
}

/// The command that flies a run again without its campaign.
fn command(campaign: &Campaign, run: u64, law: &Law) -> String {
    let sets = campaign.sets(run, law);
    let sets = sets.iter().flat_map(|set| ["--set", set.as_str()]);
    command_line(["run", campaign.scenario_argument()].into_iter().chain(sets).collect::<Vec<_>>().into_iter())
}
