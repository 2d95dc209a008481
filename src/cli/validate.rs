//! `tautline validate`: judge every claim of ours and of the paper.

use std::path::PathBuf;

use clap::Args;

use super::console::{self, Console};
use super::folder::OutFolder;
use super::pictures::{svg_files, write_files};
use super::run::threads;
use super::{Exit, Failure};
use tautline_report::report::write_atomically;
use tautline_validate::{self as validate, Validation};

/// The page for people.
const PAGE: &str = "validate.html";

/// Arguments of `tautline validate`.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct ValidateArguments {
    /// Folder for `validate.json` and the rest.
    #[arg(long, value_name = "DIR", default_value = "out/validate")]
    out: PathBuf,
    /// Overwrite a folder that holds a finished validation.
    #[arg(long)]
    force: bool,
    /// Print the result as JSON on standard output, and nothing else there.
    #[arg(long)]
    json: bool,
    /// Print the generated part of docs/validation.md on standard output, and nothing else there.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
    /// Print no summary and no progress.
    #[arg(long)]
    quiet: bool,
    /// Threads to use, by default one a core; the result is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

pub(super) fn validate(arguments: &ValidateArguments) -> Result<Exit, Failure> {
    let console = Console { data_on_stdout: arguments.json || arguments.markdown, quiet: arguments.quiet };
    let folder = OutFolder::at(&arguments.out, "validation", "validate.json");
    let _lock = folder.open(arguments.force)?;
    let threads = threads(arguments.threads.map_or(0, usize::from))?;
    let bar = console.progress(validate::work(), "validate".to_owned());
    let validation = threads.install(|| validate::validate(&|units| bar.inc(units)));
    bar.finish_and_clear();

    let json = validation.to_json().map_err(|error| Failure::machine(format!("cannot write the result: {error}")))?;
    leave(&folder, &validation, &json)?;
    console.say(&format!("{}{}", validation.text(), validation.headline()));
    console.say(&format!("wrote {} and {}", folder.report().display(), folder.file(PAGE).display()));
    if arguments.json {
        console::data(&json)?;
    }
    if arguments.markdown {
        console::data(&validation.markdown())?;
    }
    Ok(if validation.pass { Exit::Good } else { Exit::Bad })
}

/// Leaves figures, page and result in the folder; `validate.json`, which marks it as finished, comes last.
fn leave(folder: &OutFolder, validation: &Validation, json: &str) -> Result<(), Failure> {
    write_files(&folder.file("figures"), &[], &svg_files(&validation.figures))?;
    write_atomically(&folder.file(PAGE), validation.to_html().as_bytes())?;
    write_atomically(&folder.report(), json.as_bytes())?;
    Ok(())
}
