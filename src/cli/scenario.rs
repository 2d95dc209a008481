//! Arguments that say which scenario is meant, the same for all commands that take one.

use clap::Args;

use tautline_report::request::{Failure, ScenarioRequest};

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
    /// The scenario as a part of a request.
    pub(super) fn request(&self) -> Result<ScenarioRequest, Failure> {
        ScenarioRequest::named(&self.scenario, &self.overrides)
    }
}
