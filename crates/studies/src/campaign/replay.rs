//! Replays of flights of a campaign: the worst flights for its page, and any flight by its number.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::folder::FAULTY;
use super::folder::file_failure;
use super::{Campaign, Folder, Law, Row, Summary, ViolatedRun, Worst};
use crate::flight::Outcome;
use crate::splitting::{self, StateHashAtStep};
use crate::study::{Block, Section};
use tautline_core::failure::Failure;
use tautline_core::monitor::{Monitor, Quiet};
use tautline_core::option::{BAD, LAW, OUT, Opt, RUN, SET};
use tautline_core::text::{beside_limit, separation, up_to};
use tautline_recordings::mcap::{Header, McapRecorder};
use tautline_report::replay::{NoReplay, PAGE_BYTES, Replay};
use tautline_report::report::page::{self, Picture, Start};
use tautline_report::request::{Pictures, RECORDING, RunFiles, RunRequest, command_line, replay_of_run, run_into};
use tautline_sim::scenario::Scenario;

/// Folder of the worst flights, in the folder of the campaign.
const WORST_FLIGHTS: &str = "worst";
/// Empty file in the folder of a flight that the campaign chose, which distinguishes it from requested replays.
const CHOSEN: &str = ".chosen-by-campaign";

/// Request for a replay of a flight, with the folder of its files.
#[derive(Clone, Debug)]
pub struct ReplayRequest {
    /// Number of the run, from 0.
    pub run: u64,
    /// Name of the law; the first by default.
    pub law: Option<String>,
    /// Index of the violated flight in this run, from 0, if runs are estimates of rare violations.
    pub bad: Option<usize>,
    /// Folder for the recording and the report; by default `worst/LAW-run-I` in the folder of the campaign.
    pub out: Option<PathBuf>,
}

/// One of the worst flights, for the page.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstFlight {
    /// Number of the run.
    pub run: u64,
    /// The law.
    pub law: String,
    /// Description in a sentence.
    pub description: String,
    /// The command that repeats the flight.
    pub command: String,
    /// Path of its recording, relative to the page.
    pub recording: Option<String>,
    /// Picture of its closest approach.
    pub picture: Option<Picture>,
    /// Replay of the flight, or the reason why it has none.
    pub replay: Option<Result<Replay, NoReplay>>,
}

impl WorstFlight {
    /// Returns the section of a page on the worst flights.
    pub(super) fn section(flights: &[Self]) -> Section {
        let mut blocks = Vec::new();
        if flights.is_empty() {
            blocks.push(page::list(&["None."]));
        }
        for (k, flight) in flights.iter().enumerate() {
            let recording = flight.recording.as_ref().map(|path| format!("Its recording: {path}"));
            let replay = flight.replay.as_ref();
            let replay = replay.map(|replay| page::replay(&flight.description, replay, Start::OnDemand));
            let recording = recording.map(|recording| page::list(&[recording]));
            let picture = flight.picture.iter().map(|picture| page::pictures(std::slice::from_ref(picture)));
            let own: Vec<_> = picture.chain(recording).chain(replay).chain([page::command(&flight.command)]).collect();
            if k == 0 {
                blocks.push(page::list(std::slice::from_ref(&flight.description)));
                blocks.extend(own);
            } else {
                blocks.push(page::folded(&flight.description, &own));
            }
        }
        Section::new(
            "The worst flights",
            "The flights that came closest, each with its replay and command.",
            blocks.into_iter().map(Block::Page),
        )
    }
}

/// Identity of a flight of a campaign.
#[derive(Clone, Copy, Debug)]
struct FlightId<'a> {
    law: &'a Law,
    run: u64,
    /// Index in the violated flights of an estimate.
    bad: Option<usize>,
}

impl FlightId<'_> {
    /// Returns the name of the flight's folder.
    fn name(self) -> String {
        let bad = self.bad.map_or_else(String::new, |bad| format!("-bad-{bad}"));
        // The name of an external law may contain characters that a path cannot hold.
        let law = self.law.name.replace(|c: char| !(c.is_ascii_alphanumeric() || "-_+.".contains(c)), "-");
        format!("{law}-run-{}{bad}", self.run)
    }

    /// Returns the default folder of the flight's files.
    fn folder(self, folder: &Folder) -> PathBuf {
        folder.file(WORST_FLIGHTS).join(self.name())
    }

    /// Creates the folder of a flight that the campaign chose.
    fn create_chosen(self, folder: &Folder) -> Result<PathBuf, Failure> {
        let path = self.folder(folder);
        std::fs::create_dir_all(&path).map_err(file_failure("write", &path))?;
        let mark = path.join(CHOSEN);
        std::fs::write(&mark, "").map_err(file_failure("write", &mark))?;
        Ok(path)
    }

    /// Returns a description of the flight.
    fn words(self) -> String {
        let bad = self.bad.map_or_else(String::new, |bad| format!("violated flight {bad} of "));
        format!("{bad}run {} under {}", self.run, self.law.name)
    }

    /// Returns the row of the flight; `None` if the run has not been flown.
    fn row(self, folder: &Folder) -> Result<Option<Row>, Failure> {
        let law = folder.campaign().laws().iter().position(|law| law == self.law).unwrap_or_default();
        folder.row(self.run, law)
    }

    fn scenario(self, campaign: &Campaign) -> Result<Scenario, Failure> {
        let scenario = campaign.scenario(self.run, self.law);
        scenario.map_err(|error| Failure::from(error).under(&format!("run {}", self.run)))
    }

    /// Refuses a state hash that differs from that of the campaign.
    fn compare(self, found: &str, expected: &str) -> Result<(), Failure> {
        if found == expected {
            return Ok(());
        }
        let problem = format!("{}: the replay has the state hash {found}, the campaign {expected}", self.words());
        Err(Failure::machine("campaign/other-bits", problem).with_help(FAULTY))
    }

    /// Returns the command that flies a run again without its campaign.
    fn command(self, campaign: &Campaign) -> String {
        if let Some(law) = campaign.external_law() {
            let sets = campaign.sets(self.run, self.law).join(", ");
            return format!("in Python, tautline.fly under the law {} with: {sets}", law.name());
        }
        let sets = campaign.sets(self.run, self.law);
        let option = SET.argument();
        let sets = sets.iter().flat_map(|set| [option.as_str(), set.as_str()]);
        let words: Vec<_> = ["run", campaign.scenario_argument()].into_iter().chain(sets).collect();
        command_line(words.into_iter())
    }
}

/// Flies one flight of a campaign again, with recording and pictures, and compares its state hash with that of the
/// campaign. Returns whether the flight passes.
///
/// # Errors
/// [`Failure`] if the flight does not exist, has another state hash, or a file cannot be written.
pub fn replay(
    folder: &Folder,
    request: &ReplayRequest,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<bool, Failure> {
    let campaign = folder.campaign();
    let law = match &request.law {
        None => campaign.laws().first(),
        Some(name) => campaign.laws().iter().find(|law| law.name == *name),
    };
    let Some(law) = law else {
        let names: Vec<_> = campaign.laws().iter().map(|law| law.name.as_str()).collect();
        let name = request.law.as_deref().unwrap_or_default();
        let problem = format!("{}: the campaign has no such law", LAW.set(name));
        return Err(Failure::input("campaign/unknown-law", problem, format!("its laws are {}", names.join(", "))));
    };
    let (run, last) = (request.run, campaign.manifest().runs - 1);
    if run > last {
        let problem = format!("{}: must be from 0 to {last}", RUN.set(run));
        return Err(Failure::input("campaign/no-run", problem, "give the number of a run of the campaign, from 0"));
    }
    let bad = campaign.splitting().map(|_| request.bad.unwrap_or_default());
    let flight = FlightId { law, run, bad };
    let out = request.out.clone().unwrap_or_else(|| flight.folder(folder));
    if let Some(bad) = bad {
        let hash = fly_violated_flight(folder, flight, bad, &out)?;
        monitor.say(&format!("state hash {hash}, as in the campaign\nwrote {}", out.join(RECORDING).display()));
        return Ok(false);
    }
    if request.out.is_some() && out.join("report.json").exists() {
        let message = format!("{} holds a finished run", out.display());
        return Err(Failure::input("files/finished", message, format!("give another folder with {OUT}")));
    }
    let scenario = flight.scenario(campaign)?;
    let left = run_into(&RunRequest::reproducible(&scenario, flight.command(campaign), out), pictures, monitor)?;
    match flight.row(folder)?.and_then(|row| row.flight) {
        Some(row) => {
            check(flight, &left, &row.state_hash)?;
            monitor.say(&format!("state hash {}, as in the campaign", row.state_hash));
        }
        None => monitor.warn("note: the campaign has not flown this run, so its state hash is not compared"),
    }
    Ok(left.report.verdict.pass)
}

/// Flies the worst flights of all laws again, the worst first.
pub(super) fn fly_worst_again(
    folder: &Folder,
    summary: &Summary,
    most: usize,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Vec<WorstFlight>, Failure> {
    let campaign = folder.campaign();
    let laws = || std::iter::zip(campaign.laws(), &summary.laws);
    let mut flights = Vec::new();
    // A campaign has worst flights or violated flights of estimates, never both.
    let mut bad: Vec<_> = laws().flat_map(|(law, summary)| summary.bad.iter().map(move |bad| (law, bad))).collect();
    bad.sort_by(|(_, a), (_, b)| a.clearance_m.total_cmp(&b.clearance_m));
    for (law, bad) in bad.into_iter().take(most) {
        if monitor.is_interrupted() {
            break;
        }
        flights.push(repeat_violated_flight(folder, law, bad)?);
    }
    let mut worst: Vec<_> =
        laws().flat_map(|(law, summary)| summary.worst.iter().map(move |worst| (law, worst))).collect();
    let rank = |worst: &Worst| worst.outcome != Outcome::Violated;
    worst.sort_by(|(_, a), (_, b)| rank(a).cmp(&rank(b)).then(a.clearance_m.total_cmp(&b.clearance_m)));
    for (law, worst) in worst.into_iter().take(most) {
        if monitor.is_interrupted() {
            monitor.warn("interrupted: flights that were not repeated have no recordings on the page");
            break;
        }
        let flight = FlightId { law, run: worst.run, bad: None };
        let scenario = flight.scenario(campaign)?;
        let out = flight.create_chosen(folder)?;
        // The engine makes as many steps as in the campaign; the state hash must be equal.
        let run = RunRequest { free_steps: true, ..RunRequest::reproducible(&scenario, flight.command(campaign), out) };
        let left = run_into(&run, pictures, &Quiet::new(monitor))?;
        check(flight, &left, &worst.state_hash)?;
        let replay = replay_of_run(&scenario, &left.log, &left.report, PAGE_BYTES / most.max(1));
        flights.push(WorstFlight { replay: Some(replay), ..shown(flight, campaign, worst, &left) });
    }
    Ok(flights)
}

/// Removes the folders of flights that the campaign chose before it had more runs, and that are not among the worst
/// now.
pub(super) fn remove_former_worst(folder: &Folder, summary: &Summary) -> Result<(), Failure> {
    let root = folder.file(WORST_FLIGHTS);
    let names: Vec<_> = std::iter::zip(folder.campaign().laws(), &summary.laws)
        .flat_map(|(law, summary)| {
            let worst = summary.worst.iter().map(move |worst| FlightId { law, run: worst.run, bad: None });
            worst.chain(summary.bad.iter().map(move |bad| FlightId { law, run: bad.run, bad: Some(bad.bad) }))
        })
        .map(|flight| root.join(flight.name()))
        .collect();
    let entries = match std::fs::read_dir(&root) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(file_failure("read", &root))?,
    };
    for entry in entries {
        let path = entry.map_err(file_failure("read", &root))?.path();
        if !names.contains(&path) && path.join(CHOSEN).is_file() && !path.is_symlink() {
            std::fs::remove_dir_all(&path).map_err(file_failure("remove", &path))?;
        }
    }
    Ok(())
}

/// Repeats a violated flight that a splitting estimate kept, and describes it for the page of the campaign.
fn repeat_violated_flight(folder: &Folder, law: &Law, bad: &ViolatedRun) -> Result<WorstFlight, Failure> {
    let flight = FlightId { law, run: bad.run, bad: Some(bad.bad) };
    fly_violated_flight(folder, flight, bad.bad, &flight.create_chosen(folder)?)?;
    let (run, number) = (bad.run.to_string(), bad.bad.to_string());
    // Relative to the folder of the page, so that the page has the same bytes for any path of the campaign.
    let options = [RUN, LAW, BAD].map(Opt::argument);
    let command = ["campaign", "replay", ".", &options[0], &run, &options[1], &law.name, &options[2], &number];
    let description = format!(
        "Violated flight {number} of run {run} under {}: {} m below delta in step {}. To repeat it, in the folder of \
         this page:",
        law.name,
        up_to(-bad.clearance_m),
        bad.violated_at_step
    );
    Ok(WorstFlight {
        run: bad.run,
        law: law.name.clone(),
        description,
        command: command_line(command.into_iter()),
        recording: Some(format!("worst/{}/{RECORDING}", flight.name())),
        picture: None,
        replay: None,
    })
}

/// Repeats and records a violated flight of an estimate, and compares the state after the step of the violation.
/// Returns the state hash.
fn fly_violated_flight(folder: &Folder, flight: FlightId<'_>, bad: usize, out: &Path) -> Result<String, Failure> {
    let kept = flight.row(folder)?.and_then(|row| row.splitting).map(|splitting| splitting.bad).unwrap_or_default();
    let Some(violated) = kept.get(bad) else {
        let problem = format!("{}: the campaign has no {}", BAD.set(bad), flight.words());
        let remedy = match kept.len() {
            0 => "this run kept no violated flight: give another run".to_owned(),
            kept => format!("give a number from 0 to {}", kept - 1),
        };
        return Err(Failure::input("campaign/no-flight", problem, remedy));
    };
    let scenario = flight.scenario(folder.campaign())?;
    std::fs::create_dir_all(out).map_err(file_failure("write", out))?;
    let header = Header::new(&scenario.name, &scenario.resolved().toml, scenario.count(), scenario.delta_m);
    let mut recording = McapRecorder::create(&out.join(RECORDING), &header)?;
    let mut state = StateHashAtStep::violation_of(violated);
    let flown = splitting::replay(&scenario, &violated.genealogy, &mut (&mut recording, &mut state));
    let closed = recording.finish();
    flown?;
    closed?;
    let found = state.hash().unwrap_or("none").to_owned();
    flight.compare(&found, &violated.state_hash)?;
    Ok(found)
}

/// Refuses a flight whose state hash is not that of the campaign, unless it was interrupted.
fn check(flight: FlightId<'_>, left: &RunFiles, state_hash: &str) -> Result<(), Failure> {
    let run = &left.report.run;
    if run.is_interrupted() { Ok(()) } else { flight.compare(&run.state_hash, state_hash) }
}

/// Returns one of the worst flights with its description and picture.
fn shown(flight: FlightId<'_>, campaign: &Campaign, worst: &Worst, left: &RunFiles) -> WorstFlight {
    let pair = worst.min_pair.map_or_else(String::new, |[a, b]| format!("vehicles {a} and {b} came to "));
    let when = worst.min_at_s.map_or_else(String::new, |at_s| format!(" at {at_s:.2} s"));
    let reached = if worst.reached { "reached its formation" } else { "did not reach its formation" };
    let by_obstacle = worst.outcome == Outcome::Violated && worst.clearance_m >= 0.0;
    let description = format!(
        "Run {} under {}: {}{pair}{} m{when}, {} m {} delta; it {reached}.",
        flight.run,
        flight.law.name,
        if by_obstacle { "a vehicle came nearer to an obstacle than its clearance; " } else { "" },
        beside_limit(worst.min_m, worst.min_m - worst.clearance_m, 3),
        if worst.clearance_m < 0.0 { up_to(-worst.clearance_m) } else { separation(worst.clearance_m) },
        if worst.clearance_m < 0.0 { "below" } else { "above" }
    );
    let closest = left.pictures.iter().find(|(name, _)| name == "closest");
    let picture = closest.map(|(_, picture)| Picture {
        description: description.clone(),
        data_uri: picture.data_uri.clone(),
        file: format!("worst/{}/{}", flight.name(), picture.file),
        is_light: picture.is_light,
    });
    WorstFlight {
        run: flight.run,
        law: flight.law.name.clone(),
        recording: Some(format!("worst/{}/{RECORDING}", flight.name())),
        command: flight.command(campaign),
        picture,
        replay: None,
        description,
    }
}
