//! `margin`: where between two values of a key the verdict turns, with the files that are asked for.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use super::{Asked, Margin, MarginError, MarginPage, Plan, Probe, Question, Range};
use crate::compare::Watch;
use crate::{MOST_RUNS, SEEDS, not_written, threads, wrote};
use tautline_report::request::outputs::{self, Called, write};
use tautline_report::request::{Failure, Monitor, ScenarioRequest, in_range};

/// Values that may be looked at first.
const SCANS: RangeInclusive<usize> = 2..=1000;
/// Halvings that may be asked for.
const HALVINGS: RangeInclusive<u32> = 0..=50;

/// A scenario, a key of it, and the files to write. `-` is standard output.
#[derive(Clone, Debug)]
pub struct MarginRequest {
    /// The scenario.
    pub scenario: ScenarioRequest,
    /// The key that is changed, such as `time.control_hz`.
    pub key: String,
    /// Its values: the two ends, how many are looked at first (2 to 1000) and how often the interval is halved (0 to 50).
    pub range: Range,
    /// What every run has to show, the runs of each value (1 to [`MOST_RUNS`]) and the seed of the first.
    pub asked: Asked,
    /// Everything.
    pub json: Option<PathBuf>,
    /// A row a value.
    pub csv: Option<PathBuf>,
    /// A page with a plot.
    pub html: Option<PathBuf>,
    /// Whether files that exist are overwritten.
    pub force: bool,
    /// Threads to use, by default one a core. The result is the same for any number.
    pub threads: Option<usize>,
}

impl MarginRequest {
    /// The verdict of single flights between two values of a key: 5 values and 6 halvings, without files.
    #[must_use]
    pub fn new(scenario: ScenarioRequest, key: &str, from: f64, to: f64) -> Self {
        Self {
            scenario,
            key: key.to_owned(),
            range: Range { from, to, scan: 5, halvings: 6, logarithmic: false },
            asked: Asked { question: Question::Pass, runs: 1, seed: 0 },
            json: None,
            csv: None,
            html: None,
            force: false,
            threads: None,
        }
    }

    /// Options of files, and the files that are asked for.
    pub fn outputs(&self) -> impl Iterator<Item = Called<'_>> {
        let all = [("--json", &self.json), ("--csv", &self.csv), ("--html", &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?)))
    }

    /// The command that makes the same search again, for a shell.
    fn command(&self) -> String {
        let Self { range, asked, .. } = self;
        let ends = [range.from, range.to].map(|number| format!("{number:?}"));
        let counts =
            [asked.runs.to_string(), asked.seed.to_string(), range.scan.to_string(), range.halvings.to_string()];
        let [runs, seed, scan, halvings] = counts.each_ref().map(String::as_str);
        let what = ["--key", &self.key, "--from", &ends[0], "--to", &ends[1], "--runs", runs, "--seed", seed];
        let how = ["--verdict", asked.question.name(), "--scan", scan, "--halvings", halvings];
        let log = range.logarithmic.then_some("--log");
        self.scenario.command("margin", what.into_iter().chain(how).chain(log), [])
    }

    /// The commands that fly the two sides of the bracket: a run that holds, and the first that does not.
    fn sides(&self, plan: &Plan, margin: &Margin) -> Vec<(String, String)> {
        let question = margin.question;
        let side = |(probe, what): (&Probe, &str)| {
            let sets = plan.sets(probe.value, probe.worst_run(question));
            (format!("A flight that {what}:"), self.scenario.command("run", [], &sets))
        };
        margin.sides().into_iter().flat_map(|sides| sides.into_iter().zip(question.words())).map(side).collect()
    }
}

/// Searches for the values between which the verdict turns and writes the files that are asked for. `None` where the monitor
/// interrupted before the verdict was known at both ends of an interval.
///
/// # Errors
/// [`Failure`] where the request or the scenario is wrong, or a file cannot be written.
pub fn margin(request: &MarginRequest, monitor: &dyn Monitor) -> Result<Option<Margin>, Failure> {
    in_range("--runs", &request.asked.runs, &(1..=MOST_RUNS))?;
    in_range("--seed", &request.asked.seed, &SEEDS)?;
    in_range("--scan", &request.range.scan, &SCANS)?;
    in_range("--halvings", &request.range.halvings, &HALVINGS)?;
    let threads = threads(request.threads)?;
    let scenario = &request.scenario;
    outputs::check_new(&scenario.argument, request.outputs(), request.force)?;
    let overrides = scenario.parsed_overrides()?;
    let plan = Plan::new(scenario.source.clone(), &overrides, &request.key, request.range, request.asked)?;

    monitor.begin("margin", Some(plan.steps()));
    let found = plan.search(
        threads,
        Watch { flown: &|steps| monitor.advance(steps), interrupted: monitor.interruption().as_ref() },
    );
    monitor.finish();
    let Some(margin) = found? else {
        monitor.warn("interrupted before the verdict was known at both ends of an interval: there is nothing to say");
        return Ok(None);
    };
    for note in margin.notes() {
        monitor.warn(&format!("note: {note}"));
    }
    let sides = request.sides(&plan, &margin);
    let repeated: Vec<_> = sides.iter().map(|(what, command)| format!("{what}\n  {command}")).collect();
    let said = [vec![margin.headline()], margin.predictions()].concat().join("\n");
    monitor.say(&format!("{said}\n\n{}\n{}", margin.text(), repeated.join("\n")));
    if let Some(file) = &request.json {
        write(file, margin.to_json().map_err(|error| not_written(&error))?.as_bytes(), monitor)?;
    }
    if let Some(file) = &request.csv {
        write(file, &margin.to_csv().map_err(|error| not_written(&error))?, monitor)?;
    }
    if let Some(file) = &request.html {
        let page = MarginPage { command: &request.command(), sides: &sides };
        write(file, margin.to_html(&page).as_bytes(), monitor)?;
    }
    wrote(request.outputs(), monitor);
    Ok(Some(margin))
}

impl From<MarginError> for Failure {
    fn from(error: MarginError) -> Self {
        match error {
            MarginError::Range(why) => Self::input(
                "margin/range",
                why,
                "give --from and --to two different finite numbers, both more than 0 where --log is given",
            ),
            MarginError::Scenario { set, error } => Self::from(error).under(&format!("with {set}")),
            MarginError::Flight { set, error } => Self::from(error).under(&format!("with {set}")),
        }
    }
}
