//! `attack`: the worst start, wind or loss within bounds, with the files that are asked for.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use super::{Asked, Attack, AttackError, AttackPage, Plan};
use crate::compare::Watch;
use crate::{not_written, threads, wrote};
use tautline_report::request::outputs::{self, Called, write};
use tautline_report::request::{
    Failure, Monitor, OutFolder, Pictures, Quiet, RECORDING, RunRequest, ScenarioRequest, in_range, run_into,
};

/// Flights that a search may have.
pub const FLIGHTS: RangeInclusive<u64> = 1..=10_000_000;
/// Seeds that a candidate may be flown with.
pub const SEEDS_OF_A_CANDIDATE: RangeInclusive<u64> = 1..=10_000;

/// A scenario, what may be varied of it, and the files to write. `-` is standard output.
#[derive(Clone, Debug)]
pub struct AttackRequest {
    /// The scenario.
    pub scenario: ScenarioRequest,
    /// What may be varied, and how the search is made: [`FLIGHTS`] flights, each candidate with
    /// [`SEEDS_OF_A_CANDIDATE`] seeds.
    pub asked: Asked,
    /// Folder for the recording, report and pictures of the worst flight, as `tautline run` leaves them.
    pub out: Option<PathBuf>,
    /// Everything.
    pub json: Option<PathBuf>,
    /// A row for each candidate that was worse than all before it.
    pub csv: Option<PathBuf>,
    /// A page with a plot.
    pub html: Option<PathBuf>,
    /// Whether files that exist are overwritten, and a folder that holds a finished run.
    pub force: bool,
    /// Threads to use, by default one a core. The result is the same for any number.
    pub threads: Option<usize>,
}

impl AttackRequest {
    /// A search without files.
    #[must_use]
    pub fn new(scenario: ScenarioRequest, asked: Asked) -> Self {
        Self { scenario, asked, out: None, json: None, csv: None, html: None, force: false, threads: None }
    }

    /// Options of files, and the files that are asked for.
    pub fn outputs(&self) -> impl Iterator<Item = Called<'_>> {
        let all = [("--json", &self.json), ("--csv", &self.csv), ("--html", &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?)))
    }

    /// The command that makes the same search again, for a shell.
    fn command(&self) -> String {
        let Asked { vary, start_m, velocity_m_s, apart_m, method, flights, seeds, seed } = &self.asked;
        let vary = vary.iter().flat_map(|of| ["--vary".to_owned(), of.to_string()]);
        let reaches = [("--start", start_m), ("--velocity", velocity_m_s), ("--apart", apart_m)];
        let reaches = reaches.into_iter().filter_map(|(option, by)| Some([option.to_owned(), format!("{:?}", (*by)?)]));
        let counts = [("--flights", flights), ("--seeds", seeds)];
        let counts = counts.into_iter().flat_map(|(option, count)| [option.to_owned(), count.to_string()]);
        let how = ["--method", method.name(), "--seed"].map(str::to_owned).into_iter().chain([seed.to_string()]);
        let after: Vec<_> = vary.chain(reaches.flatten()).chain(counts).chain(how).collect();
        self.scenario.command("attack", after.iter().map(String::as_str), [])
    }

    /// The folder of the worst flight, made ready; none where there is to be none.
    fn folder(&self) -> Result<Option<&Path>, Failure> {
        let Some(path) = self.out.as_deref() else { return Ok(None) };
        // Known before an hour of flights; the flight itself opens it again.
        OutFolder::at(path, "run", "report.json").open(self.force)?;
        Ok(Some(path))
    }
}

/// Searches for the worst flight and writes the files that are asked for. `None` where the monitor interrupted before a
/// candidate was flown.
///
/// # Errors
/// [`Failure`] where the request or the scenario is wrong, or a file cannot be written.
pub fn attack(
    request: &AttackRequest,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<Attack>, Failure> {
    in_range("--flights", &request.asked.flights, &FLIGHTS)?;
    in_range("--seeds", &request.asked.seeds, &SEEDS_OF_A_CANDIDATE)?;
    let threads = threads(request.threads)?;
    let scenario = &request.scenario;
    outputs::check_new(&scenario.argument, request.outputs(), request.force)?;
    let plan = Plan::new(scenario.source.clone(), &scenario.parsed_overrides()?, request.asked.clone())?;
    let folder = request.folder()?;

    monitor.begin("attack", Some(plan.steps()));
    let found = plan.search(
        threads,
        Watch { flown: &|steps| monitor.advance(steps), interrupted: monitor.interruption().as_ref() },
    );
    monitor.finish();
    let Some(attack) = found? else {
        monitor.warn("interrupted before a candidate was flown: there is nothing to say");
        return Ok(None);
    };
    for note in attack.notes() {
        monitor.warn(&format!("note: {note}"));
    }
    let command = attack.worst().map(|_| scenario.run_command(&attack.sets));
    let again = command.as_ref().map_or_else(String::new, |command| format!("\nFly the worst again:\n  {command}"));
    monitor.say(&format!("{}\n\n{}{again}", attack.headline(), attack.text()));
    if let Some(file) = &request.json {
        write(file, attack.to_json().map_err(|error| not_written(&error))?.as_bytes(), monitor)?;
    }
    if let Some(file) = &request.csv {
        write(file, &attack.to_csv().map_err(|error| not_written(&error))?, monitor)?;
    }
    if let Some(file) = &request.html {
        let page = AttackPage { command: &request.command(), worst: command.as_deref() };
        write(file, attack.to_html(&page).as_bytes(), monitor)?;
    }
    wrote(request.outputs(), monitor);
    if let (Some(command), Some(worst), Some(folder), false) = (command, attack.worst(), folder, attack.interrupted) {
        let scenario = plan.scenario(&worst.values, worst.run)?;
        let run = RunRequest::reproducible(&scenario, command, folder.to_owned());
        run_into(&run, pictures, &Quiet::new(monitor))?;
        monitor.say(&format!("wrote {} and the report beside it", folder.join(RECORDING).display()));
    }
    Ok(Some(attack))
}

impl From<AttackError> for Failure {
    fn from(error: AttackError) -> Self {
        let (code, help) = match error {
            AttackError::Scenario { set, error } => return Self::from(error).under(&format!("with {set}")),
            AttackError::Flight { set, error } => return Self::from(error).under(&format!("with {set}")),
            AttackError::Nothing => (
                "attack/nothing-varied",
                "say what may be varied: --start 1 moves every start by up to 1 m, --vary network.loss=0..0.3 a key",
            ),
            AttackError::Twice(_) => {
                ("attack/key-twice", "vary each key once; --start and --velocity vary the whole of [start]")
            }
            AttackError::Seed(_) => {
                ("attack/seed-varied", "leave it out; --seeds K flies each candidate with K seeds of noise")
            }
            AttackError::Reach { .. } => (
                "attack/out-of-range",
                "give --start metres and --velocity metres a second, each a positive finite number",
            ),
            AttackError::Apart { .. } => {
                ("attack/out-of-range", "give --apart a distance between the two, or leave it out")
            }
            AttackError::Flights { .. } => ("attack/too-few-flights", "give --flights at least as many as --seeds"),
            AttackError::Seeds(_) => (
                "attack/nothing-random",
                "leave --seeds out, or give the scenario turbulence, noise of measurement, loss or jitter",
            ),
        };
        Self::input(code, error.to_string(), help)
    }
}
