//! `tautline check`: what is known before the first step.

use clap::Args;

use super::Exit;
use super::console::{self, Console};
use super::scenario::ScenarioArguments;
use tautline_report::request::Failure;
use tautline_sim::preflight::Preflight;

/// Arguments of `tautline check`.
#[derive(Debug, Args)]
#[command(after_help = "\
Exits with 1 where the flight cannot do what it is for: relative-velocity-unstable, start-on-line, start-in-plane, \
step-too-long, drift-unresolved. Other warnings leave 0; a scenario that is wrong, such as a desired distance of not more than delta, is 2.")]
pub(super) struct CheckArguments {
    #[command(flatten)]
    what: ScenarioArguments,
    /// Print what was found as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// Print no summary: the exit code says it.
    #[arg(long)]
    quiet: bool,
}

pub(super) fn check(arguments: &CheckArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.json, quiet: arguments.quiet };
    let scenario = arguments.what.request()?.read()?;
    let found = Preflight::of(&scenario)?;
    console.say(&format!("{}\n{}", found.headline(), found.text()));
    for warning in &found.warnings {
        console.say(&warning.to_string());
    }
    if arguments.json {
        console::json(&found)?;
    }
    Ok(Exit::good_if(!found.refuses()))
}
