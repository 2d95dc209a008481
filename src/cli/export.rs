//! `tautline export`: a recording in another format, or a flight for drones.

use std::path::PathBuf;

use clap::Args;
use clap::builder::TypedValueParser;
use nalgebra::Vector3;

use super::Exit;
use super::console::{self, Console, Terminal};
use super::reading::{self, ReadArguments, three};
use tautline_recordings::export::WRITTEN;
use tautline_recordings::export::drones::Dialect;
use tautline_recordings::read::Format;
use tautline_report::request::{DroneChoices, ExportRequest, Failure, export_drones, export_file, one_of};

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
    #[command(flatten)]
    drones: DroneArguments,
    // Last, because its help heading also applies to all later arguments.
    #[command(flatten)]
    reading: ReadArguments,
    /// Format of the recording [default: detected from its content].
    #[arg(long, value_name = "FORMAT", value_parser = reading::format())]
    input_format: Option<Format>,
}

/// Arguments of an export for drones.
#[derive(Debug, Args)]
#[command(next_help_heading = "For drones")]
struct DroneArguments {
    /// Format that drones fly. The written motion is judged; nothing is written if it is not clear.
    #[arg(long, value_name = "FORMAT", value_parser = dialect())]
    to: Option<Dialect>,
    /// Largest distance of the written motion from the flight [m] [default: 0.01; none for px4-show and vviz].
    #[arg(long, value_name = "METRES", requires = "to", allow_negative_numbers = true)]
    tolerance: Option<f64>,
    /// Safety distance between two centres [m] [default: that of the recording].
    #[arg(long, value_name = "METRES", requires = "to", allow_negative_numbers = true)]
    delta: Option<f64>,
    /// Half axes [m] of an ellipsoid around each vehicle [default: those of the recording].
    #[arg(long, value_name = "X,Y,Z", requires = "to", value_parser = ellipsoid)]
    ellipsoid: Option<Vector3<f64>>,
    /// TOML file of obstacles [default: those of the recording].
    #[arg(long, value_name = "FILE", requires = "to")]
    obstacles: Option<PathBuf>,
    /// Start of the exported part of the flight [s].
    #[arg(long, value_name = "SECONDS", requires = "to", allow_negative_numbers = true)]
    from: Option<f64>,
    /// End of the exported part of the flight [s].
    #[arg(long, value_name = "SECONDS", requires = "to", allow_negative_numbers = true)]
    until: Option<f64>,
    /// Write the compressed form of a Crazyflie, whose coordinates reach 32.767 m.
    #[arg(long, requires = "to")]
    compressed: bool,
    /// Version of .skyb files: 1, or 2 with a checksum.
    #[arg(long, value_name = "VERSION", requires = "to", default_value_t = 2, hide_default_value = true)]
    skyb_version: u8,
}

impl DroneArguments {
    fn choices(&self) -> DroneChoices {
        DroneChoices {
            tolerance_m: self.tolerance,
            delta_m: self.delta,
            ellipsoid_m: self.ellipsoid,
            obstacles: self.obstacles.clone(),
            from_s: self.from,
            until_s: self.until,
            is_compressed: self.compressed,
            skyb_version: self.skyb_version,
        }
    }
}

pub(super) fn export(arguments: &ExportArguments) -> Result<Exit, Failure> {
    let [paths] = &arguments.reading.recordings()[..] else {
        let help = "give --join if each file holds a vehicle of one recording";
        let message = "RECORDING: must be one recording, got several";
        return Err(Failure::input("usage/several-recordings", message, help));
    };
    let terminal = Terminal::new(Console { data_on_stdout: false, quiet: arguments.quiet })?;
    let (paths, options) = (paths.clone(), arguments.reading.options(arguments.input_format));
    let ExportArguments { output, format, sample_hz, force, drones, .. } = arguments;
    let (output, sample_hz, force) = (output.clone(), *sample_hz, *force);
    let request = ExportRequest { paths, options, output, format: *format, sample_hz, force };
    let Some(dialect) = drones.to else {
        export_file(&request, &terminal)?;
        return Ok(Exit::Good);
    };
    let request = request.for_drones(dialect, drones.choices());
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

fn ellipsoid(text: &str) -> Result<Vector3<f64>, String> {
    three(text).map(Vector3::from)
}
