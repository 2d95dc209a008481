//! `tautline list` (built-in scenarios) and `schema` (of the scenario file).

use std::path::Path;

use clap::Args;
use serde::Serialize;

use super::console::{self, Console};
use super::json::JsonArgument;
use super::{Exit, completions, hints};
use tautline_core::text::aligned;
use tautline_recordings::mcap::McapRecording;
use tautline_report::request::Failure;
use tautline_sim::scenario::{self, Scenario, Source, builtin};

/// Arguments of `tautline list`.
#[derive(Debug, Args)]
pub(super) struct ListArguments {
    /// Print this built-in scenario as TOML, or the scenario in a recording of `tautline run` with all defaults.
    #[arg(long, value_name = "NAME|RECORDING", conflicts_with = "json", add = completions::scenario())]
    show: Option<String>,
    #[command(flatten)]
    json: JsonArgument,
}

/// Built-in scenario with the size of its flight, which decides how long a flight takes.
#[derive(Debug, Serialize)]
struct Listed {
    name: &'static str,
    vehicles: usize,
    duration_s: f64,
    steps: u64,
    content: &'static str,
}

pub(super) fn list(arguments: &ListArguments) -> Result<Exit, Failure> {
    if arguments.json.place().is_some() {
        arguments.json.check_new()?;
        arguments.json.write(&listed()?, Console { data_on_stdout: arguments.json.is_piped(), quiet: false })?;
        return Ok(Exit::Good);
    }
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
        let help = hints::builtin_meant(name).unwrap_or_default()
            + "`tautline list` shows the built-in scenarios; give a recording by its path, such as \
               out/pentagon/run.mcap";
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

fn listed() -> Result<Vec<Listed>, Failure> {
    let read = |builtin: &builtin::Builtin| {
        let scenario = Scenario::read(&Source::Builtin(builtin.name.to_owned()), &[])?;
        let (vehicles, duration_s, steps) = (scenario.count(), scenario.time.duration_s, scenario.time.steps());
        Ok(Listed { name: builtin.name, vehicles, duration_s, steps, content: builtin.summary })
    };
    builtin::all().iter().map(read).collect()
}

fn table() -> Result<String, Failure> {
    let heading = ["scenario", "vehicles", "time", "steps", "content"].map(str::to_owned);
    let row = |of: Listed| {
        let (vehicles, time, steps) = (of.vehicles.to_string(), format!("{} s", of.duration_s), of.steps.to_string());
        vec![of.name.to_owned(), vehicles, time, steps, of.content.to_owned()]
    };
    let rows = listed()?.into_iter().map(row);
    Ok(aligned(&std::iter::once(heading.to_vec()).chain(rows).collect::<Vec<_>>()))
}

/// Prints the JSON Schema of the scenario file.
pub(super) fn schema() -> Result<Exit, Failure> {
    console::data(&console::to_json(&scenario::schema())?)?;
    Ok(Exit::Good)
}
