//! `tautline export`: a recording in another format.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

use super::console::Console;
use super::reading::{self, ReadArguments, one_of};
use super::run::interruption;
use super::{Exit, Failure, outputs};
use tautline_core::track::{Clock, EarthOrigin, Item, Tracks};
use tautline_recordings::export::{self, ExportOptions, WRITTEN};
use tautline_recordings::read::{self, Fault, Format, ReadError, Recording};
use tautline_report::report::write_atomically_with;

/// Arguments of `tautline export`.
#[derive(Debug, Args)]
pub(super) struct ExportArguments {
    /// The file to write.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Format to write [default: by the extension of the file].
    #[arg(long, value_name = "FORMAT", value_parser = one_of(WRITTEN.iter().map(|format| (format.name().into(), *format)).collect()))]
    format: Option<Format>,
    /// How often curves are sampled [Hz]; what is between the samples is lost.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    sample_hz: Option<f64>,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
    /// Say nothing.
    #[arg(long, short)]
    quiet: bool,
    // Last, because its heading holds for all that follows.
    #[command(flatten)]
    reading: ReadArguments,
    /// Format of the recording [default: recognised by its content].
    #[arg(long, value_name = "FORMAT", value_parser = reading::format())]
    input_format: Option<Format>,
}

/// A recording that ends with an error once the user has had enough, so that no unfinished file is left behind.
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

    fn clock(&self) -> &Clock {
        self.tracks.clock()
    }

    fn notes(&self) -> &[String] {
        self.tracks.notes()
    }

    fn assumed(&self) -> Option<&str> {
        self.tracks.assumed()
    }

    fn is_planar(&self) -> bool {
        self.tracks.is_planar()
    }

    fn earth_origin(&self) -> Option<&EarthOrigin> {
        self.tracks.earth_origin()
    }
}

pub(super) fn export(arguments: &ExportArguments) -> Result<Exit, Failure> {
    if arguments.reading.recordings().len() > 1 {
        let help = "give --join if each file holds a vehicle of one recording";
        return Err(Failure::input("several recordings are given, and one is exported", help));
    }
    let reading = arguments.reading.options(arguments.input_format)?;
    let path = &arguments.output;
    let by_extension = || {
        let extension = path.extension()?.to_str()?;
        WRITTEN.iter().copied().find(|format| format.name().eq_ignore_ascii_case(extension))
    };
    let format = arguments.format.or_else(by_extension).ok_or_else(|| {
        let message = format!("the name `{}` does not tell a format", path.display());
        Failure::input(message, "name the format with --format csv, parquet, npz or mcap")
    })?;
    if path.exists() && !arguments.force {
        let message = format!("`{}` exists", path.display());
        return Err(Failure::input(message, "overwrite it with --force, or write another file"));
    }
    let inputs: Vec<_> = arguments.reading.paths().map(|path| ("the recording", path)).collect();
    outputs::check(&inputs, &[("--output", path)])?;
    let options = ExportOptions { sample_hz: arguments.sample_hz };
    let interrupted = interruption()?;
    let recording = &arguments.reading.recording;
    let open = || -> Result<Recording, ReadError> {
        let (tracks, path, interrupted) = (arguments.reading.open(&reading)?, recording.clone(), interrupted.clone());
        Ok(Box::new(Interruptible { tracks, path, interrupted }))
    };
    let may_have_channels =
        arguments.reading.paths().count() == 1 && arguments.input_format.is_none_or(|format| format == Format::Mcap);
    let channels = || if may_have_channels { read::open_channels(recording) } else { Ok(None) };
    let exported = write_atomically_with(path, |file| {
        export::export_with(&open, &channels, format, &options, file).map_err(Failure::from)
    });
    if exported.is_err() && interrupted.load(Ordering::Relaxed) {
        return Err(Failure::machine(format!("interrupted: `{}` was not written", path.display())));
    }
    let exported = exported?;
    let console = Console { data_on_stdout: false, quiet: arguments.quiet };
    let file = path.display();
    let lost = match arguments.reading.own(arguments.input_format, reading.scale) {
        Ok(own) => own.filter(|own| !own.has_every_step).map(|own| {
            let steps = own.most_steps;
            format!(
                "up to {steps} steps were flown between two samples: what the run saw between them is not in {file}"
            )
        }),
        Err(unread) => Some(format!("{}; what the run saw between two samples is not in {file}", unread.said.message)),
    };
    for note in exported.notes.iter().chain(&lost) {
        console.warn(&format!("note: {note}"));
    }
    let vehicles =
        if exported.vehicles == 1 { "1 vehicle".to_owned() } else { format!("{} vehicles", exported.vehicles) };
    console.say(&format!("{file}: {} samples of {vehicles}", exported.samples));
    Ok(Exit::Good)
}
