//! Recordings of any origin as a stream of [`Item`](crate::track::Item)s.
//!
//! [`open`] recognises the format by the content of the file and gives a [`Tracks`](crate::track::Tracks): items in order of time, a clock, and
//! what a person should know. A format is a file of this room that turns its content into rows or into pieces of curves;
//! order, clocks and limits are the same for all.
//!
//! Memory is bounded by what is read at a time, not by the file: a recording in order of time is streamed. One that is
//! not is sorted, in memory, and says so in [`Tracks::notes`](crate::track::Tracks::notes).
//!
//! # What is refused
//! Numbers that are not finite, a vehicle that is in two places at a time, time that runs backwards where each time is a
//! row, cells that are not numbers, files that break off. Every [`ReadError`] names the file, the place, the value and
//! the remedy. Nothing is guessed silently: an inferred unit of time is said in the notes.

mod archive;
mod clock;
mod crazyflie;
mod csv;
mod curves;
mod error;
mod format;
mod layout;
pub(crate) mod mcap;
mod names;
mod npy;
mod npz;
mod options;
mod order;
#[cfg(feature = "parquet")]
pub(crate) mod parquet;
mod recognise;
mod skybrush;
mod source;
mod table;

#[cfg(feature = "parquet")]
pub use self::parquet::is_guarded;
pub use clock::TimeUnit;
pub use error::{Fault, Place, ReadError};
pub use format::Format;
pub use options::{AxisOrder, ColumnNames, ReadOptions};
pub use order::Recording;

use std::path::Path;

use recognise::{Recognised, recognise};
use source::Source;

/// Opens a recording.
///
/// # Errors
/// [`ReadError`] when the file cannot be read, is of no known format, or is wrong where it was looked at so far.
pub fn open(path: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    try_open(path, options).map_err(|fault| fault.of(path))
}

fn try_open(path: &Path, options: &ReadOptions) -> Result<Recording, ReadError> {
    if !(options.scale.is_finite() && options.scale > 0.0) {
        let problem = format!("its lengths cannot be scaled by {}", options.scale);
        return Err(Fault::content(problem, "give a positive number of metres per unit of length").into());
    }
    let Recognised { format, gzip } = recognise(path, options.format)?;
    if let Some((option, why)) = options.needless_for(format) {
        let problem = format!("{} {why}", format.title());
        return Err(Fault::content(problem, format!("leave {option} away")).into());
    }
    let source = &Source { path: path.to_owned(), gzip };
    match format {
        Format::Csv | Format::Text => csv::open(source, format, options),
        Format::Crazyflie => crazyflie::open(path, options),
        Format::Mcap => mcap::open(source, options),
        Format::Npz => npz::open(source, options),
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::open(source, options),
        #[cfg(not(feature = "parquet"))]
        Format::Parquet => {
            let problem = "it is a Parquet file, which this build does not read";
            Err(Fault::content(problem, "build it with the feature of the format's name").into())
        }
        Format::Skybrush => skybrush::open(source, options),
    }
}
