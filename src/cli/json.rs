//! The option `--json[=FILE]` of all commands that answer with data.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::console::{self, Console};
use tautline_core::files::write_atomically;
use tautline_report::request::Failure;
use tautline_report::request::outputs::{self, NamedPath, is_standard_output};

/// Rejects a file of an option in a folder of the command, which may hold its own files.
pub(super) fn check_outside(option: &str, file: &Path, folder: &Path) -> Result<(), Failure> {
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let places = [parent, folder].map(std::fs::canonicalize);
    let is_inside = matches!(&places, [Ok(parent), Ok(folder)] if parent.starts_with(folder));
    if is_inside || file.starts_with(folder) {
        let message = format!("{option}: {} is in the folder {}", file.display(), folder.display());
        return Err(Failure::input("files/overwrites-input", message, "write into another folder"));
    }
    Ok(())
}

/// Place of an answer as JSON.
#[derive(Clone, Debug, Args)]
pub(super) struct JsonArgument {
    /// Write the answer as JSON to standard output, with all text on standard error, or into FILE.
    // The equals sign separates FILE from a recording or scenario that follows.
    #[arg(long = "json", id = "json", value_name = "FILE", num_args = 0..=1, require_equals = true)]
    #[arg(default_missing_value = "-")]
    place: Option<PathBuf>,
}

impl JsonArgument {
    /// Returns the place if the option is given; `-` is standard output.
    pub(super) fn place(&self) -> Option<&Path> {
        self.place.as_deref()
    }

    /// Returns whether standard output carries the answer.
    pub(super) fn is_piped(&self) -> bool {
        self.place().is_some_and(is_standard_output)
    }

    /// Returns the file, if the answer goes to one.
    pub(super) fn file(&self) -> Option<NamedPath<'_>> {
        self.place().filter(|place| !is_standard_output(place)).map(|file| ("--json".to_owned(), file))
    }

    /// Rejects a file that would overwrite the scenario or, without `force`, any file, and one that cannot be written.
    pub(super) fn check(&self, scenario: &str, force: bool) -> Result<(), Failure> {
        outputs::check_new(scenario, self.file().into_iter(), force)
    }

    /// Rejects a file that exists, for a command that overwrites none.
    pub(super) fn check_new(&self) -> Result<(), Failure> {
        let there = self.file().map(|(_, file)| file).filter(|file| file.is_file());
        if let Some(file) = there {
            let message = format!("--json: {} exists", file.display());
            return Err(Failure::input("files/exists", message, "remove it, or write another file"));
        }
        self.check("", false)
    }

    /// Rejects a file in a folder of the command, which may hold its own files.
    pub(super) fn check_outside(&self, folder: &Path) -> Result<(), Failure> {
        self.file().map_or(Ok(()), |(option, file)| check_outside(&option, file, folder))
    }

    /// Writes an answer if the option is given.
    pub(super) fn write(&self, answer: &impl Serialize, console: Console) -> Result<(), Failure> {
        self.write_text(|| console::to_json(answer), console)
    }

    /// Writes the JSON of an answer if the option is given.
    pub(super) fn write_text(
        &self,
        answer: impl FnOnce() -> Result<String, Failure>,
        console: Console,
    ) -> Result<(), Failure> {
        match self.place() {
            None => Ok(()),
            Some(place) if is_standard_output(place) => console::data(&answer()?),
            Some(file) => {
                write_atomically(file, answer()?.as_bytes())?;
                console.say(&format!("wrote {}", file.display()));
                Ok(())
            }
        }
    }
}
