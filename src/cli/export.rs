//! `tautline export`: a recording in another format, or a flight for drones.

use std::path::PathBuf;

use clap::Args;
use clap::builder::TypedValueParser;

use super::Exit;
use super::console::{self, Console, Terminal};
use super::reading::ReadArguments;
use tautline_recordings::export::WRITTEN;
use tautline_recordings::export::drones::Dialect;
use tautline_recordings::read::Format;
use tautline_report::request::{
    DroneExportOptions, DroneExportRequest, ExportRequest, Failure, export_drones, export_file, one_of,
};

/// Arguments of `tautline export`.
#[derive(Debug, Args)]
pub(super) struct ExportArguments {
    /// File to write; a folder for the formats `crazyflie` and `skyb`.
    #[arg(long, short, value_name = "PATH")]
    out: PathBuf,
    /// Format to write [default: csv, parquet, npz or mcap, from the extension of the file]. Drones fly the others:
    /// the written motion is judged, and nothing is written if it is not clear.
    #[arg(long, value_name = "FORMAT", value_parser = written())]
    format: Option<Written>,
    /// Sampling rate [Hz] of curves; the motion between the samples is lost.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    sample_hz: Option<f64>,
    /// Overwrite an existing file, or a folder with files of an export.
    #[arg(long)]
    force: bool,
    /// Print no text.
    #[arg(long, short)]
    quiet: bool,
    #[command(flatten)]
    drones: DroneExportOptions,
    // Last, because its help heading also applies to all later arguments.
    #[command(flatten)]
    reading: ReadArguments,
}

/// Format that is written.
#[derive(Clone, Copy, Debug)]
enum Written {
    /// Recording.
    Recording(Format),
    /// Flight for drones.
    Flight(Dialect),
}

pub(super) fn export(arguments: &ExportArguments) -> Result<Exit, Failure> {
    let [paths] = &arguments.reading.recordings()[..] else {
        let help = "give --join if each file holds a vehicle of one recording";
        let message = "RECORDING: must be one recording, got several";
        return Err(Failure::input("usage/several-recordings", message, help));
    };
    let terminal = Terminal::new(Console { data_on_stdout: false, quiet: arguments.quiet })?;
    let (format, dialect) = match arguments.format {
        Some(Written::Recording(format)) => (Some(format), None),
        Some(Written::Flight(dialect)) => (None, Some(dialect)),
        None => (None, None),
    };
    let file = ExportRequest {
        paths: paths.clone(),
        options: arguments.reading.options(),
        output: arguments.out.clone(),
        format,
        sample_hz: arguments.sample_hz,
        force: arguments.force,
    };
    let Some(dialect) = dialect else {
        arguments.drones.refuse()?;
        export_file(&file, &terminal)?;
        return Ok(Exit::Good);
    };
    let request = DroneExportRequest { file, dialect, options: arguments.drones.clone() };
    match export_drones(&request, &terminal)?.refusal {
        None => Ok(Exit::Good),
        Some(refusal) => {
            console::show(&refusal);
            Ok(Exit::Bad)
        }
    }
}

/// Returns a parser of writable formats.
fn written() -> impl TypedValueParser<Value = Written> {
    let recordings = WRITTEN.iter().map(|format| (format.name.into(), Written::Recording(*format)));
    let flights = Dialect::ALL.map(|dialect| (dialect.name().into(), Written::Flight(dialect)));
    one_of(recordings.chain(flights).collect())
}
