//! Recordings written in other formats, without losing a bit.
//!
//! What is read back from an exported file has the same times, vehicles, positions, velocities and radii, bit for bit;
//! only a table in text cannot say what its times count from, and holds the same instants since 1970. A recording is
//! read several times, so that memory is bounded by an instant and a block, not by the recording. Curves cannot be
//! written as samples silently: [`ExportOptions::sample_hz`] says how often they are sampled.

mod csv;
mod mcap;
mod npz;
mod parquet;
mod source;

pub use crate::read::Format;

use std::fs::File;
use std::io;

use crate::read::{Channels, ReadError, Recording};
use source::Source;

/// The formats that are written; files of each have its name as their extension.
pub const WRITTEN: &[Format] = &[Format::CSV, Format::PARQUET, Format::NPZ, Format::MCAP];

/// How a recording is written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportOptions {
    /// How often curves are sampled \[Hz\], from the beginning of the recording on.
    pub sample_hz: Option<f64>,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of vehicles.
    pub vehicles: usize,
    /// Number of samples: a vehicle at an instant each.
    pub samples: u64,
    /// What a person should know, a sentence each.
    pub notes: Vec<String>,
}

/// Writes a recording into an empty file. `open` opens the recording, each time from its beginning.
///
/// # Errors
/// [`ExportError`] when the recording cannot be read, the file cannot be written, or one does not fit the other.
pub fn export(
    open: &dyn Fn() -> Result<Recording, ReadError>,
    format: Format,
    options: &ExportOptions,
    file: &mut File,
) -> Result<Exported, ExportError> {
    export_with(open, &|| Ok(None), format, options, file)
}

/// Writes a recording and its channels: what it says of every vehicle beside its motion. `channels` opens them, each time
/// from the beginning.
///
/// Tables have a column for each of theirs, NPZ an array for each channel, MCAP a topic. Readers of motion pass them over.
///
/// # Errors
/// Those of [`export`].
pub fn export_with(
    open: &dyn Fn() -> Result<Recording, ReadError>,
    channels: &dyn Fn() -> Result<Option<Channels>, ReadError>,
    format: Format,
    options: &ExportOptions,
    file: &mut File,
) -> Result<Exported, ExportError> {
    let source = Source { open, channels, sample_hz: options.sample_hz };
    let about = source.survey()?;
    let mut exported = Exported { vehicles: about.names.len(), samples: about.samples, notes: about.notes.clone() };
    if format == Format::CSV {
        exported.notes.extend(csv::write(&source, &about, file)?);
    } else if format == Format::PARQUET {
        parquet::write(&source, &about, file)?;
    } else if format == Format::NPZ {
        npz::write(&source, &about, file)?;
    } else if format == Format::MCAP {
        mcap::write(&source, &about, file)?;
    } else {
        return Err(ExportError::NotWritten(format));
    }
    Ok(exported)
}

/// A recording cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file cannot be written.
    #[error("cannot write the exported file: {0}")]
    Write(#[from] io::Error),
    /// The recording holds curves, and no sampling rate is given.
    #[error("the recording holds curves, and the file would hold samples")]
    Curves,
    /// The recording holds samples, which are written as they are.
    #[error("the recording holds samples, which are written as they are and not sampled again")]
    NoCurves,
    /// The curves cannot be sampled so often.
    #[error("curves cannot be sampled at {0} Hz")]
    SampleRate(f64),
    /// Nothing writes the format.
    #[error("nothing writes {}", .0.title)]
    NotWritten(Format),
    /// The name of a vehicle cannot be written in the format.
    #[error("the name {0:?} of a vehicle cannot be written in this format")]
    Name(String),
}

impl ExportError {
    /// What helps, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Read(error) => return error.help(),
            Self::Write(error) if error.kind() == io::ErrorKind::NotSeekable => {
                "write it to a file: this format goes back to what it has written"
            }
            Self::Write(_) => "free some space or write to another folder",
            Self::Curves => "say how often curves are sampled with --sample-hz; between the samples they are lost",
            Self::NoCurves => "leave --sample-hz away",
            Self::SampleRate(_) => "give a positive number of samples per second, such that their count stays sensible",
            Self::NotWritten(_) => "write csv, parquet, npz or mcap",
            Self::Name(_) => "export to mcap or parquet",
        }
        .to_owned()
    }

    /// The stable name of the problem, such as `export/curves`.
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

    /// Whether the machine failed and not the input.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        match self {
            Self::Read(error) => error.is_machine(),
            Self::Write(_) => true,
            _ => false,
        }
    }
}
