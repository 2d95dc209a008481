//! Arguments that say which scenario is meant, the same for all commands that take one.

use clap::Args;

use super::Failure;
use super::caller::source;
use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source};

/// Which scenario, and what is changed of it.
#[derive(Debug, Args)]
pub(super) struct ScenarioArguments {
    /// A scenario file, the name of a built-in scenario, or - for standard input.
    #[arg(default_value = "pentagon")]
    pub(super) scenario: String,
    /// Set any key of the scenario; may be given several times.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub(super) overrides: Vec<String>,
}

impl ScenarioArguments {
    /// Where the text of the scenario comes from.
    pub(super) fn source(&self) -> Result<Source, ScenarioError> {
        source(&self.scenario)
    }
}

/// The scenario of this name or in this file, with these keys set.
pub(super) fn read<'a>(scenario: &str, overrides: impl IntoIterator<Item = &'a String>) -> Result<Scenario, Failure> {
    let overrides = overrides.into_iter().map(|text| Override::parse(text)).collect::<Result<Vec<_>, _>>()?;
    Ok(Scenario::read(&source(scenario)?, &overrides)?)
}
