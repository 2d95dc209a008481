//! `tautline list` (built-in scenarios) and `schema` (of the scenario file).

use std::path::Path;

use clap::Args;

use super::{Exit, completions, console};
use tautline_core::text::aligned;
use tautline_recordings::mcap::McapRecording;
use tautline_report::request::Failure;
use tautline_sim::scenario::{self, Scenario, Source, builtin};

/// Arguments of `tautline list`.
#[derive(Debug, Args)]
pub(super) struct ListArguments {
    /// Print this built-in scenario as TOML, or the scenario in a recording of `tautline run` with all defaults.
    #[arg(long, value_name = "NAME|RECORDING", add = completions::scenario())]
    show: Option<String>,
}

pub(super) fn list(arguments: &ListArguments) -> Result<Exit, Failure> {
    let text = match &arguments.show {
        Some(name) => match builtin::find(name) {
            Some(builtin) => builtin.toml.to_owned(),
            None => of_recording(name)?,
        },
        None => table()?,
    };
    console::data(&text)?;
    Ok(Exit::Good)
}

/// Returns the scenario in a recording of `tautline run`.
fn of_recording(name: &str) -> Result<String, Failure> {
    let path = Path::new(name);
    if !path.exists() {
        let help =
            "`tautline list` shows the built-in scenarios; give a recording by its path, such as out/pentagon/run.mcap";
        return Err(Failure::input(
            "scenario/not-found",
            format!("no built-in scenario and no recording `{name}`"),
            help,
        ));
    }
    let recording = McapRecording::open(path).map_err(|error| {
        Failure::from(error)
            .with_help("only recordings of `tautline run` hold a scenario, such as out/pentagon/run.mcap")
    })?;
    Ok(recording.header().scenario_toml.clone())
}

/// Returns the built-in scenarios with the size of their flights, which decides how long a flight takes.
fn table() -> Result<String, Failure> {
    let heading = ["scenario", "vehicles", "time", "steps", "content"].map(str::to_owned).to_vec();
    let row = |builtin: &builtin::Builtin| {
        let scenario = Scenario::read(&Source::Builtin(builtin.name.to_owned()), &[])?;
        let (vehicles, time) = (scenario.count().to_string(), format!("{} s", scenario.time.duration_s));
        let (steps, content) = (scenario.time.steps().to_string(), builtin.summary.to_owned());
        Ok(vec![builtin.name.to_owned(), vehicles, time, steps, content])
    };
    let rows = std::iter::once(Ok(heading)).chain(builtin::all().iter().map(row));
    Ok(aligned(&rows.collect::<Result<Vec<_>, Failure>>()?))
}

/// Prints the JSON Schema of the scenario file.
pub(super) fn schema() -> Result<Exit, Failure> {
    console::json(&scenario::schema())?;
    Ok(Exit::Good)
}
