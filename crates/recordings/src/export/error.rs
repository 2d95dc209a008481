//! Why a recording cannot be exported.

use std::io;

use crate::read::{Format, ReadError};

/// A recording cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file cannot be written.
    #[error("cannot write the exported file: {0}")]
    Write(#[from] io::Error),
    /// The recording holds curves, and nobody says how often they are to be sampled.
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
