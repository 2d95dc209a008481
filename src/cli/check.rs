//! `tautline check`: what is known before the first step.

use clap::Args;

use super::console::{self, Console};
use super::{Exit, Failure};
use crate::preflight::Preflight;
use crate::scenario::{Override, Scenario, Source};

/// Arguments of `tautline check`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 1 where the flight cannot do what it is for: relative-velocity-unstable, start-on-line, start-in-plane. \
Other warnings leave 0; a scenario that is wrong, such as a desired distance of not more than delta, is 2.")]
pub(super) struct CheckArguments {
    /// A scenario file, or the name of a built-in scenario.
    #[arg(default_value = "pentagon")]
    scenario: String,
    /// Set any key of the scenario; may be given several times.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Print what was found as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// Print no summary: the exit code says it.
    #[arg(long)]
    quiet: bool,
}

pub(super) fn check(arguments: &CheckArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.json, quiet: arguments.quiet };
    let overrides = arguments.overrides.iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>()?;
    let scenario = Scenario::read(&Source::resolve(&arguments.scenario)?, &overrides)?;
    let found = Preflight::of(&scenario)?;
    console.say(&format!("{}\n{}", found.headline(), found.text()));
    for warning in &found.warnings {
        console.say(&warning.to_string());
    }
    if arguments.json {
        let json = serde_json::to_string_pretty(&found)
            .map_err(|error| Failure::machine(format!("cannot write what was found: {error}")))?;
        console::data(&(json + "\n"))?;
    }
    Ok(if found.refuses() { Exit::Bad } else { Exit::Good })
}
