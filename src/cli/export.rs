//! `tautline export`: a recording in another format.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::console::Console;
use super::reading::{FormatArgument, ReadArguments};
use super::{Exit, Failure};
use crate::export::{self, ExportOptions, Format};
use crate::read;
use crate::report::write_atomically_with;

/// Arguments of `tautline export`.
#[derive(Debug, Args)]
pub(super) struct ExportArguments {
    #[command(flatten)]
    reading: ReadArguments,
    /// Format of the recording [default: recognised by its content].
    #[arg(long, value_name = "FORMAT", help_heading = "Reading")]
    input_format: Option<FormatArgument>,
    /// The file to write.
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Format to write [default: by the extension of the file].
    #[arg(long, value_name = "FORMAT")]
    format: Option<TargetArgument>,
    /// How often curves are sampled [Hz]; what is between the samples is lost.
    #[arg(long, value_name = "HZ")]
    sample_hz: Option<f64>,
    /// Overwrite the file if it exists.
    #[arg(long)]
    force: bool,
    /// Say nothing.
    #[arg(long, short)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TargetArgument {
    Csv,
    Parquet,
    Npz,
    Mcap,
}

impl TargetArgument {
    fn format(self) -> Format {
        match self {
            Self::Csv => Format::Csv,
            Self::Parquet => Format::Parquet,
            Self::Npz => Format::Npz,
            Self::Mcap => Format::Mcap,
        }
    }
}

pub(super) fn export(arguments: &ExportArguments) -> Result<Exit, Failure> {
    let reading = arguments.reading.options(arguments.input_format)?;
    let path = &arguments.output;
    let by_extension = || Format::from_name(path.extension()?.to_str()?);
    let format = arguments.format.map(TargetArgument::format).or_else(by_extension).ok_or_else(|| {
        let message = format!("the name `{}` does not tell a format", path.display());
        Failure::input(message, "name the format with --format csv, parquet, npz or mcap")
    })?;
    if path.exists() && !arguments.force {
        let message = format!("`{}` exists", path.display());
        return Err(Failure::input(message, "overwrite it with --force, or write another file"));
    }
    let options = ExportOptions { sample_hz: arguments.sample_hz };
    let open = || read::open(&arguments.reading.recording, &reading);
    let exported =
        write_atomically_with(path, |file| export::export(&open, format, &options, file).map_err(Failure::from))?;
    let console = Console { data_on_stdout: false, quiet: arguments.quiet };
    for note in &exported.notes {
        console.warn(&format!("note: {note}"));
    }
    let vehicles =
        if exported.vehicles == 1 { "1 vehicle".to_owned() } else { format!("{} vehicles", exported.vehicles) };
    console.say(&format!("{}: {} samples of {vehicles}", path.display(), exported.samples));
    Ok(Exit::Good)
}
