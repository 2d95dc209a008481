//! `validate_into`: judges every claim and leaves result, page and figures in a folder.

use std::path::PathBuf;

use crate::{Validation, validate, work};
use tautline_report::report::write_atomically;
use tautline_report::request::{Failure, Monitor, OutFolder, in_range, svg_files, threads, write_files};

/// The page for people.
const PAGE: &str = "validate.html";
/// Most threads.
const MOST_THREADS: usize = 256;

/// Where a validation leaves its files.
#[derive(Clone, Debug)]
pub struct ValidateRequest {
    /// Folder for `validate.json` and the rest.
    pub out: PathBuf,
    /// Whether a folder that holds a finished validation is overwritten.
    pub force: bool,
    /// Threads to use, by default one a core. The result is the same for any number.
    pub threads: Option<usize>,
}

/// Judges every claim and leaves `validate.json`, `validate.html` and figures in a folder. The result, which marks the
/// folder as finished, comes last.
///
/// # Errors
/// [`Failure`] where the folder holds a finished validation, or the system refuses.
pub fn validate_into(request: &ValidateRequest, monitor: &dyn Monitor) -> Result<Validation, Failure> {
    if let Some(number) = &request.threads {
        in_range("--threads", number, &(1..=MOST_THREADS))?;
    }
    let folder = OutFolder::at(&request.out, "validation", "validate.json");
    let _lock = folder.open(request.force)?;
    let threads = threads(request.threads.unwrap_or(0))?;
    monitor.begin("validate", Some(work()));
    let validation = threads.install(|| validate(&|units| monitor.advance(units)));
    monitor.finish();
    let json = validation
        .to_json()
        .map_err(|error| Failure::machine("files/cannot-write", format!("cannot write the result: {error}")))?;
    write_files(&folder.file("figures"), &[], &svg_files(&validation.figures))?;
    write_atomically(&folder.file(PAGE), validation.to_html().as_bytes())?;
    write_atomically(&folder.report(), json.as_bytes())?;
    monitor.say(&format!("{}{}", validation.text(), validation.headline()));
    monitor.say(&format!("wrote {} and {}", folder.report().display(), folder.file(PAGE).display()));
    Ok(validation)
}
