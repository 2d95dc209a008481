//! Errors of exports.

use std::io;

use crate::read::{Format, ReadError};
use tautline_core::failure::Failure;
use tautline_core::option::SAMPLE_HZ;

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
