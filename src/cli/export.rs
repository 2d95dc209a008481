//! `tautline export`: a recording in another format, or a flight for drones.

use std::path::PathBuf;

use clap::Args;
use clap::builder::TypedValueParser;

use super::Exit;
use super::console::{self, Console, Terminal};
use super::reading::{self, ReadArguments};
use tautline_recordings::export::WRITTEN;
use tautline_recordings::export::drones::Dialect;
use tautline_recordings::read::Format;
use tautline_report::request::{
    DroneExportOptions, DroneExportRequest, ExportRequest, Failure, export_drones, export_file, one_of,
};

/// Arguments of `tautline export`.
#[derive(Debug, Args)]
pub(super) struct ExportArguments {
    /// File to write; a folder for `--to crazyflie`, `skyb` and `px4-show`.
    #[arg(long, short, value_name = "PATH")]
    output: PathBuf,
    /// Format to write [default: from the extension of the file].
    #[arg(long, value_name = "FORMAT", value_parser = written_format(), conflicts_with = "to")]
    format: Option<Format>,
    /// Sampling rate [Hz] of curves, of setpoints [default: 20] or of VVIZ [default: 30]; the motion between the
    /// samples is lost.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    sample_hz: Option<f64>,
    /// Overwrite an existing file, or a folder with files of an export.
    #[arg(long)]
    force: bool,
    /// Print no text.
    #[arg(long, short)]
    quiet: bool,
    /// Format that drones fly. The written motion is judged; nothing is written if it is not clear.
    #[arg(long, value_name = "FORMAT", value_parser = dialect(), help_heading = "For drones")]
    to: Option<Dialect>,
    #[command(flatten)]
    drones: DroneExportOptions,
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
    let terminal = Terminal::new(Console { data_on_stdout: false, quiet: arguments.quiet })?;
    let ExportArguments { output, format, sample_hz, force, to, drones, .. } = arguments;
    let file = ExportRequest {
        paths: paths.clone(),
        options: arguments.reading.options(arguments.input_format),
        output: output.clone(),
        format: *format,
        sample_hz: *sample_hz,
        force: *force,
    };
    let Some(dialect) = *to else {
        export_file(&file, &terminal)?;
        return Ok(Exit::Good);
    };
    let request = DroneExportRequest { file, dialect, options: drones.clone() };
    match export_drones(&request, &terminal)?.refusal {
        None => Ok(Exit::Good),
        Some(refusal) => {
            console::show(&refusal);
            Ok(Exit::Bad)
        }
    }
}

/// Returns a parser of writable formats.
fn written_format() -> impl TypedValueParser<Value = Format> {
    one_of(WRITTEN.iter().map(|format| (format.name.into(), *format)).collect())
}

/// Returns a parser of formats of drones.
fn dialect() -> impl TypedValueParser<Value = Dialect> {
    one_of(Dialect::ALL.map(|dialect| (dialect.name().into(), dialect)).into())
}
