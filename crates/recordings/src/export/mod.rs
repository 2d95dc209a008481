//! Lossless export of recordings to other formats.
//!
//! An exported file has the same times, vehicles, positions, velocities and radii as its source, bit for bit. One
//! exception: CSV has no field for the epoch and holds absolute times since 1970 instead. A recording is read several
//! times, so that memory is bounded by one instant and one block. Curves are sampled only at a rate that the user sets:
//! [`ExportOptions::sample_hz`].

mod csv;
pub mod drones;
mod mcap;
mod npz;
mod parquet;
mod source;

pub use crate::read::Format;

use std::fs::File;
use std::io;

use crate::read::{Channels, ReadError, Recording};
use source::Source;
use tautline_core::failure::Failure;
use tautline_core::option::SAMPLE_HZ;

/// Formats that can be written; the extension of a file is the name of its format.
pub const WRITTEN: &[Format] = &[Format::CSV, Format::PARQUET, Format::NPZ, Format::MCAP];

/// Options of an export.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportOptions {
    /// Sampling rate of curves \[Hz\], from the start of the recording on.
    pub sample_hz: Option<f64>,
}

/// Result of an export.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of vehicles.
    pub vehicles: usize,
    /// Number of samples; a sample is one vehicle at one instant.
    pub samples: u64,
    /// Notes for the user, one sentence each.
    pub notes: Vec<String>,
}

/// Writes a recording into an empty file. `open` opens the recording from its start on each call.
///
/// # Errors
/// [`ExportError`] if the recording cannot be read, the file cannot be written, or the format cannot hold the
/// recording.
pub fn export(
    open: &dyn Fn() -> Result<Recording, ReadError>,
    format: Format,
    options: &ExportOptions,
    file: &mut File,
) -> Result<Exported, ExportError> {
    export_with(open, &|| Ok(None), format, options, file)
}

/// Writes a recording and its channels, the additional numbers of every vehicle. `channels` opens them from the start
/// on each call.
///
/// A channel becomes columns of a table, an array of an NPZ archive or a topic of an MCAP file. Readers of motion
/// ignore it.
///
/// # Errors
/// As [`export`].
pub fn export_with(
    open: &dyn Fn() -> Result<Recording, ReadError>,
    channels: &dyn Fn() -> Result<Option<Channels>, ReadError>,
    format: Format,
    options: &ExportOptions,
    file: &mut File,
) -> Result<Exported, ExportError> {
    let source = Source { open, channels, sample_hz: options.sample_hz };
    let info = source.survey()?;
    let mut exported = Exported { vehicles: info.names.len(), samples: info.samples, notes: info.notes.clone() };
    if format == Format::CSV {
        exported.notes.extend(csv::write(&source, &info, file)?);
    } else if format == Format::PARQUET {
        parquet::write(&source, &info, file)?;
    } else if format == Format::NPZ {
        npz::write(&source, &info, file)?;
    } else if format == Format::MCAP {
        mcap::write(&source, &info, file)?;
    } else {
        return Err(ExportError::NotWritten(format));
    }
    Ok(exported)
}

/// Error of an export.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file cannot be written.
    #[error("cannot write the exported file: {0}")]
    Write(#[from] io::Error),
    /// The recording holds curves, and no sampling rate was given.
    #[error("the recording holds curves, but the file can hold only samples")]
    Curves,
    /// A sampling rate was given for a recording without curves.
    #[error("the recording holds samples, which cannot be resampled")]
    NoCurves,
    /// The sampling rate is invalid or gives too many samples.
    #[error("curves cannot be sampled at {0} Hz")]
    SampleRate(f64),
    /// The format cannot be written.
    #[error("{} cannot be written", .0.title)]
    NotWritten(Format),
    /// The name of a vehicle cannot be written in this format.
    #[error("the name {0:?} of a vehicle cannot be written in this format")]
    Name(String),
}

impl ExportError {
    /// Returns the remedy, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Read(error) => return error.help(),
            Self::Write(error) if error.kind() == io::ErrorKind::NotSeekable => {
                "write it to a file: this format goes back to what it has written"
            }
            Self::Write(_) => "free some space or write to another folder",
            Self::Curves => {
                return format!("set the sampling rate with {SAMPLE_HZ}; the motion between samples is lost");
            }
            Self::NoCurves => return format!("omit {SAMPLE_HZ}"),
            Self::SampleRate(_) => "give a positive rate that yields at most 1e9 samples",
            Self::NotWritten(_) => "use csv, parquet, npz or mcap",
            Self::Name(_) => "export to mcap or parquet",
        }
        .to_owned()
    }

    /// Returns the stable code of the error, such as `export/curves`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Read(error) => error.code(),
            Self::Write(_) => "files/cannot-write",
            Self::Curves => "export/curves",
            Self::NoCurves => "export/no-curves",
            Self::SampleRate(_) => "export/sample-rate",
            Self::NotWritten(_) => "export/not-written",
            Self::Name(_) => "export/name",
        }
    }

    /// Returns whether the operating system failed, not the input.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        match self {
            Self::Read(error) => error.is_machine(),
            Self::Write(_) => true,
            _ => false,
        }
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}
