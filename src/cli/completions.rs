//! `tautline completions`: a completion script for a shell.

use clap::Args;
use clap_complete::Shell;

use super::{Exit, console};
use tautline_report::request::Failure;

/// Arguments of `tautline completions`.
#[derive(Debug, Args)]
pub(super) struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

pub(super) fn completions(arguments: &CompletionsArguments, program: &mut clap::Command) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, program, env!("CARGO_PKG_NAME"), &mut script);
    console::data(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Good)
}
