//! Lossless export of recordings to other formats.
//!
//! An exported file has the same times, vehicles, positions, velocities and radii as its source, bit for bit. One
//! exception: CSV has no field for the epoch and holds absolute times since 1970 instead. A recording is read several
//! times, so that memory is bounded by one instant and one block. Curves are sampled only at a rate that the user sets:
//! [`ExportOptions::sample_hz`].

mod csv;
pub mod drones;
mod error;
#[cfg(feature = "mcap")]
mod mcap;
mod npz;
#[cfg(feature = "arrow")]
mod parquet;
mod source;

pub use crate::read::Format;
pub use error::ExportError;
#[cfg(feature = "mcap")]
pub use mcap::TrackRecorder;

use std::fs::File;

#[cfg(not(all(feature = "arrow", feature = "mcap")))]
use crate::read::Fault;
use crate::read::{Channels, ReadError, Recording};
use source::Source;

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
        #[cfg(feature = "arrow")]
        parquet::write(&source, &info, file)?;
        #[cfg(not(feature = "arrow"))]
        return Err(ReadError::from(Fault::without_feature("arrow")).into());
    } else if format == Format::NPZ {
        npz::write(&source, &info, file)?;
    } else if format == Format::MCAP {
        #[cfg(feature = "mcap")]
        mcap::write(&source, &info, file)?;
        #[cfg(not(feature = "mcap"))]
        return Err(ReadError::from(Fault::without_feature("mcap")).into());
    } else {
        return Err(ExportError::NotWritten(format));
    }
    Ok(exported)
}
