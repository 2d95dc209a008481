//! `tautline export`: a recording in another format.

use std::path::PathBuf;

use clap::Args;
use clap::builder::TypedValueParser;

use super::Exit;
use super::console::{Console, Terminal};
use super::reading::{self, ReadArguments, one_of};
use tautline_recordings::export::WRITTEN;
use tautline_recordings::read::Format;
use tautline_report::request::{ExportRequest, Failure, export_file};

/// Arguments of `tautline export`.
#[derive(Debug, Args)]
pub(super) struct ExportArguments {
    /// File to write.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Format to write [default: from the extension of the file].
    #[arg(long, value_name = "FORMAT", value_parser = written_format())]
    format: Option<Format>,
    /// Sampling rate of curves [Hz]; the motion between the samples is lost.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    sample_hz: Option<f64>,
    /// Overwrite an existing file.
    #[arg(long)]
    force: bool,
    /// Print no text.
    #[arg(long, short)]
    quiet: bool,
    // Last, because its help heading also applies to all later arguments.
    #[command(flatten)]
    reading: ReadArguments,
    /// Format of the recording [default: detected from its content].
    #[arg(long, value_name = "FORMAT", value_parser = reading::format())]
    input_format: Option<Format>,
}

pub(super) fn export(arguments: &ExportArguments) -> Result<Exit, Failure> {
    let [paths] = &arguments.reading.recordings()[..] else {
        let help = "give --join if each file holds a vehicle of one recording";
        let message = "RECORDING: must be one recording, got several";
        return Err(Failure::input("usage/several-recordings", message, help));
    };
    let request = ExportRequest {
        paths: paths.clone(),
        options: arguments.reading.options(arguments.input_format),
        output: arguments.output.clone(),
        format: arguments.format,
        sample_hz: arguments.sample_hz,
        force: arguments.force,
    };
    export_file(&request, &Terminal::new(Console { data_on_stdout: false, quiet: arguments.quiet })?)?;
    Ok(Exit::Good)
}

/// Returns a parser of writable formats.
fn written_format() -> impl TypedValueParser<Value = Format> {
    one_of(WRITTEN.iter().map(|format| (format.name.into(), *format)).collect())
}
