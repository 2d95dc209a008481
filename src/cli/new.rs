//! `tautline new`: writes a commented scenario file to start from.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Args;

use super::console::Console;
use super::{Exit, completions, hints};
use tautline_core::files::write_atomically;
use tautline_report::request::{Failure, command_line};
use tautline_sim::scenario::builtin;

/// Arguments of `tautline new`.
#[derive(Debug, Args)]
pub(super) struct NewArguments {
    /// Name of the scenario, or path of its file; `.toml` is added.
    name: PathBuf,
    /// Built-in scenario to repeat [default: that of the same name, else six vehicles that fly to a ring].
    #[arg(long, value_name = "SCENARIO", add = completions::scenario())]
    like: Option<String>,
    /// Print no text.
    #[arg(long, short)]
    quiet: bool,
    /// Overwrite an existing file.
    #[arg(long)]
    force: bool,
}

pub(super) fn new(arguments: &NewArguments) -> Result<Exit, Failure> {
    let path = match arguments.name.extension() {
        Some(extension) if extension == "toml" => arguments.name.clone(),
        _ => {
            let mut path = arguments.name.clone().into_os_string();
            path.push(".toml");
            PathBuf::from(path)
        }
    };
    let name = path.file_stem().and_then(OsStr::to_str).unwrap_or_default();
    let from = match &arguments.like {
        Some(from) => Some(builtin::find(from).ok_or_else(|| unknown(from))?),
        None => builtin::find(name),
    };
    // A leading hyphen would read as an option.
    let text = builtin::new_scenario(name, from)
        .filter(|_| !name.starts_with('-'))
        .ok_or_else(|| wrong_name(&arguments.name))?;
    if path.exists() && !arguments.force {
        let message = format!("{} exists already", path.display());
        return Err(Failure::input("files/exists", message, "give another name, or overwrite it with --force"));
    }
    write_atomically(&path, text.as_bytes())?;
    let console = Console { data_on_stdout: false, quiet: arguments.quiet };
    let content = match from {
        Some(builtin) => format!("the built-in scenario {}", builtin.name),
        None => "six vehicles fly to a ring; --like SCENARIO repeats a built-in one".to_owned(),
    };
    console.say(&format!("wrote {}: {content}\nnext: {}", path.display(), flight(&path)));
    Ok(Exit::Good)
}

/// Returns the command that flies a scenario file.
fn flight(path: &Path) -> String {
    command_line(["run", &path.to_string_lossy(), "--open"].into_iter())
}

fn unknown(from: &str) -> Failure {
    let names: Vec<_> = builtin::all().iter().map(|builtin| builtin.name).collect();
    let meant = hints::builtin_meant(from).unwrap_or_default();
    let help = format!("{meant}give one of {}; copy a file of your own without tautline new", names.join(", "));
    Failure::input("scenario/not-found", format!("--like: `{from}` is not a built-in scenario"), help)
}

fn wrong_name(name: &Path) -> Failure {
    let name = name.display();
    let message = format!("NAME: must have 1 to 64 letters, digits, `-` or `_`, and not begin with `-`, got `{name}`");
    Failure::input("usage/name", message, "give a name such as `ring`, or a path such as scenarios/ring.toml")
}
