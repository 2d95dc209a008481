//! `tautline completions`: completion in a shell. The shell calls the program, which also completes the names of
//! built-in scenarios and the keys of the scenario file.

use std::ffi::{OsStr, OsString};

use clap::builder::PossibleValuesParser;
use clap::{Args, CommandFactory as _};
use clap_complete::CompleteEnv;
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter as _};
use clap_complete::env::Shells;

use super::{Exit, console};
use tautline_report::request::Failure;
use tautline_sim::scenario::{builtin, key_paths};

/// Environment variable by which a shell asks for candidates.
const VARIABLE: &str = "COMPLETE";
const PROGRAM: &str = env!("CARGO_PKG_NAME");

/// Arguments of `tautline completions`.
#[derive(Debug, Args)]
pub(super) struct CompletionsArguments {
    /// Shell of the script.
    #[arg(value_parser = PossibleValuesParser::new(Shells::builtins().names()))]
    shell: String,
}

pub(super) fn completions(arguments: &CompletionsArguments) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    if let Some(shell) = Shells::builtins().completer(&arguments.shell) {
        let written = shell.write_registration(VARIABLE, PROGRAM, PROGRAM, PROGRAM, &mut script);
        written.map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the script: {error}")))?;
    }
    console::data(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Good)
}

/// Answers a shell that asks for candidates by the environment variable `COMPLETE`; returns whether one asked.
pub(super) fn answer(arguments: &[OsString]) -> bool {
    let folder = std::env::current_dir().ok();
    let program = CompleteEnv::with_factory(super::Arguments::command).var(VARIABLE).bin(PROGRAM).completer(PROGRAM);
    match program.try_complete(arguments.iter().cloned(), folder.as_deref()) {
        Ok(has_answered) => has_answered,
        Err(error) => {
            // The shell may have closed the pipe.
            let _ = error.print();
            true
        }
    }
}

/// Completes a scenario: names of built-in scenarios, and paths.
pub(super) fn scenario() -> ArgValueCompleter {
    ArgValueCompleter::new(|typed: &OsStr| {
        let names = builtin::all().iter().filter(|builtin| starts(builtin.name, typed));
        let names = names.map(|builtin| CompletionCandidate::new(builtin.name).help(Some(builtin.summary.into())));
        names.chain(PathCompleter::any().complete(typed)).collect()
    })
}

/// Completes a key of the scenario file, followed by `=` for an override.
pub(super) fn key(end: &'static str) -> ArgValueCompleter {
    ArgValueCompleter::new(move |typed: &OsStr| {
        let keys = key_paths().into_iter().filter(|key| starts(key, typed));
        keys.map(|key| CompletionCandidate::new(key + end)).collect::<Vec<_>>()
    })
}

fn starts(candidate: &str, typed: &OsStr) -> bool {
    typed.to_str().is_some_and(|typed| candidate.starts_with(typed))
}
