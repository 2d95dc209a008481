//! `tautline completions`: completion in a shell. The shell calls the program, which also completes the names of
//! built-in scenarios and the keys of the scenario file.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;

use clap::builder::PossibleValuesParser;
use clap::{Args, CommandFactory as _};
use clap_complete::CompleteEnv;
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter as _, complete};
use clap_complete::env::{Bash, Elvish, EnvCompleter, Fish, Powershell, Shells, Zsh};

use super::{Exit, console};
#[cfg(feature = "viewer")]
use tautline_render::CameraSpec;
use tautline_report::request::Failure;
use tautline_sim::scenario::{builtin, key_choices, key_paths};

/// Environment variable by which a shell asks for candidates.
const VARIABLE: &str = "COMPLETE";
const PROGRAM: &str = env!("CARGO_PKG_NAME");

/// Arguments of `tautline completions`.
#[derive(Debug, Args)]
pub(super) struct CompletionsArguments {
    /// Shell of the script.
    #[arg(value_parser = PossibleValuesParser::new(SHELLS.names()))]
    shell: String,
}

pub(super) fn completions(arguments: &CompletionsArguments) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    if let Some(shell) = SHELLS.completer(&arguments.shell) {
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
    let program = program.shells(SHELLS);
    match program.try_complete(arguments.iter().cloned(), folder.as_deref()) {
        Ok(has_answered) => has_answered,
        Err(error) => {
            // The shell may have closed the pipe.
            let _ = error.print();
            true
        }
    }
}

/// Shells of completion scripts. Bash splits words at `=` and `:`.
const SHELLS: Shells<'static> = Shells(&[&SplittingBash, &Elvish, &Fish, &Powershell, &Zsh]);

/// Bash, which splits words at `=` and `:` and replaces only the last piece of a word by a candidate.
struct SplittingBash;

impl EnvCompleter for SplittingBash {
    fn name(&self) -> &'static str {
        Bash.name()
    }

    fn is(&self, name: &str) -> bool {
        Bash.is(name)
    }

    fn write_registration(
        &self,
        variable: &str,
        name: &str,
        bin: &str,
        completer: &str,
        out: &mut dyn io::Write,
    ) -> io::Result<()> {
        let mut script = Vec::new();
        Bash.write_registration(variable, name, bin, completer, &mut script)?;
        // A piece `=` or `:` must reach the program, which otherwise sees an empty word.
        let replaces = r#"words[COMP_CWORD]="$2""#;
        let keeps = format!(r"[[ ${{words[COMP_CWORD]}} =~ ^[=:]+$ ]] || {replaces}");
        out.write_all(String::from_utf8_lossy(&script).replace(replaces, &keeps).as_bytes())
    }

    fn write_complete(
        &self,
        command: &mut clap::Command,
        pieces: Vec<OsString>,
        folder: Option<&Path>,
        out: &mut dyn io::Write,
    ) -> io::Result<()> {
        let current = std::env::var("_CLAP_COMPLETE_INDEX").ok().and_then(|index| index.parse().ok());
        let (words, current, kept) = joined(&pieces, current.unwrap_or_default());
        let candidates = complete(command, words, current, folder)?;
        let ends = |candidate: &CompletionCandidate| {
            let value = candidate.get_value().to_string_lossy().into_owned();
            value.get(kept..).map_or(value.clone(), str::to_owned)
        };
        let separator = std::env::var("_CLAP_IFS").unwrap_or_else(|_| "\n".to_owned());
        out.write_all(candidates.iter().map(ends).collect::<Vec<_>>().join(&separator).as_bytes())
    }
}

/// Joins the pieces of words that Bash split. Also returns the number of the current word, and the length of its part
/// that a candidate leaves as it is.
fn joined(pieces: &[OsString], current: usize) -> (Vec<OsString>, usize, usize) {
    let breaks = |piece: &OsString| !piece.is_empty() && piece.as_encoded_bytes().iter().all(|b| b"=:".contains(b));
    let (mut words, mut at, mut kept): (Vec<OsString>, _, _) = (Vec::new(), current, 0);
    for (k, piece) in pieces.iter().enumerate() {
        let is_joined = k > 1 && (breaks(piece) || breaks(&pieces[k - 1]));
        let before = if is_joined { words.pop().unwrap_or_default() } else { OsString::new() };
        if k == current {
            (at, kept) = (words.len(), before.len() + if breaks(piece) { piece.len() } else { 0 });
        }
        words.push([before, piece.clone()].into_iter().collect());
    }
    (words, at, kept)
}

/// Completes a scenario: names of built-in scenarios, and paths.
pub(super) fn scenario() -> ArgValueCompleter {
    ArgValueCompleter::new(|typed: &OsStr| {
        let names = builtin::all().iter().filter(|builtin| starts(builtin.name, typed));
        let names = names.map(|builtin| CompletionCandidate::new(builtin.name).help(Some(builtin.summary.into())));
        names.chain(PathCompleter::any().complete(typed)).collect()
    })
}

/// Completes an override: a key of the scenario file, or one of the words that it admits.
pub(super) fn setting() -> ArgValueCompleter {
    ArgValueCompleter::new(|typed: &OsStr| match typed.to_str().and_then(|typed| typed.split_once('=')) {
        Some((key, value)) => {
            let words = key_choices(key).into_iter().filter(|word| word.starts_with(value));
            words.map(|word| CompletionCandidate::new(format!("{key}={word}"))).collect()
        }
        None => key("=").complete(typed),
    })
}

/// Completes one of the words that a key of the scenario file admits.
pub(super) fn choice(key: &'static str) -> ArgValueCompleter {
    ArgValueCompleter::new(move |typed: &OsStr| {
        key_choices(key).into_iter().filter(|word| starts(word, typed)).map(CompletionCandidate::new).collect()
    })
}

/// Completes the name of a camera.
#[cfg(feature = "viewer")]
pub(super) fn camera() -> ArgValueCompleter {
    ArgValueCompleter::new(|typed: &OsStr| {
        let names = CameraSpec::NAMED.into_iter().map(|(name, _)| name).filter(|name| starts(name, typed));
        names.map(CompletionCandidate::new).collect::<Vec<_>>()
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
