//! `export_file`: writes a recording in another format.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::audit::{open, own_recording, recording_in};
use super::{Failure, Monitor, outputs};
use tautline_core::fact::Fact;
use tautline_core::files::write_atomically_with;
use tautline_core::option::{EXPORT_FORMAT, FORCE, OUTPUT, TIME_UNIT};
use tautline_core::text::counted;
use tautline_core::track::{Item, Metadata, Plan, Tracks};
use tautline_recordings::export::{self, ExportOptions, WRITTEN};
use tautline_recordings::read::{self, Fault, Format, ReadError, ReadOptions, Recording};

/// A recording and the file to write.
#[derive(Clone, Debug)]
pub struct ExportRequest {
    /// Files or folders. Several paths are one recording, each with a vehicle of its own.
    pub paths: Vec<PathBuf>,
    /// Options of the readers.
    pub options: ReadOptions,
    /// Path of the output.
    pub output: PathBuf,
    /// Format of the output; by default that of the file name extension.
    pub format: Option<Format>,
    /// Sampling rate of curves \[Hz\]. The motion between the samples is lost.
    pub sample_hz: Option<f64>,
    /// Whether an existing file is overwritten.
    pub force: bool,
}

/// A recording that ends with an error after an interruption, so that no unfinished file is left behind.
struct Interruptible {
    tracks: Recording,
    path: PathBuf,
    interrupted: Arc<AtomicBool>,
}

impl Tracks for Interruptible {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.tracks.vehicles()
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        if self.interrupted.load(Ordering::Relaxed) {
            return Err(ReadError::new(&self.path, Fault::System(ErrorKind::Interrupted.into())));
        }
        self.tracks.read(items)
    }

    fn metadata(&self) -> &Metadata {
        self.tracks.metadata()
    }

    fn plans(&self) -> &[Plan] {
        self.tracks.plans()
    }
}

impl ExportRequest {
    /// Returns the output format, after checking that the file may be written.
    fn checked(&self) -> Result<Format, Failure> {
        let path = &self.output;
        let by_extension = || {
            let extension = path.extension()?.to_str()?;
            WRITTEN.iter().copied().find(|format| format.name.eq_ignore_ascii_case(extension))
        };
        let format = self.format.or_else(by_extension).ok_or_else(|| {
            let message = format!("the file name `{}` has no extension of a known format", path.display());
            let help = format!("name the format with {}, parquet, npz or mcap", EXPORT_FORMAT.set("csv"));
            Failure::input("export/unknown-format", message, help)
        })?;
        if path.exists() && !self.force {
            let message = format!("`{}` exists", path.display());
            let help = format!("overwrite it with {FORCE}, or write another file");
            return Err(Failure::input("files/exists", message, help));
        }
        let inputs: Vec<_> = self.paths.iter().map(|path| ("the recording".to_owned(), path.as_path())).collect();
        outputs::check(&inputs, &[(OUTPUT.to_string(), path)])?;
        Ok(format)
    }
}

/// Writes a recording in another format without rounding. The file is written atomically.
///
/// # Errors
/// [`Failure`] if the recording cannot be read or the file cannot be written.
pub fn export_file(request: &ExportRequest, monitor: &dyn Monitor) -> Result<(), Failure> {
    let request =
        &ExportRequest { paths: request.paths.iter().map(|path| recording_in(path)).collect(), ..request.clone() };
    let format = request.checked()?;
    let ExportRequest { paths, options, output, sample_hz, .. } = request;
    let interrupted = monitor.interruption();
    let assumed = examine(&mut open(paths, options)?)?;
    let tracks = || -> Result<Recording, ReadError> {
        let path = paths.first().cloned().unwrap_or_default();
        Ok(Box::new(Interruptible { tracks: open(paths, options)?, path, interrupted: Arc::clone(interrupted) }))
    };
    let channels = || match &paths[..] {
        [path] if options.format.is_none_or(|format| format == Format::MCAP) => read::open_channels(path),
        _ => Ok(None),
    };
    let exported = write_atomically_with(output, |file| {
        let options = ExportOptions { sample_hz: *sample_hz };
        export::export_with(&tracks, &channels, format, &options, file).map_err(Failure::from)
    });
    let file = output.display();
    if exported.is_err() && monitor.is_interrupted() {
        return Err(Failure::machine(Failure::INTERRUPTED, format!("interrupted: `{file}` was not written")));
    }
    let exported = exported?;
    for note in exported.notes.iter().chain(&lost(request, monitor)) {
        monitor.warn(&format!("note: {note}"));
    }
    for assumed in assumed {
        monitor.warn(&format!("note: {file} does not contain this assumption: {assumed}"));
    }
    let vehicles = counted(exported.vehicles as u64, "vehicle", "vehicles");
    monitor.say(&format!("wrote {file}: {} samples of {vehicles}", exported.samples));
    Ok(())
}

/// Number of items from which the unit of time is judged.
const JUDGED_ITEMS: usize = 10_000;

/// Refuses a guessed unit of time, because the output would contain the guess as a fact. Returns the assumptions of
/// the recording.
fn examine(tracks: &mut Recording) -> Result<Vec<Fact>, Failure> {
    let (mut items, mut more) = (Vec::new(), true);
    while more && items.len() < JUDGED_ITEMS && tracks.clock().other_unit.is_some() {
        more = tracks.read(&mut items)?;
    }
    let Some(other) = tracks.clock().doubt(&items) else {
        return Ok(tracks.facts().iter().filter(|fact| fact.is_assumption()).cloned().collect());
    };
    let unit = tracks.clock().unit;
    let message = format!("the times may be in {unit} or {other}, and the output is in seconds");
    let help = format!("give {}, or {}", TIME_UNIT.set(unit), TIME_UNIT.set(other));
    Err(Failure::input("export/guessed-time-unit", message, help))
}

/// Returns a note if the run's audit, which is not exported, holds more than the samples.
fn lost(request: &ExportRequest, monitor: &dyn Monitor) -> Option<String> {
    let lost = format!("the run's audit of every step is not in {}", request.output.display());
    match own_recording(&request.paths, &request.options, monitor) {
        Ok(own) => own.filter(|own| !own.holds_every_step()).map(|_| lost),
        Err(unread) => Some(format!("{}; {lost}", unread.message())),
    }
}
