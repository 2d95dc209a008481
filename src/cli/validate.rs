//! `tautline validate`: measure every claim of tautline and of its source paper.

use std::path::PathBuf;

use clap::Args;

use super::Exit;
use super::console::{self, Console, Terminal};
use super::json::JsonArgument;
use tautline_report::request::Failure;
use tautline_validate::{ValidateRequest, validate_into};

/// Arguments of `tautline validate`.
#[derive(Debug, Args)]
pub(super) struct ValidateArguments {
    /// Folder for `validate.json`, the page and figures.
    #[arg(long, short, value_name = "DIR", default_value = "out/validate")]
    out: PathBuf,
    /// Overwrite a folder with a finished validation.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    json: JsonArgument,
    /// Print the generated part of docs/validation.md on standard output; all text goes to standard error.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
    /// Print no summary and no progress.
    #[arg(long, short)]
    quiet: bool,
    /// Number of threads [default: one for each core]; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

pub(super) fn validate(arguments: &ValidateArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.json.is_piped() || arguments.markdown, quiet: arguments.quiet };
    arguments.json.check("", arguments.force)?;
    let request = ValidateRequest {
        out: arguments.out.clone(),
        force: arguments.force,
        threads: arguments.threads.map(usize::from),
    };
    let terminal = Terminal::that_abandons(console, "interrupted: nothing was written; give the command again")?;
    let validation = validate_into(&request, &terminal)?;
    let failed = |error| Failure::machine("files/cannot-write", format!("cannot write the answer: {error}"));
    arguments.json.write_text(|| validation.to_json().map_err(failed), console)?;
    if arguments.markdown {
        console::data(&validation.markdown())?;
    }
    Ok(Exit::good_if(validation.pass))
}
