//! `tautline validate`: judge every claim of ours and of the paper.

use std::path::{Path, PathBuf};

use clap::Args;

use super::console::{self, Console};
use super::folder::OutFolder;
use super::{Exit, Failure};
use crate::report::write_atomically;
use crate::validate;

/// Arguments of `tautline validate`.
#[derive(Debug, Args)]
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
    /// Print the tables of docs/validation.md on standard output, and write no folder.
    #[arg(long, conflicts_with_all = ["json", "out", "force"])]
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
    let folder = OutFolder::at(&arguments.out, "validate.json");
    if !arguments.markdown {
        folder.open(arguments.force)?;
    }
    let threads = rayon::ThreadPoolBuilder::new()
        .num_threads(arguments.threads.map_or(0, usize::from))
        .build()
        .map_err(|error| Failure::machine(format!("cannot start threads: {error}")))?;
    let bar = console.progress(validate::work(), "validate".to_owned());
    let judged = threads.install(|| validate::validate(&|units| bar.inc(units)));
    bar.finish_and_clear();
    let validation = judged.map_err(|error| Failure::machine(format!("a claim could not be tried: {error}")))?;

    if arguments.markdown {
        console::data(&validation.markdown())?;
    } else {
        let json =
            validation.to_json().map_err(|error| Failure::machine(format!("cannot write the result: {error}")))?;
        console.say(&format!("{}{}", validation.text(), validation.headline()));
        leave(&arguments.out, &json)?;
        console.say(&format!("wrote {}", folder.report().display()));
        if arguments.json {
            console::data(&json)?;
        }
    }
    Ok(if validation.pass { Exit::Good } else { Exit::Bad })
}

/// Leaves the result in the folder; `validate.json`, which marks it as finished, comes last.
fn leave(folder: &Path, json: &str) -> Result<(), Failure> {
    write_atomically(&folder.join("validate.json"), json.as_bytes())?;
    Ok(())
}
