//! `compare`: laws side by side on the same starts, with the files that are asked for.

use std::path::PathBuf;

use super::{CompareError, ComparePage, Comparison, LawRow, Plan, Watch};
use crate::{MOST_RUNS, SEEDS, not_written, threads, wrote};
use tautline_core::text::at_least;
use tautline_report::report::page::Picture;
use tautline_report::request::outputs::{self, Called, write};
use tautline_report::request::{Failure, Monitor, PICTURES_BYTES, Pictures, ScenarioRequest, in_range};

/// A scenario, the laws to compare on it, and the files to write. `-` is standard output.
#[derive(Clone, Debug)]
pub struct CompareRequest {
    /// The scenario.
    pub scenario: ScenarioRequest,
    /// Kinds of laws, or names of tables `[laws.NAME]`; those of all such tables by default, and where there are none,
    /// every kind.
    pub laws: Option<Vec<String>>,
    /// Starts under each law: 1 to [`MOST_RUNS`].
    pub runs: u64,
    /// Run k, from 0, has `start.seed` and, where the flight is random, `noise.seed` of this plus k.
    pub seed: u64,
    /// Every number.
    pub json: Option<PathBuf>,
    /// A row a law.
    pub csv: Option<PathBuf>,
    /// The table as LaTeX.
    pub latex: Option<PathBuf>,
    /// A page with a picture of each law at its worst moment.
    pub html: Option<PathBuf>,
    /// Whether files that exist are overwritten.
    pub force: bool,
    /// Threads to use, by default one a core. The result is the same for any number.
    pub threads: Option<usize>,
}

impl CompareRequest {
    /// 20 runs of all laws of a scenario, from seed 0, without files.
    #[must_use]
    pub fn new(scenario: ScenarioRequest) -> Self {
        Self {
            scenario,
            laws: None,
            runs: 20,
            seed: 0,
            json: None,
            csv: None,
            latex: None,
            html: None,
            force: false,
            threads: None,
        }
    }

    /// Options of files, and the files that are asked for.
    pub fn outputs(&self) -> impl Iterator<Item = Called<'_>> {
        let all = [("--json", &self.json), ("--csv", &self.csv), ("--latex", &self.latex), ("--html", &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option, file.as_deref()?)))
    }

    /// The command that compares the same again, for a shell.
    fn command(&self, plan: &Plan) -> String {
        let laws: Vec<_> = plan.laws().iter().map(|law| law.name.as_str()).collect();
        let (laws, runs, seed) = (laws.join(","), self.runs.to_string(), self.seed.to_string());
        self.scenario.command("compare", ["--laws", &laws, "--runs", &runs, "--seed", &seed], [])
    }

    /// The commands that fly the worst flight of each law, by the law's name.
    fn worst(&self, plan: &Plan, comparison: &Comparison) -> Vec<(String, String)> {
        let jitter = plan.jitter_m().map(|jitter_m| format!("start.jitter_m={jitter_m:?}"));
        let is_random = plan.template().flight_is_random();
        let command = |law: &LawRow| {
            let seed = law.worst()?.seed;
            let noise = is_random.then(|| format!("noise.seed={seed}"));
            let seed = format!("start.seed={seed}");
            let sets = law.overrides.iter().chain([&seed]).chain(&noise).chain(&jitter);
            Some((law.name.clone(), self.scenario.command("run", [], sets)))
        };
        comparison.laws.iter().filter_map(command).collect()
    }
}

/// Flies every law from the same starts and writes the files that are asked for. `None` where the monitor interrupted before
/// one start was flown under every law.
///
/// # Errors
/// [`Failure`] where the request or the scenario is wrong, or a file cannot be written.
pub fn compare(
    request: &CompareRequest,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<Comparison>, Failure> {
    in_range("--runs", &request.runs, &(1..=MOST_RUNS))?;
    in_range("--seed", &request.seed, &SEEDS)?;
    let threads = threads(request.threads)?;
    outputs::check_new(&request.scenario.argument, request.outputs(), request.force)?;
    let template = request.scenario.template()?;
    let names = request.laws.clone().unwrap_or_else(|| template.compared());
    let plan = Plan::new(template, &names, request.runs, request.seed)?;

    monitor.begin("compare", Some(plan.steps()));
    let flown = plan
        .fly(threads, Watch { flown: &|steps| monitor.advance(steps), interrupted: monitor.interruption().as_ref() });
    monitor.finish();
    let comparison = flown?;
    if comparison.runs == 0 {
        monitor.warn("interrupted before one start was flown under every law: there is nothing to compare");
        return Ok(None);
    }
    for note in comparison.notes() {
        monitor.warn(&format!("note: {note}"));
    }
    monitor.say(&format!("{}\n\n{}", comparison.headline(), comparison.text()));
    leave(request, &plan, &comparison, pictures, monitor)?;
    Ok(Some(comparison))
}

/// Writes what was asked for.
fn leave(
    request: &CompareRequest,
    plan: &Plan,
    comparison: &Comparison,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<(), Failure> {
    if let Some(file) = &request.json {
        write(file, comparison.to_json().map_err(|error| not_written(&error))?.as_bytes(), monitor)?;
    }
    if let Some(file) = &request.csv {
        write(file, &comparison.to_csv().map_err(|error| not_written(&error))?, monitor)?;
    }
    if let Some(file) = &request.latex {
        write(file, comparison.to_latex().as_bytes(), monitor)?;
    }
    if let Some(file) = &request.html {
        let (pictures, no_pictures) = match worst_moments(plan, comparison, pictures) {
            Ok(pictures) => (pictures, None),
            Err(failure) => (Vec::new(), Some(format!("no pictures were taken: {}", failure.in_words()))),
        };
        if let Some(why) = &no_pictures {
            monitor.warn(why);
        }
        let page = ComparePage {
            pictures: &pictures,
            no_pictures: no_pictures.as_deref(),
            command: &request.command(plan),
            worst: &request.worst(plan, comparison),
        };
        write(file, comparison.to_html(&page).as_bytes(), monitor)?;
    }
    wrote(request.outputs(), monitor);
    Ok(())
}

/// One picture a law, of its flight with the smallest separation at that instant.
fn worst_moments(plan: &Plan, comparison: &Comparison, pictures: &dyn Pictures) -> Result<Vec<Picture>, Failure> {
    let mut taken = Vec::new();
    for (law, row) in plan.laws().iter().zip(&comparison.laws) {
        let Some((worst, min_m, min_at_s)) = row.worst().and_then(|worst| Some((worst, worst.min_m?, worst.min_at_s?)))
        else {
            continue;
        };
        let mut scenario = plan.scenario(law, worst.seed)?;
        scenario.name = format!("{}, {}", scenario.name, law.name);
        let data_uri = pictures.shot(&scenario, min_at_s, PICTURES_BYTES / comparison.laws.len().max(1))?;
        let pair = worst.min_pair.map_or_else(String::new, |[a, b]| format!(", vehicles {a} and {b}"));
        let description = format!(
            "{}: {} m apart at {min_at_s:.2} s{pair}, the closest of {} flights (start.seed {}).",
            law.name,
            at_least(min_m, 3),
            comparison.runs,
            worst.seed
        );
        taken.push(Picture { description, data_uri });
    }
    Ok(taken)
}

impl From<CompareError> for Failure {
    fn from(error: CompareError) -> Self {
        let under = |law: &str, seed: u64| format!("under the law {law}, start.seed = {seed}");
        match error {
            CompareError::NoLaw => {
                Self::input("compare/no-law", error.to_string(), "name one with --laws, such as edge-tension")
            }
            CompareError::Twice(_) => Self::input(
                "compare/law-twice",
                error.to_string(),
                "name each once; two settings of one law have tables [laws.NAME] of two names, with the same `kind`",
            ),
            CompareError::Law(error) => error.into(),
            CompareError::Scenario { law, seed, error } => Self::from(error).under(&under(&law, seed)),
            CompareError::Flight { law, seed, error } => Self::from(error).under(&under(&law, seed)),
        }
    }
}
